//! Repeatable random numbers: the same seed gives the same sequence on every machine and thread
//! count.

use glam::{DVec2, DVec3};

/// SplitMix64 (Steele, Lea and Flood 2014): small, fast, and any seed is a good seed.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// The sequence of this seed.
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// Uniform in 0..1 (53 bits).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in `low..high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let (s, c) = self.between(0.0, std::f64::consts::TAU).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * c, r * s, z)
    }
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A well-mixed function of 64 bits (SplitMix64's output function).
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Point `i` of `n` spread evenly over the unit sphere (Fibonacci lattice).
pub fn fibonacci_direction(i: usize, n: usize) -> DVec3 {
    let z = 1.0 - (2 * i + 1) as f64 / n.max(1) as f64;
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let plane = DVec2::from_angle(turn * i as f64) * (1.0 - z * z).max(0.0).sqrt();
    plane.extend(z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_numbers_are_splitmix64s() {
        // Reference values of the published generator for seed 1234567.
        let mut r = Random::new(1_234_567);
        assert_eq!([r.bits(), r.bits()], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn directions_are_unit_and_centred() {
        let mut r = Random::new(1);
        for directions in [
            (0..10_000).map(|_| r.direction()).collect::<Vec<_>>(),
            (0..10_000).map(|i| fibonacci_direction(i, 10_000)).collect(),
        ] {
            assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
            assert!((directions.iter().sum::<DVec3>() / 1e4).length() < 0.03);
        }
    }
}
