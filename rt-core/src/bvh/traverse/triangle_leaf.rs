//! Test of a ray against the triangles of a leaf.

use super::single::{LeafTest, RaySetup, inflate_t};
use super::three;
use crate::bvh::intersect::watertight::{Candidate, Shear, test};
use crate::bvh::layout::triangles::{TRI_LEAF_UNITS, leaf_floats, leaf_triangle_ids, row};
use crate::bvh::layout::wide::{ChildRef, Unit, WIDTH};
use crate::bvh::query::{AnyHit, ClosestHit, TriangleTest};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x4, f32x8, mask32x4, mask32x8};
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

type LeafFloats = [f32; 8 * TRI_LEAF_UNITS];

/// Tests the four triangles of a leaf against a ray. Returns the candidate lanes, if any.
#[inline(always)]
pub(crate) fn test_leaf<S: Simd, T: TriangleTest>(
    simd: S,
    leaf: &LeafFloats,
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

/// Tests the triangles of two leaves against a ray, the first leaf's in the low lanes.
#[inline(always)]
pub(crate) fn test_two_leaves<S: Simd, T: TriangleTest>(
    simd: S,
    leaves: [&LeafFloats; 2],
    ray: &RaySetup,
) -> Option<Candidate<f32x8<S>, mask32x8<S>>> {
    let Shear { kx, ky, kz, sx, sy, sz } = ray.shear;
    let axes = [kx, ky, kz];
    let o: [f32x8<S>; 3] = three!(|k| f32x8::splat(simd, ray.origin[axes[k]]));
    let a: [f32x8<S>; 3] = three!(|k| both_rows(simd, leaves, axes[k]) - o[k]);
    let b: [f32x8<S>; 3] = three!(|k| both_rows(simd, leaves, 3 + axes[k]) - o[k]);
    let c: [f32x8<S>; 3] = three!(|k| both_rows(simd, leaves, 6 + axes[k]) - o[k]);
    let (sx, sy, sz) = (f32x8::splat(simd, sx), f32x8::splat(simd, sy), f32x8::splat(simd, sz));
    test::<S, f32x8<S>, T>(simd, a, b, c, sx, sy, sz)
}

/// Row `r` of two leaves, the first leaf's in the low lanes.
#[inline(always)]
pub(crate) fn both_rows<S: Simd>(simd: S, leaves: [&LeafFloats; 2], r: usize) -> f32x8<S> {
    let [first, second] = [row(leaves[0], r), row(leaves[1], r)];
    simd.combine_f32x4(f32x4::from_slice(simd, first), f32x4::from_slice(simd, second))
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
    const TOGETHER: bool = true;

    #[inline(always)]
    fn closest(&self) -> Option<u32> {
        if self.best.found { Some(self.best.prim) } else { None }
    }

    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        mut leaves: u32,
        skip_t: &mut f32,
    ) -> bool {
        loop {
            let first = ChildRef(refs[leaves.trailing_zeros() as usize & 7]);
            leaves &= leaves - 1;
            // A leaf alone is tested twice: no branch on the number of leaves.
            let second = refs[leaves.trailing_zeros() as usize & 7];
            let second = if leaves == 0 { first } else { ChildRef(second) };
            leaves &= leaves.wrapping_sub(1);
            count(Counter::Primitives, 2);
            let floats = [leaf_floats(units, first), leaf_floats(units, second)];
            if let Some(c) = test_two_leaves::<S, T>(simd, floats, self.ray) {
                let in_range = c.inside
                    & c.t.simd_ge(f32x8::splat(simd, self.ray.t_min))
                    & c.t.simd_le(f32x8::splat(simd, self.best.t));
                let mut mask = in_range.to_bitmask() as u32;
                if mask != 0 {
                    let (t, u, v) = (c.t.to_array(), c.u.to_array(), c.v.to_array());
                    while mask != 0 {
                        let i = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        let id = leaf_triangle_ids(floats[i >> 2])[i & 3];
                        let b = &mut self.best;
                        if t[i] < b.t || (t[i] == b.t && id < b.prim) {
                            *b = ClosestTri { t: t[i], u: u[i], v: v[i], prim: id, found: true };
                            *skip_t = inflate_t(t[i]);
                        }
                    }
                }
            }
            if leaves == 0 {
                return false;
            }
        }
    }

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
    const TOGETHER: bool = true;
    const NUMBERS: bool = false;

    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        mut leaves: u32,
        _: &mut f32,
    ) -> bool {
        loop {
            let first = ChildRef(refs[leaves.trailing_zeros() as usize & 7]);
            leaves &= leaves - 1;
            // A leaf alone is tested twice: no branch on the number of leaves.
            let second = refs[leaves.trailing_zeros() as usize & 7];
            let second = if leaves == 0 { first } else { ChildRef(second) };
            leaves &= leaves.wrapping_sub(1);
            count(Counter::Primitives, 2);
            let floats = [leaf_floats(units, first), leaf_floats(units, second)];
            if let Some(c) = test_two_leaves::<S, T>(simd, floats, self.ray) {
                let hit = c.inside
                    & c.t.simd_ge(f32x8::splat(simd, self.ray.t_min))
                    & c.t.simd_lt(f32x8::splat(simd, self.t_max));
                if hit.any_true() {
                    self.found = true;
                    return true;
                }
            }
            if leaves == 0 {
                return false;
            }
        }
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::layout::local_frame::LocalFrame;
    use crate::bvh::layout::triangles::TriWriter;
    use crate::bvh::layout::wide::LeafWriter;
    use crate::bvh::query::{FastTest, WatertightTest};
    use crate::mesh::TriMesh;
    use crate::ray::Ray;
    use crate::test_shapes::Random;
    use fearless_simd::{Level, dispatch};
    use glam::{DVec3, Vec3};

    /// The leaf of `n` triangles around the origin, and their mesh.
    fn leaf(n: u32) -> (LeafFloats, TriMesh) {
        let mut r = Random::new(u64::from(n));
        let positions = (0..3 * n).map(|_| r.direction()).collect();
        let mesh = TriMesh::new(positions, (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect());
        let frame = LocalFrame { center: DVec3::ZERO, scale: 1.0 };
        let mut units = [Unit::ZERO; TRI_LEAF_UNITS];
        let ids: Vec<u32> = (0..n).collect();
        TriWriter::new(mesh.triangles(), &frame, 0).write(&ids, &mut units);
        (bytemuck::cast(units), mesh)
    }

    #[test]
    fn unused_slots_never_pass_the_edge_test_of_a_ray_that_misses() {
        for n in 1..=3 {
            let (floats, _) = leaf(n);
            dispatch!(Level::new(), simd => {
                for k in 0..100 {
                    let away = Vec3::new(10.0 + k as f32, 0.3, -0.2);
                    let ray = RaySetup::new(&Ray::new(away, Vec3::new(0.1, 1.0, 0.05)));
                    // As points, they passed with three zeros, and the slow exact products decided.
                    assert!(test_leaf::<_, FastTest>(simd, &floats, &ray).is_none());
                    assert!(test_leaf::<_, WatertightTest>(simd, &floats, &ray).is_none());
                    let two = [&floats, &floats];
                    assert!(test_two_leaves::<_, WatertightTest>(simd, two, &ray).is_none());
                }
            });
        }
    }

    #[test]
    fn two_leaves_together_have_the_bits_of_each_alone() {
        let [(first, _), (second, _)] = [leaf(4), leaf(3)];
        let mut r = Random::new(9);
        let mut hits = 0;
        dispatch!(Level::new(), simd => {
            for _ in 0..2000 {
                let origin = r.direction() * 3.0;
                let ray = RaySetup::new(&Ray::new(origin, r.direction() * 0.5 - origin));
                let both = test_two_leaves::<_, WatertightTest>(simd, [&first, &second], &ray);
                for (half, floats) in [&first, &second].into_iter().enumerate() {
                    let one = test_leaf::<_, WatertightTest>(simd, floats, &ray);
                    for i in 0..4 {
                        let alone = one.as_ref().filter(|c| c.inside.to_bitmask() >> i & 1 == 1);
                        let lane = 4 * half + i;
                        let pair = both.as_ref().filter(|c| c.inside.to_bitmask() >> lane & 1 == 1);
                        let bits = |t: f32, u: f32, v: f32| [t, u, v].map(f32::to_bits);
                        let alone = alone.map(|c| {
                            bits(c.t.to_array()[i], c.u.to_array()[i], c.v.to_array()[i])
                        });
                        let pair = pair.map(|c| {
                            bits(c.t.to_array()[lane], c.u.to_array()[lane], c.v.to_array()[lane])
                        });
                        assert_eq!(alone, pair, "leaf {half}, triangle {i}");
                        hits += alone.is_some() as u32;
                    }
                }
            }
        });
        assert!(hits > 100, "{hits} hits");
    }
}
