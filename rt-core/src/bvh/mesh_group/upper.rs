//! The upper part of a group's tree, over nodes and leaves from inside the subtrees.

use super::subtree::Subtree;
use crate::bvh::build::{BuilderConfig, LeafCapacity, PrimRef, Progress, Stopped, build_wide};
use crate::bvh::layout::triangles::{TriWriter, leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{
    CHILD_ROW, ChildRef, LeafWriter, NODE_UNITS, Unit, WIDTH, WideBvh, get_box, set_box,
};
use crate::bvh::traverse::tree_view::{ChildOwners, NO_OWNER};
use crate::math::Aabb;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// One node below the roots is opened for this many triangles of large meshes. Measured on eight
/// nested spheres of 159,200 triangles, times of rays against those in one merged mesh, closest
/// hits of rays in any direction: 1.40 with 4096, 1.39 with 512, 1.07 with 64.
const TRIANGLES_PER_OPENED: usize = 64;
/// Meshes with fewer triangles are not counted for that. Ten thousand spheres of 288 triangles are
/// traced as fast with only their roots opened (0.83 to 0.99), and built in two thirds of the time.
const LARGE_MESH: usize = 2048;

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
    const COUNTS: bool = false;

    fn write(&self, _: &[u32], _: &mut [Unit]) {}

    /// The number of the opened node; [`link`] puts the node's own reference there when it
    /// knows how large the upper part is.
    fn reference(&self, _: usize, prims: &[u32]) -> ChildRef {
        ChildRef::leaf(prims[0] as usize, 1)
    }
}

/// Opens the subtrees and sorts what is found: all roots, then the nodes with the largest surface,
/// so that the leaves of the upper part have similar sizes wherever they come from.
pub(super) fn build_upper(
    subtrees: &[Subtree<'_>],
    mut config: BuilderConfig,
    notes: &mut Vec<String>,
    progress: &Progress<'_>,
) -> Result<Upper, Stopped> {
    let triangles = subtrees.iter().map(|s| s.triangles as usize).filter(|&n| n >= LARGE_MESH);
    let count = triangles.sum::<usize>() / TRIANGLES_PER_OPENED;
    let of_roots: Vec<Vec<Opened>> = subtrees
        .par_iter()
        .enumerate()
        .map(|(member, s)| children(s, member as u32, ChildRef::node(s.base)).collect())
        .collect();
    let mut opened: Vec<Opened> = of_roots.into_iter().flatten().collect();
    let more = open_largest(subtrees, &mut opened, count);
    let refs = opened.iter().enumerate().map(|(i, o)| PrimRef::new(o.bounds, i as u32)).collect();
    config.sah.leaves = LeafCapacity::One;
    let tree = build_wide(refs, &OpenedWriter, config, notes, progress)?;
    Ok(Upper { tree, opened, replaced: subtrees.len() + more })
}

/// Replaces nodes in `opened` by their children, at most `count` of them and the one with the
/// largest surface first; returns how many.
fn open_largest(subtrees: &[Subtree<'_>], opened: &mut Vec<Opened>, count: usize) -> usize {
    // Surface as the bits of a float that is not negative, which sort like the float; of equal
    // ones the first, so that the result depends only on the input.
    let key = |i: usize, o: &Opened| {
        (!o.child.is_leaf()).then(|| (o.bounds.half_area().to_bits(), Reverse(i)))
    };
    let mut largest: BinaryHeap<(u32, Reverse<usize>)> =
        opened.iter().enumerate().filter_map(|(i, o)| key(i, o)).collect();
    let mut replaced = 0;
    while replaced < count {
        let Some((_, Reverse(i))) = largest.pop() else { break };
        let Opened { child, member, .. } = opened[i];
        let mut at = i;
        // The first child takes the place of its parent.
        for o in children(&subtrees[member as usize], member, child) {
            largest.extend(key(at, &o));
            if at == i {
                opened[i] = o
            } else {
                opened.push(o)
            }
            at = opened.len();
        }
        replaced += 1;
    }
    replaced
}

/// The children of a node inside a subtree. A node has at least one, but for the root of an empty
/// tree.
fn children<'s>(
    subtree: &'s Subtree<'_>,
    member: u32,
    node: ChildRef,
) -> impl Iterator<Item = Opened> + 's {
    let at = node.unit() - subtree.base;
    let node = &subtree.units[at..at + NODE_UNITS];
    let references = node[CHILD_ROW].bits().iter().map(|&bits| ChildRef(bits));
    let used = references.take_while(|&child| child != ChildRef::NONE).enumerate();
    used.map(move |(slot, child)| Opened { bounds: get_box(node, slot), child, member })
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
