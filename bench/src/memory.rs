//! Peak memory of a computation, counted where Rust allocates it.
//!
//! All of `bench` allocates through a counting allocator (crate peak_alloc: two atomic additions
//! per call). The resident set size from the operating system is not suitable: the allocator keeps
//! freed memory, so the second build of a run would appear to need none.

use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Runs `work`. Returns its result, and the number of bytes by which the peak heap size exceeded
/// the initial one. Other threads' memory is included; allocations of C libraries are not.
pub fn peak<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start = HEAP.current_usage();
    HEAP.reset_peak_usage();
    let value = work();
    (value, HEAP.peak_usage().saturating_sub(start) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_freed_again_counts_in_the_peak() {
        let block = 256 << 20;
        for _ in 0..2 {
            let (sum, bytes) =
                peak(|| vec![1u8; block].iter().step_by(4096).map(|&b| u64::from(b)).sum::<u64>());
            assert_eq!(sum, block as u64 / 4096);
            // Other tests of this process allocate and free at the same time, far less than this.
            assert!(bytes.abs_diff(block as u64) < 64 << 20, "{bytes} B for a block of {block} B");
        }
    }
}
