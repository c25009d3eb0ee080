//! Dormand and Prince 1980: fifth order with an error estimate that chooses the step. The oracle.

use super::integrator::{Medium, Rate, Ray};

/// DOPRI5 with steps chosen so that the estimated error of each stays below a tolerance.
///
/// The estimate is blind to kinks of an interpolant that a step jumps over: give `longest_step_m`
/// about a voxel for interpolated fields.
#[derive(Debug, Clone, Copy)]
pub struct DormandPrince {
    /// Largest error a step may have: in metres for positions and path, and for w without unit.
    pub tolerance: f64,
    /// Longest step.
    pub longest_step_m: f64,
}

/// Where an adaptive run ended and what it took.
#[derive(Debug, Clone, Copy)]
pub struct AdaptiveRay {
    /// The ray at the end.
    pub ray: Ray,
    /// Samples of the medium.
    pub samples: u32,
    /// Sum of the steps' estimated errors.
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
/// Fifth order minus fourth.
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
    /// The ray after `tau_m`. `None` when the steps become too short to move the ray: the medium is
    /// singular there.
    pub fn run(&self, medium: &impl Medium, ray: &Ray, tau_m: f64) -> Option<AdaptiveRay> {
        let mut r = *ray;
        let end = ray.tau_m + tau_m;
        let mut h = (0.01 * tau_m).min(self.longest_step_m);
        let mut k = [r.rate(medium); 7];
        let mut out = AdaptiveRay { ray: r, samples: 1, error: 0.0 };
        while r.tau_m < end {
            // A step that nearly reaches the end goes there.
            let last = r.tau_m + 1.000_001 * h >= end;
            let step = if last { end - r.tau_m } else { h };
            let mut next = r;
            for s in 0..6 {
                let terms: [(f64, &Rate); 6] = [0, 1, 2, 3, 4, 5].map(|i| (A[s][i], &k[i]));
                next = r.after(step, &Rate::sum(&terms[..=s]));
                // `after` moved tau by the whole step; the stages in between are at fractions of
                // it, whose sum the row of A is.
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
