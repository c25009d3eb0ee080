//! The explicit Euler integrator: equations 5.7 and 5.8 of the dissertation.

use super::integrator::{Integrator, Medium, Ray};

/// Explicit Euler: advances position and rate with the values at the start of the step. First
/// order; it gains energy and diverges in a light guide.
#[derive(Debug, Clone, Copy, Default)]
pub struct Euler;

impl Integrator for Euler {
    const ORDER: u32 = 1;
    const SAMPLES: u32 = 1;

    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray {
        ray.after(dtau_m, &ray.rate(medium))
    }
}
