//! Interpolation by a prefiltered cubic B-spline: C2, 64 taps.

use super::{
    Interpolate, Interpolate16, LANES, Row, Sample, Samples, cell, cells16, prefilter_line,
    prefilter_rows, transpose, trilinear::padded_row,
};
use crate::field::Field;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, f32x16};
use rayon::prelude::*;

/// The cubic spline through the nodes, without a knot next to the faces. Wherever the field is
/// resolved, its error is hundreds of times smaller than that of trilinear gradients (Sigworth's
/// rule of thumb).
#[derive(Debug)]
pub struct BSpline {
    /// Coefficients of nodes -1 ..= n along each axis.
    coefficients: Vec<f32>,
    dims: [usize; 3],
    stride: [usize; 2],
}

impl BSpline {
    /// Computes the coefficients from a field's values, in parallel.
    pub fn new(field: &Field) -> BSpline {
        BSpline::in_jobs_of(field, 1)
    }

    /// [`BSpline::new`] on the calling thread alone, with the same result bit for bit. Callers that
    /// hold a lock need this: a worker that waits inside rayon may take any other job, also one
    /// that waits for the same lock.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_this_thread(field: &Field) -> BSpline {
        // Rayon does not divide ranges that are shorter than this minimum, and an undivided range
        // runs on the calling thread.
        BSpline::in_jobs_of(field, usize::MAX)
    }

    /// [`BSpline::new`] in rayon jobs of at least `least` layers or sheets.
    fn in_jobs_of(field: &Field, least: usize) -> BSpline {
        let [nx, ny, nz] = field.dims();
        let row = padded_row(nx + 2);
        let layer = row * (ny + 2);

        // Along x and y, a layer at a time in f64.
        let mut layers = vec![0.0f32; layer * nz];
        let filtered =
            layers.par_chunks_exact_mut(layer).zip(field.eps().par_chunks_exact(nx * ny));
        filtered.with_min_len(least).for_each(|(out, values)| {
            let mut plane = vec![0.0f64; (nx + 2) * (ny + 2)];
            for (to, from) in plane.chunks_exact_mut(nx + 2).skip(1).zip(values.chunks_exact(nx)) {
                for (t, f) in to[1..].iter_mut().zip(from) {
                    *t = f64::from(*f);
                }
                prefilter_line(to);
            }
            prefilter_rows(&mut plane, nx + 2);
            for (to, from) in out.chunks_exact_mut(row).zip(plane.chunks_exact(nx + 2)) {
                for (t, f) in to.iter_mut().zip(from) {
                    *t = *f as f32;
                }
            }
        });

        // Along z, a sheet of rows with the same y at a time, again in f64: two roundings to f32 in
        // all. (Elimination layer by layer in place would save this copy, but it rounds in every
        // step of the recursion, so that a uniform gas gets slopes of one unit in the last place.)
        let sheets: Vec<Vec<f32>> = (0..ny + 2)
            .into_par_iter()
            .with_min_len(least)
            .map(|j| {
                let mut sheet = vec![0.0f64; row * (nz + 2)];
                for (k, to) in sheet.chunks_exact_mut(row).skip(1).take(nz).enumerate() {
                    for (t, f) in to.iter_mut().zip(&layers[k * layer + j * row..][..row]) {
                        *t = f64::from(*f);
                    }
                }
                prefilter_rows(&mut sheet, row);
                sheet.iter().map(|c| *c as f32).collect()
            })
            .collect();
        drop(layers);
        let mut coefficients = vec![0.0f32; layer * (nz + 2)];
        coefficients.par_chunks_exact_mut(layer).enumerate().with_min_len(least).for_each(
            |(k, out)| {
                for (to, sheet) in out.chunks_exact_mut(row).zip(&sheets) {
                    to.copy_from_slice(&sheet[k * row..(k + 1) * row]);
                }
            },
        );
        BSpline { coefficients, dims: [nx, ny, nz], stride: [row, layer] }
    }

    pub(crate) fn rows(&self) -> BSplineRows<'_> {
        let [sy, sz] = self.stride;
        let len = self.coefficients.len() - 3 * sy;
        BSplineRows {
            rows: [
                &self.coefficients[..len],
                &self.coefficients[sy..sy + len],
                &self.coefficients[2 * sy..2 * sy + len],
                &self.coefficients[3 * sy..3 * sy + len],
            ],
            last_cell: self.dims.map(|n| (n - 2) as f32),
            last: self.dims.map(|n| (n - 1) as f32),
            stride: [sy, sz],
        }
    }

    /// The coefficients of nodes -1 ..= n along each axis, and the strides along y and z.
    pub(crate) fn coefficients(&self) -> (&[f32], [usize; 2]) {
        (&self.coefficients, self.stride)
    }
}

/// Weights of the four coefficients around a cell at position `t` in 0..1, and of their three
/// differences for the derivative.
pub(crate) fn weights(t: f64) -> ([f64; 4], [f64; 3]) {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    (
        [
            s2 * s / 6.0,
            (4.0 + 3.0 * t2 * t - 6.0 * t2) / 6.0,
            (4.0 + 3.0 * s2 * s - 6.0 * s2) / 6.0,
            t2 * t / 6.0,
        ],
        [0.5 * s2, 0.5 + t * s, 0.5 * t2],
    )
}

impl Interpolate for BSpline {
    fn sample(&self, at: [f64; 3]) -> Sample {
        let [(i, x), (j, y), (k, z)] = [0, 1, 2].map(|c| cell(at[c], self.dims[c]));
        let [(wx, dx), (wy, dy), (wz, dz)] = [weights(x), weights(y), weights(z)];
        let [sy, sz] = self.stride;
        // Along x: value and derivative in each of the sixteen rows.
        let mut rows = [[(0.0, 0.0); 4]; 4];
        for (dk, rows) in rows.iter_mut().enumerate() {
            for (dj, row) in rows.iter_mut().enumerate() {
                let o = i + (j + dj) * sy + (k + dk) * sz;
                let c: [f64; 4] = [0, 1, 2, 3].map(|l| f64::from(self.coefficients[o + l]));
                row.0 = wx[0] * c[0] + wx[1] * c[1] + wx[2] * c[2] + wx[3] * c[3];
                row.1 = dx[0] * (c[1] - c[0]) + dx[1] * (c[2] - c[1]) + dx[2] * (c[3] - c[2]);
            }
        }
        // Then along y, then along z.
        let layers = rows.map(|r| {
            let value = wy[0] * r[0].0 + wy[1] * r[1].0 + wy[2] * r[2].0 + wy[3] * r[3].0;
            let gx = wy[0] * r[0].1 + wy[1] * r[1].1 + wy[2] * r[2].1 + wy[3] * r[3].1;
            let gy =
                dy[0] * (r[1].0 - r[0].0) + dy[1] * (r[2].0 - r[1].0) + dy[2] * (r[3].0 - r[2].0);
            [value, gx, gy]
        });
        let along = |q: usize| {
            wz[0] * layers[0][q]
                + wz[1] * layers[1][q]
                + wz[2] * layers[2][q]
                + wz[3] * layers[3][q]
        };
        let gz = dz[0] * (layers[1][0] - layers[0][0])
            + dz[1] * (layers[2][0] - layers[1][0])
            + dz[2] * (layers[3][0] - layers[2][0]);
        Sample { eps: along(0), gradient: [along(1), along(2), gz] }
    }

    fn dims(&self) -> [usize; 3] {
        self.dims
    }

    fn memory_bytes(&self) -> usize {
        size_of_val(&self.coefficients[..])
    }
}

/// The coefficients as four slices of one length, shifted by rows, so that one bounds check serves
/// the four rows of a layer.
#[derive(Clone, Copy)]
pub(crate) struct BSplineRows<'a> {
    rows: [&'a [f32]; 4],
    last_cell: [f32; 3],
    last: [f32; 3],
    stride: [usize; 2],
}

/// [`weights`] for sixteen rays.
#[inline(always)]
pub(crate) fn weights16<S: Simd>(simd: S, t: f32x16<S>) -> ([f32x16<S>; 4], [f32x16<S>; 3]) {
    let (one, half) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, 0.5));
    let (sixth, two_thirds) = (f32x16::splat(simd, 1.0 / 6.0), f32x16::splat(simd, 2.0 / 3.0));
    let s = one - t;
    let (t2, s2) = (t * t, s * s);
    let w = [
        s2 * s * sixth,
        t.mul_sub(half, one).mul_add(t2, two_thirds),
        s.mul_sub(half, one).mul_add(s2, two_thirds),
        t2 * t * sixth,
    ];
    (w, [s2 * half, t.mul_add(s, half), t2 * half])
}

/// The 4x4 taps of a layer, two rows per vector.
#[inline(always)]
fn layer<S: Simd>(simd: S, rows: &[&[f32]; 4], at: usize) -> [f32x8<S>; 2] {
    let r0 = f32x4::from_slice(simd, &rows[0][at..at + 4]);
    let r1 = f32x4::from_slice(simd, &rows[1][at..at + 4]);
    let r2 = f32x4::from_slice(simd, &rows[2][at..at + 4]);
    let r3 = f32x4::from_slice(simd, &rows[3][at..at + 4]);
    [r0.combine(r1), r2.combine(r3)]
}

impl Interpolate16 for BSplineRows<'_> {
    const COMPENSATE_SUMS: bool = true;

    #[inline(always)]
    fn sample16<S: Simd>(&self, simd: S, at: &[f32x16<S>; 3]) -> Samples<S> {
        let (cells, fraction) = cells16(simd, at, self.last, self.last_cell);
        let offsets =
            cells[0] + cells[1] * (self.stride[0] as i32) + cells[2] * (self.stride[1] as i32);
        let offsets: [i32; LANES] = offsets.into();
        let (wx, dx) = weights16(simd, fraction[0]);
        let (wy, dy) = weights16(simd, fraction[1]);
        let (wz, dz) = weights16(simd, fraction[2]);
        // Along y and z, each ray's weights are scalars that multiply its four taps along x.
        let wy: [Row; 4] = [wy[0].into(), wy[1].into(), wy[2].into(), wy[3].into()];
        let wz: [Row; 4] = [wz[0].into(), wz[1].into(), wz[2].into(), wz[3].into()];
        let dy: [Row; 3] = [dy[0].into(), dy[1].into(), dy[2].into()];
        let dz: [Row; 3] = [dz[0].into(), dz[1].into(), dz[2].into()];

        // Along z and y, one ray at a time. Four numbers along x remain for each of value, y slope
        // and z slope.
        let mut value = [0.0f32; 4 * LANES];
        let mut along_y = [0.0f32; 4 * LANES];
        let mut along_z = [0.0f32; 4 * LANES];
        // The compiler sees here that the slices have one length, so one bounds check is enough for
        // a layer's four rows.
        let len = self.rows[0].len();
        let rows = [self.rows[0], &self.rows[1][..len], &self.rows[2][..len], &self.rows[3][..len]];
        for l in 0..LANES {
            let o = offsets[l] as u32 as usize;
            let c0 = layer(simd, &rows, o);
            let c1 = layer(simd, &rows, o + self.stride[1]);
            let c2 = layer(simd, &rows, o + 2 * self.stride[1]);
            let c3 = layer(simd, &rows, o + 3 * self.stride[1]);
            let (w0, w1) = (f32x8::splat(simd, wz[0][l]), f32x8::splat(simd, wz[1][l]));
            let (w2, w3) = (f32x8::splat(simd, wz[2][l]), f32x8::splat(simd, wz[3][l]));
            let [d0, d1, d2] = [
                f32x8::splat(simd, dz[0][l]),
                f32x8::splat(simd, dz[1][l]),
                f32x8::splat(simd, dz[2][l]),
            ];
            let mut a = [c0[0]; 2];
            let mut az = [c0[0]; 2];
            for h in 0..2 {
                a[h] = w3.mul_add(c3[h], w2.mul_add(c2[h], w1.mul_add(c1[h], w0 * c0[h])));
                az[h] = d2.mul_add(c3[h] - c2[h], d1.mul_add(c2[h] - c1[h], d0 * (c1[h] - c0[h])));
            }
            let ((a0, a1), (a2, a3)) = (a[0].split(), a[1].split());
            let ((z0, z1), (z2, z3)) = (az[0].split(), az[1].split());
            let (w0, w1) = (f32x4::splat(simd, wy[0][l]), f32x4::splat(simd, wy[1][l]));
            let (w2, w3) = (f32x4::splat(simd, wy[2][l]), f32x4::splat(simd, wy[3][l]));
            let [d0, d1, d2] = [
                f32x4::splat(simd, dy[0][l]),
                f32x4::splat(simd, dy[1][l]),
                f32x4::splat(simd, dy[2][l]),
            ];
            let v = w3.mul_add(a3, w2.mul_add(a2, w1.mul_add(a1, w0 * a0)));
            let gy = d2.mul_add(a3 - a2, d1.mul_add(a2 - a1, d0 * (a1 - a0)));
            let gz = w3.mul_add(z3, w2.mul_add(z2, w1.mul_add(z1, w0 * z0)));
            v.store_slice(&mut value[4 * l..4 * l + 4]);
            gy.store_slice(&mut along_y[4 * l..4 * l + 4]);
            gz.store_slice(&mut along_z[4 * l..4 * l + 4]);
        }

        // Along x, all rays at once.
        let [v0, v1, v2, v3] = transpose(simd, &value);
        let [y0, y1, y2, y3] = transpose(simd, &along_y);
        let [z0, z1, z2, z3] = transpose(simd, &along_z);
        Samples {
            eps: wx[3].mul_add(v3, wx[2].mul_add(v2, wx[1].mul_add(v1, wx[0] * v0))),
            gradient: [
                dx[2].mul_add(v3 - v2, dx[1].mul_add(v2 - v1, dx[0] * (v1 - v0))),
                wx[3].mul_add(y3, wx[2].mul_add(y2, wx[1].mul_add(y1, wx[0] * y0))),
                wx[3].mul_add(z3, wx[2].mul_add(z2, wx[1].mul_add(z1, wx[0] * z0))),
            ],
        }
    }
}
