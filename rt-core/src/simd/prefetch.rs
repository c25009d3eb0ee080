//! Asking for memory before it is needed.

use crate::bvh::Unit;

/// Starts loading `bytes` from `units[first]` on; out-of-range places are ignored by the processor.
#[inline(always)]
pub(crate) fn prefetch<const LINES: usize>(units: &[Unit], first: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let p = units.as_ptr().wrapping_add(first).cast::<i8>();
        for line in 0..LINES {
            // SAFETY: a prefetch reads nothing the program can see and cannot fault, wherever it
            // points.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(64 * line)) }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = (units, first);
    }
}

/// Starts loading `items[i]`; out-of-range places are ignored by the processor.
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
