//! The classical Runge-Kutta integrator.

use super::integrator::{Integrator, Medium, Rate, Ray};

/// The classical Runge-Kutta method: fourth order, four samples per step, not symplectic.
#[derive(Debug, Clone, Copy, Default)]
pub struct RungeKutta4;

impl Integrator for RungeKutta4 {
    const ORDER: u32 = 4;
    const SAMPLES: u32 = 4;

    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray {
        let k1 = ray.rate(medium);
        let k2 = ray.after(0.5 * dtau_m, &k1).rate(medium);
        let k3 = ray.after(0.5 * dtau_m, &k2).rate(medium);
        let k4 = ray.after(dtau_m, &k3).rate(medium);
        let (sixth, third) = (1.0 / 6.0, 1.0 / 3.0);
        ray.after(dtau_m, &Rate::sum(&[(sixth, &k1), (third, &k2), (third, &k3), (sixth, &k4)]))
    }
}
