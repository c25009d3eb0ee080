//! Trilinear interpolation of eps, with the exact gradient of the interpolant: eight taps.

use super::{Interpolate, Interpolate16, LANES, Sample, Samples, cell, cells16};
use crate::field::Field;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, u64x8};
use std::borrow::Cow;

/// Trilinear interpolation. Its gradient jumps between cells, so the contrast of shadowgraphs is
/// mostly wrong; deflections are right within a few percent.
#[derive(Debug)]
pub struct Trilinear<'a> {
    values: Cow<'a, [f32]>,
    dims: [usize; 3],
    /// Strides along y and z in `values`.
    stride: [usize; 2],
}

impl<'a> Trilinear<'a> {
    /// Interpolates a field. The field is copied only when its rows would map to the same cache
    /// lines.
    pub fn new(field: &'a Field) -> Trilinear<'a> {
        Trilinear::of(Cow::Borrowed(field.eps()), field.dims())
    }

    /// Interpolates any values at the nodes of a lattice, x fastest, with at least two nodes along
    /// each axis.
    pub(crate) fn of(values: Cow<'a, [f32]>, [nx, ny, nz]: [usize; 3]) -> Trilinear<'a> {
        let (row, layer) = (padded_row(nx), ny);
        if row == nx {
            return Trilinear { values, dims: [nx, ny, nz], stride: [nx, nx * ny] };
        }
        let mut padded = vec![0.0; row * layer * nz];
        for (to, from) in padded.chunks_exact_mut(row).zip(values.chunks_exact(nx)) {
            to[..nx].copy_from_slice(from);
        }
        Trilinear { values: Cow::Owned(padded), dims: [nx, ny, nz], stride: [row, row * layer] }
    }

    /// The values at the nodes, x fastest, without padding.
    pub(crate) fn nodes(&self) -> Vec<f32> {
        let [nx, ny, nz] = self.dims;
        let rows = self.values.chunks_exact(self.stride[0]).take(ny * nz);
        rows.flat_map(|row| &row[..nx]).copied().collect()
    }

    pub(crate) fn rows(&self) -> TrilinearRows<'_> {
        let [sy, sz] = self.stride;
        let len = self.values.len() - sy - sz;
        TrilinearRows {
            corners: [
                &self.values[..len],
                &self.values[sy..sy + len],
                &self.values[sz..sz + len],
                &self.values[sy + sz..sy + sz + len],
            ],
            last_cell: self.dims.map(|n| (n - 2) as f32),
            last: self.dims.map(|n| (n - 1) as f32),
            stride: [sy as i32, sz as i32],
        }
    }
}

/// Length of a row with padding. With rows of a power of two, a column of the lattice would map to
/// a few cache sets.
pub(super) fn padded_row(nx: usize) -> usize {
    if nx.is_multiple_of(64) { nx + 16 } else { nx }
}

impl Interpolate for Trilinear<'_> {
    fn sample(&self, at: [f64; 3]) -> Sample {
        let [(i, x), (j, y), (k, z)] = [0, 1, 2].map(|c| cell(at[c], self.dims[c]));
        let v = |dj: usize, dk: usize| {
            let o = i + (j + dj) * self.stride[0] + (k + dk) * self.stride[1];
            let (a, b) = (f64::from(self.values[o]), f64::from(self.values[o + 1]));
            (a + x * (b - a), b - a)
        };
        let [(a, da), (b, db), (c, dc), (d, dd)] = [v(0, 0), v(1, 0), v(0, 1), v(1, 1)];
        let (low, high) = (a + y * (b - a), c + y * (d - c));
        let (dx_low, dx_high) = (da + y * (db - da), dc + y * (dd - dc));
        Sample {
            eps: low + z * (high - low),
            gradient: [
                dx_low + z * (dx_high - dx_low),
                (b - a) + z * ((d - c) - (b - a)),
                high - low,
            ],
        }
    }

    fn dims(&self) -> [usize; 3] {
        self.dims
    }

    fn memory_bytes(&self) -> usize {
        match &self.values {
            Cow::Borrowed(_) => 0,
            Cow::Owned(v) => size_of_val(&v[..]),
        }
    }
}

/// The lattice as four slices of one length, shifted by a row and a layer, so that one bounds check
/// serves all eight taps.
#[derive(Clone, Copy)]
pub(crate) struct TrilinearRows<'a> {
    corners: [&'a [f32]; 4],
    last_cell: [f32; 3],
    last: [f32; 3],
    stride: [i32; 2],
}

impl Interpolate16 for TrilinearRows<'_> {
    const COMPENSATE_SUMS: bool = false;

    #[inline(always)]
    fn sample16<S: Simd>(&self, simd: S, at: &[f32x16<S>; 3]) -> Samples<S> {
        // Cells and positions in them.
        let (cells, fraction) = cells16(simd, at, self.last, self.last_cell);
        let offsets = cells[0] + cells[1] * self.stride[0] + cells[2] * self.stride[1];
        let offsets: [i32; LANES] = offsets.into();

        // The eight taps of each cell.
        let [[a0, a1], [b0, b1], [c0, c1], [d0, d1]] = taps(simd, &self.corners, &offsets);

        // Differences are taken first, so that the gradient is not a difference of interpolated
        // values.
        let [x, y, z] = fraction;
        let [da, db, dc, dd] = [a1 - a0, b1 - b0, c1 - c0, d1 - d0];
        let [a, b, c, d] =
            [x.mul_add(da, a0), x.mul_add(db, b0), x.mul_add(dc, c0), x.mul_add(dd, d0)];
        let [dy_low, dy_high] = [b - a, d - c];
        let [low, high] = [y.mul_add(dy_low, a), y.mul_add(dy_high, c)];
        let [dx_low, dx_high] = [y.mul_add(db - da, da), y.mul_add(dd - dc, dc)];
        let dz = high - low;
        Samples {
            eps: z.mul_add(dz, low),
            gradient: [
                z.mul_add(dx_high - dx_low, dx_low),
                z.mul_add(dy_high - dy_low, dy_low),
                dz,
            ],
        }
    }
}

/// The two neighbours along x at each of a cell's four edges, for sixteen cells. Each pair is one
/// load of eight bytes.
#[inline(always)]
fn taps<S: Simd>(simd: S, corners: &[&[f32]; 4], offsets: &[i32; LANES]) -> [[f32x16<S>; 2]; 4] {
    // The compiler sees here that the slices have one length, so one bounds check is enough for all
    // four.
    let len = corners[0].len();
    let corners = [corners[0], &corners[1][..len], &corners[2][..len], &corners[3][..len]];
    let mut halves = [[[0u64; 8]; 2]; 4];
    for l in 0..LANES {
        let o = offsets[l] as u32 as usize;
        for e in 0..4 {
            let pair = &corners[e][o..o + 2];
            halves[e][l / 8][l % 8] = bytemuck::cast([pair[0], pair[1]]);
        }
    }
    let mut out = [[f32x16::splat(simd, 0.0); 2]; 4];
    for e in 0..4 {
        let low: f32x16<S> = u64x8::simd_from(simd, halves[e][0]).bitcast();
        let high: f32x16<S> = u64x8::simd_from(simd, halves[e][1]).bitcast();
        let (even, odd) = low.deinterleave(high);
        out[e] = [even, odd];
    }
    out
}
