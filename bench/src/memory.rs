//! Peak memory of a computation, counted where Rust allocates it, and of an experiment, as the
//! kernel counts it too.
//!
//! All of `bench` allocates through a counting allocator (crate peak_alloc: two atomic additions
//! per call). For one build, the resident set size from the operating system is not suitable: the
//! allocator keeps freed memory, so the second build of a run would appear to need none.

use peak_alloc::PeakAlloc;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// The highest peak since [`start`] that [`peak`] has reset.
static HIGHEST: AtomicUsize = AtomicUsize::new(0);
/// As [`HIGHEST`], by the kernel, which [`resident_during`] has reset.
static HIGHEST_RESIDENT: AtomicU64 = AtomicU64::new(0);

const STATUS: &str = "/proc/self/status";

/// The most that this process held at a time, programs that it started apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PeakMemory {
    /// By Rust's allocator, in MB (10⁶ bytes).
    pub allocated_mb: f64,
    /// Resident, by the kernel (`VmHWM`), in MB: C libraries, the program, and what the allocator
    /// keeps, too. `null` where the kernel does not tell.
    pub resident_mb: Option<f64>,
}

impl PeakMemory {
    /// The higher of both, each way of counting by itself.
    pub fn max(self, other: PeakMemory) -> PeakMemory {
        PeakMemory {
            allocated_mb: self.allocated_mb.max(other.allocated_mb),
            resident_mb: match (self.resident_mb, other.resident_mb) {
                (Some(a), Some(b)) => Some(a.max(b)),
                (a, b) => a.or(b),
            },
        }
    }
}

/// Starts counting for [`since_start`].
pub fn start() {
    HIGHEST.store(0, Ordering::Relaxed);
    HEAP.reset_peak_usage();
    HIGHEST_RESIDENT.store(0, Ordering::Relaxed);
    // Where that is forbidden, an earlier experiment of the same run may have needed more.
    let _ = reset_resident_peak();
}

/// Sets the kernel's peak to what is resident now (proc(5)).
fn reset_resident_peak() -> std::io::Result<()> {
    std::fs::write("/proc/self/clear_refs", "5")
}

/// The peak since [`start`].
pub fn since_start() -> PeakMemory {
    let mb = |bytes: f64| (bytes / 1e5).round() / 10.0;
    let allocated = HEAP.peak_usage().max(HIGHEST.load(Ordering::Relaxed));
    PeakMemory {
        allocated_mb: mb(allocated as f64),
        resident_mb: resident_peak(STATUS)
            .map(|bytes| mb(bytes.max(HIGHEST_RESIDENT.load(Ordering::Relaxed)) as f64)),
    }
}

/// `VmHWM` of a process's status file, in bytes.
pub fn resident_peak(status: &str) -> Option<u64> {
    bytes_of(status, "VmHWM:")
}

/// A field of a process's status file, in bytes.
fn bytes_of(status: &str, field: &str) -> Option<u64> {
    let status = std::fs::read_to_string(status).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(field))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Runs `work`. Returns its result, and the number of bytes by which the resident memory exceeded
/// that before, at the height: that of C libraries included, without what was kept from before and
/// is used again. `None` where the kernel does not tell.
pub fn resident_during<T>(work: impl FnOnce() -> T) -> (T, Option<u64>) {
    if let Some(peak) = resident_peak(STATUS) {
        HIGHEST_RESIDENT.fetch_max(peak, Ordering::Relaxed);
    }
    let before = bytes_of(STATUS, "VmRSS:").filter(|_| reset_resident_peak().is_ok());
    let value = work();
    let peak = before.and_then(|before| Some(resident_peak(STATUS)?.saturating_sub(before)));
    (value, peak)
}

/// Runs `work`. Returns its result, and the number of bytes by which the peak heap size exceeded
/// the initial one. Other threads' memory is included; allocations of C libraries are not.
pub fn peak<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start = HEAP.current_usage();
    HIGHEST.fetch_max(HEAP.peak_usage(), Ordering::Relaxed);
    HEAP.reset_peak_usage();
    let value = work();
    (value, HEAP.peak_usage().saturating_sub(start) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_freed_again_counts_in_the_peak_of_a_computation_and_of_the_experiment() {
        start();
        let block = 256 << 20;
        for _ in 0..2 {
            let (sum, bytes) =
                peak(|| vec![1u8; block].iter().step_by(4096).map(|&b| u64::from(b)).sum::<u64>());
            assert_eq!(sum, block as u64 / 4096);
            // Other tests of this process allocate and free at the same time, far less than this.
            assert!(bytes.abs_diff(block as u64) < 64 << 20, "{bytes} B for a block of {block} B");
        }
        // What is measured in an experiment resets the allocator's own peak.
        assert!(peak(|| ()).1 < 64 << 20);
        let found = since_start();
        assert!(found.allocated_mb > 256.0, "{found:?}");
        if cfg!(target_os = "linux") {
            assert!(found.resident_mb.is_some_and(|mb| mb > 256.0), "{found:?}");
            // Nor does the kernel's peak forget what came before a part that is measured alone.
            let (sum, held) = resident_during(|| {
                vec![1u8; block].iter().step_by(4096).map(|&b| u64::from(b)).sum::<u64>()
            });
            assert_eq!(sum, block as u64 / 4096);
            assert!(held.is_some_and(|b| b.abs_diff(block as u64) < 64 << 20), "{held:?}");
            assert!(resident_during(|| ()).1.is_some_and(|b| b < 64 << 20));
            assert!(since_start().resident_mb >= found.resident_mb, "{found:?}");
        }
    }
}
