//! A meshlet in the layout of the ordinary tree: each node and each leaf when a ray first reaches
//! it. Most rays of ambient occlusion see two nodes of a far meshlet, and none of the rest.

use super::boxes::plane;
use super::cut::MAX_LEAVES;
use super::expand_leaf::ExpandedLeaves;
use super::meshlet::{HEADER_WORDS, Header, MAX_NODES};
use crate::bvh::layout::triangles::TRI_LEAF_UNITS;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, Unit, WIDTH};
use fearless_simd::Simd;
use glam::Vec3;

const NODES: usize = NODE_UNITS * MAX_NODES;

/// An expanded meshlet. References in its nodes lead to its own nodes and leaves.
pub(crate) struct Expanded {
    nodes: ExpandedNodes,
    pub(crate) leaves: ExpandedLeaves,
}

/// The nodes of an expanded meshlet, some of them not yet expanded.
pub(crate) struct ExpandedNodes {
    units: [Unit; NODES],
    /// The nodes that are in `units`.
    present: u32,
    starts: [NodeStart; MAX_NODES],
    count: usize,
    origin: [f32; 3],
    steps: [f32; 3],
}

/// Where a node starts, and the first of what it names.
#[derive(Debug, Clone, Copy, PartialEq)]
struct NodeStart {
    word: u16,
    node: u8,
    leaf: u8,
    triangle: u8,
}

/// The children of a node: for each, the lowest of the four bits that have its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Children {
    count: u32,
    nodes: u32,
    leaves: u32,
}

impl Children {
    /// The children of these kinds, up to the first that is none.
    #[inline(always)]
    fn of(kinds: u32) -> Children {
        const EACH: u32 = 0x1111_1111;
        let none = kinds & kinds >> 1 & kinds >> 2 & kinds >> 3 & EACH;
        let count = none.trailing_zeros() / 4;
        let there = EACH & ((1u64 << (4 * count)) - 1) as u32;
        let nodes = kinds >> 3 & there;
        Children { count, nodes, leaves: there & !nodes }
    }
}

impl NodeStart {
    const ZERO: NodeStart = NodeStart { word: 0, node: 0, leaf: 0, triangle: 0 };

    /// Where the next node starts.
    #[inline(always)]
    fn next(self, kinds: u32) -> NodeStart {
        let Children { count, nodes, leaves } = Children::of(kinds);
        // Of a leaf, the lowest two bits have its triangles less one.
        let triangles = leaves.count_ones()
            + (kinds & leaves).count_ones()
            + 2 * (kinds >> 1 & leaves).count_ones();
        NodeStart {
            word: self.word + 1 + (6 * count).div_ceil(4) as u16,
            node: self.node.wrapping_add(nodes.count_ones() as u8),
            leaf: self.leaf.wrapping_add(leaves.count_ones() as u8),
            triangle: self.triangle.wrapping_add(triangles as u8),
        }
    }
}

/// Eight bytes from `at` on, whatever they belong to; zeros where there are fewer. A copy of a
/// length that only the meshlet knows would be a call for each row of each node.
#[inline(always)]
fn eight_bytes(bytes: &[u8], at: usize) -> [u8; WIDTH] {
    let rest = bytes.get(at..).unwrap_or(&[]);
    match rest.first_chunk() {
        Some(eight) => *eight,
        None => {
            let mut eight = [0; WIDTH];
            eight[..rest.len()].copy_from_slice(rest);
            eight
        }
    }
}

impl Expanded {
    pub(super) const EMPTY: Expanded =
        Expanded { nodes: ExpandedNodes::EMPTY, leaves: ExpandedLeaves::EMPTY };

    /// Takes the meshlet at the start of `words`, nothing of which is expanded yet.
    #[inline(never)]
    pub(super) fn load<S: Simd>(&mut self, simd: S, words: &[u32]) {
        simd.vectorize(
            #[inline(always)]
            || self.load_body(words),
        );
    }

    #[inline(always)]
    fn load_body(&mut self, words: &[u32]) {
        let header = Header::read(words);
        let nodes = &mut self.nodes;
        nodes.present = 0;
        nodes.count = (header.nodes as usize).min(MAX_NODES);
        (nodes.origin, nodes.steps) = (header.lattice.origin, header.lattice.steps());
        let mut start = NodeStart { word: HEADER_WORDS as u16, node: 1, leaf: 0, triangle: 0 };
        for place in nodes.starts.iter_mut().take(nodes.count) {
            *place = start;
            start = start.next(words[usize::from(start.word)]);
        }
        self.leaves.load(&header, usize::from(start.word));
    }

    /// The nodes, the leaves.
    #[inline(always)]
    pub(crate) fn parts(&mut self) -> (&mut ExpandedNodes, &mut ExpandedLeaves) {
        (&mut self.nodes, &mut self.leaves)
    }

    /// The units of all nodes, and the leaves. `words` start with the meshlet.
    #[inline(always)]
    pub(crate) fn with_all_nodes<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
    ) -> (&[Unit; NODES], &mut ExpandedLeaves) {
        for number in 0..self.nodes.count {
            self.nodes.with(simd, words, NODE_UNITS * number, &mut self.leaves);
        }
        (&self.nodes.units, &mut self.leaves)
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
}

impl ExpandedNodes {
    const EMPTY: ExpandedNodes = ExpandedNodes {
        units: [Unit::ZERO; NODES],
        present: 0,
        starts: [NodeStart::ZERO; MAX_NODES],
        count: 0,
        origin: [0.0; 3],
        steps: [0.0; 3],
    };

    /// The node at unit `at`, which is expanded first where it is not. `words` start with the
    /// meshlet, `leaves` are its.
    #[inline(always)]
    pub(crate) fn with<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
        at: usize,
        leaves: &mut ExpandedLeaves,
    ) -> &[Unit; NODE_UNITS] {
        let number = at / NODE_UNITS;
        if self.present >> number & 1 == 0 {
            self.expand(simd, words, number, leaves);
        }
        self.units[at..at + NODE_UNITS].try_into().expect("a slice of that length")
    }

    #[inline(never)]
    fn expand<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
        number: usize,
        leaves: &mut ExpandedLeaves,
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.expand_body(words, number, leaves),
        );
    }

    #[inline(always)]
    fn expand_body(&mut self, words: &[u32], number: usize, leaves: &mut ExpandedLeaves) {
        let start = self.starts[number];
        let at = usize::from(start.word);
        let kinds = words[at];
        let there = Children::of(kinds);
        let (mut node, mut leaf, mut triangle) =
            (usize::from(start.node), usize::from(start.leaf), u32::from(start.triangle));
        let units = &mut self.units[NODE_UNITS * number..][..NODE_UNITS];

        // ---- Planes.
        let count = there.count as usize;
        let planes: &[u8] = bytemuck::cast_slice(&words[at + 1..]);
        let (origin, steps) = (self.origin, self.steps);
        for (row, unit) in units[..CHILD_ROW].iter_mut().enumerate() {
            let q = eight_bytes(planes, row * count);
            let (origin, step) = (origin[row / 2], steps[row / 2]);
            // Boxes of no child are empty: as in the ordinary tree.
            let empty = if row % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
            for (slot, (x, q)) in unit.0.iter_mut().zip(q).enumerate() {
                *x = if slot < count { plane(origin, step, q) } else { empty };
            }
        }

        // ---- References. Which child is a leaf is unpredictable, so this has no branches.
        let children = units[CHILD_ROW].bits_mut();
        for (slot, child) in children.iter_mut().enumerate() {
            let kind = kinds >> (4 * slot);
            let is_leaf = there.leaves >> (4 * slot) & 1 == 1;
            let is_node = there.nodes >> (4 * slot) & 1 == 1;
            let last = triangle + (kind & 3);
            let to_leaf =
                ChildRef::leaf(TRI_LEAF_UNITS * (leaf % MAX_LEAVES), (kind & 3) as usize + 1);
            let to_node = ChildRef::node(NODE_UNITS * (node % MAX_NODES));
            *child = if is_leaf {
                to_leaf
            } else if is_node {
                to_node
            } else {
                ChildRef::NONE
            }
            .0;
            leaves.set_triangles(if is_leaf { leaf } else { MAX_LEAVES }, triangle, last);
            triangle = if is_leaf { last + 1 } else { triangle };
            leaf += usize::from(is_leaf);
            node += usize::from(is_node);
        }
        self.present |= 1 << number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::compact::meshlet::{NODE, NONE};
    use crate::test_shapes::Random;

    #[test]
    fn kinds_of_children_are_counted_as_one_by_one() {
        let mut r = Random::new(6);
        for _ in 0..2000 {
            let count = r.bits() as usize % 9;
            let all: Vec<u32> =
                (0..WIDTH)
                    .map(|slot| {
                        if slot < count { [0, 1, 2, 3, NODE][r.bits() as usize % 5] } else { NONE }
                    })
                    .collect();
            let kinds = all.iter().rev().fold(0, |word, kind| word << 4 | kind);
            let start = NodeStart { word: 11, node: 1, leaf: 2, triangle: 5 };
            let leaves = all[..count].iter().filter(|&&kind| kind != NODE);
            let triangles: u32 = leaves.clone().map(|kind| kind + 1).sum();
            let expected = NodeStart {
                word: 11 + 1 + (6 * count).div_ceil(4) as u16,
                node: 1 + (count - leaves.clone().count()) as u8,
                leaf: 2 + leaves.count() as u8,
                triangle: 5 + triangles as u8,
            };
            assert_eq!(start.next(kinds), expected, "{kinds:08x}");
        }
    }
}
