//! Evaluates eps and its gradient anywhere in a field, with one of three interpolants.
//!
//! | interpolant | smoothness | bytes/node | error of deflection, OPD for a Gaussian of 10 voxels' sigma (`interpolation_errors_are_those_on_record`) |
//! |---|---|---|---|
//! | [`BSpline`] | C2 | 4 | 8e-6, 2e-7 |
//! | [`Trilinear`] | C0 | 4 | 1e-2, 4e-4 |
//! | [`TrilinearGradient`] | C0, gradient C0 | 16 | 2e-3, 4e-4 |
//!
//! All of them take lattice coordinates: 0 at the first node along each axis, 1 at the next. Points
//! outside the lattice get the value and the gradient of the nearest point on its surface.

mod bspline;
mod lagrange;
mod prefilter;
mod trilinear;
mod trilinear_gradient;

pub use bspline::BSpline;
pub(crate) use bspline::{weights as bspline_weights, weights16 as bspline_weights16};
pub(crate) use lagrange::Lagrange;
pub(crate) use prefilter::{prefilter_line, prefilter_rows};
pub use trilinear::Trilinear;
pub(crate) use trilinear::TrilinearRows;
pub use trilinear_gradient::TrilinearGradient;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16};

/// How eps and its gradient are interpolated between the nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolant {
    /// Prefiltered cubic B-spline: the default.
    #[default]
    BSpline,
    /// Trilinear eps and the exact gradient of that interpolant: for previews.
    Trilinear,
    /// Trilinear interpolation of eps and of its central differences, as in the dissertation.
    TrilinearGradient,
}

/// Number of rays in a packet.
pub(crate) const LANES: usize = 16;

/// One value for each ray of a packet.
pub(crate) type Row = [f32; LANES];

/// The value of eps at a point, and its gradient per lattice step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The value of eps = n/n0 - 1.
    pub eps: f64,
    /// Change of eps per lattice step along x, y and z.
    pub gradient: [f64; 3],
}

/// [`Sample`] for the sixteen rays of a packet.
pub(crate) struct Samples<S: Simd> {
    pub(crate) eps: f32x16<S>,
    pub(crate) gradient: [f32x16<S>; 3],
}

/// Interpolation of one point in `f64`: the reference for the kernels.
pub trait Interpolate: Sync {
    /// Value and gradient at a point in lattice coordinates.
    fn sample(&self, at: [f64; 3]) -> Sample;

    /// Number of nodes along x, y and z.
    fn dims(&self) -> [usize; 3];

    /// Memory of the interpolant in bytes, without the field's own arrays.
    fn memory_bytes(&self) -> usize;
}

/// Interpolation of sixteen points in `f32`, for the kernels. Implementors borrow an interpolant's
/// arrays, so that bounds are checked once per point.
pub(crate) trait Interpolate16: Copy + Sync {
    /// Whether the samples are accurate enough that compensated (Kahan) summation over hundreds of
    /// them is worth its cost.
    const COMPENSATE_SUMS: bool;

    /// Values and gradients at points in lattice coordinates. Points may lie outside the lattice;
    /// NaN is not allowed.
    fn sample16<S: Simd>(&self, simd: S, at: &[f32x16<S>; 3]) -> Samples<S>;
}

/// The cell that holds a coordinate, and the position in that cell in 0..1. Coordinates are clamped
/// to the lattice; the last cell includes the coordinate n - 1.
#[inline(always)]
pub(crate) fn cell(at: f64, nodes: usize) -> (usize, f64) {
    let at = at.clamp(0.0, (nodes - 1) as f64);
    let i = (at as usize).min(nodes - 2);
    (i, at - i as f64)
}

/// [`cell`] along x, y and z for sixteen rays. `last` and `last_cell` are n - 1 and n - 2 along
/// each axis.
#[inline(always)]
pub(crate) fn cells16<S: Simd>(
    simd: S,
    at: &[f32x16<S>; 3],
    last: [f32; 3],
    last_cell: [f32; 3],
) -> ([i32x16<S>; 3], [f32x16<S>; 3]) {
    let mut cells = [i32x16::splat(simd, 0); 3];
    let mut fraction = *at;
    for c in 0..3 {
        let clamped = at[c].max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, last[c]));
        cells[c] = clamped.min(f32x16::splat(simd, last_cell[c])).to_int::<i32x16<S>>();
        fraction[c] = clamped - cells[c].to_float::<f32x16<S>>();
    }
    (cells, fraction)
}

/// Transposes sixteen groups of four numbers, one group per ray, into four vectors with one lane
/// per ray.
#[inline(always)]
pub(crate) fn transpose<S: Simd>(simd: S, rays: &[f32; 4 * LANES]) -> [f32x16<S>; 4] {
    let a = f32x16::from_slice(simd, &rays[..16]);
    let b = f32x16::from_slice(simd, &rays[16..32]);
    let c = f32x16::from_slice(simd, &rays[32..48]);
    let d = f32x16::from_slice(simd, &rays[48..]);
    // First separates components 0, 2 from 1, 3, then each pair.
    let ((ab02, ab13), (cd02, cd13)) = (a.deinterleave(b), c.deinterleave(d));
    let ((q0, q2), (q1, q3)) = (ab02.deinterleave(cd02), ab13.deinterleave(cd13));
    [q0, q1, q2, q3]
}
