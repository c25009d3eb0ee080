//! The position Verlet integrator: half a drift, a kick, half a drift.

use super::integrator::{Integrator, Medium, Ray};

/// Position Verlet: second order with one sample per step, symplectic and reversible, and exact
/// where n^2 is linear. The reference for the kernels in `packet.rs`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Verlet;

impl Integrator for Verlet {
    const ORDER: u32 = 2;
    const SAMPLES: u32 = 1;

    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray {
        let mut r = *ray;
        r.drift(0.5 * dtau_m);
        r.kick(medium, dtau_m);
        r.drift(0.5 * dtau_m);
        r
    }
}
