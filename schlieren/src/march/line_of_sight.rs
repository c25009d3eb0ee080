//! Traces light along straight rays: the field is projected along the light once, and every photon
//! samples its deflection and path from a two-dimensional spline.
//!
//! The result is linear in eps. It is valid as long as a ray's displacement is small against the
//! field's finest structure: the relative error is of the order of eps times (size of the field /
//! size of the structure). Light is deflected in the plane through the view's centre, and the tilt
//! of an extended source's beams causes no shift.

mod spline_derivatives;

use super::frame::{BlankCells, Frame, clip};
use crate::at_level;
use crate::field::{Field, Node};
use crate::interpolate::{
    BSpline, Interpolant, Interpolate, Interpolate16, LANES, Row, Trilinear, bspline_weights16,
    cell, prefilter_line, transpose,
};
use crate::path::{Exit, Jacobian, LightPaths, PathQuantities, Start};
use crate::view::View;
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, f32x4, f32x16, i32x16};
use glam::DVec3;
use rayon::prelude::*;
use spline_derivatives::{derivatives, second_derivatives};

/// Light paths by line of sight.
pub struct LineOfSight {
    frame: Frame,
    map: Map,
    quantities: PathQuantities,
    blank: BlankCells,
    n0: f64,
    level: Level,
    /// Distance from the centre plane to the exit, when it is the same for all rays.
    exit_depth_m: Option<f64>,
}

/// The projection: the integral of eps along the light.
struct Map {
    /// Spline coefficients in metres, of nodes -1 ..= n along both axes.
    coefficients: Vec<f32>,
    /// Nodes along right and up.
    dims: [usize; 2],
    row: usize,
    /// Map coordinate of the view's centre, and map steps per metre (negative where the lattice
    /// runs the other way).
    centre: [f64; 2],
    per_m: [f64; 2],
    /// Coefficients of the deflection along right and up, for oblique views. There the chord
    /// through the field's box changes from ray to ray, so the slope of `coefficients` would
    /// include the deflection of a prism of the box's shape.
    slopes: Option<[Vec<f32>; 2]>,
    /// The worst [`Node`] along the ray, by nearest map node.
    kinds: Option<Vec<u8>>,
}

impl LineOfSight {
    /// Projects a field along a view, in parallel. Along an axis of the field the projection is the
    /// exact integral of the cubic B-spline through the nodes, and takes milliseconds. Other
    /// directions are integrated with the given interpolant, one step per voxel.
    pub fn new(
        field: &Field,
        view: View,
        interpolant: Interpolant,
        quantities: PathQuantities,
        blank: BlankCells,
    ) -> LineOfSight {
        Self::with_level(field, view, interpolant, quantities, blank, Level::new())
    }

    /// [`LineOfSight::new`] limited to an instruction set, for tests and measurements.
    pub fn with_level(
        field: &Field,
        view: View,
        interpolant: Interpolant,
        quantities: PathQuantities,
        blank: BlankCells,
        level: Level,
    ) -> LineOfSight {
        let frame = Frame::new(field, view);
        let axes = [view.right, view.up, view.forward].map(lattice_axis);
        let (map, exit_depth_m) = if let [Some(right), Some(up), Some(forward)] = axes {
            let centre = (view.centre_m - field.origin_m()) / frame.spacing_m;
            let far = if forward.1 > 0.0 {
                frame.last[forward.0] - centre[forward.0]
            } else {
                centre[forward.0]
            };
            (
                project_along_axis(field, centre, right, up, forward.0),
                Some(far * frame.spacing_m[forward.0]),
            )
        } else {
            let map = match interpolant {
                Interpolant::BSpline => {
                    let s = BSpline::new(field);
                    project_obliquely(field, &frame, s.rows(), level)
                }
                // Line of sight is linear in eps, so gradients at the nodes would add nothing.
                Interpolant::Trilinear | Interpolant::TrilinearGradient => {
                    let s = Trilinear::new(field);
                    debug_assert_eq!(s.dims(), field.dims());
                    project_obliquely(field, &frame, s.rows(), level)
                }
            };
            (map, None)
        };
        LineOfSight { frame, map, quantities, blank, n0: field.n0(), level, exit_depth_m }
    }

    /// Memory in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.map.coefficients[..]) * if self.map.slopes.is_some() { 3 } else { 1 }
            + self.map.kinds.as_ref().map_or(0, Vec::len)
    }

    /// Distance at which a photon leaves the field; `None` when it misses the field.
    #[inline(always)]
    fn exit_depth_m(&self, start: &Start, map: [f32; 2]) -> Option<f64> {
        if let Some(depth_m) = self.exit_depth_m {
            let inside = map[0] >= 0.0
                && map[1] >= 0.0
                && map[0] <= (self.map.dims[0] - 1) as f32
                && map[1] <= (self.map.dims[1] - 1) as f32;
            return inside.then_some(depth_m);
        }
        let straight = Start { tilt_rad: [0.0; 2], ..*start };
        let ray = self.frame.undisturbed(
            &straight,
            &mut Some((
                [0.0; 2],
                [self.frame.view.right, self.frame.view.up, self.frame.view.forward],
            )),
        );
        (ray.range_m[1] > ray.range_m[0]).then_some(ray.range_m[1])
    }

    fn exit(&self, start: &Start, map: [f32; 2], path_m: f32, slope: [f32; 2]) -> Exit {
        let Some(depth_m) = self.exit_depth_m(start, map) else {
            return Exit {
                opd_m: if self.quantities.opd { 0.0 } else { f32::NAN },
                ..Exit::UNDISTURBED
            };
        };
        let worst_node = self.map.kinds.as_ref().map_or(0, |k| {
            let near = |c: usize| (map[c] + 0.5).clamp(0.0, (self.map.dims[c] - 1) as f32) as usize;
            k[near(0) + near(1) * self.map.dims[0]]
        });
        let (transmission, status) = self.blank.outcome(worst_node);
        Exit {
            deflection_rad: slope,
            displacement_m: slope.map(|u| u * depth_m as f32),
            exit_depth_m: depth_m as f32,
            opd_m: if self.quantities.opd { path_m * self.n0 as f32 } else { f32::NAN },
            transmission,
            status,
        }
    }

    #[inline(never)]
    fn packets<S: Simd>(&self, simd: S, starts: &[Start], exits: &mut [Exit]) {
        simd.vectorize(
            #[inline(always)]
            || {
                let m = &self.map;
                let rows = four_rows(&m.coefficients, m.row);
                let slope_rows =
                    m.slopes.as_ref().map(|s| [four_rows(&s[0], m.row), four_rows(&s[1], m.row)]);
                for (starts, exits) in starts.chunks(LANES).zip(exits.chunks_mut(LANES)) {
                    let mut at = [[0.0f32; LANES]; 2];
                    for (l, s) in starts.iter().enumerate() {
                        for c in 0..2 {
                            at[c][l] =
                                (m.centre[c] + f64::from(s.position_m[c]) * m.per_m[c]) as f32;
                        }
                    }
                    let [path, mut along_s, mut along_t] = spline2(simd, rows, m.dims, m.row, &at);
                    for l in 0..LANES {
                        along_s[l] *= m.per_m[0] as f32;
                        along_t[l] *= m.per_m[1] as f32;
                    }
                    if let Some([s, t]) = slope_rows {
                        [along_s, ..] = spline2(simd, s, m.dims, m.row, &at);
                        [along_t, ..] = spline2(simd, t, m.dims, m.row, &at);
                    }
                    for (l, (s, e)) in starts.iter().zip(exits).enumerate() {
                        let slope = [along_s[l], along_t[l]];
                        *e = self.exit(s, [at[0][l], at[1][l]], path[l], slope);
                    }
                }
            },
        );
    }
}

/// A map as four slices of one length, shifted by rows.
fn four_rows(coefficients: &[f32], row: usize) -> [&[f32]; 4] {
    let len = coefficients.len() - 3 * row;
    [0, 1, 2, 3].map(|j| &coefficients[j * row..j * row + len])
}

/// Value and derivatives of a two-dimensional spline at sixteen points.
#[inline(always)]
fn spline2<S: Simd>(
    simd: S,
    rows: [&[f32]; 4],
    dims: [usize; 2],
    row: usize,
    at: &[Row; 2],
) -> [Row; 3] {
    let mut cells = [i32x16::splat(simd, 0); 2];
    let mut fraction = [f32x16::splat(simd, 0.0); 2];
    for c in 0..2 {
        let last = f32x16::splat(simd, (dims[c] - 1) as f32);
        // NaN becomes 0 here, because comparisons with it are false.
        let a = f32x16::from_slice(simd, &at[c]);
        let inside = a.simd_ge(0.0).select(a, f32x16::splat(simd, 0.0)).min(last);
        cells[c] = inside.min(f32x16::splat(simd, (dims[c] - 2) as f32)).to_int::<i32x16<S>>();
        fraction[c] = inside - cells[c].to_float::<f32x16<S>>();
    }
    let offsets: [i32; LANES] = (cells[0] + cells[1] * (row as i32)).into();
    let (ws, ds) = bspline_weights16(simd, fraction[0]);
    let (wt, dt) = bspline_weights16(simd, fraction[1]);
    let wt: [Row; 4] = [wt[0].into(), wt[1].into(), wt[2].into(), wt[3].into()];
    let dt: [Row; 3] = [dt[0].into(), dt[1].into(), dt[2].into()];
    let mut value = [0.0f32; 4 * LANES];
    let mut along_t = [0.0f32; 4 * LANES];
    for l in 0..LANES {
        let o = offsets[l] as u32 as usize;
        let mut taps = [f32x4::splat(simd, 0.0); 4];
        for j in 0..4 {
            taps[j] = f32x4::from_slice(simd, &rows[j][o..o + 4]);
        }
        let mut v = taps[0] * wt[0][l];
        let mut d = (taps[1] - taps[0]) * dt[0][l];
        for j in 1..4 {
            v = taps[j].mul_add(f32x4::splat(simd, wt[j][l]), v);
        }
        for j in 1..3 {
            d = (taps[j + 1] - taps[j]).mul_add(f32x4::splat(simd, dt[j][l]), d);
        }
        v.store_slice(&mut value[4 * l..4 * l + 4]);
        d.store_slice(&mut along_t[4 * l..4 * l + 4]);
    }
    let [v0, v1, v2, v3] = transpose(simd, &value);
    let [t0, t1, t2, t3] = transpose(simd, &along_t);
    [
        ws[3].mul_add(v3, ws[2].mul_add(v2, ws[1].mul_add(v1, ws[0] * v0))).into(),
        ds[2].mul_add(v3 - v2, ds[1].mul_add(v2 - v1, ds[0] * (v1 - v0))).into(),
        ws[3].mul_add(t3, ws[2].mul_add(t2, ws[1].mul_add(t1, ws[0] * t0))).into(),
    ]
}

/// The lattice axis along which a direction points exactly, with its sign.
fn lattice_axis(d: DVec3) -> Option<(usize, f64)> {
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

fn project_along_axis(
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

fn project_obliquely<I: Interpolate16>(field: &Field, frame: &Frame, rows: I, level: Level) -> Map {
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

impl LightPaths for LineOfSight {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        at_level!(self.level, simd => self.packets(simd, starts, exits));
    }

    fn view(&self) -> &View {
        &self.frame.view
    }

    fn quantities(&self) -> PathQuantities {
        self.quantities
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * self.frame.spacing_m.min_element()
    }

    /// Computes the Jacobians from the spline's second derivatives.
    fn trace_with_jacobians(
        &self,
        starts: &[Start],
        exits: &mut [Exit],
        jacobians: &mut [Jacobian],
    ) {
        assert_eq!(starts.len(), jacobians.len(), "one Jacobian per start");
        self.trace(starts, exits);
        let m = &self.map;
        for ((s, e), j) in starts.iter().zip(exits.iter()).zip(jacobians) {
            *j = Jacobian::default();
            let at = [0, 1].map(|c| m.centre[c] + f64::from(s.position_m[c]) * m.per_m[c]);
            if self.exit_depth_m(s, at.map(|a| a as f32)).is_none() {
                continue;
            }
            let [(i, x), (k, y)] = [0, 1].map(|c| cell(at[c], m.dims[c]));
            let hessian = match &m.slopes {
                None => second_derivatives(&m.coefficients, m.row, [i, k], [x, y], m.per_m),
                Some(slopes) => {
                    [0, 1].map(|r| derivatives(&slopes[r], m.row, [i, k], [x, y], m.per_m))
                }
            };
            j.deflection_per_m = hessian.map(|r| r.map(|v| v as f32));
            j.displacement_per_m =
                hessian.map(|r| r.map(|v| (v * f64::from(e.exit_depth_m)) as f32));
        }
    }
}

/// The order of the kinds must be by how much they stop light, because the worst one is found by
/// `max`.
const _: () =
    assert!((Node::Gas as u8) < Node::Blank as u8 && (Node::Blank as u8) < Node::Solid as u8);
