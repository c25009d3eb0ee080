//! Measures robustness. The tests require perfect results; the program `bench` traces more rays and
//! compares ray tracers.
//!
//! [`LeakTest`] counts rays that get through when aimed at vertices, edges and points of a closed
//! mesh. `SelfShadowTest` (feature `render`) counts secondary rays that hit the surface from which
//! they start.

mod leaks;
#[cfg(feature = "render")]
mod self_shadow;

pub use leaks::{LeakCount, LeakTest, QueryKind, RayOrigins, RayTarget};
#[cfg(feature = "render")]
pub use self_shadow::{SelfShadowCount, SelfShadowTest};

use crate::math::SplitMix64;

/// Random numbers for one batch of rays. They do not depend on the batches before it.
fn batch_numbers(seed: u64, batch: u64) -> SplitMix64 {
    SplitMix64::new(seed ^ (batch + 1).wrapping_mul(0xd134_2543_de82_ef95))
}
