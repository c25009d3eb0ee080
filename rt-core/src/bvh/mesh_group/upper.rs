//! The upper part of a group's tree, over nodes and leaves from inside the subtrees.

use super::subtree::Subtree;
use crate::bvh::build::{BuilderConfig, LeafCapacity, PrimRef, build_wide};
use crate::bvh::layout::triangles::{TriWriter, leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{
    CHILD_ROW, ChildRef, LeafWriter, NODE_UNITS, Unit, WIDTH, WideBvh, get_box, set_box,
};
use crate::bvh::traverse::tree_view::{ChildOwners, NO_OWNER};
use crate::math::Aabb;
use rayon::prelude::*;

/// Leaves of the upper part per member, and triangles per leaf of the upper part: whichever allows
/// more leaves. Measured on ten thousand spheres of 144 triangles (random, overlapping): ray times
/// do not change between 2 and 16 leaves per member.
const LEAVES_PER_MEMBER: usize = 4;
const TRIANGLES_PER_LEAF: usize = 64;

/// The upper part before its leaves refer to the subtrees.
pub(super) struct Upper {
    pub(super) tree: WideBvh,
    pub(super) opened: Vec<Opened>,
    /// Number of nodes of the subtrees that it replaces.
    pub(super) replaced: usize,
}

/// A node or leaf inside a subtree, as a leaf of the upper part.
pub(super) struct Opened {
    bounds: Aabb,
    child: ChildRef,
    member: u32,
}

/// Leaves of the upper part: one reference each, without storage of their own.
struct OpenedWriter;

impl LeafWriter for OpenedWriter {
    const UNITS: usize = 0;
    const CAPACITY: usize = 1;

    fn write(&self, _: &[u32], _: &mut [Unit]) {}

    /// The number of the opened node; [`link`] puts the node's own reference there when it
    /// knows how large the upper part is.
    fn reference(&self, _: usize, prims: &[u32]) -> ChildRef {
        ChildRef::leaf(prims[0] as usize, 1)
    }
}

/// Opens the subtrees and sorts what is found. Boxes with more surface than a common limit are
/// opened, so that the leaves of the upper part have similar sizes wherever they come from.
pub(super) fn build_upper(
    subtrees: &[Subtree<'_>],
    mut config: BuilderConfig,
    notes: &mut Vec<String>,
) -> Upper {
    let triangles: usize = subtrees.iter().map(|s| s.triangles as usize).sum();
    let surface: f64 = subtrees.iter().map(|s| s.bounds.half_area() as f64).sum();
    let leaves = (LEAVES_PER_MEMBER * subtrees.len()).max(triangles / TRIANGLES_PER_LEAF);
    let limit = (surface / leaves as f64) as f32;
    let found: Vec<(Vec<Opened>, usize)> =
        subtrees.par_iter().enumerate().map(|(member, s)| open(s, member as u32, limit)).collect();
    let replaced = found.iter().map(|(_, n)| n).sum();
    let opened: Vec<Opened> = found.into_iter().flat_map(|(o, _)| o).collect();
    let refs = opened.iter().enumerate().map(|(i, o)| PrimRef::new(o.bounds, i as u32)).collect();
    config.sah.leaves = LeafCapacity::One;
    let tree = build_wide(refs, &OpenedWriter, config, notes);
    Upper { tree, opened, replaced }
}

/// The nodes and leaves of a subtree that become leaves of the upper part, and the number of nodes
/// that it replaces. The root is always replaced.
fn open(subtree: &Subtree<'_>, member: u32, limit: f32) -> (Vec<Opened>, usize) {
    let (mut found, mut replaced) = (Vec::new(), 0);
    let mut todo = vec![ChildRef::node(subtree.base)];
    while let Some(at) = todo.pop() {
        let at = at.unit() - subtree.base;
        let node = &subtree.units[at..at + NODE_UNITS];
        replaced += 1;
        for slot in 0..WIDTH {
            let child = ChildRef(node[CHILD_ROW].bits()[slot]);
            if child == ChildRef::NONE {
                break;
            }
            let bounds = get_box(node, slot);
            if !child.is_leaf() && bounds.half_area() > limit {
                todo.push(child);
            } else {
                found.push(Opened { bounds, child, member });
            }
        }
    }
    (found, replaced)
}

/// Puts references to the subtrees' nodes into the upper part, and returns the owners of its
/// nodes' children. `moved` says by how many units each subtree was moved.
pub(super) fn link(
    top: &mut [Unit],
    opened: &[Opened],
    instances: &[u32],
    moved: impl Fn(usize) -> usize + Sync,
) -> Vec<ChildOwners> {
    let link_node = |node: &mut [Unit]| {
        let mut owners = [NO_OWNER; WIDTH];
        for (child, owner) in node[CHILD_ROW].bits_mut().iter_mut().zip(&mut owners) {
            let reference = ChildRef(*child);
            if reference == ChildRef::NONE || !reference.is_leaf() {
                continue;
            }
            let o = &opened[reference.unit()];
            *child = o.child.moved(moved(o.member as usize)).0;
            *owner = instances[o.member as usize];
        }
        owners
    };
    top.par_chunks_exact_mut(NODE_UNITS).with_min_len(64).map(link_node).collect()
}

/// Recomputes the boxes of the upper part after the subtree of `instance` has changed; returns the
/// bounds of everything.
pub(super) fn update_boxes(
    units: &mut [Unit],
    owners: &[ChildOwners],
    instance: u32,
    writer: &TriWriter<'_>,
) -> Aabb {
    // Parents come before their children, so backwards is bottom up.
    for (n, owners) in owners.iter().enumerate().rev() {
        let at = n * NODE_UNITS;
        for slot in 0..WIDTH {
            let child = ChildRef(units[at + CHILD_ROW].bits()[slot]);
            if child == ChildRef::NONE {
                break;
            }
            let changed = owners[slot] == NO_OWNER || owners[slot] == instance;
            if changed {
                let bounds = if child.is_leaf() {
                    let ids = leaf_triangle_ids(leaf_floats(units, child));
                    let ids = writer.in_mesh(ids);
                    ids[..child.count()].iter().fold(Aabb::EMPTY, |b, &i| b.union(writer.bounds(i)))
                } else {
                    node_bounds(&units[child.unit()..child.unit() + NODE_UNITS])
                };
                set_box(&mut units[at..at + NODE_UNITS], slot, bounds);
            }
        }
    }
    node_bounds(&units[..NODE_UNITS])
}

/// The box around the children of a node. Unused slots are empty boxes.
fn node_bounds(node: &[Unit]) -> Aabb {
    (0..WIDTH).fold(Aabb::EMPTY, |b, slot| b.union(get_box(node, slot)))
}
