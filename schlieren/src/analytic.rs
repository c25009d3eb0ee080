//! Media with known rays, to validate marches against closed forms.

use crate::march::Medium;
use glam::DVec3;
use std::f64::consts::PI;

/// A Gaussian blob, eps = amplitude exp(-r^2 / (2 sigma^2)), at the origin.
#[derive(Debug, Clone, Copy)]
pub struct Gaussian {
    /// eps at the centre.
    pub amplitude: f64,
    /// Standard deviation of the blob.
    pub sigma_m: f64,
}

impl Gaussian {
    /// Optical path difference of a straight ray along z through (x, y), between -half and half,
    /// divided by n0. The error is of order amplitude^2.
    pub fn path_difference_m(&self, x: f64, y: f64, half_m: f64) -> f64 {
        let s = self.sigma_m;
        self.amplitude
            * s
            * (2.0 * PI).sqrt()
            * (-(x * x + y * y) / (2.0 * s * s)).exp()
            * erf(half_m / (s * std::f64::consts::SQRT_2))
    }

    /// Deflection of that ray.
    pub fn deflection_rad(&self, x: f64, y: f64, half_m: f64) -> [f64; 2] {
        let path = self.path_difference_m(x, y, half_m);
        [-x / self.sigma_m.powi(2) * path, -y / self.sigma_m.powi(2) * path]
    }

    /// Derivatives of the deflection with respect to the ray's position: d u_x/dx, d u_x/dy, d
    /// u_y/dy.
    pub fn jacobian_per_m(&self, x: f64, y: f64, half_m: f64) -> [f64; 3] {
        let path = self.path_difference_m(x, y, half_m);
        let s2 = self.sigma_m.powi(2);
        [(x * x / s2 - 1.0) / s2 * path, x * y / (s2 * s2) * path, (y * y / s2 - 1.0) / s2 * path]
    }
}

impl Medium for Gaussian {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        let s2 = self.sigma_m.powi(2);
        let eps = self.amplitude * (-at_m.length_squared() / (2.0 * s2)).exp();
        (eps, -at_m / s2 * eps)
    }
}

/// A Luneburg lens of radius 1 m: n^2 = 2 - r^2. It focuses parallel light into one point on the
/// far side.
#[derive(Debug, Clone, Copy, Default)]
pub struct Luneburg;

impl Medium for Luneburg {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        eps_from_n_squared(2.0 - at_m.length_squared(), -at_m)
    }
}

impl Luneburg {
    /// Position and w, at path parameter `tau_m`, of the ray that enters along z at (b, 0,
    /// -sqrt(1 - b^2)).
    pub fn ray(b: f64, tau_m: f64) -> (DVec3, DVec3) {
        let (s, c) = tau_m.sin_cos();
        let z = -(1.0 - b * b).sqrt();
        (DVec3::new(b * c, 0.0, z * c + s), DVec3::new(-b * s, 0.0, -z * s + c))
    }
}

/// Maxwell's fish-eye, n = 2 / (1 + r^2), with eps = n - 1. Rays are circles, and light from any
/// point is focused into the opposite one.
#[derive(Debug, Clone, Copy, Default)]
pub struct FishEye;

impl Medium for FishEye {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        let d = 1.0 + at_m.length_squared();
        (2.0 / d - 1.0, at_m * (-4.0 / (d * d)))
    }
}

/// A graded fibre along z, n^2 = n0^2 (1 - g^2 (x^2 + y^2)), with n0 as the reference.
#[derive(Debug, Clone, Copy)]
pub struct Selfoc {
    /// g.
    pub gradient_per_m: f64,
}

impl Medium for Selfoc {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        let g2 = self.gradient_per_m.powi(2);
        eps_from_n_squared(
            1.0 - g2 * (at_m.x * at_m.x + at_m.y * at_m.y),
            DVec3::new(at_m.x, at_m.y, 0.0) * -g2,
        )
    }
}

/// n^2 = 1 + 2 a y: rays are parabolas, which Verlet, Sharma and Runge-Kutta follow exactly.
#[derive(Debug, Clone, Copy)]
pub struct LinearSquare {
    /// a.
    pub slope_per_m: f64,
}

impl Medium for LinearSquare {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        eps_from_n_squared(1.0 + 2.0 * self.slope_per_m * at_m.y, DVec3::Y * self.slope_per_m)
    }
}

/// n = 1 + a y: rays are catenaries (mirages).
#[derive(Debug, Clone, Copy)]
pub struct Linear {
    /// a.
    pub slope_per_m: f64,
}

impl Medium for Linear {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        (self.slope_per_m * at_m.y, DVec3::Y * self.slope_per_m)
    }
}

/// n^2 = 1 + 2 k / r: rays are Kepler's hyperbolas.
#[derive(Debug, Clone, Copy)]
pub struct Kepler {
    /// k.
    pub strength_m: f64,
}

impl Medium for Kepler {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        let r = at_m.length();
        eps_from_n_squared(1.0 + 2.0 * self.strength_m / r, -at_m * (self.strength_m / (r * r * r)))
    }
}

impl Kepler {
    /// Angle between a ray's two asymptotes, for impact parameter `b_m`.
    pub fn deflection_rad(&self, b_m: f64) -> f64 {
        2.0 * (self.strength_m / b_m).atan()
    }
}

/// Computes eps and its gradient from n^2 and half the gradient of n^2. Avoids the cancellation in
/// sqrt(1 + x) - 1.
fn eps_from_n_squared(n2: f64, half_gradient: DVec3) -> (f64, DVec3) {
    let n = n2.sqrt();
    ((n2 - 1.0) / (n + 1.0), half_gradient / n)
}

/// Abel pairs: line integrals of functions of the distance from an axis.
pub mod abel {
    use super::PI;

    /// Line integral of exp(-r^2/s^2) at distance `y` from the axis.
    pub fn gaussian(y: f64, s: f64) -> f64 {
        s * PI.sqrt() * (-(y / s).powi(2)).exp()
    }

    /// Line integral of (1 - r^2/R^2)^m, which is zero outside R, for m = 0 (cylinder), 1, 2 or 3.
    ///
    /// # Panics
    /// If m is above 3.
    pub fn power(y: f64, radius: f64, m: u32) -> f64 {
        // sqrt(pi) Gamma(m + 1) / Gamma(m + 3/2) = 2, 4/3, 16/15, 32/35.
        let factor = [2.0, 4.0 / 3.0, 16.0 / 15.0, 32.0 / 35.0][m as usize];
        let inside = (1.0 - (y / radius).powi(2)).max(0.0);
        factor * radius * inside.powf(f64::from(m) + 0.5)
    }

    /// Derivative of [`power`] with respect to y: the deflection by a weak cylinder of that
    /// profile.
    ///
    /// # Panics
    /// If m is above 3.
    pub fn power_slope(y: f64, radius: f64, m: u32) -> f64 {
        let factor = [2.0, 4.0 / 3.0, 16.0 / 15.0, 32.0 / 35.0][m as usize];
        let inside = (1.0 - (y / radius).powi(2)).max(0.0);
        factor * radius * (f64::from(m) + 0.5) * inside.powf(f64::from(m) - 0.5) * -2.0 * y
            / (radius * radius)
    }
}

/// The error function to 1e-15, by its series near zero and its continued fraction elsewhere.
pub fn erf(x: f64) -> f64 {
    let a = x.abs();
    let value = if a < 2.5 {
        // erf(x) = 2/sqrt(pi) exp(-x^2) sum 2^k x^(2k+1) / (2k+1)!!: all terms positive.
        let (mut term, mut sum, mut k) = (a, a, 1.0);
        while term > 1e-17 * sum {
            term *= 2.0 * a * a / (2.0 * k + 1.0);
            sum += term;
            k += 1.0;
        }
        2.0 / PI.sqrt() * (-a * a).exp() * sum
    } else {
        let fraction = (1..=60).rev().fold(a, |f, k| a + f64::from(k) / 2.0 / f);
        1.0 - (-a * a).exp() / (PI.sqrt() * fraction)
    };
    value.copysign(x)
}
