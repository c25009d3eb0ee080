//! Traces light along straight rays: the field is projected along the light once, and every photon
//! samples its deflection and path from a two-dimensional spline.
//!
//! The result is linear in eps. It is valid as long as a ray's displacement is small against the
//! field's finest structure: the relative error is of the order of eps times (size of the field /
//! size of the structure). Light is deflected in the plane through the view's centre, and the tilt
//! of an extended source's beams causes no shift.

mod projection;
mod spline_derivatives;

use super::frame::{BlankCells, Frame};
use crate::at_level;
use crate::field::{Field, Node};
use crate::interpolate::{
    BSpline, Interpolant, Interpolate, LANES, Row, Trilinear, bspline_weights16, cell, transpose,
};
use crate::path::{Exit, Jacobian, LightPaths, PathQuantities, Start};
use crate::view::View;
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, f32x4, f32x16, i32x16};
pub(crate) use projection::Map as ProjectedMap;
use projection::{lattice_axis, project_along_axis, project_obliquely};
use spline_derivatives::{derivatives, second_derivatives};

/// Light paths by line of sight.
pub struct LineOfSight {
    frame: Frame,
    map: ProjectedMap,
    quantities: PathQuantities,
    blank: BlankCells,
    n0: f64,
    level: Level,
    /// Distance from the centre plane to the exit, when it is the same for all rays.
    exit_depth_m: Option<f64>,
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

    /// What the rays sample, and the distance from the centre plane at which they leave the field
    /// where it is the same for all: in views along an axis of the field.
    #[cfg(feature = "gpu")]
    pub(crate) fn projection(&self) -> (&ProjectedMap, Option<f64>) {
        (&self.map, self.exit_depth_m)
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
