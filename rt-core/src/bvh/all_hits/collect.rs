//! Visits every leaf that a ray reaches, in the upper level and in the entries' trees.

use crate::bvh::Unit;
use crate::bvh::blas::Content;
use crate::bvh::entry::Entry;
use crate::bvh::instance_filter::InstanceFilter;
use crate::bvh::intersect::crossing::crosses;
use crate::bvh::layout::id_leaf::leaf_primitive_ids;
use crate::bvh::layout::triangles::{leaf_floats, leaf_triangle_ids, row};
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::{AnyHit, WatertightTest};
use crate::bvh::traverse::meshlets;
use crate::bvh::traverse::single::{LeafTest, RaySetup, traverse};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::test_leaf;
use crate::bvh::world::World;
use crate::ray::{Hit, Ray};
use crate::shapes::Shape;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x4};

/// The search for all hits of a ray.
pub(super) struct Crossings<'w, F> {
    world: &'w World,
    ray: Ray,
    /// Takes a hit, and returns true when it wants no more.
    found: F,
    over: bool,
}

impl<'w, F: FnMut(Hit) -> bool> Crossings<'w, F> {
    pub(super) fn new(world: &'w World, ray: Ray, found: F) -> Self {
        Crossings { world, ray, found, over: false }
    }

    pub(super) fn find<S: Simd>(mut self, simd: S) {
        let world = self.world;
        match world.only {
            Some(id) => self.search_entry(simd, world.entry(id)),
            None => {
                let (setup, t_max) = (RaySetup::new(&self.ray), self.ray.t_max);
                traverse(simd, &TreeView::all(&world.tlas), &setup, t_max, &mut self);
            }
        }
    }

    fn search_entry<S: Simd>(&mut self, simd: S, entry: Entry<'_>) {
        let mut ray = Ray::UNSET;
        let moved = entry.placement().enter(&self.ray, self.ray.t_max, &mut ray);
        if ray.t_max <= ray.t_min {
            return;
        }
        let (found, over) = (&mut self.found, &mut self.over);
        let mut take = |hit: Hit| {
            let t = if moved == 0.0 { hit.t } else { (hit.t as f64 + moved) as f32 };
            *over = found(Hit { t, ..hit });
            *over
        };
        let setup = RaySetup::new(&ray);
        match entry {
            Entry::Group(group) => {
                let found = |hit: Hit| {
                    let (instance, prim) = group.owner(hit.prim);
                    take(Hit { prim, instance, ..hit })
                };
                let mut leaves = TriangleCrossings { ray: &setup, t_max: ray.t_max, found };
                let tree = group.tree(InstanceFilter::All);
                traverse(simd, &tree, &setup, ray.t_max, &mut leaves);
            }
            Entry::Instance { number, blas, .. } => {
                let found = |hit: Hit| take(Hit { instance: number, ..hit });
                match &blas.content {
                    Content::Triangles(tris) => {
                        let mut leaves = TriangleCrossings { ray: &setup, t_max: ray.t_max, found };
                        let tree = TreeView::all(&tris.bvh);
                        traverse(simd, &tree, &setup, ray.t_max, &mut leaves);
                    }
                    Content::Compact(tree) => {
                        let leaves = TriangleCrossings { ray: &setup, t_max: ray.t_max, found };
                        let tree = TreeView::of_meshlets(tree);
                        meshlets::search(simd, &tree, &setup, ray.t_max, leaves);
                    }
                    Content::Shape { bvh, shape } => {
                        let mut leaves = ShapeCrossings { shape: &**shape, ray, found };
                        traverse(simd, &TreeView::all(bvh), &setup, ray.t_max, &mut leaves);
                    }
                    // Rays reach a member through its group.
                    Content::Member { .. } => {}
                }
            }
        }
    }
}

impl<S: Simd, F: FnMut(Hit) -> bool> LeafTest<S> for Crossings<'_, F> {
    type Query = AnyHit;

    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        if let Some(entry) = self.world.entry_of_leaf(units, leaf, InstanceFilter::All) {
            self.search_entry(simd, entry);
        }
        self.over
    }
}

/// Hits with triangles; their instance is left to the taker.
struct TriangleCrossings<'r, F> {
    ray: &'r RaySetup,
    t_max: f32,
    found: F,
}

impl<S: Simd, F: FnMut(Hit) -> bool> LeafTest<S> for TriangleCrossings<'_, F> {
    type Query = AnyHit;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        let floats = leaf_floats(units, leaf);
        let ray = self.ray;
        let Some(c) = test_leaf::<S, WatertightTest>(simd, floats, ray) else { return false };
        let in_range = c.inside
            & c.t.simd_ge(f32x4::splat(simd, ray.t_min))
            & c.t.simd_lt(f32x4::splat(simd, self.t_max));
        let mut mask = in_range.to_bitmask() as u32;
        if mask == 0 {
            return false;
        }
        let (t, u, v) = (c.t.to_array(), c.u.to_array(), c.v.to_array());
        let ids = leaf_triangle_ids(floats);
        // Unused slots repeat a triangle.
        mask &= (1 << leaf.count()) - 1;
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            let corners =
                [0, 1, 2].map(|vertex| [0, 1, 2].map(|axis| row(floats, 3 * vertex + axis)[i]));
            if crosses(corners, ray.origin, &ray.shear)
                && (self.found)(Hit { t: t[i], u: u[i], v: v[i], prim: ids[i], instance: 0 })
            {
                return true;
            }
        }
        false
    }
}

/// Hits with other shapes: each primitive is asked again behind its last hit.
struct ShapeCrossings<'a, F> {
    shape: &'a dyn Shape,
    ray: Ray,
    found: F,
}

impl<S: Simd, F: FnMut(Hit) -> bool> LeafTest<S> for ShapeCrossings<'_, F> {
    type Query = AnyHit;

    fn test(&mut self, _: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        for &prim in leaf_primitive_ids(units, leaf) {
            let mut rest = self.ray;
            while let Some(h) = self.shape.closest(prim, &rest) {
                if (self.found)(Hit { t: h.t, u: h.u, v: h.v, prim, instance: 0 }) {
                    return true;
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
