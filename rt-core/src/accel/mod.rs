//! Acceleration structures: how rays find primitives.

mod brute_force;
mod options;
mod world;

pub use options::{BuildOptions, BuildQuality, BuildReport, Robustness};
pub use world::{BuildError, Geometry, Instance, World};
