//! Memory that work needs at its height, as the operating system counts it.
//!
//! Linux only: the high-water mark of the resident set (`VmHWM` in `/proc/self/status`) is set back to the present by writing 5 to
//! `/proc/self/clear_refs` (proc(5)). What the allocator keeps back for later counts as resident before and after alike; blocks of
//! more than 32 MiB always go back to the system, so the error is of that size.

use std::fs;

/// Runs `work`; returns what it returned and by how many bytes the resident set was larger at its height than at the start. `None`
/// where the system does not tell. Other threads' memory counts too.
pub fn peak<T>(work: impl FnOnce() -> T) -> (T, Option<u64>) {
    let start = fs::write("/proc/self/clear_refs", "5").ok().and_then(|()| status_bytes("VmRSS:"));
    let value = work();
    let height = status_bytes("VmHWM:");
    (value, start.zip(height).map(|(start, height)| height.saturating_sub(start)))
}

fn status_bytes(field: &str) -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(field))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn what_was_freed_again_counts_in_the_peak() {
        let block = 256 << 20;
        let (sum, bytes) = peak(|| {
            let v = vec![1u8; block];
            v.iter().step_by(4096).map(|&b| b as u64).sum::<u64>()
        });
        assert_eq!(sum, block as u64 / 4096);
        // Other tests of this process allocate and free meanwhile, far less than this.
        let Some(bytes) = bytes else { panic!("Linux tells the resident set") };
        let off = bytes.abs_diff(block as u64);
        assert!(off < 64 << 20, "{bytes} B for a block of {block} B");
    }
}
