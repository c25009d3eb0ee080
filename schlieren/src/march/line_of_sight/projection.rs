//! Projects a field along the light: the two-dimensional splines that line of sight samples.

use crate::at_level;
use crate::field::Field;
use crate::interpolate::{Interpolate16, LANES, Row, prefilter_line};
use crate::march::frame::{Frame, clip};
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, f32x16};
use glam::DVec3;
use rayon::prelude::*;

/// The projection: the integral of eps along the light.
pub(crate) struct Map {
    /// Spline coefficients in metres, of nodes -1 ..= n along both axes.
    pub(crate) coefficients: Vec<f32>,
    /// Nodes along right and up.
    pub(crate) dims: [usize; 2],
    pub(crate) row: usize,
    /// Map coordinate of the view's centre, and map steps per metre (negative where the lattice
    /// runs the other way).
    pub(crate) centre: [f64; 2],
    pub(crate) per_m: [f64; 2],
    /// Coefficients of the deflection along right and up, for oblique views. There the chord
    /// through the field's box changes from ray to ray, so the slope of `coefficients` would
    /// include the deflection of a prism of the box's shape.
    pub(crate) slopes: Option<[Vec<f32>; 2]>,
    /// The worst [`Node`] along the ray, by nearest map node.
    pub(crate) kinds: Option<Vec<u8>>,
}

/// The lattice axis along which a direction points exactly, with its sign.
pub(super) fn lattice_axis(d: DVec3) -> Option<(usize, f64)> {
    let a = d.to_array();
    let c = (0..3).find(|&c| a[c].abs() == 1.0)?;
    (0..3).all(|o| o == c || a[o] == 0.0).then_some((c, a[c]))
}

/// Weights of a line's values in the integral of the spline through them, in steps. They are 1
/// inside and other numbers near the ends.
fn integral_weights(n: usize) -> Vec<f64> {
    // Integrals of the coefficients' basis functions between the first and the last node.
    let basis = |i: usize| {
        let from_end = i.min(n + 1 - i);
        let one_sided = |d: usize| [1.0 / 24.0, 0.5, 23.0 / 24.0].get(d).copied().unwrap_or(1.0);
        // With fewer than five nodes a basis function is cut at both ends.
        let other = (n + 1) - from_end;
        one_sided(from_end) + one_sided(other) - 1.0
    };
    (0..n)
        .map(|v| {
            let mut line = vec![0.0; n + 2];
            line[v + 1] = 1.0;
            prefilter_line(&mut line);
            line.iter().enumerate().map(|(i, c)| c * basis(i)).sum()
        })
        .collect()
}

pub(super) fn project_along_axis(
    field: &Field,
    centre: DVec3,
    right: (usize, f64),
    up: (usize, f64),
    forward: usize,
) -> Map {
    let dims3 = field.dims();
    let stride = [1, dims3[0], dims3[0] * dims3[1]];
    let weights = integral_weights(dims3[forward]);
    let step_m = field.spacing_m()[forward];
    let (eps, nodes) = (field.eps(), field.nodes());

    // Rows of the projection run along the faster of its two axes.
    let (fast, slow) = (right.0.min(up.0), right.0.max(up.0));
    let (nf, ns) = (dims3[fast], dims3[slow]);
    let mut sums = vec![0.0f64; nf * ns];
    let mut kinds = nodes.map(|_| vec![0u8; nf * ns]);
    sums.par_chunks_exact_mut(nf).enumerate().for_each(|(s, out)| {
        if forward == 0 {
            for (f, v) in out.iter_mut().enumerate() {
                let line = &eps[f * stride[fast] + s * stride[slow]..][..dims3[0]];
                *v = line.iter().zip(&weights).map(|(e, w)| f64::from(*e) * w).sum();
            }
        } else {
            for (k, w) in weights.iter().enumerate() {
                let line = &eps[s * stride[slow] + k * stride[forward]..][..nf];
                for (v, e) in out.iter_mut().zip(line) {
                    *v += f64::from(*e) * w;
                }
            }
        }
    });
    if let (Some(kinds), Some(nodes)) = (&mut kinds, nodes) {
        kinds.par_chunks_exact_mut(nf).enumerate().for_each(|(s, out)| {
            for (f, worst) in out.iter_mut().enumerate() {
                let o = f * stride[fast] + s * stride[slow];
                *worst = (0..dims3[forward])
                    .map(|k| nodes[o + k * stride[forward]] as u8)
                    .max()
                    .unwrap_or(0);
            }
        });
    }
    if right.0 != fast {
        sums = transposed(&sums, nf);
        kinds = kinds.map(|k| transposed(&k, nf));
    }
    for v in &mut sums {
        *v *= step_m;
    }
    let dims = [dims3[right.0], dims3[up.0]];
    let (coefficients, row) = prefilter_map(&sums, dims);
    Map {
        coefficients,
        dims,
        row,
        centre: [centre[right.0], centre[up.0]],
        per_m: [right.1 / field.spacing_m()[right.0], up.1 / field.spacing_m()[up.0]],
        slopes: None,
        kinds,
    }
}

fn transposed<T: Copy>(a: &[T], row: usize) -> Vec<T> {
    let rows = a.len() / row;
    (0..a.len()).map(|i| a[i / rows + i % rows * row]).collect()
}

pub(super) fn project_obliquely<I: Interpolate16>(
    field: &Field,
    frame: &Frame,
    rows: I,
    level: Level,
) -> Map {
    let view = &frame.view;
    // The smallest rectangle in the image plane that holds the field, with the field's smallest
    // node spacing.
    let step_m = frame.spacing_m.min_element();
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in 0..8 {
        let c =
            DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
        let from_centre = field.origin_m() + c * field.size_m() - view.centre_m;
        for (a, axis) in [view.right, view.up].into_iter().enumerate() {
            lo[a] = lo[a].min(from_centre.dot(axis));
            hi[a] = hi[a].max(from_centre.dot(axis));
        }
    }
    let dims = [0, 1].map(|a| ((hi[a] - lo[a]) / step_m).ceil() as usize + 1);
    let mut sums = vec![[0.0f64; 3]; dims[0] * dims[1]];
    let mut kinds = field.nodes().map(|_| vec![0u8; dims[0] * dims[1]]);
    let no_kinds: &mut [u8] = &mut [];
    let kind_rows = kinds.as_deref_mut().unwrap_or(no_kinds);
    let line = |v: usize, out: &mut [[f64; 3]], kinds: &mut [u8]| {
        let start = [lo[0], lo[1] + v as f64 * step_m];
        at_level!(
            level,
            simd => integrate_row(simd, field, frame, rows, step_m, start, out, kinds)
        );
    };
    if kind_rows.is_empty() {
        sums.par_chunks_exact_mut(dims[0]).enumerate().for_each(|(v, out)| line(v, out, &mut []));
    } else {
        sums.par_chunks_exact_mut(dims[0])
            .zip(kind_rows.par_chunks_exact_mut(dims[0]))
            .enumerate()
            .for_each(|(v, (out, k))| line(v, out, k));
    }
    let component = |q: usize| -> Vec<f64> { sums.iter().map(|s| s[q]).collect() };
    let (coefficients, row) = prefilter_map(&component(0), dims);
    let slopes = [1, 2].map(|q| prefilter_map(&component(q), dims).0);
    Map {
        coefficients,
        dims,
        row,
        centre: [-lo[0] / step_m, -lo[1] / step_m],
        per_m: [1.0 / step_m; 2],
        slopes: Some(slopes),
        kinds,
    }
}

/// Integrals of eps (in metres) and of its gradient along right and up, along the rays through a
/// row of map nodes.
#[inline(never)]
fn integrate_row<S: Simd, I: Interpolate16>(
    simd: S,
    field: &Field,
    frame: &Frame,
    rows: I,
    step_m: f64,
    first_m: [f64; 2],
    out: &mut [[f64; 3]],
    kinds: &mut [u8],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            let origin = (frame.view.centre_m - field.origin_m()) / frame.spacing_m;
            let direction = frame.view.forward / frame.spacing_m;
            let speed = direction.length();
            let dims = field.dims();
            let (right, up) = (frame.view.right / frame.spacing_m, frame.view.up / frame.spacing_m);
            for (block, sums) in out.chunks_mut(LANES).enumerate() {
                let mut entry = [[0.0f32; LANES]; 3];
                let mut chord = [[0.0f32; LANES]; 3];
                let mut length_m = [0.0f64; LANES];
                let mut longest_m = 0.0f64;
                for l in 0..sums.len() {
                    let x = first_m[0] + (block * LANES + l) as f64 * step_m;
                    let at = origin
                        + (frame.view.right * x + frame.view.up * first_m[1]) / frame.spacing_m;
                    let [near, far] = clip(at, direction, frame.last);
                    length_m[l] = far - near;
                    longest_m = longest_m.max(far - near);
                    if far > near {
                        for c in 0..3 {
                            entry[c][l] = (at[c] + direction[c] * near) as f32;
                            chord[c][l] = (direction[c] * (far - near)) as f32;
                        }
                    }
                }
                if longest_m == 0.0 {
                    continue;
                }
                let steps = (longest_m * speed).ceil().max(1.0) as u32;
                let per_step = 1.0 / steps as f32;
                let mut total = [[0.0f64; LANES]; 4];
                let mut k = 0;
                while k < steps {
                    // Sums blocks of 16 steps in f32 and the blocks in f64, so that rounding does
                    // not grow with the path.
                    let mut some = [f32x16::splat(simd, 0.0); 4];
                    let end = (k + 16).min(steps);
                    while k < end {
                        let fraction = f32x16::splat(simd, (k as f32 + 0.5) * per_step);
                        let mut at = [fraction; 3];
                        for c in 0..3 {
                            at[c] = fraction.mul_add(
                                f32x16::from_slice(simd, &chord[c]),
                                f32x16::from_slice(simd, &entry[c]),
                            );
                        }
                        let here = rows.sample16(simd, &at);
                        some[0] += here.eps;
                        for c in 0..3 {
                            some[c + 1] += here.gradient[c];
                        }
                        if let (Some(nodes), false) = (field.nodes(), kinds.is_empty()) {
                            let p: [Row; 3] = [at[0].into(), at[1].into(), at[2].into()];
                            for l in 0..sums.len() {
                                let near = [0, 1, 2]
                                    .map(|c| ((p[c][l] + 0.5).max(0.0) as usize).min(dims[c] - 1));
                                let kind =
                                    nodes[near[0] + (near[1] + near[2] * dims[1]) * dims[0]] as u8;
                                if length_m[l] > 0.0 {
                                    let worst = &mut kinds[block * LANES + l];
                                    *worst = (*worst).max(kind);
                                }
                            }
                        }
                        k += 1;
                    }
                    for (total, some) in total.iter_mut().zip(some) {
                        let some: Row = some.into();
                        for l in 0..LANES {
                            total[l] += f64::from(some[l]);
                        }
                    }
                }
                for (l, s) in sums.iter_mut().enumerate() {
                    let step_m = length_m[l] / f64::from(steps);
                    let gradient = DVec3::new(total[1][l], total[2][l], total[3][l]) * step_m;
                    *s = [total[0][l] * step_m, gradient.dot(right), gradient.dot(up)];
                }
            }
        },
    );
}

/// Spline coefficients of a map, padded by one on each side, and the length of their rows.
fn prefilter_map(values: &[f64], [nu, nv]: [usize; 2]) -> (Vec<f32>, usize) {
    let row = nu + 2;
    let mut plane = vec![0.0; row * (nv + 2)];
    plane[row..row * (nv + 1)].par_chunks_exact_mut(row).zip(values.par_chunks_exact(nu)).for_each(
        |(to, from)| {
            to[1..=nu].copy_from_slice(from);
            prefilter_line(to);
        },
    );
    let columns: Vec<Vec<f64>> = (0..row)
        .into_par_iter()
        .map(|i| {
            let mut line: Vec<f64> = (0..nv + 2).map(|j| plane[i + j * row]).collect();
            prefilter_line(&mut line);
            line
        })
        .collect();
    let coefficients: Vec<f32> =
        (0..row * (nv + 2)).map(|o| columns[o % row][o / row] as f32).collect();
    (coefficients, row)
}
