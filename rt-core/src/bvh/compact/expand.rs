//! A meshlet in the layout of the ordinary tree: each leaf when a ray first reaches it, and all
//! nodes together when a packet does. A single ray reads [nodes as they are stored](super::nodes).

use super::expand_leaf::ExpandedLeaves;
use super::meshlet::{Header, MAX_NODES};
use super::nodes::{NodeStarts, Nodes};
use crate::bvh::layout::triangles::TRI_LEAF_UNITS;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, Unit};
use fearless_simd::{Simd, SimdBase};
use glam::Vec3;

const NODES: usize = NODE_UNITS * MAX_NODES;

/// An expanded meshlet. References in its nodes lead to its own nodes and leaves.
pub(crate) struct Expanded {
    nodes: [Unit; NODES],
    has_nodes: bool,
    count: usize,
    pub(crate) leaves: ExpandedLeaves,
}

impl Expanded {
    pub(super) const EMPTY: Expanded = Expanded {
        nodes: [Unit::ZERO; NODES],
        has_nodes: false,
        count: 0,
        leaves: ExpandedLeaves::EMPTY,
    };

    /// Takes the meshlet at the start of `words`, nothing of which is expanded yet.
    #[inline(never)]
    pub(super) fn load<S: Simd>(&mut self, simd: S, words: &[u32]) {
        simd.vectorize(
            #[inline(always)]
            || {
                let header = Header::read(words);
                self.has_nodes = false;
                self.count = (header.nodes as usize).min(MAX_NODES);
                self.leaves.load(&header);
            },
        );
    }

    /// The units of all nodes, and the leaves. `words` start with the meshlet.
    #[inline(always)]
    pub(crate) fn with_all_nodes<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
    ) -> (&[Unit; NODES], &mut ExpandedLeaves) {
        if !self.has_nodes {
            self.expand_nodes(simd, words);
        }
        (&self.nodes, &mut self.leaves)
    }

    /// The number and the corners of the triangle in a slot of a leaf. `None` when there is no such
    /// leaf. `words` start with the meshlet.
    #[inline(always)]
    pub(crate) fn triangle<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
        leaf: usize,
        slot: usize,
    ) -> Option<(u32, [Vec3; 3])> {
        if !self.leaves.has(leaf) {
            // The node that names it says which triangles it has.
            self.with_all_nodes(simd, words);
        }
        self.leaves.triangle(simd, words, leaf, slot)
    }

    #[inline(never)]
    fn expand_nodes<S: Simd>(&mut self, simd: S, words: &[u32]) {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut starts = NodeStarts::new();
                let mut nodes = Nodes::new(words, &mut starts);
                let (origin, steps) = nodes.lattice();
                for number in 0..self.count {
                    let node = nodes.node(number);
                    let units = &mut self.nodes[NODE_UNITS * number..][..NODE_UNITS];

                    // ---- Planes. Boxes of no child are empty: as in the ordinary tree.
                    let (there, leaves) = (node.slots(), node.leaf_slots());
                    for (row, unit) in units[..CHILD_ROW].iter_mut().enumerate() {
                        let planes =
                            node.planes(simd, row, origin[row / 2], steps[row / 2]).to_array();
                        let empty = if row % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
                        for (slot, (x, plane)) in unit.0.iter_mut().zip(planes).enumerate() {
                            *x = if there >> slot & 1 == 1 { plane } else { empty };
                        }
                    }

                    // ---- References.
                    for (slot, child) in units[CHILD_ROW].bits_mut().iter_mut().enumerate() {
                        *child = if leaves >> slot & 1 == 1 {
                            let (leaf, first, last) = node.leaf_in(slot);
                            self.leaves.set_triangles(leaf, first, last);
                            ChildRef::leaf(TRI_LEAF_UNITS * leaf, (last - first) as usize + 1)
                        } else if there >> slot & 1 == 1 {
                            ChildRef::node(NODE_UNITS * node.node_in(slot).min(MAX_NODES - 1))
                        } else {
                            ChildRef::NONE
                        }
                        .0;
                    }
                }
                self.has_nodes = true;
            },
        );
    }
}
