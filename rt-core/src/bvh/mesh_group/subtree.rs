//! The tree of one mesh, on its way into a group's.

use crate::bvh::layout::wide::Unit;
use std::borrow::Cow;

/// The tree of one mesh, to be copied into the group's.
pub(super) struct Subtree<'a> {
    pub(super) instance: u32,
    pub(super) geometry: usize,
    /// Number of the mesh's triangles, including those that cannot be hit.
    pub(super) triangles: u32,
    /// Nodes and leaves, the root first. References count from `base`, triangles from `first`.
    pub(super) units: Cow<'a, [Unit]>,
    pub(super) base: usize,
    pub(super) first: u32,
    pub(super) depth: usize,
}
