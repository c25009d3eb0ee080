//! Points spread evenly over a sphere.

use glam::{DVec2, DVec3};

/// Point `i` of `n` spread evenly over the unit sphere (Fibonacci lattice).
pub(super) fn fibonacci_direction(i: usize, n: usize) -> DVec3 {
    let z = 1.0 - (2 * i + 1) as f64 / n.max(1) as f64;
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let plane = DVec2::from_angle(turn * i as f64) * (1.0 - z * z).max(0.0).sqrt();
    plane.extend(z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_unit_and_centred() {
        let directions: Vec<_> = (0..10_000).map(|i| fibonacci_direction(i, 10_000)).collect();
        assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        assert!((directions.iter().sum::<DVec3>() / 1e4).length() < 0.03);
    }
}
