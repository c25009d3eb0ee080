//! Fields, views and rays shared by several tests.
#![allow(dead_code, reason = "each test binary uses its part")]

use glam::DVec3;
use schlieren::analytic::Gaussian;
use schlieren::field::Field;
use schlieren::march::Medium;
use schlieren::path::{Exit, LightPaths, Start};
use schlieren::view::View;

/// A blob in a cube of 1 m around the origin, with `n` nodes per side.
pub(crate) fn blob(n: usize, amplitude: f64, sigma_m: f64) -> Field {
    let g = Gaussian { amplitude, sigma_m };
    cube(n, |p| g.sample(p).0)
}

pub(crate) fn cube(n: usize, eps: impl Fn(DVec3) -> f64 + Sync) -> Field {
    Field::from_fn([n; 3], [1.0 / (n - 1) as f64; 3], DVec3::splat(-0.5), 1.0, eps).unwrap()
}

/// Three blobs of different size and sign, without any symmetry.
pub(crate) fn lopsided(p: DVec3) -> f64 {
    let blob = |x: f64, y: f64, z: f64, s: f64| {
        (-(p - DVec3::new(x, y, z)).length_squared() / (2.0 * s * s)).exp()
    };
    1e-4 * (blob(0.1, 0.05, -0.08, 0.09) - 0.6 * blob(-0.12, 0.1, 0.05, 0.11)
        + 0.3 * blob(0.02, -0.14, 0.13, 0.08))
}

/// A view rotated by 0.6 rad about y, and a little about x, so that no direction cosine is zero.
pub(crate) fn oblique() -> View {
    View::new(DVec3::new(0.6f64.sin(), 0.1, 0.6f64.cos()), DVec3::Y, DVec3::ZERO).unwrap()
}

/// `n` by `n` starts over a square of side `side_m`, none on a node.
pub(crate) fn grid(n: usize, side_m: f64) -> Vec<Start> {
    let at = |i: usize| (((i as f64 + 0.437) / n as f64 - 0.5) * side_m) as f32;
    (0..n * n).map(|i| Start { position_m: [at(i % n), at(i / n)], tilt_rad: [0.0; 2] }).collect()
}

pub(crate) fn trace(paths: &impl LightPaths, starts: &[Start]) -> Vec<Exit> {
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace(starts, &mut exits);
    exits
}

/// Largest deflection component.
pub(crate) fn largest(exits: &[Exit]) -> f64 {
    exits.iter().flat_map(|e| e.deflection_rad).fold(0.0, |m, u| f64::from(u.abs()).max(m))
}

/// Root mean square and maximum of the deflections' differences, relative to the largest
/// deflection.
pub(crate) fn difference(a: &[Exit], b: &[Exit]) -> (f64, f64) {
    let scale = largest(b).max(f64::MIN_POSITIVE);
    let (mut sum, mut max) = (0.0, 0.0f64);
    for (x, y) in a.iter().zip(b) {
        for c in 0..2 {
            let d = (f64::from(x.deflection_rad[c]) - f64::from(y.deflection_rad[c])) / scale;
            sum += d * d;
            // Not `max`, which would ignore NaN.
            if d.is_nan() || d.abs() > max {
                max = d.abs();
            }
        }
    }
    ((sum / (2 * a.len()) as f64).sqrt(), max)
}
