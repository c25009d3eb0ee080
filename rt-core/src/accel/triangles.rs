//! Triangles in leaves: four to a leaf, their vertices stored in it.

use super::blas::LocalFrame;
use super::build::{LeafWriter, MAX_PRIMS, PrimRef, build_wide};
use super::options::BuildQuality;
use super::wide::{ChildRef, LEAF_SIZE, Unit, WideBvh};
use crate::intersect::watertight::{Shear, test};
use crate::math::Aabb;
use crate::mesh::TriMesh;
use crate::ray::Ray;
use crate::stats::{Work, count};
use crate::traverse::packet::three;
use crate::traverse::single::{LeafTest, RaySetup, beyond, traverse_body};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x4};
use glam::Vec3;
use rayon::prelude::*;

/// Units of a leaf: nine rows of four floats (x, y, z of the first, second and third vertices) and a row of four triangle numbers.
pub(crate) const TRI_LEAF_UNITS: usize = 5;

/// Row `row` (0..=8) of a leaf: one coordinate of one vertex of the four triangles.
#[inline(always)]
pub(crate) fn row(leaf: &[f32; 8 * TRI_LEAF_UNITS], row: usize) -> &[f32] {
    &leaf[4 * row..4 * row + 4]
}

/// The leaf's floats.
#[inline(always)]
pub(crate) fn leaf_floats(units: &[Unit], leaf: ChildRef) -> &[f32; 8 * TRI_LEAF_UNITS] {
    let at = leaf.unit();
    let leaf: &[Unit; TRI_LEAF_UNITS] =
        units[at..at + TRI_LEAF_UNITS].try_into().expect("a slice of that length");
    bytemuck::cast_ref(leaf)
}

/// The four triangle numbers of a leaf; unused places repeat the last.
#[inline(always)]
pub(crate) fn leaf_ids(leaf: &[f32; 8 * TRI_LEAF_UNITS]) -> [u32; 4] {
    std::array::from_fn(|i| leaf[36 + i].to_bits())
}

/// Puts a mesh's triangles into leaves.
pub(crate) struct TriWriter<'m> {
    mesh: &'m TriMesh,
    frame: &'m LocalFrame,
    /// Positions are stored as they are.
    plain: bool,
}

impl<'m> TriWriter<'m> {
    pub(crate) fn new(mesh: &'m TriMesh, frame: &'m LocalFrame) -> Self {
        TriWriter { mesh, frame, plain: frame.center == mesh.origin && frame.scale == 1.0 }
    }
}

impl TriWriter<'_> {
    #[inline(always)]
    fn triangle(&self, i: u32) -> [Vec3; 3] {
        let [a, b, c] = self.mesh.indices[i as usize];
        let p = &self.mesh.positions;
        let corners = [p[a as usize], p[b as usize], p[c as usize]];
        if self.plain { corners } else { corners.map(|p| self.frame.local(self.mesh.origin, p)) }
    }
}

impl TriWriter<'_> {
    /// The box of a triangle, [`widened`]; empty when it cannot be built.
    #[inline(always)]
    pub(crate) fn bounds(&self, i: u32) -> Aabb {
        if !self.mesh.is_renderable(i as usize) {
            return Aabb::EMPTY;
        }
        let [a, b, c] = self.triangle(i);
        widened(Aabb::new(a.min(b).min(c), a.max(b).max(c)))
    }
}

impl LeafWriter for TriWriter<'_> {
    const UNITS: usize = TRI_LEAF_UNITS;

    fn write(&self, prims: &[u32], out: &mut [Unit]) {
        let floats: &mut [f32] = bytemuck::cast_slice_mut(out);
        let floats: &mut [f32; 8 * TRI_LEAF_UNITS] = floats.try_into().expect("a leaf's units");
        // Unused places, and triangles that a refit made unusable, are points: no area, never hit.
        let last = prims.len() - 1;
        for slot in 0..LEAF_SIZE {
            let id = prims[slot.min(last)];
            let mut corners = self.triangle(id);
            if slot > last {
                corners = [corners[0]; 3];
            }
            if !corners.iter().all(|p| p.is_finite()) {
                corners = [Vec3::ZERO; 3];
            }
            for (vertex, corner) in corners.iter().enumerate() {
                for axis in 0..3 {
                    floats[4 * (3 * vertex + axis) + slot] = corner[axis];
                }
            }
            floats[36 + slot] = f32::from_bits(id);
        }
    }
}

/// A primitive's box, wider by 2⁻²⁰ of its largest extent.
///
/// The triangle test rounds the corners after the shear: an edge moves by up to 5·2⁻²⁴ of the triangle's extent (7 with the box's own rounding),
/// which next to a ray that starts close to a large triangle is far more than the slack of the slab test. The test's decision is consistent, its
/// neighbour across the edge leaves the ray to it; so a box that stands exactly on the edge must not say no. (Measured on a cube, rays from 10⁻⁶
/// to 1 of its size off an edge, aimed 10⁻⁹ to 10⁻⁶ beside it: 68 of 454,656 were lost to tight boxes.)
///
/// Always wider than the corners, so that a ray in the plane of a box's side meets the box whatever the sign of a zero in its direction.
#[inline]
pub(crate) fn widened(b: Aabb) -> Aabb {
    let margin = b.extent().max_element() * (8.0 * f32::EPSILON);
    let lo = (b.min - margin).to_array().map(f32::next_down);
    let hi = (b.max + margin).to_array().map(f32::next_up);
    Aabb::new(Vec3::from_array(lo), Vec3::from_array(hi))
}

/// A hierarchy over a mesh's triangles, in the mesh's object space.
#[derive(Clone)]
pub(crate) struct TriBvh {
    pub(crate) bvh: WideBvh,
    pub(crate) skipped: usize,
    pub(crate) notes: Vec<String>,
}

impl TriBvh {
    pub(crate) fn build(mesh: &TriMesh, frame: &LocalFrame, quality: BuildQuality) -> TriBvh {
        debug_assert!(mesh.indices.len() < MAX_PRIMS, "checked by the caller");
        let writer = TriWriter::new(mesh, frame);
        // Nearly always every triangle can be built: collect in place and throw out the few others afterwards.
        let mut refs: Vec<PrimRef> = (0..mesh.indices.len() as u32)
            .into_par_iter()
            .with_min_len(1 << 14)
            .map(|i| PrimRef::new(writer.bounds(i), i))
            .collect();
        refs.retain(|r| !r.is_empty());
        let skipped = mesh.indices.len() - refs.len();
        let mut notes = Vec::new();
        TriBvh { bvh: build_wide(refs, &writer, quality.recipe(), &mut notes), skipped, notes }
    }

    /// The closest hit of a local-space ray. Set-up and traversal in one body: called once per ray, the call chain around a traversal used to take
    /// two fifths of the time.
    #[inline(never)]
    pub(crate) fn closest<S: Simd, const EXACT: bool>(&self, simd: S, ray: &Ray) -> ClosestTri {
        simd.vectorize(
            #[inline(always)]
            || {
                let setup = RaySetup::new(ray);
                let mut leaves = ClosestLeaf::<EXACT>::new(&setup, ray.t_max);
                traverse_body::<S, _, true>(simd, &self.bvh, &setup, ray.t_max, &mut leaves);
                leaves.best
            },
        )
    }

    /// Whether anything blocks a local-space ray.
    #[inline(never)]
    pub(crate) fn occluded<S: Simd, const EXACT: bool>(&self, simd: S, ray: &Ray) -> bool {
        simd.vectorize(
            #[inline(always)]
            || {
                let setup = RaySetup::new(ray);
                let mut leaves = AnyLeaf::<EXACT>::new(&setup, ray.t_max);
                traverse_body::<S, _, false>(simd, &self.bvh, &setup, ray.t_max, &mut leaves);
                leaves.found
            },
        )
    }
}

/// The closest triangle so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClosestTri {
    pub(crate) t: f32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) prim: u32,
    pub(crate) found: bool,
}

/// The four triangles of a leaf against a ray: candidate lanes, if any.
#[inline(always)]
fn test_leaf<S: Simd, const EXACT: bool>(
    simd: S,
    leaf: &[f32; 8 * TRI_LEAF_UNITS],
    ray: &RaySetup,
) -> Option<crate::intersect::watertight::Candidate<f32x4<S>, fearless_simd::mask32x4<S>>> {
    let Shear { kx, ky, kz, sx, sy, sz } = ray.shear;
    let axes = [kx, ky, kz];
    let o: [f32x4<S>; 3] = three!(|k| f32x4::splat(simd, ray.origin[axes[k]]));
    let a: [f32x4<S>; 3] = three!(|k| f32x4::from_slice(simd, row(leaf, axes[k])) - o[k]);
    let b: [f32x4<S>; 3] = three!(|k| f32x4::from_slice(simd, row(leaf, 3 + axes[k])) - o[k]);
    let c: [f32x4<S>; 3] = three!(|k| f32x4::from_slice(simd, row(leaf, 6 + axes[k])) - o[k]);
    let (sx, sy, sz) = (f32x4::splat(simd, sx), f32x4::splat(simd, sy), f32x4::splat(simd, sz));
    test::<S, f32x4<S>, EXACT>(simd, a, b, c, sx, sy, sz)
}

#[derive(Clone, Copy)]
pub(crate) struct ClosestLeaf<'r, const EXACT: bool> {
    ray: &'r RaySetup,
    pub(crate) best: ClosestTri,
}

impl<'r, const EXACT: bool> ClosestLeaf<'r, EXACT> {
    /// Goes on from a hit found elsewhere in the tree.
    #[inline(always)]
    pub(crate) fn continuing(ray: &'r RaySetup, best: ClosestTri) -> Self {
        ClosestLeaf { ray, best }
    }

    #[inline(always)]
    fn new(ray: &'r RaySetup, t_max: f32) -> Self {
        // Number 0 with t_max: nothing at exactly t_max can win the tie, which makes the range half-open.
        ClosestLeaf { ray, best: ClosestTri { t: t_max, u: 0.0, v: 0.0, prim: 0, found: false } }
    }
}

impl<S: Simd, const EXACT: bool> LeafTest<S> for ClosestLeaf<'_, EXACT> {
    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        count(Work::Primitives, 1);
        let floats = leaf_floats(units, leaf);
        let Some(c) = test_leaf::<S, EXACT>(simd, floats, self.ray) else { return false };
        let in_range = c.inside
            & c.t.simd_ge(f32x4::splat(simd, self.ray.t_min))
            & c.t.simd_le(f32x4::splat(simd, self.best.t));
        let mut mask = in_range.to_bitmask() as u32;
        if mask == 0 {
            return false;
        }
        let (t, u, v) = (c.t.to_array(), c.u.to_array(), c.v.to_array());
        let ids = leaf_ids(floats);
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            let b = &mut self.best;
            if t[i] < b.t || (t[i] == b.t && ids[i] < b.prim) {
                *b = ClosestTri { t: t[i], u: u[i], v: v[i], prim: ids[i], found: true };
                *skip_t = beyond(t[i]);
            }
        }
        false
    }
}

#[derive(Clone, Copy)]
pub(crate) struct AnyLeaf<'r, const EXACT: bool> {
    ray: &'r RaySetup,
    t_max: f32,
    pub(crate) found: bool,
}

impl<'r, const EXACT: bool> AnyLeaf<'r, EXACT> {
    #[inline(always)]
    pub(crate) fn new(ray: &'r RaySetup, t_max: f32) -> Self {
        AnyLeaf { ray, t_max, found: false }
    }
}

impl<S: Simd, const EXACT: bool> LeafTest<S> for AnyLeaf<'_, EXACT> {
    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        count(Work::Primitives, 1);
        let Some(c) = test_leaf::<S, EXACT>(simd, leaf_floats(units, leaf), self.ray) else { return false };
        let hit = c.inside
            & c.t.simd_ge(f32x4::splat(simd, self.ray.t_min))
            & c.t.simd_lt(f32x4::splat(simd, self.t_max));
        self.found = hit.any_true();
        self.found
    }
}
