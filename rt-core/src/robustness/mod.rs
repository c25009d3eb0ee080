//! Measurements of robustness, shared by the tests, which ask for perfection, and by the program
//! `bench`, which runs more rays and compares.
//!
//! [`LeakTest`]: how many rays aimed at vertices, edges and points of a closed mesh get through.
//! [`SelfShadowTest`]: how many secondary rays meet the surface that they start from.

mod leaks;
mod self_shadow;

pub use leaks::{LeakCount, LeakTest, QueryKind, RayOrigins, RayTarget};
pub use self_shadow::{SelfShadowCount, SelfShadowTest};

use glam::DVec3;

/// A repeatable sequence (SplitMix64, Steele, Lea and Flood 2014).
struct SplitMix64(u64);

impl SplitMix64 {
    fn for_batch(seed: u64, batch: u64) -> SplitMix64 {
        SplitMix64(seed ^ (batch + 1).wrapping_mul(0xd134_2543_de82_ef95))
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (((self.bits() >> 32) * n as u64) >> 32) as usize
    }

    /// Uniform on the unit sphere.
    fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.unit() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}
