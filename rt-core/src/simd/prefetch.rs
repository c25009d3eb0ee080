//! Asking for memory before it is needed.

use crate::accel::Unit;

/// Starts loading `bytes` from `units[first]` on; out-of-range places are ignored by the processor.
#[inline(always)]
pub(crate) fn prefetch<const LINES: usize>(units: &[Unit], first: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let p = units.as_ptr().wrapping_add(first).cast::<i8>();
        for line in 0..LINES {
            // SAFETY: a prefetch reads nothing the program can see and cannot fault, wherever it points.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(64 * line)) }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = (units, first);
    }
}
