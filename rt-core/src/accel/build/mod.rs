//! Builders of the 8-wide hierarchy.

mod binned_sah;
mod prim_ref;
mod wide_builder;

pub(crate) use prim_ref::{MAX_PRIMS, PrimRef};
pub(crate) use wide_builder::{LeafWriter, build_wide};
