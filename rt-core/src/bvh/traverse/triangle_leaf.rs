//! Test of a ray against the triangles of a leaf.

use super::single::{LeafTest, RaySetup, inflate_t};
use super::three;
use crate::bvh::intersect::watertight::{Candidate, Shear, test};
use crate::bvh::layout::triangles::{TRI_LEAF_UNITS, leaf_floats, leaf_triangle_ids, row};
use crate::bvh::layout::wide::{ChildRef, Unit};
use crate::bvh::query::{AnyHit, ClosestHit, TriangleTest};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x4, mask32x4};
use std::marker::PhantomData;

/// The closest hit so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClosestTri {
    pub(crate) t: f32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) prim: u32,
    pub(crate) found: bool,
}

/// Tests the four triangles of a leaf against a ray. Returns the candidate lanes, if any.
#[inline(always)]
fn test_leaf<S: Simd, T: TriangleTest>(
    simd: S,
    leaf: &[f32; 8 * TRI_LEAF_UNITS],
    ray: &RaySetup,
) -> Option<Candidate<f32x4<S>, mask32x4<S>>> {
    let Shear { kx, ky, kz, sx, sy, sz } = ray.shear;
    let axes = [kx, ky, kz];
    let o: [f32x4<S>; 3] = three!(|k| f32x4::splat(simd, ray.origin[axes[k]]));
    let a: [f32x4<S>; 3] = three!(|k| f32x4::from_slice(simd, row(leaf, axes[k])) - o[k]);
    let b: [f32x4<S>; 3] = three!(|k| f32x4::from_slice(simd, row(leaf, 3 + axes[k])) - o[k]);
    let c: [f32x4<S>; 3] = three!(|k| f32x4::from_slice(simd, row(leaf, 6 + axes[k])) - o[k]);
    let (sx, sy, sz) = (f32x4::splat(simd, sx), f32x4::splat(simd, sy), f32x4::splat(simd, sz));
    test::<S, f32x4<S>, T>(simd, a, b, c, sx, sy, sz)
}

#[derive(Clone, Copy)]
pub(crate) struct ClosestLeaf<'r, T: TriangleTest> {
    ray: &'r RaySetup,
    pub(crate) best: ClosestTri,
    test: PhantomData<T>,
}

impl<'r, T: TriangleTest> ClosestLeaf<'r, T> {
    /// Continues from a hit found elsewhere in the tree.
    #[inline(always)]
    pub(crate) fn continuing(ray: &'r RaySetup, best: ClosestTri) -> Self {
        ClosestLeaf { ray, best, test: PhantomData }
    }

    #[inline(always)]
    pub(crate) fn new(ray: &'r RaySetup, t_max: f32) -> Self {
        // Number 0 with t_max: nothing at exactly t_max can win the tie, so the range is half-open.
        let best = ClosestTri { t: t_max, u: 0.0, v: 0.0, prim: 0, found: false };
        ClosestLeaf::continuing(ray, best)
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for ClosestLeaf<'_, T> {
    type Query = ClosestHit;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        count(Counter::Primitives, 1);
        let floats = leaf_floats(units, leaf);
        let Some(c) = test_leaf::<S, T>(simd, floats, self.ray) else { return false };
        let in_range = c.inside
            & c.t.simd_ge(f32x4::splat(simd, self.ray.t_min))
            & c.t.simd_le(f32x4::splat(simd, self.best.t));
        let mut mask = in_range.to_bitmask() as u32;
        if mask == 0 {
            return false;
        }
        let (t, u, v) = (c.t.to_array(), c.u.to_array(), c.v.to_array());
        let ids = leaf_triangle_ids(floats);
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            let b = &mut self.best;
            if t[i] < b.t || (t[i] == b.t && ids[i] < b.prim) {
                *b = ClosestTri { t: t[i], u: u[i], v: v[i], prim: ids[i], found: true };
                *skip_t = inflate_t(t[i]);
            }
        }
        false
    }
}

#[derive(Clone, Copy)]
pub(crate) struct AnyLeaf<'r, T: TriangleTest> {
    ray: &'r RaySetup,
    t_max: f32,
    pub(crate) found: bool,
    test: PhantomData<T>,
}

impl<'r, T: TriangleTest> AnyLeaf<'r, T> {
    #[inline(always)]
    pub(crate) fn new(ray: &'r RaySetup, t_max: f32) -> Self {
        AnyLeaf { ray, t_max, found: false, test: PhantomData }
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for AnyLeaf<'_, T> {
    type Query = AnyHit;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        count(Counter::Primitives, 1);
        let Some(c) = test_leaf::<S, T>(simd, leaf_floats(units, leaf), self.ray) else {
            return false;
        };
        let hit = c.inside
            & c.t.simd_ge(f32x4::splat(simd, self.ray.t_min))
            & c.t.simd_lt(f32x4::splat(simd, self.t_max));
        self.found = hit.any_true();
        self.found
    }
}
