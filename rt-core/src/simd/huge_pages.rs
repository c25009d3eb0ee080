//! Allocates large arrays on huge pages. A traversal accesses the arena at random: with 4 KiB
//! pages, every node costs a TLB miss on top of its cache miss (notes: 251 ns instead of 147 ns per
//! dependent read from memory).

/// An array of `len` times `value`. On Linux, arrays of several megabytes request transparent huge
/// pages before they are first written.
pub(crate) fn filled<T: Copy>(value: T, len: usize) -> Vec<T> {
    let mut items: Vec<T> = Vec::with_capacity(len);
    #[cfg(target_os = "linux")]
    advise_huge(items.as_mut_ptr().cast(), len * size_of::<T>());
    items.resize(len, value);
    items
}

#[cfg(target_os = "linux")]
fn advise_huge(start: *mut u8, bytes: usize) {
    const HUGE: usize = 2 << 20;
    let first = (start as usize).next_multiple_of(HUGE);
    let last = (start as usize + bytes) / HUGE * HUGE;
    if last > first {
        // SAFETY: the range lies inside one allocation of ours, and the advice changes how pages
        // are backed, not their contents. A refusal (old kernel, feature off) only costs speed, so
        // the result is not needed.
        unsafe {
            libc::madvise(first as *mut libc::c_void, last - first, libc::MADV_HUGEPAGE);
        }
    }
}
