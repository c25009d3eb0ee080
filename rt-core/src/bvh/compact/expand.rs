//! A meshlet in the layout of the ordinary tree: the small tree at once, each leaf when a ray first
//! reaches it.

use super::bits;
use super::boxes::plane;
use super::coordinates::Coordinates;
use super::cut::MAX_LEAVES;
use super::meshlet::{HEADER_WORDS, Header, MAX_NODES, NODE, NONE};
use super::place::TrianglePlace;
use crate::bvh::layout::triangles::{TRI_LEAF_UNITS, leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, LEAF_SIZE, NODE_UNITS, Unit, WIDTH};
use fearless_simd::Simd;
use glam::Vec3;

const NODES: usize = NODE_UNITS * MAX_NODES;
const LEAVES: usize = TRI_LEAF_UNITS * MAX_LEAVES;

/// An expanded meshlet. References in its nodes lead to its own nodes and leaves.
pub(crate) struct Expanded {
    pub(crate) nodes: [Unit; NODES],
    pub(crate) leaves: ExpandedLeaves,
}

/// The leaves of an expanded meshlet, some of them not yet expanded.
pub(crate) struct ExpandedLeaves {
    units: [Unit; LEAVES],
    /// The leaves that are in `units`.
    present: u32,
    /// First triangle and last triangle of each leaf.
    triangles: [[u8; 2]; MAX_LEAVES],
    index_bits: u32,
    vertex_mask: u32,
    id_bits: u32,
    first_id: u32,
    /// Where vertex numbers and triangle numbers start, in bits.
    indices: usize,
    ids: usize,
    coordinates: [Coordinates; 3],
}

/// A reference to a leaf of an expanded meshlet.
fn leaf_reference(leaf: usize) -> ChildRef {
    ChildRef::leaf(TRI_LEAF_UNITS * leaf, LEAF_SIZE)
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
    pub(super) const EMPTY: Expanded = Expanded {
        nodes: [Unit::ZERO; NODES],
        leaves: ExpandedLeaves {
            units: [Unit::ZERO; LEAVES],
            present: 0,
            triangles: [[0; 2]; MAX_LEAVES],
            index_bits: 0,
            vertex_mask: 0,
            id_bits: 0,
            first_id: 0,
            indices: 0,
            ids: 0,
            coordinates: [Coordinates::EMPTY; 3],
        },
    };

    /// Expands the small tree of the meshlet at the start of `words`.
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
        let leaves = &mut self.leaves;
        leaves.present = 0;

        // ---- The nodes.
        let (origin, steps) = (header.lattice.origin, header.lattice.steps());
        let (mut at, mut next_node, mut next_leaf, mut triangle) = (HEADER_WORDS, 1, 0, 0u32);
        for node in self.nodes.chunks_exact_mut(NODE_UNITS).take(header.nodes as usize) {
            let kinds = words[at];
            let mut children = [ChildRef::NONE.0; WIDTH];
            let mut count = 0;
            for (slot, child) in children.iter_mut().enumerate() {
                let kind = kinds >> (4 * slot) & 15;
                if kind == NONE {
                    break;
                }
                count = slot + 1;
                if kind == NODE {
                    *child = ChildRef::node(NODE_UNITS * (next_node % MAX_NODES)).0;
                    next_node += 1;
                } else {
                    let leaf = next_leaf % MAX_LEAVES;
                    next_leaf += 1;
                    let last = triangle + (kind & 3);
                    *child = ChildRef::leaf(TRI_LEAF_UNITS * leaf, (kind & 3) as usize + 1).0;
                    leaves.triangles[leaf] = [triangle as u8, last as u8];
                    triangle = last + 1;
                }
            }
            let planes: &[u8] = bytemuck::cast_slice(&words[at + 1..]);
            for (row, unit) in node[..CHILD_ROW].iter_mut().enumerate() {
                let q = eight_bytes(planes, row * count);
                let (origin, step) = (origin[row / 2], steps[row / 2]);
                // Boxes of no child are empty: as in the ordinary tree.
                let empty = if row % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
                for (slot, (x, q)) in unit.0.iter_mut().zip(q).enumerate() {
                    *x = if slot < count { plane(origin, step, q) } else { empty };
                }
            }
            *node[CHILD_ROW].bits_mut() = children;
            at += 1 + (6 * count).div_ceil(4);
        }

        // ---- What leaves are read from.
        let triangles = header.triangles as usize;
        leaves.index_bits = header.index_bits;
        leaves.vertex_mask = (1 << header.index_bits) - 1;
        leaves.id_bits = header.id_bits;
        leaves.first_id = header.first_id;
        leaves.indices = 32 * at;
        leaves.ids = leaves.indices + 3 * triangles * header.index_bits as usize;
        let mut at = leaves.ids + triangles * header.id_bits as usize;
        for (coordinates, axis) in leaves.coordinates.iter_mut().zip(&header.axes) {
            (*coordinates, at) = Coordinates::at(axis, header.vertices, at);
        }
    }

    /// The units of the nodes, the units of the leaves.
    #[inline(always)]
    pub(crate) fn parts(&mut self) -> (&[Unit; NODES], &mut ExpandedLeaves) {
        (&self.nodes, &mut self.leaves)
    }
}

impl ExpandedLeaves {
    /// The units that hold `leaf`, which is expanded first where it is not. `words` start with the
    /// meshlet.
    #[inline(always)]
    pub(crate) fn with<S: Simd>(&mut self, simd: S, words: &[u32], leaf: ChildRef) -> &[Unit] {
        let number = leaf.unit() / TRI_LEAF_UNITS;
        if self.present >> number & 1 == 0 {
            self.expand(simd, words, number);
        }
        &self.units
    }

    /// The place of triangle `id` of the meshlet at `unit`, among the leaves that are expanded.
    #[inline(never)]
    pub(crate) fn place_of(&self, unit: usize, id: u32) -> TrianglePlace {
        for leaf in (0..MAX_LEAVES).filter(|leaf| self.present >> leaf & 1 == 1) {
            let ids = leaf_triangle_ids(leaf_floats(&self.units, leaf_reference(leaf)));
            if let Some(slot) = ids.iter().position(|&i| i == id) {
                return TrianglePlace::of_leaf(unit, leaf).in_slot(slot);
            }
        }
        TrianglePlace::NONE
    }

    /// The number and the corners of the triangle in a slot of a leaf. `None` when there is no such
    /// leaf.
    #[inline(always)]
    pub(crate) fn triangle<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
        leaf: usize,
        slot: usize,
    ) -> Option<(u32, [Vec3; 3])> {
        if leaf >= MAX_LEAVES || slot >= LEAF_SIZE {
            return None;
        }
        let reference = leaf_reference(leaf);
        let floats = leaf_floats(self.with(simd, words, reference), reference);
        let at = |corner: usize, axis: usize| floats[4 * (3 * corner + axis) + slot];
        let corner = |k: usize| Vec3::new(at(k, 0), at(k, 1), at(k, 2));
        Some((leaf_triangle_ids(floats)[slot], [corner(0), corner(1), corner(2)]))
    }

    /// The units with the leaves in `slots` of a row of references.
    #[inline(always)]
    pub(crate) fn with_many<S: Simd>(
        &mut self,
        simd: S,
        words: &[u32],
        refs: &[u32; WIDTH],
        mut slots: u32,
    ) -> &[Unit] {
        while slots != 0 {
            self.with(simd, words, ChildRef(refs[slots.trailing_zeros() as usize & 7]));
            slots &= slots - 1;
        }
        &self.units
    }

    #[inline(never)]
    fn expand<S: Simd>(&mut self, simd: S, words: &[u32], leaf: usize) {
        simd.vectorize(
            #[inline(always)]
            || self.expand_body(words, leaf),
        );
    }

    #[inline(always)]
    fn expand_body(&mut self, words: &[u32], leaf: usize) {
        let [first, last] = self.triangles[leaf].map(u32::from);
        let units = &mut self.units[TRI_LEAF_UNITS * leaf..][..TRI_LEAF_UNITS];
        let floats: &mut [f32] = bytemuck::cast_slice_mut(units);
        let floats: &mut [f32; 8 * TRI_LEAF_UNITS] = floats.try_into().expect("a leaf's units");
        let count = (last.saturating_sub(first) as usize + 1).min(LEAF_SIZE);
        // Copies: what is written cannot change them, so they need not be read again.
        let (coordinates, index_bits, mask) = (self.coordinates, self.index_bits, self.vertex_mask);
        let (indices, ids, id_bits, first_id) =
            (self.indices, self.ids, self.id_bits, self.first_id);
        // The three numbers together: 24 bits at most.
        let three = 3 * index_bits;
        for slot in 0..count {
            let triangle = first + slot as u32;
            let vertices = bits::read(words, indices + (triangle * three) as usize, three);
            for corner in 0..3 {
                let vertex = vertices >> (corner as u32 * index_bits) & mask;
                for axis in 0..3 {
                    floats[4 * (3 * corner + axis) + slot] = coordinates[axis].of(words, vertex);
                }
            }
            let at = ids + (triangle * id_bits) as usize;
            let id = first_id.wrapping_add(bits::read(words, at, id_bits));
            floats[36 + slot] = f32::from_bits(id);
        }
        // Unused slots repeat the last triangle, as in the ordinary tree.
        for row in floats.chunks_exact_mut(LEAF_SIZE) {
            for slot in count..LEAF_SIZE {
                row[slot] = row[count - 1];
            }
        }
        self.present |= 1 << leaf;
    }
}
