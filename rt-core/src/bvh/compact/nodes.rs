//! The nodes of a meshlet, as they are stored.
//!
//! A ray tests the boxes of a node from their bytes: the eight of a row become floats with three
//! instructions, and most rays of ambient occlusion see two nodes of a far meshlet and none of the
//! rest. (Measured with nodes that were expanded first and kept: a sixth of such rays' time went
//! into expanding nodes.)

use super::meshlet::{HEADER_WORDS, MAX_NODES};
use crate::bvh::layout::wide::WIDTH;
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};

/// Where a node starts, and the first of what it names: its word (16 bits), node, leaf, and
/// triangle (8 each), added to at once.
#[derive(Debug, Clone, Copy, PartialEq)]
struct NodeStart(u64);

/// The children of a node: for each, the lowest of the four bits that have its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Children {
    pub(super) count: u32,
    pub(super) nodes: u32,
    pub(super) leaves: u32,
}

impl Children {
    /// The children of these kinds, up to the first that is none.
    #[inline(always)]
    pub(super) fn of(kinds: u32) -> Children {
        const EACH: u32 = 0x1111_1111;
        let none = kinds & kinds >> 1 & kinds >> 2 & kinds >> 3 & EACH;
        let count = none.trailing_zeros() / 4;
        let there = EACH & ((1u64 << (4 * count)) - 1) as u32;
        let nodes = kinds >> 3 & there;
        Children { count, nodes, leaves: there & !nodes }
    }

    /// The slots of the children, a bit each.
    #[inline(always)]
    fn slots(self) -> u32 {
        (1 << self.count) - 1
    }
}

/// The lowest bits of each four, without gaps.
#[inline(always)]
fn without_gaps(each: u32) -> u32 {
    let two = (each | each >> 3) & 0x0303_0303;
    let four = (two | two >> 6) & 0x000f_000f;
    (four | four >> 12) & 0xff
}

impl NodeStart {
    /// The root of a small tree.
    const ROOT: NodeStart = NodeStart::new(HEADER_WORDS as u32, 1, 0, 0);

    #[inline(always)]
    const fn new(word: u32, node: u32, leaf: u32, triangle: u32) -> NodeStart {
        NodeStart(word as u64 | (node as u64) << 16 | (leaf as u64) << 24 | (triangle as u64) << 32)
    }

    #[inline(always)]
    fn word(self) -> usize {
        self.0 as usize & 0xffff
    }

    #[inline(always)]
    fn node(self) -> usize {
        (self.0 >> 16) as usize & 0xff
    }

    #[inline(always)]
    fn leaf(self) -> usize {
        (self.0 >> 24) as usize & 0xff
    }

    #[inline(always)]
    fn triangle(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Where the next node starts.
    #[inline(always)]
    fn next(self, kinds: u32) -> NodeStart {
        let Children { count, nodes, leaves } = Children::of(kinds);
        let words = 1 + (6 * count).div_ceil(4);
        let triangles = triangles_of(kinds, leaves);
        let next = NodeStart::new(words, nodes.count_ones(), leaves.count_ones(), triangles);
        NodeStart(self.0.wrapping_add(next.0))
    }
}

/// The words of the planes of eight children. As many follow the kinds of every node.
pub(super) const PLANE_WORDS: usize = 6 * WIDTH / 4;

/// The nodes of the meshlet at the start of `words`.
pub(crate) struct Nodes<'u, 's> {
    words: &'u [u32],
    starts: &'s mut NodeStarts,
    /// How many of the starts are known.
    known: usize,
}

/// Room for where the nodes of a meshlet start: kept from one to the next, because most rays need
/// one or two of the places.
#[derive(Clone, Copy)]
pub(crate) struct NodeStarts([NodeStart; MAX_NODES]);

impl NodeStarts {
    pub(crate) const fn new() -> NodeStarts {
        NodeStarts([NodeStart::ROOT; MAX_NODES])
    }
}

/// A node of a meshlet.
pub(crate) struct Node<'u> {
    planes: &'u [u32; PLANE_WORDS],
    start: NodeStart,
    kinds: u32,
    children: Children,
}

impl<'u, 's> Nodes<'u, 's> {
    #[inline(always)]
    pub(crate) fn new(words: &'u [u32], starts: &'s mut NodeStarts) -> Nodes<'u, 's> {
        Nodes { words, starts, known: 1 }
    }

    /// The origin of the boxes' lattice, and its steps.
    #[inline(always)]
    pub(crate) fn lattice(&self) -> ([f32; 3], [f32; 3]) {
        let words: &[u32; HEADER_WORDS] = self.words.first_chunk().expect("a meshlet's header");
        // The exponents are stored as those of floats are.
        let step = |a: usize| f32::from_bits((words[2] >> (8 * a) & 255) << 23);
        ([words[3], words[4], words[5]].map(f32::from_bits), [step(0), step(1), step(2)])
    }

    /// A node. Where it starts depends on all before it.
    #[inline(always)]
    pub(crate) fn node(&mut self, number: usize) -> Node<'u> {
        let number = number.min(MAX_NODES - 1);
        while self.known <= number {
            let last = self.starts.0[self.known - 1];
            self.starts.0[self.known] = last.next(self.words[last.word()]);
            self.known += 1;
        }
        let start = self.starts.0[number];
        let at = start.word();
        let kinds = self.words[at];
        let planes = self.words[at + 1..].first_chunk().expect("words behind every node");
        Node { planes, start, kinds, children: Children::of(kinds) }
    }
}

impl Node<'_> {
    /// The slots of children, a bit each.
    #[inline(always)]
    pub(crate) fn slots(&self) -> u32 {
        self.children.slots()
    }

    /// The slots of leaves, a bit each.
    #[inline(always)]
    pub(crate) fn leaf_slots(&self) -> u32 {
        without_gaps(self.children.leaves)
    }

    /// The planes of a row of the children's boxes, in the order of the ordinary node. Nothing in
    /// them belongs to slots without a child.
    #[inline(always)]
    pub(crate) fn planes<S: Simd>(&self, simd: S, row: usize, origin: f32, step: f32) -> f32x8<S> {
        let bytes: &[u8; 4 * PLANE_WORDS] = bytemuck::cast_ref(self.planes);
        // Of eight rows, the last starts at byte 40.
        let first = (row * self.children.count as usize).min(4 * PLANE_WORDS - WIDTH);
        let q: [u8; WIDTH] = bytes[first..first + WIDTH].try_into().expect("a row");
        let mut numbers = [0.0; WIDTH];
        for (x, q) in numbers.iter_mut().zip(q) {
            *x = f32::from(q);
        }
        // Fused where there is an instruction for it: the coder of boxes knows both.
        let step = f32x8::splat(simd, step);
        f32x8::from_slice(simd, &numbers).mul_add(step, f32x8::splat(simd, origin))
    }

    /// The number of the node in `slot`.
    #[inline(always)]
    pub(crate) fn node_in(&self, slot: usize) -> usize {
        let before = self.children.nodes & before(slot);
        self.start.node() + before.count_ones() as usize
    }

    /// The leaf in `slot`: its number, its first triangle and its last one.
    #[inline(always)]
    pub(crate) fn leaf_in(&self, slot: usize) -> (usize, u32, u32) {
        let leaves = self.children.leaves & before(slot);
        let number = self.start.leaf() + leaves.count_ones() as usize;
        let first = self.start.triangle() + triangles_of(self.kinds, leaves);
        (number, first, first + (self.kinds >> (4 * slot) & 3))
    }
}

/// The bits of the children before `slot`.
#[inline(always)]
fn before(slot: usize) -> u32 {
    (1 << (4 * slot)) - 1
}

/// The triangles of these leaves, of which the lowest two bits have their number less one.
#[inline(always)]
fn triangles_of(kinds: u32, leaves: u32) -> u32 {
    leaves.count_ones() + (kinds & leaves).count_ones() + 2 * (kinds >> 1 & leaves).count_ones()
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
            let start = NodeStart::new(11, 1, 2, 5);
            let leaves = all[..count].iter().filter(|&&kind| kind != NODE);
            let triangles: u32 = leaves.clone().map(|kind| kind + 1).sum();
            let leaves = leaves.count();
            let words = 1 + (6 * count).div_ceil(4);
            let expected = NodeStart::new(
                11 + words as u32,
                1 + (count - leaves) as u32,
                2 + leaves as u32,
                5 + triangles,
            );
            assert_eq!(start.next(kinds), expected, "{kinds:08x}");
        }
    }
}
