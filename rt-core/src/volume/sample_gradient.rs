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
pub(super) fn gradient<S: Simd>(
    simd: S,
    medium: &Medium<'_>,
    gradients: &Gradients<'_>,
    cells: &Cells<S>,
) -> Vec3x16<S> {
    let scale = Vec3x16::splat(simd, gradients.scale);
    if medium.nearest {
        return at_points(simd, medium, gradients, cells).mul(scale);
    }
    in_cells(simd, medium, gradients, cells).mul(scale)
}

/// Central differences at the points in whose boxes the samples lie.
#[inline(always)]
fn at_points<S: Simd>(
    simd: S,
    medium: &Medium<'_>,
    gradients: &Gradients<'_>,
    cells: &Cells<S>,
) -> Vec3x16<S> {
    let s = |x: f32| f32x16::splat(simd, x);
    let dims = medium.dims.to_array();
    let (low, inside) = (&cells.low, &cells.inside);
    let at = [low[0] + inside[0], low[1] + inside[1], low[2] + inside[2]];
    let mut differences = [s(0.0); 3];
    for axis in 0..3 {
        let (mut before, mut after) = (at, at);
        before[axis] = (at[axis] - s(1.0)).max(s(0.0));
        after[axis] = (at[axis] + s(1.0)).min(s((dims[axis] - 1) as f32));
        let difference = medium.point(simd, after) - medium.point(simd, before);
        // One-sided: over one spacing instead of two.
        let is_short = (after[axis] - before[axis]).simd_lt(s(1.5));
        let factor = if gradients.clamped { s(1.0) } else { is_short.select(s(2.0), s(1.0)) };
        differences[axis] = difference * factor;
    }
    let [x, y, z] = differences;
    Vec3x16 { x, y, z }
}

impl<S: Simd> Neighbours<S> {
    #[inline(always)]
    fn new(
        simd: S,
        medium: &Medium<'_>,
        gradients: &Gradients<'_>,
        cells: &Cells<S>,
        axis: usize,
    ) -> Self {
        let dims = medium.dims.to_array().map(|n| n as i32);
        let stride = [1, dims[0], dims[0] * dims[1]][axis];
        let s = |x: f32| f32x16::splat(simd, x);
        let whole = |x: i32| i32x16::splat(simd, x);
        let low = cells.low[axis];
        let is_first = low.simd_lt(s(0.5));
        let is_last = low.simd_gt(s(dims[axis] as f32 - 2.5));
        let one = s(1.0);
        let factors = if gradients.clamped {
            [one, one]
        } else {
            // One-sided: over one spacing instead of two.
            [is_first.select(s(2.0), one), is_last.select(s(2.0), one)]
        };
        Neighbours {
            before: is_first.select(whole(0), whole(-stride)),
            after: is_last.select(whole(stride), whole(2 * stride)),
            factors,
        }
    }

    /// Differences at `at` between two lines, which begin at `start` and behind it and have the
    /// values `lines`.
    #[inline(always)]
    fn difference(
        &self,
        simd: S,
        medium: &Medium<'_>,
        start: i32x16<S>,
        lines: [f32x16<S>; 2],
        [fx, at]: [f32x16<S>; 2],
    ) -> f32x16<S> {
        let before = medium.along_x(simd, start + self.before, fx);
        let after = medium.along_x(simd, start + self.after, fx);
        mix((lines[1] - before) * self.factors[0], (after - lines[0]) * self.factors[1], at)
    }
}

/// Differences at the corners of the cells, interpolated.
#[inline(always)]
fn in_cells<S: Simd>(
    simd: S,
    medium: &Medium<'_>,
    gradients: &Gradients<'_>,
    cells: &Cells<S>,
) -> Vec3x16<S> {
    let [fx, fy, fz] = cells.inside;
    let x = Neighbours::new(simd, medium, gradients, cells, 0);
    let y = Neighbours::new(simd, medium, gradients, cells, 1);
    let z = Neighbours::new(simd, medium, gradients, cells, 2);
    let whole = |x: u32| i32x16::splat(simd, x as i32);
    let (row, slab) = (whole(medium.dims.x), whole(medium.dims.x * medium.dims.y));

    // ---- The four lines along x through the cell: their values, and differences along them.
    let first = cells.index;
    let starts = [first, first + row, first + slab, first + slab + row];
    let zero = f32x16::splat(simd, 0.0);
    let (mut lines, mut rises) = ([zero; 4], [zero; 4]);
    for k in 0..4 {
        let [b, c] = medium.values.pairs(simd, starts[k]);
        let a = medium.values.numbers(simd, starts[k] + x.before);
        let d = medium.values.pairs(simd, starts[k] + x.after - whole(1))[1];
        lines[k] = mix(b, c, fx);
        rises[k] = mix((c - a) * x.factors[0], (d - b) * x.factors[1], fx);
    }
    let gx = mix(mix(rises[0], rises[1], fy), mix(rises[2], rises[3], fy), fz);

    // ---- Along y and z: the lines before and behind.
    let near = y.difference(simd, medium, starts[0], [lines[0], lines[1]], [fx, fy]);
    let far = y.difference(simd, medium, starts[2], [lines[2], lines[3]], [fx, fy]);
    let gy = mix(near, far, fz);
    let near = z.difference(simd, medium, starts[0], [lines[0], lines[2]], [fx, fz]);
    let far = z.difference(simd, medium, starts[1], [lines[1], lines[3]], [fx, fz]);
    let gz = mix(near, far, fy);
    Vec3x16 { x: gx, y: gy, z: gz }
}
