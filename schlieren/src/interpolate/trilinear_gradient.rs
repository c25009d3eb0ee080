//! Trilinear interpolation of eps and of its central differences at the nodes, which the
//! dissertation keeps in a texture of four floats per voxel.

use super::{
    Interpolate, Interpolate16, LANES, Row, Sample, Samples, cell, cells16, transpose,
    trilinear::padded_row,
};
use crate::field::Field;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x16};
use rayon::prelude::*;

/// Trilinear interpolation of the gradient and of eps, which are stored at each node in sixteen
/// bytes.
#[derive(Debug)]
pub struct TrilinearGradient {
    /// Per node: d/dx, d/dy and d/dz per lattice step, then eps.
    nodes: Vec<f32>,
    dims: [usize; 3],
    /// Strides along y and z, in nodes.
    stride: [usize; 2],
}

impl TrilinearGradient {
    /// Computes central differences, and one-sided ones of second order at the faces, in parallel.
    pub fn new(field: &Field) -> TrilinearGradient {
        TrilinearGradient::in_jobs_of(field, 1)
    }

    /// [`TrilinearGradient::new`] on the calling thread alone, which waits for no other thread.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_this_thread(field: &Field) -> TrilinearGradient {
        // Rayon does not divide ranges that are shorter than this minimum, and an undivided range
        // runs on the calling thread.
        TrilinearGradient::in_jobs_of(field, usize::MAX)
    }

    /// [`TrilinearGradient::new`] in rayon jobs of at least `least` rows.
    fn in_jobs_of(field: &Field, least: usize) -> TrilinearGradient {
        let [nx, ny, nz] = field.dims();
        let row = padded_row(nx);
        let eps = field.eps();
        let mut nodes = vec![0.0f32; 4 * row * ny * nz];
        let rows = nodes.par_chunks_exact_mut(4 * row).with_min_len(least);
        rows.enumerate().for_each(|(r, out)| {
            let (j, k) = (r % ny, r / ny);
            for (i, node) in out.chunks_exact_mut(4).take(nx).enumerate() {
                let o = i + (j + k * ny) * nx;
                node[0] = difference(eps, o, 1, i, nx);
                node[1] = difference(eps, o, nx, j, ny);
                node[2] = difference(eps, o, nx * ny, k, nz);
                node[3] = eps[o];
            }
        });
        TrilinearGradient { nodes, dims: [nx, ny, nz], stride: [row, row * ny] }
    }

    /// Four numbers for each node, and the strides along y and z, in nodes.
    #[cfg(feature = "gpu")]
    pub(crate) fn nodes(&self) -> (&[f32], [usize; 2]) {
        (&self.nodes, self.stride)
    }

    pub(crate) fn rows(&self) -> TrilinearGradientRows<'_> {
        let [sy, sz] = self.stride;
        let len = self.nodes.len() - 4 * (sy + sz);
        TrilinearGradientRows {
            corners: [
                &self.nodes[..len],
                &self.nodes[4 * sy..4 * sy + len],
                &self.nodes[4 * sz..4 * sz + len],
                &self.nodes[4 * (sy + sz)..4 * (sy + sz) + len],
            ],
            last_cell: self.dims.map(|n| (n - 2) as f32),
            last: self.dims.map(|n| (n - 1) as f32),
            stride: [sy as i32, sz as i32],
        }
    }
}

/// Derivative per lattice step at node `i` of the `n` nodes of a line. The node's index in `eps` is
/// `o`.
fn difference(eps: &[f32], o: usize, stride: usize, i: usize, n: usize) -> f32 {
    let v = |o: usize| f64::from(eps[o]);
    let d = match (i, n) {
        (_, 2) => v(o - i * stride + stride) - v(o - i * stride),
        (0, _) => -1.5 * v(o) + 2.0 * v(o + stride) - 0.5 * v(o + 2 * stride),
        (i, n) if i + 1 == n => 1.5 * v(o) - 2.0 * v(o - stride) + 0.5 * v(o - 2 * stride),
        _ => 0.5 * (v(o + stride) - v(o - stride)),
    };
    d as f32
}

impl Interpolate for TrilinearGradient {
    fn sample(&self, at: [f64; 3]) -> Sample {
        let [(i, x), (j, y), (k, z)] = [0, 1, 2].map(|c| cell(at[c], self.dims[c]));
        let component = |q: usize| {
            let v = |d: [usize; 3]| {
                f64::from(
                    self.nodes[4
                        * (i + d[0] + (j + d[1]) * self.stride[0] + (k + d[2]) * self.stride[1])
                        + q],
                )
            };
            let along_x = |dj, dk| (1.0 - x) * v([0, dj, dk]) + x * v([1, dj, dk]);
            let along_y = |dk| (1.0 - y) * along_x(0, dk) + y * along_x(1, dk);
            (1.0 - z) * along_y(0) + z * along_y(1)
        };
        Sample { eps: component(3), gradient: [component(0), component(1), component(2)] }
    }

    fn dims(&self) -> [usize; 3] {
        self.dims
    }

    fn memory_bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
    }
}

/// The nodes as four slices of one length, shifted by a row and a layer.
#[derive(Clone, Copy)]
pub(crate) struct TrilinearGradientRows<'a> {
    corners: [&'a [f32]; 4],
    last_cell: [f32; 3],
    last: [f32; 3],
    stride: [i32; 2],
}

impl Interpolate16 for TrilinearGradientRows<'_> {
    const COMPENSATE_SUMS: bool = false;

    #[inline(always)]
    fn sample16<S: Simd>(&self, simd: S, at: &[f32x16<S>; 3]) -> Samples<S> {
        let (cells, fraction) = cells16(simd, at, self.last, self.last_cell);
        let fraction: [Row; 3] = fraction.map(Into::into);
        let offsets = cells[0] + cells[1] * self.stride[0] + cells[2] * self.stride[1];
        let offsets: [i32; LANES] = offsets.into();
        // The compiler sees here that the slices have one length, so one bounds check is enough for
        // all four.
        let len = self.corners[0].len();
        let corners = [
            self.corners[0],
            &self.corners[1][..len],
            &self.corners[2][..len],
            &self.corners[3][..len],
        ];
        let mut out = [0.0f32; 4 * LANES];
        for l in 0..LANES {
            let o = 4 * offsets[l] as u32 as usize;
            let x = f32x4::splat(simd, fraction[0][l]);
            let y = f32x4::splat(simd, fraction[1][l]);
            let z = f32x4::splat(simd, fraction[2][l]);
            let mut edges = [x; 4];
            for e in 0..4 {
                let taps = &corners[e][o..o + 8];
                let (a, b) =
                    (f32x4::from_slice(simd, &taps[..4]), f32x4::from_slice(simd, &taps[4..]));
                edges[e] = x.mul_add(b - a, a);
            }
            let [a, b, c, d] = edges;
            let (low, high) = (y.mul_add(b - a, a), y.mul_add(d - c, c));
            z.mul_add(high - low, low).store_slice(&mut out[4 * l..4 * l + 4]);
        }
        let [gx, gy, gz, eps] = transpose(simd, &out);
        Samples { eps, gradient: [gx, gy, gz] }
    }
}
