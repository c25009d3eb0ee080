//! Builds the tree of f32 boxes, and leaves for the filter.

use super::frame::Frame;
use super::input::MeshF64;
use crate::bvh::build::{PrimRef, UNWATCHED, build_wide};
use crate::bvh::layout::wide::{ChildRef, LEAF_SIZE, LeafWriter, Unit, WideBvh};
use crate::bvh::options::BuildQuality;
use crate::simd::prefetch;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Units of a leaf: nine rows of four floats (x, y, z of the first, second and third vertices, in
/// local space) and a row of four triangle numbers.
pub(super) const LEAF_UNITS: usize = 5;

/// A leaf's floats.
pub(super) type LeafFloats = [f32; 8 * LEAF_UNITS];

/// The floats of `leaf`.
#[inline(always)]
pub(super) fn leaf_floats(units: &[Unit], leaf: ChildRef) -> &LeafFloats {
    let at = leaf.unit();
    let leaf: &[Unit; LEAF_UNITS] =
        units[at..at + LEAF_UNITS].try_into().expect("a slice of that length");
    bytemuck::cast_ref(leaf)
}

/// The number of the triangle in slot `slot` of a leaf.
#[inline(always)]
pub(super) fn leaf_number(leaf: &LeafFloats, slot: usize) -> u32 {
    leaf[36 + (slot & 3)].to_bits()
}

/// The triangles of all meshes, numbered one mesh after the other.
#[derive(Clone)]
pub(super) struct Numbered {
    pub(super) meshes: Vec<Arc<MeshF64>>,
    /// The number of each mesh's first triangle, and of all triangles.
    first: Vec<u32>,
}

impl Numbered {
    /// The caller has checked that the numbers fit.
    pub(super) fn new(meshes: Vec<Arc<MeshF64>>) -> Self {
        let mut first = vec![0];
        for mesh in &meshes {
            first.push(first[first.len() - 1] + mesh.indices.len() as u32);
        }
        Numbered { meshes, first }
    }

    /// Number of all triangles, including those that cannot be hit.
    pub(super) fn len(&self) -> u32 {
        self.first[self.meshes.len()]
    }

    /// The mesh of a triangle, and its number there.
    #[inline]
    pub(super) fn place(&self, number: u32) -> (u32, u32) {
        if self.meshes.len() == 1 {
            return (0, number);
        }
        // The last mesh that starts at or before it: empty meshes start where the next one does.
        let mesh = self.first.partition_point(|&first| first <= number) - 1;
        (mesh as u32, number - self.first[mesh])
    }

    /// Requests a triangle's indices from memory.
    #[inline(always)]
    pub(super) fn prefetch_indices(&self, number: u32) {
        let (mesh, prim) = self.place(number);
        if let Some(mesh) = self.meshes.get(mesh as usize) {
            prefetch::<1, _>(&mesh.indices, prim as usize);
        }
    }

    /// Requests a triangle's corners from memory. Reads its indices.
    #[inline(always)]
    pub(super) fn prefetch_corners(&self, number: u32) {
        let (mesh, prim) = self.place(number);
        let Some(mesh) = self.meshes.get(mesh as usize) else { return };
        for vertex in mesh.indices.get(prim as usize).into_iter().flatten() {
            prefetch::<1, _>(&mesh.positions, *vertex as usize);
        }
    }

    /// The corners of a triangle; `None` when it cannot be hit.
    #[inline]
    pub(super) fn corners(&self, number: u32) -> Option<[DVec3; 3]> {
        let (mesh, prim) = self.place(number);
        self.meshes.get(mesh as usize)?.triangle(prim as usize)
    }
}

/// The tree, its frame, and how many triangles cannot be hit.
pub(super) struct Tree {
    pub(super) bvh: WideBvh,
    pub(super) frame: Frame,
    /// Smallest and largest corner of the world; `None` without triangles.
    pub(super) bounds: Option<(DVec3, DVec3)>,
    pub(super) skipped: usize,
    pub(super) notes: Vec<String>,
}

/// Builds the tree of all triangles.
pub(super) fn build_tree(triangles: &Numbered, quality: BuildQuality) -> Tree {
    let grow = |bounds: Option<(DVec3, DVec3)>, (lo, hi): (DVec3, DVec3)| match bounds {
        None => Some((lo, hi)),
        Some((min, max)) => Some((min.min(lo), max.max(hi))),
    };
    let numbers = || (0..triangles.len()).into_par_iter().with_min_len(1 << 14);
    let bounds = numbers()
        .filter_map(|i| triangles.corners(i))
        .fold(|| None, |all, [a, b, c]| grow(all, (a.min(b).min(c), a.max(b).max(c))))
        .reduce(|| None, |x, y| y.map_or(x, |y| grow(x, y)));
    let (min, max) = bounds.unwrap_or_default();
    let frame = Frame::of(min, max);
    let refs: Vec<PrimRef> = numbers()
        .filter_map(|i| Some(PrimRef::new(frame.bounds(triangles.corners(i)?), i)))
        .collect();
    let skipped = triangles.len() as usize - refs.len();
    let mut notes = Vec::new();
    let writer = FilterLeaves { triangles, frame: &frame };
    let bvh = build_wide(refs, &writer, quality.config(), &mut notes, &UNWATCHED)
        .expect("nobody stops this build");
    Tree { bvh, frame, bounds, skipped, notes }
}

/// Writes leaves of corners rounded to f32.
struct FilterLeaves<'a> {
    triangles: &'a Numbered,
    frame: &'a Frame,
}

impl LeafWriter for FilterLeaves<'_> {
    const UNITS: usize = LEAF_UNITS;

    fn write(&self, prims: &[u32], out: &mut [Unit]) {
        let floats: &mut [f32] = bytemuck::cast_slice_mut(out);
        let last = prims.len() - 1;
        // Unused slots repeat the last triangle; the leaf test leaves them out.
        for slot in 0..LEAF_SIZE {
            let number = prims[slot.min(last)];
            let corners = self.triangles.corners(number).unwrap_or_default();
            for (vertex, corner) in corners.into_iter().enumerate() {
                let local = self.frame.corner(corner);
                for axis in 0..3 {
                    floats[4 * (3 * vertex + axis) + slot] = local[axis];
                }
            }
            floats[36 + slot] = f32::from_bits(number);
        }
    }
}
