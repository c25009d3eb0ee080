//! The reference integrator for smooth media: Dormand and Prince 1980, fifth order with an error
//! estimate that chooses the step.

use super::integrator::{Medium, Rate, Ray};

/// DOPRI5 with steps chosen so that the estimated error of each step stays below a tolerance.
///
/// The estimate does not see the kinks of an interpolant that a step jumps over. For interpolated
/// fields, limit `longest_step_m` to about a voxel.
#[derive(Debug, Clone, Copy)]
pub struct DormandPrince {
    /// Largest error of a step: in metres for positions and path, without unit for w.
    pub tolerance: f64,
    /// Longest step, in metres.
    pub longest_step_m: f64,
}

/// The end of an adaptive run and its cost.
#[derive(Debug, Clone, Copy)]
pub struct AdaptiveRay {
    /// The ray at the end.
    pub ray: Ray,
    /// Number of samples taken of the medium.
    pub samples: u32,
    /// Sum of the estimated errors of the steps.
    pub error: f64,
}

const A: [[f64; 6]; 6] = [
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Weights of the fifth-order formula minus those of the fourth-order one.
const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

impl DormandPrince {
    /// The ray after `tau_m`, or `None` when the steps become too short to move the ray because the
    /// medium is singular.
    pub fn run(&self, medium: &impl Medium, ray: &Ray, tau_m: f64) -> Option<AdaptiveRay> {
        let mut r = *ray;
        let end = ray.tau_m + tau_m;
        let mut h = (0.01 * tau_m).min(self.longest_step_m);
        let mut k = [r.rate(medium); 7];
        let mut out = AdaptiveRay { ray: r, samples: 1, error: 0.0 };
        while r.tau_m < end {
            // A step that nearly reaches the end is extended to it.
            let last = r.tau_m + 1.000_001 * h >= end;
            let step = if last { end - r.tau_m } else { h };
            let mut next = r;
            for s in 0..6 {
                let terms: [(f64, &Rate); 6] = [0, 1, 2, 3, 4, 5].map(|i| (A[s][i], &k[i]));
                next = r.after(step, &Rate::sum(&terms[..=s]));
                // `after` moved tau by the whole step. An intermediate Runge-Kutta stage is at a
                // fraction of it: the sum of the row of A.
                let fraction: f64 = A[s][..=s].iter().sum();
                next.tau_m = r.tau_m + fraction * step;
                k[s + 1] = next.rate(medium);
            }
            out.samples += 6;
            let terms: [(f64, &Rate); 7] = [0, 1, 2, 3, 4, 5, 6].map(|i| (E[i], &k[i]));
            let e = Rate::sum(&terms);
            let error = step * e.xi.length().max(e.u.length()).max(e.excess.abs());
            if error <= self.tolerance {
                r = next;
                if last {
                    r.tau_m = end;
                }
                k[0] = k[6];
                out.error += error;
            }
            let change = 0.9 * (self.tolerance / error.max(1e-300)).powf(0.2);
            h = (step * change.clamp(0.2, 5.0)).min(self.longest_step_m);
            if h.is_nan() || h < 1e-14 * tau_m {
                return None;
            }
        }
        out.ray = r;
        Some(out)
    }
}
