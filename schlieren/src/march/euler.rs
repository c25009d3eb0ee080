//! Explicit Euler: the dissertation's equations 5.7 and 5.8.

use super::integrator::{Integrator, Medium, Ray};

/// Position and rate both from the values at the step's start. First order; it gains energy, and
/// blows up in a light guide.
#[derive(Debug, Clone, Copy, Default)]
pub struct Euler;

impl Integrator for Euler {
    const ORDER: u32 = 1;
    const SAMPLES: u32 = 1;

    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray {
        ray.after(dtau_m, &ray.rate(medium))
    }
}
