//! Builders of the 8-wide hierarchy.
//!
//! ```text
//! boxes ─ binned_sah cuts ─► fragments ─┬─ sah_tree ──┬─► binary trees ─ collapse ─► plans ─ wide_builder writes ─► arena
//!         (large sets)                  └─ obvhs_tree ┘
//! ```

mod binary_tree;
mod binned_sah;
mod collapse;
mod obvhs_tree;
mod prim_ref;
mod progress;
mod sah_tree;
mod schedule;
mod wide_builder;

pub(crate) use binned_sah::{LeafCapacity, SahConfig};
pub(crate) use prim_ref::{MAX_PRIMS, PrimRef};
pub(crate) use progress::{OneAtATime, Progress, Stopped, UNWATCHED};
pub(crate) use schedule::build_in_parallel;
pub(crate) use wide_builder::{BuilderConfig, Method, build_wide};

#[cfg(test)]
mod parallel_tests;
#[cfg(test)]
mod progress_tests;
#[cfg(test)]
mod tests;
