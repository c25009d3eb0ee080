//! Blocks of sixteen rays in any direction through a compact tree: together near the root, and
//! through a meshlet that several of them meet one after the other, so that it is expanded once.

use super::Meshlets;
use crate::bvh::Unit;
use crate::bvh::compact::{MeshletCache, TrianglePlace, with_cache};
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, STACK_SIZE};
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::block_boxes::BlockSetup;
use crate::bvh::traverse::single::{LeafTest, RaySetup, inflate_t, traverse_from};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, f32x16};
use std::marker::PhantomData;

/// With this many rays or fewer, each goes on alone.
const MAX_SINGLE_RAYS: u32 = 4;

/// A subtree and the rays that hit its box.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Entry {
    /// For the order of visits, smallest first: the distance of one of the rays to the box. For
    /// occlusion, minus the number of rays that reach it.
    order: f32,
    child: u32,
    rays: u16,
}

/// Traces blocks of rays and writes the results into `hits`, as long as `rays` (for occlusion,
/// `prim` is 0 where something blocks the ray). `places` gets where the closest triangles lie, for
/// as many blocks as it has rows.
#[inline(never)]
pub(crate) fn trace_blocks<S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    tree: &TreeView<'_>,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    instance: u32,
    places: &mut [[TrianglePlace; LANES]],
) {
    with_cache(|cache| {
        simd.vectorize(
            #[inline(always)]
            || {
                for (b, (rays, hits)) in rays.iter().zip(hits).enumerate() {
                    let places = places.get_mut(b);
                    let key = tree.meshlets();
                    let (t, active) = (rays.t_max, rays.active_lanes());
                    let kind = PhantomData::<(T, Q)>;
                    let mut block =
                        Block { tree, cache, key, t, active, hits, places, instance, kind };
                    block.trace(simd, rays);
                }
            },
        );
    });
}

/// A block on its way through the tree.
struct Block<'a, T, Q> {
    tree: &'a TreeView<'a>,
    cache: &'a mut MeshletCache,
    key: u64,
    /// Distances of the closest hits so far.
    t: [f32; LANES],
    /// Lanes that still search for a hit.
    active: u16,
    hits: &'a mut HitBlock,
    places: Option<&'a mut [TrianglePlace; LANES]>,
    instance: u32,
    kind: PhantomData<(T, Q)>,
}

impl<T: TriangleTest, Q: HitQuery> Block<'_, T, Q> {
    #[inline(always)]
    fn trace<S: Simd>(&mut self, simd: S, rays: &RayBlock) {
        let tree = self.tree;
        let block = BlockSetup::new(simd, rays);
        let setups = &block.rays(rays);
        let skip = f32x16::splat(simd, inflate_t(1.0));
        let mut memory = StackMemory::<Entry, STACK_SIZE>::new();
        let mut stack = Stack::empty(&mut memory);
        stack.push(Entry { order: 0.0, child: ChildRef::node(0).0, rays: self.active });
        while let Some(Entry { child, rays: met, .. }) = stack.pop() {
            let (child, met) = (ChildRef(child), met & self.active);
            if child.is_leaf() || met.count_ones() <= MAX_SINGLE_RAYS {
                let mut rest = met;
                while rest != 0 {
                    let lane = rest.trailing_zeros() as usize & 15;
                    rest &= rest - 1;
                    self.trace_ray(simd, child, lane, &setups[lane]);
                }
                continue;
            }
            count(Counter::Nodes, 1);
            let at = child.unit();
            let node: &[Unit; NODE_UNITS] =
                tree.units[at..at + NODE_UNITS].try_into().expect("a slice of that length");
            let refs = node[CHILD_ROW].bits();
            let limit = f32x16::from_slice(simd, &self.t) * skip;
            let base = stack.len();
            for slot in 0..8 {
                if refs[slot] == ChildRef::NONE.0 {
                    break;
                }
                count(Counter::GroupBoxes, 1);
                let (near, hit) = block.enter(simd, node, slot, limit);
                let hit = hit & met;
                if hit == 0 {
                    continue;
                }
                prefetch::<4, _>(tree.units, ChildRef(refs[slot]).unit());
                // What is in the way of many rays answers them before they part.
                let order = if Q::ANY {
                    -(hit.count_ones() as f32)
                } else {
                    near.as_slice()[hit.trailing_zeros() as usize & 15]
                };
                stack.push(Entry { order, child: refs[slot], rays: hit });
            }
            stack.sort_descending_from(base);
        }
    }

    /// One ray through the subtree or meshlet at `start`.
    #[inline(always)]
    fn trace_ray<S: Simd>(&mut self, simd: S, start: ChildRef, lane: usize, ray: &RaySetup) {
        let t = self.t[lane];
        if Q::ANY {
            if self.search(simd, start, ray, t, AnyLeaf::<T>::new(ray, t)).0.found {
                self.hits.prim[lane] = 0;
                self.active &= !(1 << lane);
            }
            return;
        }
        let hits = &self.hits;
        let found = hits.prim[lane] != NO_HIT;
        let prim = if found { hits.prim[lane] } else { 0 };
        let best = ClosestTri { t, u: hits.u[lane], v: hits.v[lane], prim, found };
        let inner = ClosestLeaf::<T>::continuing(ray, best);
        let (ClosestLeaf { best: b, .. }, place) = self.search(simd, start, ray, t, inner);
        if b.found {
            self.t[lane] = b.t;
            let hits = &mut *self.hits;
            (hits.t[lane], hits.u[lane], hits.v[lane]) = (b.t, b.u, b.v);
            (hits.prim[lane], hits.instance[lane]) = (b.prim, self.instance);
            if let (Some(places), Some(place)) = (&mut self.places, place) {
                places[lane] = place;
            }
        }
    }

    #[inline(always)]
    fn search<S: Simd, L: LeafTest<S>>(
        &mut self,
        simd: S,
        start: ChildRef,
        ray: &RaySetup,
        t_max: f32,
        inner: L,
    ) -> (L, Option<TrianglePlace>) {
        let mut leaves = Meshlets::new(&mut *self.cache, self.key, ray, inner);
        leaves.keeps_place = self.places.is_some();
        if start.is_leaf() {
            leaves.test(simd, self.tree.units, start, &mut inflate_t(t_max));
        } else {
            traverse_from(simd, self.tree, ray, t_max, start, &mut leaves);
        }
        (leaves.inner, leaves.place)
    }
}
