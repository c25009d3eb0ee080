//! Samples of four rays. Each is a sum over the 4 x 4 x 4 nodes around a cell, with weights of
//! value and derivative for each axis; eight nodes of these, or 32, have any weight.
//!
//! Weights are computed for four rays at once. The nodes of a ray are read in rows of four along x,
//! which are summed over y and z first and over x at last.

use super::Brick;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f64x4};

/// Nodes around the cells of four rays along one axis, with their weights.
pub(super) struct AxisWeights {
    /// The cell: it lies between this node and the next.
    pub(super) cell: [f64; 4],
    /// Weights of the values at the two nodes of the cell.
    value: [[f64; 4]; 2],
    /// Weights of the derivative per node distance, from the node before the cell.
    slope: [[f64; 4]; 4],
}

/// Weights and cells of four rays at `at`, along an axis of `nodes` nodes. With `WIDE`, the
/// derivative is interpolated between differences at both nodes of the cell: central ones, of
/// second order at the faces.
#[inline(always)]
pub(super) fn axis_weights<S: Simd, const WIDE: bool>(
    simd: S,
    at: f64x4<S>,
    nodes: usize,
) -> AxisWeights {
    let splat = |value: f64| f64x4::splat(simd, value);
    let at = at.max(splat(0.0)).min(splat((nodes - 1) as f64));
    let last = splat((nodes - 2) as f64);
    let cell = at.floor().min(last);
    let x = at - cell;
    let rest = splat(1.0) - x;
    let mut slope = [splat(0.0), splat(-1.0), splat(1.0), splat(0.0)];
    if WIDE {
        slope = [rest * -0.5, x * -0.5, rest * 0.5, x * 0.5];
        let (is_first, is_last) = (cell.simd_eq(splat(0.0)), cell.simd_eq(last));
        if (is_first | is_last).any_true() {
            // Differences at the node below and at the node above, as far as they are others here.
            let below_first = [splat(0.0), rest * -1.5, rest * 2.0, rest * -0.5];
            let above_last = [x * 0.5, x * -2.0, x * 1.5, splat(0.0)];
            let below = [rest * -0.5, splat(0.0), rest * 0.5, splat(0.0)];
            let above = [splat(0.0), x * -0.5, splat(0.0), x * 0.5];
            let is_only = is_first & is_last;
            let only = [splat(0.0), splat(-1.0), splat(1.0), splat(0.0)];
            for k in 0..4 {
                let low = is_first.select(below_first[k], below[k]);
                let high = is_last.select(above_last[k], above[k]);
                slope[k] = is_only.select(only[k], low + high);
            }
        }
    }
    AxisWeights {
        cell: cell.into(),
        value: [rest.into(), x.into()],
        slope: [slope[0].into(), slope[1].into(), slope[2].into(), slope[3].into()],
    }
}

/// Value and gradient per node distance of one ray: eps, and its derivatives along x, y and z.
#[inline(always)]
pub(super) fn sample<S: Simd, B: Brick, const WIDE: bool>(
    simd: S,
    brick: &B,
    dims: [usize; 3],
    weights: &[AxisWeights; 3],
    lane: usize,
) -> f64x4<S> {
    let [x, y, z] = weights;
    let cell = [x.cell[lane] as usize, y.cell[lane] as usize, z.cell[lane] as usize];
    let splat = |value: f64| f64x4::splat(simd, value);
    let rows_y = around(cell[1], dims[1]);
    let rows_z = around(cell[2], dims[2]);
    let zero = splat(0.0);
    // Written out: a loop over the rows stayed one, and cost as much again as its sums.
    let rows = Rows { brick, x: cell[0], nodes: dims[0], y: rows_y, z: rows_z };
    let y_value = [splat(y.value[0][lane]), splat(y.value[1][lane])];
    let z_value = [splat(z.value[0][lane]), splat(z.value[1][lane])];
    let y_slope = |j: usize| splat(y.slope[j][lane]);
    let z_slope = |k: usize| splat(z.slope[k][lane]);
    let [r11, r21, r12, r22] = [
        rows.row::<S, WIDE>(simd, 1, 1),
        rows.row::<S, WIDE>(simd, 2, 1),
        rows.row::<S, WIDE>(simd, 1, 2),
        rows.row::<S, WIDE>(simd, 2, 2),
    ];
    // Sums along y: of values, of derivatives.
    let values = [r11 * y_value[0] + r21 * y_value[1], r12 * y_value[0] + r22 * y_value[1]];
    let mut slopes = [r11 * y_slope(1) + r21 * y_slope(2), r12 * y_slope(1) + r22 * y_slope(2)];
    let mut along_z = values[0] * z_slope(1) + values[1] * z_slope(2);
    if WIDE {
        slopes[0] += rows.row::<S, WIDE>(simd, 0, 1) * y_slope(0)
            + rows.row::<S, WIDE>(simd, 3, 1) * y_slope(3);
        slopes[1] += rows.row::<S, WIDE>(simd, 0, 2) * y_slope(0)
            + rows.row::<S, WIDE>(simd, 3, 2) * y_slope(3);
        let below = rows.row::<S, WIDE>(simd, 1, 0) * y_value[0]
            + rows.row::<S, WIDE>(simd, 2, 0) * y_value[1];
        let above = rows.row::<S, WIDE>(simd, 1, 3) * y_value[0]
            + rows.row::<S, WIDE>(simd, 2, 3) * y_value[1];
        along_z += below * z_slope(0) + above * z_slope(3);
    }
    let plain = values[0] * z_value[0] + values[1] * z_value[1];
    let along_y = slopes[0] * z_value[0] + slopes[1] * z_value[1];
    // ---- Sums over x. Only the nodes of the cell have a value there: the others may lie where
    // there is no gas, and a weight of 0 does not make a number of NaN.
    let x_value = f64x4::simd_from(simd, [0.0, x.value[0][lane], x.value[1][lane], 0.0]);
    let is_inner = f64x4::simd_from(simd, [0.0, 1.0, 1.0, 0.0]).simd_eq(splat(1.0));
    let of_cell = |sum: f64x4<S>| is_inner.select(sum * x_value, zero);
    let [s0, s1, s2, s3] = &x.slope;
    let along_x = plain * f64x4::simd_from(simd, [s0[lane], s1[lane], s2[lane], s3[lane]]);
    let [a, b, c, d] = transposed([of_cell(plain), along_x, of_cell(along_y), of_cell(along_z)]);
    (b + c) + (a + d)
}

/// The nodes around a cell along an axis. A node that is not there has no weight; the nearest one
/// is read in its place.
#[inline(always)]
fn around(cell: usize, nodes: usize) -> [usize; 4] {
    [cell.saturating_sub(1), cell, cell + 1, (cell + 2).min(nodes - 1)]
}

/// The rows of nodes along x around a cell.
struct Rows<'a, B> {
    brick: &'a B,
    /// The cell along x, and all nodes along it.
    x: usize,
    nodes: usize,
    y: [usize; 4],
    z: [usize; 4],
}

impl<B: Brick> Rows<'_, B> {
    /// Values at the nodes around the cell, from the one before it. Not a closure: one that is
    /// called from several places becomes a call, which takes half as long as the whole march.
    #[inline(always)]
    fn row<S: Simd, const WIDE: bool>(&self, simd: S, j: usize, k: usize) -> f64x4<S> {
        let (x, y, z) = (self.x, self.y[j], self.z[k]);
        let row = if !WIDE {
            let [b, c] = self.brick.row::<2>([x, y, z]);
            [0.0, b, c, 0.0]
        } else if x >= 1 && x + 2 < self.nodes {
            self.brick.row::<4>([x - 1, y, z])
        } else {
            let mut row = [0.0; 4];
            for (value, x) in row.iter_mut().zip(around(x, self.nodes)) {
                *value = self.brick.eps([x, y, z]);
            }
            row
        };
        f64x4::simd_from(simd, row)
    }
}

/// Rows become columns.
#[inline(always)]
pub(super) fn transposed<S: Simd>([a, b, c, d]: [f64x4<S>; 4]) -> [f64x4<S>; 4] {
    let (ac_low, ac_high) = (a.zip_low(c), a.zip_high(c));
    let (bd_low, bd_high) = (b.zip_low(d), b.zip_high(d));
    [
        ac_low.zip_low(bd_low),
        ac_low.zip_high(bd_low),
        ac_high.zip_low(bd_high),
        ac_high.zip_high(bd_high),
    ]
}
