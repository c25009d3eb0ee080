//! eps and its gradient between the nodes.
//!
//! | interpolant | smoothness | bytes/node | error of deflection, OPD for a Gaussian of 10 voxels' sigma (`interpolation_errors_are_those_on_record`) |
//! |---|---|---|---|
//! | [`BSpline`] | C2 | 4 | 8e-6, 2e-7 |
//! | [`Trilinear`] | C0 | 4 | 1e-2, 4e-4 |
//! | [`TrilinearGradient`] | C0, gradient C0 | 16 | 2e-3, 4e-4 |
//!
//! All work in lattice coordinates: 0 at the first node along each axis, 1 at the next. Points
//! outside the lattice get the value and the gradient of the nearest point on its surface.

mod bspline;
mod prefilter;
mod trilinear;
mod trilinear_gradient;

pub use bspline::BSpline;
pub(crate) use bspline::{weights as bspline_weights, weights16 as bspline_weights16};
pub(crate) use prefilter::prefilter_line;
pub use trilinear::Trilinear;
pub(crate) use trilinear::TrilinearRows;
pub use trilinear_gradient::TrilinearGradient;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16};

/// Which interpolant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolant {
    /// Prefiltered cubic B-spline: the default.
    #[default]
    BSpline,
    /// Trilinear eps, and the gradient of that: for previews.
    Trilinear,
    /// Trilinear interpolation of eps and of its central differences: the dissertation's.
    TrilinearGradient,
}

/// Rays of a packet.
pub(crate) const LANES: usize = 16;

/// One value for each ray of a packet.
pub(crate) type Row = [f32; LANES];

/// A point's eps, and its gradient per lattice step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// eps = n/n0 - 1.
    pub eps: f64,
    /// Change of eps per lattice step along x, y and z.
    pub gradient: [f64; 3],
}

/// The same for the sixteen rays of a packet.
pub(crate) struct Samples<S: Simd> {
    pub(crate) eps: f32x16<S>,
    pub(crate) gradient: [f32x16<S>; 3],
}

/// The reference: one point in `f64`.
pub trait Interpolate: Sync {
    /// At a point in lattice coordinates.
    fn sample(&self, at: [f64; 3]) -> Sample;

    /// Nodes along x, y and z.
    fn dims(&self) -> [usize; 3];

    /// Bytes held beside the field's own.
    fn memory_bytes(&self) -> usize;
}

/// The kernels: sixteen points in `f32`. Implementors borrow an interpolant's arrays, so that
/// bounds are checked once a point.
pub(crate) trait Interpolate16: Copy + Sync {
    /// Accurate enough for sums over hundreds of samples to be compensated.
    const EXACT: bool;

    /// At points in lattice coordinates, which may lie outside (but are no NaNs).
    fn sample16<S: Simd>(&self, simd: S, at: &[f32x16<S>; 3]) -> Samples<S>;
}

/// The cell of a coordinate, the lower one at 0 and the last one at n - 1, and the place in it.
pub(crate) fn cell(at: f64, nodes: usize) -> (usize, f64) {
    let at = at.clamp(0.0, (nodes - 1) as f64);
    let i = (at as usize).min(nodes - 2);
    (i, at - i as f64)
}

/// [`cell`] along x, y and z for sixteen rays. `last` and `last_cell` are n - 1 and n - 2 along
/// each.
#[inline(always)]
pub(crate) fn cells16<S: Simd>(
    simd: S,
    at: &[f32x16<S>; 3],
    last: [f32; 3],
    last_cell: [f32; 3],
) -> ([i32x16<S>; 3], [f32x16<S>; 3]) {
    let mut cells = [i32x16::splat(simd, 0); 3];
    let mut place = *at;
    for c in 0..3 {
        let clamped = at[c].max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, last[c]));
        cells[c] = clamped.min(f32x16::splat(simd, last_cell[c])).to_int::<i32x16<S>>();
        place[c] = clamped - cells[c].to_float::<f32x16<S>>();
    }
    (cells, place)
}

/// Four numbers for each of sixteen rays, ray by ray, as four vectors over the rays.
#[inline(always)]
pub(crate) fn transpose<S: Simd>(simd: S, rays: &[f32; 4 * LANES]) -> [f32x16<S>; 4] {
    let a = f32x16::from_slice(simd, &rays[..16]);
    let b = f32x16::from_slice(simd, &rays[16..32]);
    let c = f32x16::from_slice(simd, &rays[32..48]);
    let d = f32x16::from_slice(simd, &rays[48..]);
    // Components 0, 2 and 1, 3 apart, then each other.
    let ((ab02, ab13), (cd02, cd13)) = (a.deinterleave(b), c.deinterleave(d));
    let ((q0, q2), (q1, q3)) = (ab02.deinterleave(cd02), ab13.deinterleave(cd13));
    [q0, q1, q2, q3]
}
