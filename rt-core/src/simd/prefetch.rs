//! Prefetches memory before it is needed.

/// Prefetches `LINES` cache lines from `items[first]` on. The processor ignores out-of-range
/// addresses.
#[inline(always)]
pub(crate) fn prefetch<const LINES: usize, T>(items: &[T], first: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let p = items.as_ptr().wrapping_add(first).cast::<i8>();
        for line in 0..LINES {
            // SAFETY: a prefetch reads nothing that the program can see, and it cannot fault,
            // whatever the address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(64 * line)) }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = (items, first);
    }
}

/// Prefetches `items[i]`. The processor ignores out-of-range addresses.
#[cfg(feature = "render")]
#[inline(always)]
pub(crate) fn prefetch_item<T>(items: &[T], i: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let p = items.as_ptr().wrapping_add(i).cast::<i8>();
        // SAFETY: as above.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(p) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = (items, i);
    }
}
