//! Acceleration structures for finding the primitives that rays hit.

mod all_hits;
mod blas;
#[cfg(test)]
mod brute_force;
mod build;
mod closest_point;
pub(crate) mod compact;
mod double_precision;
mod entries_in_turns;
mod entry;
mod entry_blocks;
mod entry_packets;
mod error;
mod geometry;
mod instance_filter;
pub(crate) mod intersect;
pub(crate) mod layout;
mod mesh_group;
mod options;
mod part_layout;
mod partition;
mod placement;
mod query;
mod ray_query;
mod refit;
mod render_space;
mod several_entries;
mod shape_packets;
mod stored_mesh;
mod streams;
mod top_level;
pub(crate) mod traverse;
mod triangle_bvh;
mod turned_bounds;
mod validate;
mod world;

pub use crate::paging::{PageSink, PageSource, PageUse};
pub use all_hits::{HitLists, TooManyHits};
pub use closest_point::{ClosestPoint, NoDistance};
pub use double_precision::{HitF64, MeshF64, RayF64, WorldF64};
pub use error::BuildError;
pub use geometry::{Geometry, Instance, SliceFacts};
pub(crate) use instance_filter::InstanceFilter;
pub(crate) use layout::wide::Unit;
pub use options::{BuildOptions, BuildQuality, BuildReport, Robustness, Storage, UnknownQuality};
pub use partition::GlobalLayout;
pub use ray_query::{MaskError, RayQuery};
pub use refit::{RefitError, RefitReport};
pub use render_space::RenderSpace;
pub use stored_mesh::{
    StoredAttributes, StoredMesh, StoredMeshError, StoredMeshReport, StoredMeshWriter,
};
pub(crate) use streams::Coherence;
pub use streams::StreamError;
pub use validate::{InvalidTree, TreeStats};
pub use world::World;

#[cfg(test)]
mod tests;
