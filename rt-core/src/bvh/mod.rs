//! Acceleration structures for finding the primitives that rays hit.

mod blas;
#[cfg(test)]
mod brute_force;
mod build;
mod error;
pub(crate) mod intersect;
pub(crate) mod layout;
mod options;
mod partition;
mod placement;
mod query;
mod refit;
mod streams;
pub(crate) mod traverse;
mod triangle_bvh;
mod validate;
mod world;

pub use error::BuildError;
pub(crate) use layout::wide::{Unit, WideBvh};
pub use options::{BuildOptions, BuildQuality, BuildReport, Robustness, UnknownQuality};
pub use partition::GlobalLayout;
pub use refit::{RefitError, RefitReport};
pub(crate) use streams::Coherence;
pub use streams::StreamError;
pub use validate::{InvalidTree, TreeStats};
pub(crate) use world::InstanceFilter;
pub use world::{Geometry, Instance, World};

#[cfg(test)]
mod tests;
