//! Where a picture is seen from, and what lights it.

use super::Totals;
use crate::settings::Picture;
use rt_core::camera::{Camera, CameraError};
use rt_core::glam::DVec3;
use rt_core::light::Light;
use rt_core::scene::AmbientOcclusion;

/// The narrower angle of a picture that shows everything.
const ANGLE_RAD: f64 = std::f64::consts::FRAC_PI_6;

/// Rays of ambient occlusion for each pixel, over all its samples.
const OCCLUSION_RAYS: u32 = 16;

/// A view of everything.
pub(super) struct View {
    middle: DVec3,
    radius: f64,
    eye: DVec3,
    up: DVec3,
    fov_y_rad: f64,
    aspect: f64,
}

impl View {
    pub(super) fn of(totals: &Totals, wanted: &Picture) -> View {
        let middle = match (wanted.middle, totals.is_nothing()) {
            (Some(middle), _) => DVec3::from(middle),
            (None, true) => DVec3::ZERO,
            (None, false) => 0.5 * (totals.low + totals.high),
        };
        let radius = wanted.radius.unwrap_or_else(|| View::radius(totals));
        let aspect = f64::from(wanted.size[0]) / f64::from(wanted.size[1].max(1));
        // The ball around everything fits the narrower side.
        let half = (0.5 * ANGLE_RAD).tan() / wanted.zoom;
        let half_y = if aspect < 1.0 { half / aspect } else { half };
        let from = DVec3::from(wanted.from).normalize_or(DVec3::Z);
        View {
            middle,
            radius,
            eye: middle + from * (radius / (0.5 * ANGLE_RAD).sin()),
            up: DVec3::from(wanted.up).normalize_or(DVec3::Y),
            fov_y_rad: 2.0 * half_y.atan(),
            aspect,
        }
    }

    pub(super) fn camera(&self) -> Result<Camera, CameraError> {
        let reach = (self.eye - self.middle).length() + 2.0 * self.radius;
        let limits = [1e-3 * reach, reach];
        Camera::perspective(self.eye, self.middle, self.up, self.fov_y_rad, self.aspect, limits)
    }

    /// A lamp above the eye's left shoulder and light from all sides; or a lamp at the eye.
    pub(super) fn lights(&self, wanted: &Picture) -> (Vec<Light>, Option<AmbientOcclusion>) {
        if !wanted.shadows {
            return (vec![Light::headlight()], None);
        }
        let forward = (self.middle - self.eye).normalize_or(DVec3::NEG_Z);
        let right = forward.cross(self.up).normalize_or(DVec3::X);
        let above = right.cross(forward);
        let lamp = self.middle + (above * 1.5 - right * 0.8 - forward * 1.2) * 2.0 * self.radius;
        let lights = vec![Light::point(lamp).with_color([0.75; 3]), Light::ambient([0.35; 3])];
        let rays = OCCLUSION_RAYS.div_ceil(wanted.samples.max(1));
        (lights, Some(AmbientOcclusion { distance: 0.15 * self.radius, rays }))
    }

    /// Of the ball around everything; 1 for a single point, and for nothing.
    pub(super) fn radius(totals: &Totals) -> f64 {
        let radius = 0.5 * (totals.high - totals.low).length();
        if !totals.is_nothing() && radius > 0.0 { radius } else { 1.0 }
    }
}
