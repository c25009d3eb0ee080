//! Acceleration structures: how rays find primitives.

mod blas;
#[cfg(test)]
mod brute_force;
mod build;
mod options;
mod part;
mod placement;
mod refit;
mod streams;
pub(crate) mod triangles;
mod validate;
pub(crate) mod wide;
mod world;

pub use options::{BuildOptions, BuildQuality, BuildReport, Robustness, UnknownQuality};
pub use part::{ShapePart, Whole};
pub use refit::{RefitError, RefitReport};
pub(crate) use streams::Coherence;
pub use streams::StreamError;
pub use validate::{InvalidTree, TreeFacts};
pub(crate) use wide::{Unit, WideBvh};
pub(crate) use world::Among;
pub use world::{BuildError, Geometry, Instance, World};

#[cfg(test)]
mod tests;
