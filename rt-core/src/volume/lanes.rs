//! Eight numbers at a time.

use fearless_simd::{Select, Simd, SimdBase, f64x8};

/// Cells, or segments, that are computed together.
pub(super) const LANES: usize = 8;
/// One number for each lane.
pub(super) type Row = [f64; LANES];

/// The larger of two numbers, in each lane; the second if either is NaN.
#[inline(always)]
pub(super) fn max<S: Simd>(a: f64x8<S>, b: f64x8<S>) -> f64x8<S> {
    a.simd_gt(b).select(a, b)
}

/// The smaller of two numbers, in each lane; the second if either is NaN.
#[inline(always)]
pub(super) fn min<S: Simd>(a: f64x8<S>, b: f64x8<S>) -> f64x8<S> {
    a.simd_lt(b).select(a, b)
}
