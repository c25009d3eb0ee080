//! Measurements of robustness, shared by the tests, which ask for perfection, and by the program
//! `bench`, which runs more rays and compares.
//!
//! [`LeakTest`]: how many rays aimed at vertices, edges and points of a closed mesh get through.
//! [`SelfShadowTest`]: how many secondary rays meet the surface that they start from.

mod leaks;
mod self_shadow;

pub use leaks::{LeakCount, LeakTest, QueryKind, RayOrigins, RayTarget};
pub use self_shadow::{SelfShadowCount, SelfShadowTest};

use crate::math::SplitMix64;

/// Numbers of a batch of rays, which do not depend on the batches before it.
fn batch_numbers(seed: u64, batch: u64) -> SplitMix64 {
    SplitMix64::new(seed ^ (batch + 1).wrapping_mul(0xd134_2543_de82_ef95))
}
