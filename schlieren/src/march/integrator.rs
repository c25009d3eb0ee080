//! Integrates one ray in `f64` with any [`Integrator`] through any [`Medium`]: the reference for
//! the kernels.
//!
//! As in the kernels, a ray is stored as its deviation: position = start + direction tau + xi, rate
//! = direction + u. Both deviations are zero at the start.

use crate::field::Field;
use crate::interpolate::Interpolate;
use glam::DVec3;

/// A medium with an index of refraction at every point.
pub trait Medium: Sync {
    /// eps = n/n0 - 1, and its gradient per metre.
    fn sample(&self, at_m: DVec3) -> (f64, DVec3);
}

/// An interpolated field as a medium. Outside the field it continues the values of the nearest
/// point on its surface.
pub struct InterpolatedMedium<'a, I: Interpolate + ?Sized> {
    interpolate: &'a I,
    origin_m: DVec3,
    spacing_m: DVec3,
}

impl<'a, I: Interpolate + ?Sized> InterpolatedMedium<'a, I> {
    /// The medium of `field` with an interpolant of it.
    pub fn new(field: &Field, interpolate: &'a I) -> Self {
        InterpolatedMedium {
            interpolate,
            origin_m: field.origin_m(),
            spacing_m: DVec3::from(field.spacing_m()),
        }
    }
}

impl<I: Interpolate + ?Sized> Medium for InterpolatedMedium<'_, I> {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        let s = self.interpolate.sample(((at_m - self.origin_m) / self.spacing_m).to_array());
        (s.eps, DVec3::from(s.gradient) / self.spacing_m)
    }
}

/// The state of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Position at tau = 0.
    pub start_m: DVec3,
    /// Direction of the undisturbed ray, of length one.
    pub direction: DVec3,
    /// Path parameter: dx/dtau = w with the length of w being 1 + eps.
    pub tau_m: f64,
    /// Position minus `start_m + direction * tau_m`.
    pub xi_m: DVec3,
    /// w minus `direction`.
    pub u: DVec3,
    /// Integral of (1+eps)^2 - 1 over tau: the optical path (divided by n0) minus tau.
    pub excess_m: f64,
}

impl Ray {
    /// An undisturbed ray. `direction` has length one.
    pub fn new(start_m: DVec3, direction: DVec3) -> Ray {
        Ray { start_m, direction, tau_m: 0.0, xi_m: DVec3::ZERO, u: DVec3::ZERO, excess_m: 0.0 }
    }

    /// A ray that starts inside a medium: the length of w there is 1 + eps, not 1.
    pub fn inside(medium: &impl Medium, start_m: DVec3, direction: DVec3) -> Ray {
        Ray { u: direction * medium.sample(start_m).0, ..Ray::new(start_m, direction) }
    }

    /// The ray's position.
    pub fn position_m(&self) -> DVec3 {
        self.start_m + self.direction * self.tau_m + self.xi_m
    }

    /// dx/dtau: the direction times 1 + eps.
    pub fn w(&self) -> DVec3 {
        self.direction + self.u
    }

    /// Distance along the undisturbed ray.
    pub fn depth_m(&self) -> f64 {
        self.tau_m + self.xi_m.dot(self.direction)
    }

    /// Optical path minus that of the undisturbed ray to the same depth, divided by n0.
    pub fn path_difference_m(&self) -> f64 {
        self.excess_m - self.xi_m.dot(self.direction)
    }

    /// Moves the ray with constant w.
    pub(crate) fn drift(&mut self, dtau_m: f64) {
        self.xi_m += self.u * dtau_m;
        self.tau_m += dtau_m;
    }

    /// Adds to w and to the path what the medium at this point contributes over `dtau_m`.
    pub(crate) fn kick(&mut self, medium: &impl Medium, dtau_m: f64) {
        let (eps, gradient) = medium.sample(self.position_m());
        self.u += gradient * ((1.0 + eps) * dtau_m);
        self.excess_m += eps * (2.0 + eps) * dtau_m;
    }

    /// Rate of change of (xi, u, excess).
    pub(crate) fn rate(&self, medium: &impl Medium) -> Rate {
        let (eps, gradient) = medium.sample(self.position_m());
        Rate { xi: self.u, u: gradient * (1.0 + eps), excess: eps * (2.0 + eps) }
    }

    /// The ray after `dtau_m` at the given rate.
    pub(crate) fn after(&self, dtau_m: f64, rate: &Rate) -> Ray {
        Ray {
            tau_m: self.tau_m + dtau_m,
            xi_m: self.xi_m + rate.xi * dtau_m,
            u: self.u + rate.u * dtau_m,
            excess_m: self.excess_m + rate.excess * dtau_m,
            ..*self
        }
    }
}

/// Rate of change of a ray's state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rate {
    pub(crate) xi: DVec3,
    pub(crate) u: DVec3,
    pub(crate) excess: f64,
}

impl Rate {
    /// The weighted sum of rates.
    pub(crate) fn sum(terms: &[(f64, &Rate)]) -> Rate {
        let mut out = Rate { xi: DVec3::ZERO, u: DVec3::ZERO, excess: 0.0 };
        for (weight, r) in terms {
            out.xi += r.xi * *weight;
            out.u += r.u * *weight;
            out.excess += r.excess * weight;
        }
        out
    }
}

/// A method that advances a ray by steps.
pub trait Integrator: Sync {
    /// Order of convergence.
    const ORDER: u32;
    /// Samples of the medium per step.
    const SAMPLES: u32;

    /// The ray after `dtau_m`.
    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray;

    /// The ray after `steps` steps over `tau_m` in all.
    fn run(&self, medium: &impl Medium, ray: &Ray, tau_m: f64, steps: u32) -> Ray {
        let dtau_m = tau_m / f64::from(steps);
        (0..steps).fold(*ray, |r, _| self.step(medium, &r, dtau_m))
    }

    /// Takes steps of `dtau_m` until `outside` of the ray is no longer negative, and returns the
    /// ray where it becomes zero: the last step is shortened to end there. Returns `None` when this
    /// does not happen within `limit` steps.
    fn run_until(
        &self,
        medium: &impl Medium,
        ray: &Ray,
        dtau_m: f64,
        limit: u32,
        outside: impl Fn(&Ray) -> f64,
    ) -> Option<Ray> {
        let mut before = *ray;
        let mut out_before = outside(&before);
        for _ in 0..limit {
            let after = self.step(medium, &before, dtau_m);
            let out_after = outside(&after);
            // Not `>= 0`: NaN also ends the march, and the caller handles it.
            if out_after < 0.0 {
                (before, out_before) = (after, out_after);
                continue;
            }
            // Regula falsi, Illinois variant.
            let (mut lo, mut hi) = ((0.0, out_before.min(0.0)), (dtau_m, out_after));
            let mut end = after;
            for _ in 0..60 {
                let t = (lo.0 * hi.1 - hi.0 * lo.1) / (hi.1 - lo.1);
                if !(t > lo.0 && t < hi.0) {
                    break;
                }
                end = self.step(medium, &before, t);
                let out = outside(&end);
                if out.abs() <= f64::EPSILON * dtau_m {
                    break;
                }
                if out < 0.0 {
                    lo = (t, out);
                    hi.1 *= 0.5;
                } else {
                    hi = (t, out);
                    lo.1 *= 0.5;
                }
            }
            return Some(end);
        }
        None
    }
}
