//! The Runge-Kutta-Nystroem integrator for rays by Sharma, Kumar and Ghatak 1982.

use super::integrator::{Integrator, Medium, Rate, Ray};

/// Runge-Kutta-Nystroem: fourth order with three samples per step, because the force does not
/// depend on the rate (Applied Optics 21, 984, equations 8 to 11).
#[derive(Debug, Clone, Copy, Default)]
pub struct Sharma;

impl Integrator for Sharma {
    const ORDER: u32 = 4;
    const SAMPLES: u32 = 3;

    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray {
        let h = dtau_m;
        // The ray after `h`, with a given mean acceleration.
        let ahead = |h: f64, acceleration| Ray {
            tau_m: ray.tau_m + h,
            xi_m: ray.xi_m + ray.u * h + acceleration * (0.5 * h * h),
            ..*ray
        };
        let a = ray.rate(medium);
        let b = ahead(0.5 * h, a.u).rate(medium);
        let c = ahead(h, b.u).rate(medium);
        let mean = Rate {
            xi: ray.u + (a.u + b.u * 2.0) * (h / 6.0),
            u: (a.u + b.u * 4.0 + c.u) / 6.0,
            excess: (a.excess + 4.0 * b.excess + c.excess) / 6.0,
        };
        ray.after(h, &mean)
    }
}
