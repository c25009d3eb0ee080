//! Traces light through a strong index with any integrator in `f64`, including rays that turn and
//! total reflection.

use super::frame::{BlankCells, Frame};
use super::integrator::{Integrator, InterpolatedMedium, Ray};
use super::kernel_ray::steps_of;
use crate::field::{Field, Node};
use crate::interpolate::Interpolate;
use crate::path::{Exit, LightPaths, PathQuantities, Start, Status};
use crate::view::View;
use glam::DVec3;

/// Options of a march through strong index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullOptions {
    /// Length of a step, in lattice steps of the undisturbed ray.
    pub step_voxels: f64,
    /// Quantities to compute besides deflection and displacement.
    pub quantities: PathQuantities,
    /// How light is treated in cells without data.
    pub blank: BlankCells,
    /// Limit on a ray's steps, as a multiple of those of the undisturbed ray. A ray that is still
    /// inside then is given up as [`Status::Turned`].
    pub step_limit_factor: u32,
}

impl Default for FullOptions {
    fn default() -> Self {
        FullOptions {
            step_voxels: 0.5,
            quantities: PathQuantities::default(),
            blank: BlankCells::Opaque,
            step_limit_factor: 8,
        }
    }
}

/// Light paths in `f64`, one ray at a time.
///
/// Rays are marched until they pass the plane through the undisturbed ray's exit or leave the field
/// elsewhere, and then continue straight to that plane. Rays that never reach it, because they left
/// backwards or stay inside, are [`Status::Turned`].
pub struct Full<'a, I: Interpolate, G: Integrator> {
    field: &'a Field,
    interpolate: &'a I,
    integrator: G,
    frame: Frame,
    options: FullOptions,
}

impl<'a, I: Interpolate, G: Integrator> Full<'a, I, G> {
    /// Marches through `field` with an interpolant of it.
    pub fn new(
        field: &'a Field,
        interpolate: &'a I,
        integrator: G,
        view: View,
        options: FullOptions,
    ) -> Self {
        Full { field, interpolate, integrator, frame: Frame::new(field, view), options }
    }

    fn trace_one(&self, start: &Start, known: &mut Option<([f32; 2], [DVec3; 3])>) -> Exit {
        let ray = self.frame.undisturbed(start, known);
        let [near_m, far_m] = ray.range_m;
        if near_m >= far_m {
            return Exit {
                opd_m: if self.options.quantities.opd { 0.0 } else { f32::NAN },
                ..Exit::UNDISTURBED
            };
        }
        let medium = InterpolatedMedium::new(self.field, self.interpolate);
        let [right, up, direction] = ray.beam;
        let lattice = |r: &Ray| (r.position_m() - self.field.origin_m()) / self.frame.spacing_m;
        let at_m = self.field.origin_m() + ray.at * self.frame.spacing_m;
        let begin = Ray::inside(&medium, at_m + direction * near_m, direction);
        let length_m = far_m - near_m;
        let speed = self.frame.lattice_speed_per_m(direction);
        let steps = steps_of(length_m * speed / self.options.step_voxels).max(1);
        let dtau_m = length_m / f64::from(steps);

        // A ray is outside beyond the exit plane, or a voxel beyond a face: rays along a face thus
        // stay inside.
        let mut worst_node = 0;
        let margin = 1.0;
        let smallest_m = self.frame.spacing_m.min_element();
        let outside = |r: &Ray| {
            let p = lattice(r);
            let beyond = (-p).max(p - self.frame.last).max_element() - margin;
            (r.depth_m() - length_m).max(beyond * smallest_m)
        };
        let step_limit = self.options.step_limit_factor.saturating_mul(steps).max(1);
        let end = match self.field.nodes() {
            None => self.integrator.run_until(&medium, &begin, dtau_m, step_limit, outside),
            Some(kinds) => {
                // Checks the nearest node after each step.
                let d = self.field.dims();
                let stops = |kind: u8| {
                    kind == Node::Solid as u8
                        || (kind != 0 && self.options.blank == BlankCells::Opaque)
                };
                let look = |r: &Ray| {
                    let p = lattice(r).clamp(DVec3::ZERO, self.frame.last).round().as_usizevec3();
                    kinds[p.x + (p.y + p.z * d[1]) * d[0]] as u8
                };
                let worst_seen = std::cell::Cell::new(look(&begin));
                let end = self.integrator.run_until(&medium, &begin, dtau_m, step_limit, |r| {
                    let out = outside(r);
                    if out < 0.0 {
                        worst_seen.set(worst_seen.get().max(look(r)));
                    }
                    if stops(worst_seen.get()) { f64::NAN } else { out }
                });
                worst_node = worst_seen.get();
                end
            }
        };
        let (mut transmission, mut status) = self.options.blank.outcome(worst_node);
        let Some(mut r) = end.filter(|r| r.position_m().is_finite()) else {
            return Exit {
                exit_depth_m: far_m as f32,
                opd_m: f32::NAN,
                transmission: 0.0,
                status: if status == Status::Free { Status::Turned } else { status },
                ..Exit::UNDISTURBED
            };
        };

        // Continues straight to the exit plane, with |w| = 1 of the reference medium.
        let mut depth_m = length_m;
        let w_z = 1.0 + r.u.dot(direction);
        if transmission > 0.0 && r.depth_m() < length_m - 1e-9 * dtau_m {
            if w_z > 0.0 {
                r.drift((length_m - r.depth_m()) / w_z);
            } else {
                (transmission, status, depth_m) = (0.0, Status::Turned, r.depth_m());
            }
        }
        Exit {
            deflection_rad: [r.u.dot(right) as f32, r.u.dot(up) as f32],
            displacement_m: [r.xi_m.dot(right) as f32, r.xi_m.dot(up) as f32],
            exit_depth_m: (near_m + depth_m) as f32,
            opd_m: if self.options.quantities.opd {
                (self.field.n0() * r.path_difference_m()) as f32
            } else {
                f32::NAN
            },
            transmission,
            status,
        }
    }
}

impl<I: Interpolate, G: Integrator> LightPaths for Full<'_, I, G> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        let mut known = None;
        for (s, e) in starts.iter().zip(exits) {
            *e = self.trace_one(s, &mut known);
        }
    }

    fn view(&self) -> &View {
        &self.frame.view
    }

    fn quantities(&self) -> PathQuantities {
        self.options.quantities
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * self.frame.spacing_m.min_element()
    }
}
