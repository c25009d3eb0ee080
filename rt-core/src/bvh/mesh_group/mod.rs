//! One tree over all meshes of a world that are not instanced.
//!
//! A scene of ten thousand small meshes is traced as if their triangles were one mesh. Each mesh
//! still has a subtree of its own in one contiguous range of the tree, so that a mesh can be
//! refitted alone and a new world can copy the subtrees of meshes that did not change. Above the
//! subtrees lies an upper part whose leaves are nodes from inside them: where meshes overlap, a
//! subtree is opened, and its children are sorted into the upper part one by one (Benthin, Woop,
//! Wald and Áfra, "Improved Two-Level BVHs using Partial Re-Braiding", HPG 2017).
//!
//! Triangles are numbered throughout the group, in the order of the instances. [`MeshGroup::owner`]
//! gives back the instance and its own triangle number.

mod assemble;
mod build;
mod members;
mod subtree;
mod upper;

use super::instance_filter::InstanceFilter;
use super::layout::local_frame::LocalFrame;
use super::layout::triangles::TriWriter;
use super::layout::wide::{Unit, WideBvh};
use super::placement::Placement;
use super::traverse::tree_view::{ChildOwners, TreeView};
use crate::math::Aabb;
use crate::ray::{HitBlock, LANES, NO_HIT};
use assemble::assemble;
pub(super) use build::{GroupInput, KnownTree, KnownTrees, build_group};
use glam::{DAffine3, DVec3};
pub(super) use members::{GroupChoice, GroupLayout, choose_members, members_among};
use std::ops::Range;

/// A mesh of the group.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    /// The only instance of the mesh.
    pub(super) instance: u32,
    pub(super) geometry: usize,
    /// Number of its first triangle in the group.
    pub(super) first: u32,
    /// Where its subtree lies in the arena; the root comes first.
    pub(super) units: Range<usize>,
}

/// The tree, and what belongs to whom in it.
#[derive(Clone)]
pub(super) struct MeshGroup {
    pub(super) bvh: WideBvh,
    pub(super) frame: LocalFrame,
    /// Bounds of all members of the whole world, of which this may be a part.
    pub(super) reach: Aabb,
    pub(super) placement: Placement,
    pub(super) members: Vec<Member>,
    /// Owners of the children of the upper part's nodes.
    owners: Vec<ChildOwners>,
    /// Units of nodes that the upper part replaces.
    pub(super) replaced_units: usize,
    lookup: OwnerLookup,
}

impl MeshGroup {
    /// `None` when the tree would be deeper than a traversal stack allows or larger than child
    /// references reach.
    pub(super) fn new(
        tree: assemble::GroupTree,
        frame: LocalFrame,
        reach: Option<Aabb>,
        origin: DVec3,
    ) -> Option<MeshGroup> {
        let assemble::GroupTree { bvh, owners, members, replaced_units, triangles } = tree;
        let reach = reach.unwrap_or(bvh.bounds);
        let placement = place(&frame, [reach, bvh.bounds], origin)?;
        let lookup = OwnerLookup::new(&members, triangles);
        Some(MeshGroup { bvh, frame, reach, placement, members, owners, replaced_units, lookup })
    }

    /// The tree with the subtrees of `filter`'s instances.
    #[inline]
    pub(super) fn tree<'a>(&'a self, filter: InstanceFilter<'a>) -> TreeView<'a> {
        TreeView::among(&self.bvh, &self.owners, filter)
    }

    /// The instance of triangle `id` of the group, and the triangle's number in its mesh.
    #[inline]
    pub(super) fn owner(&self, id: u32) -> (u32, u32) {
        let member = &self.members[self.lookup.member(&self.members, id)];
        (member.instance, id - member.first)
    }

    /// Replaces the group's triangle numbers by instances and their triangle numbers.
    pub(super) fn resolve(&self, hits: &mut [HitBlock]) {
        for h in hits {
            for lane in 0..LANES {
                if h.prim[lane] != NO_HIT {
                    (h.instance[lane], h.prim[lane]) = self.owner(h.prim[lane]);
                }
            }
        }
    }

    /// The subtree of member `index`.
    pub(super) fn subtree(&self, index: usize) -> &[Unit] {
        &self.bvh.units[self.members[index].units.clone()]
    }

    /// The owners of the children of the upper part's nodes.
    pub(super) fn owners(&self) -> &[ChildOwners] {
        &self.owners
    }

    /// Recomputes the boxes of the upper part after the triangles of `instance` have moved.
    pub(super) fn update_upper_boxes(&mut self, instance: u32, writer: &TriWriter<'_>) {
        let units = &mut self.bvh.units;
        self.bvh.bounds = upper::update_boxes(units, &self.owners, instance, writer);
        self.reach = self.bvh.bounds;
    }

    /// Takes over new bounds, in render space with the origin at `origin`.
    pub(super) fn place(&mut self, origin: DVec3) {
        let bounds = [self.reach, self.bvh.bounds];
        self.placement = place(&self.frame, bounds, origin).unwrap_or(self.placement);
    }
}

/// The placement of a group that has everything in `layout`.
pub(super) fn place_group(layout: &GroupLayout, origin: DVec3) -> Option<Placement> {
    place(&layout.frame, [layout.reach; 2], origin)
}

/// Members have no transforms. `None` cannot happen with finite bounds.
fn place(frame: &LocalFrame, bounds: [Aabb; 2], origin: DVec3) -> Option<Placement> {
    Placement::new(0, &DAffine3::IDENTITY, frame, bounds, origin)
}

/// Finds the member of a triangle: a table over ranges of triangle numbers, then a search among the
/// few members of the range.
#[derive(Clone)]
struct OwnerLookup {
    /// Triangle number to index in the table: shift right by this.
    shift: u32,
    /// The member of the first triangle of each range, and of the end.
    member: Vec<u32>,
}

impl OwnerLookup {
    /// Ranges per member. With four, half of the ranges of equally large meshes lie in one member.
    const RANGES: usize = 4;

    fn new(members: &[Member], triangles: u32) -> OwnerLookup {
        let ranges = (members.len() * Self::RANGES).next_power_of_two() as u32;
        let shift = (triangles.max(1).next_power_of_two() / ranges).max(1).ilog2();
        let mut member = Vec::with_capacity((triangles >> shift) as usize + 2);
        let mut at = 0;
        for range in 0..=triangles >> shift {
            while members.get(at + 1).is_some_and(|m| m.first <= range << shift) {
                at += 1;
            }
            member.push(at as u32);
        }
        member.push(members.len().saturating_sub(1) as u32);
        OwnerLookup { shift, member }
    }

    #[inline]
    fn member(&self, members: &[Member], id: u32) -> usize {
        let range = (id >> self.shift) as usize;
        let (low, high) = (self.member[range] as usize, self.member[range + 1] as usize);
        low + members[low + 1..=high].partition_point(|m| m.first <= id)
    }
}

#[cfg(test)]
mod tests;
