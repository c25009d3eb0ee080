//! The leaves of an expanded meshlet.

use super::bits;
use super::cut::MAX_LEAVES;
use super::meshlet::{Header, Sections};
use super::place::TrianglePlace;
use super::triangle_numbers::TriangleNumbers;
use crate::bvh::layout::triangles::{TRI_LEAF_UNITS, leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{ChildRef, LEAF_SIZE, Unit};
use fearless_simd::Simd;
use glam::Vec3;

const LEAVES: usize = TRI_LEAF_UNITS * MAX_LEAVES;
/// Corners of the triangles of a leaf.
const CORNERS: usize = 3 * LEAF_SIZE;

/// The leaves of an expanded meshlet, some of them not yet expanded.
pub(crate) struct ExpandedLeaves {
    units: [Unit; LEAVES],
    /// The leaves that are in `units`, and those of them that have the numbers of their triangles.
    present: u32,
    numbered: u32,
    /// First triangle and last triangle of each leaf that a ray has reached, or an expanded node
    /// names.
    triangles: [[u8; 2]; MAX_LEAVES],
    coding: LeafCoding,
}

/// How the triangles of a meshlet are coded.
struct LeafCoding {
    index_bits: u32,
    numbers: TriangleNumbers,
    sections: Sections,
}

type LeafFloats = [f32; 8 * TRI_LEAF_UNITS];

/// A reference to a leaf of an expanded meshlet.
fn leaf_reference(leaf: usize) -> ChildRef {
    ChildRef::leaf(TRI_LEAF_UNITS * leaf, LEAF_SIZE)
}

impl ExpandedLeaves {
    pub(super) const EMPTY: ExpandedLeaves = ExpandedLeaves {
        units: [Unit::ZERO; LEAVES],
        present: 0,
        numbered: 0,
        triangles: [[0; 2]; MAX_LEAVES],
        coding: LeafCoding {
            index_bits: 0,
            numbers: TriangleNumbers::EMPTY,
            sections: Sections::EMPTY,
        },
    };

    /// Takes the leaves of a meshlet.
    #[inline(always)]
    pub(super) fn load(&mut self, header: &Header) {
        (self.present, self.numbered) = (0, 0);
        let &Header { index_bits, numbers, .. } = header;
        self.coding = LeafCoding { index_bits, numbers, sections: header.sections() };
    }

    /// Notes which triangles a leaf has.
    #[inline(always)]
    pub(super) fn set_triangles(&mut self, leaf: usize, first: u32, last: u32) {
        self.triangles[leaf.min(MAX_LEAVES - 1)] = [first as u8, last as u8];
    }

    /// The units that hold `leaf`, which a node that is expanded names. It is expanded first where
    /// it is not. `words` start with the meshlet.
    #[inline(always)]
    pub(crate) fn with<S: Simd>(&mut self, simd: S, words: &[u32], leaf: ChildRef) -> &[Unit] {
        let number = leaf.unit() / TRI_LEAF_UNITS;
        if self.numbered >> number & 1 == 0 {
            self.expand::<S, true>(simd, words, number);
        }
        &self.units
    }

    /// A reference to leaf `number` with these triangles, which is expanded first where it is not.
    /// It has their count: whoever asks for all hits must not get the last triangle four times.
    /// Their numbers are there with `NUMBERS`; else they may not be.
    #[inline(always)]
    pub(crate) fn leaf<S: Simd, const NUMBERS: bool>(
        &mut self,
        simd: S,
        words: &[u32],
        number: usize,
        first: u32,
        last: u32,
    ) -> ChildRef {
        let number = number.min(MAX_LEAVES - 1);
        let present = if NUMBERS { self.numbered } else { self.present };
        if present >> number & 1 == 0 {
            self.set_triangles(number, first, last);
            self.expand::<S, NUMBERS>(simd, words, number);
        }
        ChildRef::leaf(TRI_LEAF_UNITS * number, (last - first) as usize + 1)
    }

    /// The units that hold the expanded leaves.
    #[inline(always)]
    pub(crate) fn units(&self) -> &[Unit] {
        &self.units
    }

    /// The place of triangle `id` of the meshlet at `unit`, among the leaves that are expanded.
    #[inline(never)]
    pub(crate) fn place_of(&self, unit: usize, id: u32) -> TrianglePlace {
        for leaf in (0..MAX_LEAVES).filter(|leaf| self.numbered >> leaf & 1 == 1) {
            let ids = leaf_triangle_ids(leaf_floats(&self.units, leaf_reference(leaf)));
            if let Some(slot) = ids.iter().position(|&i| i == id) {
                return TrianglePlace::of_leaf(unit, leaf).in_slot(slot);
            }
        }
        TrianglePlace::NONE
    }

    /// Whether a leaf is expanded.
    #[inline(always)]
    pub(super) fn has(&self, leaf: usize) -> bool {
        leaf < MAX_LEAVES && self.present >> leaf & 1 == 1
    }

    /// The number and the corners of the triangle in a slot of a leaf whose node is expanded.
    /// `None` when there is no such leaf.
    #[inline(always)]
    pub(super) fn triangle<S: Simd>(
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

    #[inline(always)]
    fn expand<S: Simd, const NUMBERS: bool>(&mut self, simd: S, words: &[u32], leaf: usize) {
        let units = &mut self.units[TRI_LEAF_UNITS * leaf..][..TRI_LEAF_UNITS];
        let floats: &mut [f32] = bytemuck::cast_slice_mut(units);
        let floats: &mut LeafFloats = floats.try_into().expect("a leaf's units");
        self.coding.expand::<S, NUMBERS>(simd, words, self.triangles[leaf], floats);
        self.present |= 1 << leaf;
        self.numbered |= u32::from(NUMBERS) << leaf;
    }
}

impl LeafCoding {
    /// Expands the leaf with these first and last triangles.
    // A function of its own, whose arguments overlap nowhere: what is written need not be read
    // again.
    #[inline(never)]
    fn expand<S: Simd, const NUMBERS: bool>(
        &self,
        simd: S,
        words: &[u32],
        ends: [u8; 2],
        floats: &mut LeafFloats,
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.expand_body::<NUMBERS>(words, ends, floats),
        );
    }

    #[inline(always)]
    fn expand_body<const NUMBERS: bool>(
        &self,
        words: &[u32],
        ends: [u8; 2],
        floats: &mut LeafFloats,
    ) {
        let &LeafCoding { index_bits, ref numbers, ref sections } = self;
        let [first, last] = ends.map(u32::from);

        // ---- Triangles: one read each. Unused slots repeat the last triangle, as in the ordinary
        // tree.
        let vertex_mask = (1 << index_bits) - 1;
        let mut starts = [0; CORNERS];
        for slot in 0..LEAF_SIZE {
            let number = (first + slot as u32).min(last);
            let triangle =
                bits::read_57(words, sections.triangles + (number * sections.triangle) as usize);
            for corner in 0..3 {
                let vertex = (triangle >> (corner as u32 * index_bits)) as u32 & vertex_mask;
                starts[LEAF_SIZE * corner + slot] =
                    sections.vertices + (vertex * sections.vertex) as usize;
            }
            if NUMBERS {
                let id = numbers.read(words, sections.groups, triangle >> (3 * index_bits));
                floats[4 * 9 + slot] = f32::from_bits(id);
            }
        }

        // ---- Corners: one read each, where 64 bits suffice.
        let mut vertices = [0; CORNERS];
        if sections.vertex <= bits::SHORT_READ {
            for (vertex, at) in vertices.iter_mut().zip(starts) {
                *vertex = bits::read_57(words, at);
            }
        } else {
            for (vertex, at) in vertices.iter_mut().zip(starts) {
                *vertex = bits::read_64(words, at);
            }
        }
        for axis in 0..3 {
            if axis == 2 && !sections.one_read() {
                for (vertex, at) in vertices.iter_mut().zip(starts) {
                    *vertex = bits::read_64(words, at + sections.before_z as usize);
                }
            }
            let coordinates = &sections.coordinates[axis];
            let row = match sections.edge {
                Some(edge) => edge.coordinates(words, &vertices, axis, coordinates),
                None => coordinates.of(words, &vertices),
            };
            for corner in 0..3 {
                floats[4 * (3 * corner + axis)..][..LEAF_SIZE]
                    .copy_from_slice(&row[LEAF_SIZE * corner..][..LEAF_SIZE]);
            }
        }
    }
}
