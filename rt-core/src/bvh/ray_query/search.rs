//! The search for hits that the caller accepts: as for all hits, but a hit counts only once it is
//! accepted. In types of its own, so that other queries keep their code.

use super::Accept;
use crate::bvh::Unit;
use crate::bvh::blas::Content;
use crate::bvh::entry::Entry;
use crate::bvh::instance_filter::InstanceFilter;
use crate::bvh::layout::id_leaf::leaf_primitive_ids;
use crate::bvh::layout::triangles::{leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::{ClosestHit, TriangleTest};
use crate::bvh::traverse::meshlets;
use crate::bvh::traverse::single::{LeafTest, RaySetup, inflate_t, traverse};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{ClosestTri, test_leaf};
use crate::bvh::world::World;
use crate::ray::{Hit, Ray};
use crate::shapes::Shape;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x4};
use std::marker::PhantomData;

/// A search through the upper level.
pub(super) struct AcceptedHits<'w, T> {
    world: &'w World,
    ray: Ray,
    /// What the caller's `t` is in units of the ray's.
    unit: f32,
    filter: InstanceFilter<'w>,
    accept: Accept<'w>,
    /// Whether any accepted hit will do.
    any: bool,
    best: Option<Hit>,
    test: PhantomData<T>,
}

impl<'w, T: TriangleTest> AcceptedHits<'w, T> {
    pub(super) fn new(
        world: &'w World,
        ray: Ray,
        unit: f32,
        filter: InstanceFilter<'w>,
        accept: Accept<'w>,
        any: bool,
    ) -> Self {
        AcceptedHits { world, ray, unit, filter, accept, any, best: None, test: PhantomData }
    }

    pub(super) fn find<S: Simd>(mut self, simd: S) -> Option<Hit> {
        let world = self.world;
        match world.only {
            Some(id) if !world.allows(self.filter, id) => {}
            Some(id) => {
                let entry = world.entry(id);
                if entry.placement().accepts(&self.ray) {
                    self.search_tree(simd, entry, &{ self.ray }, 0.0, &mut 0.0);
                } else {
                    self.search_entry(simd, entry, &mut 0.0);
                }
            }
            None => {
                let (setup, t_max) = (RaySetup::new(&self.ray), self.ray.t_max);
                traverse(simd, &TreeView::all(&world.tlas), &setup, t_max, &mut self);
            }
        }
        self.best
    }

    /// Searches an entry for what is nearer than the best so far, or as near.
    fn search_entry<S: Simd>(&mut self, simd: S, entry: Entry<'_>, skip_t: &mut f32) {
        // One ulp past the best so far: a tie may go to this entry.
        let limit = self.best.map_or(self.ray.t_max, |b| b.t.next_up());
        let mut local = Ray::UNSET;
        let moved = entry.placement().enter(&self.ray, limit, &mut local);
        if local.t_max > local.t_min {
            self.search_tree(simd, entry, &local, moved, skip_t);
        }
    }

    /// Searches an entry with a ray in its space, whose origin was `moved` along the ray.
    fn search_tree<S: Simd>(
        &mut self,
        simd: S,
        entry: Entry<'_>,
        ray: &Ray,
        moved: f64,
        skip_t: &mut f32,
    ) {
        let owner = |id: u32| match entry {
            Entry::Group(group) => group.owner(id),
            Entry::Instance { number, .. } => (number, id),
        };
        let world_t = |t: f32| if moved == 0.0 { t } else { (t as f64 + moved) as f32 };
        let accepts = |c: &ClosestTri| {
            let (instance, prim) = owner(c.prim);
            (self.accept)(&Hit { t: world_t(c.t) * self.unit, u: c.u, v: c.v, prim, instance })
        };
        let (any, setup) = (self.any, RaySetup::new(ray));
        let best = ClosestTri { t: ray.t_max, u: 0.0, v: 0.0, prim: 0, found: false };
        let found = match (entry.triangles(self.filter), entry) {
            (Some(tree), _) => {
                let mut leaves = TriangleLeaf::<T> {
                    ray: &setup,
                    best,
                    any,
                    accepts: &accepts,
                    test: PhantomData,
                };
                if tree.meshlets() != 0 {
                    meshlets::search(simd, &tree, &setup, ray.t_max, leaves).best
                } else {
                    traverse(simd, &tree, &setup, ray.t_max, &mut leaves);
                    leaves.best
                }
            }
            (None, Entry::Instance { blas, .. }) => {
                let Content::Shape { bvh, shape } = &blas.content else { return };
                let mut leaves =
                    ShapeLeaf { shape: &**shape, ray: *ray, best, any, accepts: &accepts };
                traverse(simd, &TreeView::all(bvh), &setup, ray.t_max, &mut leaves);
                leaves.best
            }
            (None, Entry::Group(_)) => return,
        };
        if !found.found {
            return;
        }
        let (instance, prim) = owner(found.prim);
        let hit = Hit { t: world_t(found.t), u: found.u, v: found.v, prim, instance };
        let better = |b: Hit| hit.t < b.t || (hit.t == b.t && hit.instance < b.instance);
        if self.best.is_none_or(better) {
            self.best = Some(hit);
            *skip_t = inflate_t(hit.t);
        }
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for AcceptedHits<'_, T> {
    type Query = ClosestHit;

    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        if let Some(entry) = self.world.entry_of_leaf(units, leaf, self.filter) {
            self.search_entry(simd, entry, skip_t);
        }
        self.any && self.best.is_some()
    }
}

/// Whether a hit in a tree, with the tree's own numbers, counts.
type AcceptLocal<'a> = &'a dyn Fn(&ClosestTri) -> bool;

struct TriangleLeaf<'a, T> {
    ray: &'a RaySetup,
    best: ClosestTri,
    any: bool,
    accepts: AcceptLocal<'a>,
    test: PhantomData<T>,
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for TriangleLeaf<'_, T> {
    type Query = ClosestHit;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        let floats = leaf_floats(units, leaf);
        let Some(c) = test_leaf::<S, T>(simd, floats, self.ray) else { return false };
        let in_range = c.inside
            & c.t.simd_ge(f32x4::splat(simd, self.ray.t_min))
            & c.t.simd_le(f32x4::splat(simd, self.best.t));
        // Unused slots repeat a triangle.
        let mut mask = in_range.to_bitmask() as u32 & ((1 << leaf.count()) - 1);
        if mask == 0 {
            return false;
        }
        let (t, u, v) = (c.t.to_array(), c.u.to_array(), c.v.to_array());
        let ids = leaf_triangle_ids(floats);
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            let hit = ClosestTri { t: t[i], u: u[i], v: v[i], prim: ids[i], found: true };
            if take(&mut self.best, hit, self.accepts, skip_t) && self.any {
                return true;
            }
        }
        false
    }
}

struct ShapeLeaf<'a> {
    shape: &'a dyn Shape,
    ray: Ray,
    best: ClosestTri,
    any: bool,
    accepts: AcceptLocal<'a>,
}

impl<S: Simd> LeafTest<S> for ShapeLeaf<'_> {
    type Query = ClosestHit;

    fn test(&mut self, _: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        for &prim in leaf_primitive_ids(units, leaf) {
            // Up to and including the best so far: a tie goes to the lower number.
            let mut rest = Ray { t_max: self.best.t.next_up(), ..self.ray };
            while let Some(h) = self.shape.closest(prim, &rest) {
                let hit = ClosestTri { t: h.t, u: h.u, v: h.v, prim, found: true };
                if take(&mut self.best, hit, self.accepts, skip_t) {
                    if self.any {
                        return true;
                    }
                    break;
                }
                let behind = h.t.next_up();
                // A shape that answers before its range must not be asked for ever.
                if behind <= rest.t_min || behind >= rest.t_max {
                    break;
                }
                rest.t_min = behind;
            }
        }
        false
    }
}

/// Makes `hit` the best when it is nearer, or as near with a lower number, and accepted; returns
/// whether it is.
fn take(
    best: &mut ClosestTri,
    hit: ClosestTri,
    accepts: AcceptLocal<'_>,
    skip_t: &mut f32,
) -> bool {
    let nearer = hit.t < best.t || (hit.t == best.t && hit.prim < best.prim);
    if !nearer || !accepts(&hit) {
        return false;
    }
    *best = hit;
    *skip_t = inflate_t(hit.t);
    true
}
