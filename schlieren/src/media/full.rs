//! Integrates along one ray at a time in `f64`, bent as by [`crate::march::Full`].

use super::MediaIntegrals;
use super::integrator::{MediaIntegrator, Sums};
use crate::interpolate::BSpline;
use crate::march::{FullOptions, Integrator, InterpolatedMedium, Pefrl, Ray};
use crate::path::Start;
use glam::DVec3;

/// Integrates along one ray. Each step is the cubic Hermite curve through its ends. Properties are
/// sampled at its middle, and its length is the integral of |w| by Simpson's rule. Both are of
/// fourth order, as the march is.
pub(super) fn integrate(
    integrator: &MediaIntegrator<'_>,
    spline: &BSpline,
    start: &Start,
    end_m: f64,
    known: &mut Option<([f32; 2], [DVec3; 3])>,
) -> MediaIntegrals {
    let (field, frame) = (integrator.field, &integrator.frame);
    let ray = frame.undisturbed(start, known);
    let [near_m, far_m] = ray.range_m;
    let length_m = far_m.min(end_m) - near_m;
    // Written so that NaN also returns here.
    if !(far_m > near_m && length_m > 0.0) {
        return MediaIntegrals::default();
    }
    let medium = InterpolatedMedium::new(field, spline);
    let direction = ray.beam[2];
    let lattice = |at_m: DVec3| (at_m - field.origin_m()) / frame.spacing_m;
    let at_m = field.origin_m() + ray.at * frame.spacing_m;
    let mut before = Ray::inside(&medium, at_m + direction * near_m, direction);
    // The march's steps, independent of where the integration ends.
    let speed = frame.lattice_speed_per_m(direction);
    let steps = ((far_m - near_m) * speed / integrator.step_voxels).ceil().max(1.0);
    let dtau_m = (far_m - near_m) / steps;

    // As in the march: outside beyond the end plane, or a voxel beyond a face.
    let smallest_m = frame.spacing_m.min_element();
    let outside = |r: &Ray| {
        let p = lattice(r.position_m());
        let beyond = (-p).max(p - frame.last).max_element() - 1.0;
        (r.depth_m() - length_m).max(beyond * smallest_m)
    };
    let stops = |at_m: DVec3| {
        field.nodes().is_some_and(|kinds| {
            let d = field.dims();
            let p = lattice(at_m).clamp(DVec3::ZERO, frame.last).round().as_usizevec3();
            integrator.stops(kinds[p.x + (p.y + p.z * d[1]) * d[0]] as u8)
        })
    };
    let mut sums = Sums::default();
    for _ in 0..FullOptions::default().step_limit_factor.saturating_mul(steps as u32).max(1) {
        let mut after = Pefrl.step(&medium, &before, dtau_m);
        let out = outside(&after);
        let last = out >= 0.0 || out.is_nan();
        if last {
            after = Pefrl.run_until(&medium, &before, dtau_m, 1, outside).unwrap_or(after);
        }
        let taken_m = after.tau_m - before.tau_m;
        let (a, b) = (before.position_m(), after.position_m());
        let middle_m = (a + b) * 0.5 + (before.w() - after.w()) * (taken_m / 8.0);
        if !middle_m.is_finite() || taken_m <= 0.0 || stops(middle_m) {
            break;
        }
        let middle_w = (b - a) * (1.5 / taken_m) - (before.w() + after.w()) * 0.25;
        let speed = (before.w().length() + 4.0 * middle_w.length() + after.w().length()) / 6.0;
        let values = integrator.wanted.map(|v| v.map_or(0.0, |v| v.sample(middle_m) as f32));
        sums.add(values, speed * taken_m);
        if last {
            break;
        }
        before = after;
    }
    sums.rounded()
}
