//! A hierarchy as a ray query sees it: all of it, or only the subtrees of some instances.
//!
//! In a tree over many meshes, a node of the upper part has children of which each is the subtree
//! of one instance (or a further node of the upper part). A query for some instances leaves out the
//! other children there, so it never descends into geometry that it does not ask for. Below the
//! upper part, and in trees of one geometry, nothing is left out and nothing is looked up.

use crate::bvh::compact::CompactBvh;
use crate::bvh::instance_filter::InstanceFilter;
use crate::bvh::layout::wide::{NODE_UNITS, Unit, WIDTH, WideBvh};

/// The instance that each child of a node of the upper part belongs to.
pub(crate) type ChildOwners = [u32; WIDTH];

/// The owner of a child that is a node of the upper part itself, or an empty slot.
pub(crate) const NO_OWNER: u32 = u32::MAX;

/// A borrowed tree. The root node is at unit 0.
#[derive(Clone, Copy)]
pub(crate) struct TreeView<'a> {
    pub(crate) units: &'a [Unit],
    /// Nodes that start before this unit are filtered; 0 when nothing is.
    filtered_units: usize,
    owners: &'a [ChildOwners],
    filter: InstanceFilter<'a>,
    /// The key of a compact tree; 0 for trees whose leaves are triangles.
    meshlets: u64,
}

impl<'a> TreeView<'a> {
    /// All of a tree.
    #[inline]
    pub(crate) fn all(bvh: &'a WideBvh) -> Self {
        TreeView::of_units(&bvh.units)
    }

    /// All of a tree in an array of its own.
    #[inline]
    pub(crate) fn of_units(units: &'a [Unit]) -> Self {
        let filter = InstanceFilter::All;
        TreeView { units, filtered_units: 0, owners: &[], filter, meshlets: 0 }
    }

    /// All of a compact tree.
    #[inline]
    pub(crate) fn of_meshlets(tree: &'a CompactBvh) -> Self {
        TreeView { meshlets: tree.key, ..TreeView::all(&tree.bvh) }
    }

    /// The key of a compact tree; 0 when the leaves are triangles.
    #[inline(always)]
    pub(crate) fn meshlets(&self) -> u64 {
        self.meshlets
    }

    /// The subtrees of `filter`'s instances. `owners` belong to the nodes of the upper part, which
    /// fill the start of the tree without gaps.
    #[inline]
    pub(crate) fn among(
        bvh: &'a WideBvh,
        owners: &'a [ChildOwners],
        filter: InstanceFilter<'a>,
    ) -> Self {
        let filtered_units = match filter {
            InstanceFilter::All => 0,
            _ => owners.len() * NODE_UNITS,
        };
        TreeView { units: &bvh.units, filtered_units, owners, filter, meshlets: 0 }
    }

    /// Those of the `children` of the node at unit `node` that belong to the query.
    #[inline(always)]
    pub(crate) fn visible(&self, node: usize, children: u32) -> u32 {
        if node < self.filtered_units { children & self.owned_children(node) } else { children }
    }

    #[cold]
    #[inline(never)]
    fn owned_children(&self, node: usize) -> u32 {
        let owners = &self.owners[node / NODE_UNITS];
        (0..WIDTH).fold(0, |mask, slot| {
            let owner = owners[slot];
            mask | u32::from(owner == NO_OWNER || self.filter.has(owner as usize)) << slot
        })
    }
}
