//! Gradients at sixteen samples: the trilinear interpolant of central differences at the corners
//! of a cell, from the 32 points in and around it.

use super::sample_medium::{Cells, Gradients, Medium, mix};
use crate::simd::vectors::Vec3x16;
use fearless_simd::{Select, Simd, SimdBase, f32x16, i32x16};

/// The points next to a cell along one axis.
struct Neighbours<S: Simd> {
    /// Steps of the index from the cell's lowest point to the point before it, and to the one two
    /// behind; both stay inside the grid.
    before: i32x16<S>,
    after: i32x16<S>,
    /// What the differences at the lower and the upper corner are multiplied with.
    factors: [f32x16<S>; 2],
}

/// Gradients, in the units of `gradients.scale`.
#[inline(always)]
pub(super) fn gradient<S: Simd, const NEAREST: bool>(
    simd: S,
    medium: &Medium<'_>,
    gradients: &Gradients<'_>,
    cells: &Cells<S>,
) -> Vec3x16<S> {
    let dims = medium.dims.to_array().map(|n| n as i32);
    let strides = [1, dims[0], dims[0] * dims[1]];
    let s = |x: f32| f32x16::splat(simd, x);
    let whole = |x: i32| i32x16::splat(simd, x);
    let neighbours = |axis: usize| -> Neighbours<S> {
        let low = cells.low[axis];
        let is_first = low.simd_lt(s(0.5));
        let is_last = low.simd_gt(s(dims[axis] as f32 - 2.5));
        let (stride, one, two) = (strides[axis], s(1.0), s(2.0));
        let factors = if gradients.clamped {
            [one, one]
        } else {
            // One-sided: over one spacing instead of two.
            [is_first.select(two, one), is_last.select(two, one)]
        };
        Neighbours {
            before: is_first.select(whole(0), whole(-stride)),
            after: is_last.select(whole(stride), whole(2 * stride)),
            factors,
        }
    };
    let [fx, fy, fz] = cells.inside;
    let (x, y, z) = (neighbours(0), neighbours(1), neighbours(2));
    let (row, slab) = (whole(strides[1]), whole(strides[2]));
    let index = cells.index;
    let pair = |at: i32x16<S>| medium.values.pairs(simd, at);
    let along_x = |[a, b]: [f32x16<S>; 2]| mix::<S, NEAREST>(simd, a, b, fx);
    let between = |a: f32x16<S>, b: f32x16<S>, at: f32x16<S>| mix::<S, NEAREST>(simd, a, b, at);

    // ---- The four lines along x through the cell: their values, and differences along them.
    let starts = [index, index + row, index + slab, index + slab + row];
    let mut lines = [s(0.0); 4];
    let mut rises = [s(0.0); 4];
    for k in 0..4 {
        let [b, c] = pair(starts[k]);
        let a = medium.values.numbers(simd, starts[k] + x.before);
        let d = pair(starts[k] + x.after - whole(1))[1];
        lines[k] = along_x([b, c]);
        rises[k] = along_x([(c - a) * x.factors[0], (d - b) * x.factors[1]]);
    }
    let gx = between(between(rises[0], rises[1], fy), between(rises[2], rises[3], fy), fz);

    // ---- Along y and z: the lines before and behind.
    let difference = |k: [usize; 2], start: i32x16<S>, n: &Neighbours<S>, at: f32x16<S>| {
        let before = along_x(pair(start + n.before));
        let after = along_x(pair(start + n.after));
        between((lines[k[1]] - before) * n.factors[0], (after - lines[k[0]]) * n.factors[1], at)
    };
    let gy =
        between(difference([0, 1], starts[0], &y, fy), difference([2, 3], starts[2], &y, fy), fz);
    let gz =
        between(difference([0, 2], starts[0], &z, fz), difference([1, 3], starts[1], &z, fz), fy);
    let scale = gradients.scale;
    Vec3x16 { x: gx * s(scale.x), y: gy * s(scale.y), z: gz * s(scale.z) }
}
