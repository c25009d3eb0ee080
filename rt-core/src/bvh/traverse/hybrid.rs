//! Traversal by sixteen rays in any direction that start close together: together near the root,
//! then a few in turns.
//!
//! Ambient-occlusion and bounce rays of neighbouring points diverge, so packets with common bounds
//! do not pay (measured: sorting 16,384 of them by direction into packets took 1.7 times the time
//! of single rays). But the rays start close together: the nodes around their origins, most of the
//! path down the tree, are the same for all. In these nodes, a box is tested against sixteen rays
//! at once. A subtree that only a few of them hit is left to [`super::interleaved`], which tests
//! eight boxes against one ray. (The idea is from Benthin et al., "Combining Single and Packet-Ray
//! Tracing for Arbitrary Ray Distributions on the Intel MIC Architecture", 2012.)
//!
//! Collecting the subtrees of whole blocks first and handing them to the rays lost 10 to 25 %: the
//! rays are answered before most of them are needed.

use super::block_boxes::BlockSetup;
use super::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use super::leaf_kind::LeafKind;
use super::single::{RaySetup, inflate_t};
use super::tree_view::TreeView;
use crate::bvh::Unit;
use crate::bvh::compact::TrianglePlace;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, STACK_SIZE};
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::ray::{HitBlock, LANES, RayBlock};
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, f32x16};
use std::marker::PhantomData;

/// With this many rays or fewer, each ray traverses the subtree by itself. Chosen on ambient
/// occlusion (any hit) and on rays with random ends (closest hit) among one million triangles, by
/// the ratios to Embree in separate runs: 8 instead of 5 loses 1 to 4 % for any-hit rays; 5 or 12
/// instead of 8 loses a tenth for closest-hit rays.
const MAX_SINGLE_RAYS_ANY: u32 = 5;
const MAX_SINGLE_RAYS_CLOSEST: u32 = 8;

/// Number of rays that search a subtree in turns.
const IN_TURNS: usize = 4;

/// A subtree and the rays that hit its box.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Entry {
    /// For the order of visits, smallest first: the distance of one of the rays to the box. For
    /// occlusion, minus the number of rays that reach it.
    order: f32,
    child: u32,
    rays: u16,
}

/// Traces the rays of a block through a triangle hierarchy and writes the results into `hits` (for
/// occlusion, `prim` is 0 where something blocks the ray). `places` gets where the closest
/// triangles lie, in trees that keep it.
#[inline(always)]
pub(super) fn trace<S, T, Q, K>(
    simd: S,
    tree: &TreeView<'_>,
    kind: K,
    rays: &RayBlock,
    hits: &mut HitBlock,
    mut places: Option<&mut [TrianglePlace; LANES]>,
    instance: u32,
) where
    S: Simd,
    T: TriangleTest,
    Q: HitQuery,
    K: for<'r> LeafKind<'r>,
{
    let units = tree.units;
    let mut active = rays.active_lanes();
    let block = BlockSetup::new(simd, rays);
    // Every ray enters about five subtrees, so it pays to keep its constants.
    let setups = &block.rays(rays);
    let skip = f32x16::splat(simd, inflate_t(1.0));
    // Distances of the closest hits so far. The limits of finished rays are nearer than every box.
    let mut t = rays.t_max;
    let mut memory = StackMemory::<Entry, STACK_SIZE>::new();
    let mut stack = Stack::empty(&mut memory);
    stack.push(Entry { order: 0.0, child: ChildRef::node(0).0, rays: active });
    while let Some(Entry { child, rays: met, .. }) = stack.pop() {
        let met = met & active;
        if met == 0 {
            continue;
        }
        let child = ChildRef(child);
        if child.is_leaf()
            || met.count_ones()
                <= (if Q::ANY { MAX_SINGLE_RAYS_ANY } else { MAX_SINGLE_RAYS_CLOSEST })
        {
            // ---- Few rays or a leaf: each ray separately from here.
            let start = child;
            if Q::ANY {
                let (t, active, test) = (&t, &mut active, PhantomData::<T>);
                let mut queue = AnyQueue { setups, t, start, met, hits, active, kind, test };
                traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
            } else {
                let (t, test) = (&mut t, PhantomData::<T>);
                let places = places.as_deref_mut();
                let mut queue =
                    ClosestQueue { setups, t, start, met, hits, places, instance, kind, test };
                traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
            }
            continue;
        }

        // ---- A node for many rays: each child's box against all of them.
        count(Counter::Nodes, 1);
        let at = child.unit();
        let node: &[Unit; NODE_UNITS] =
            units[at..at + NODE_UNITS].try_into().expect("a slice of that length");
        let refs = node[CHILD_ROW].bits();
        let limit = f32x16::from_slice(simd, &t) * skip;
        let base = stack.len();
        let visible = tree.visible(at, 0xff);
        for slot in 0..8 {
            if refs[slot] == ChildRef::NONE.0 {
                // A node fills its slots in order.
                break;
            }
            if visible >> slot & 1 == 0 {
                continue;
            }
            count(Counter::GroupBoxes, 1);
            let (near, hit) = block.enter(simd, node, slot, limit);
            let hit = hit & met;
            if hit == 0 {
                continue;
            }
            prefetch::<4, _>(units, ChildRef(refs[slot]).unit());
            // Another ray of `hit` may be nearer than the first one. The order of visits need not
            // be exact. What is in the way of many rays answers them before they part.
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

/// Lanes for which the closest hit in the subtree at `start` is requested.
struct ClosestQueue<'a, 'r, T, K> {
    setups: &'r [RaySetup; LANES],
    t: &'a mut [f32; LANES],
    start: ChildRef,
    met: u16,
    hits: &'a mut HitBlock,
    places: Option<&'a mut [TrianglePlace; LANES]>,
    instance: u32,
    kind: K,
    test: PhantomData<T>,
}

impl<'r, S: Simd, T: TriangleTest, K: LeafKind<'r>> RayQueue<'r, S> for ClosestQueue<'_, 'r, T, K> {
    type Leaf = K::Leaf<S, ClosestLeaf<'r, T>>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        if self.met == 0 {
            return None;
        }
        let lane = take_lane(&mut self.met);
        let (ray, hits) = (&self.setups[lane], &self.hits);
        let found = hits.prim[lane] != crate::ray::NO_HIT;
        let prim = if found { hits.prim[lane] } else { 0 };
        let best = ClosestTri { t: self.t[lane], u: hits.u[lane], v: hits.v[lane], prim, found };
        let leaf = self.kind.around(ray, ClosestLeaf::continuing(ray, best));
        stack.push(self.start.0 as u64);
        Some(RayTask { number: lane, ray, t_max: best.t, leaf })
    }

    #[inline(always)]
    fn done(&mut self, lane: usize, leaf: Self::Leaf) {
        let (leaf, place) = K::found(leaf);
        let (b, lane) = (leaf.best, lane & 15);
        if let (Some(places), Some(place)) = (&mut self.places, place) {
            places[lane] = place;
        }
        if b.found {
            self.t[lane] = b.t;
            (self.hits.t[lane], self.hits.u[lane], self.hits.v[lane]) = (b.t, b.u, b.v);
            (self.hits.prim[lane], self.hits.instance[lane]) = (b.prim, self.instance);
        }
    }
}

/// Lanes for which any hit in the subtree at `start` is requested.
struct AnyQueue<'a, 'r, T, K> {
    setups: &'r [RaySetup; LANES],
    t: &'a [f32; LANES],
    start: ChildRef,
    met: u16,
    hits: &'a mut HitBlock,
    active: &'a mut u16,
    kind: K,
    test: PhantomData<T>,
}

impl<'r, S: Simd, T: TriangleTest, K: LeafKind<'r>> RayQueue<'r, S> for AnyQueue<'_, 'r, T, K> {
    type Leaf = K::Leaf<S, AnyLeaf<'r, T>>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        if self.met == 0 {
            return None;
        }
        let lane = take_lane(&mut self.met);
        let (ray, t_max) = (&self.setups[lane], self.t[lane]);
        stack.push(self.start.0 as u64);
        let leaf = self.kind.around(ray, AnyLeaf::new(ray, t_max));
        Some(RayTask { number: lane, ray, t_max, leaf })
    }

    #[inline(always)]
    fn done(&mut self, lane: usize, leaf: Self::Leaf) {
        if K::found(leaf).0.found {
            self.hits.prim[lane & 15] = 0;
            *self.active &= !(1 << (lane & 15));
        }
    }
}

/// Removes and returns the lowest lane of a non-empty set.
#[inline(always)]
fn take_lane(lanes: &mut u16) -> usize {
    let lane = lanes.trailing_zeros() as usize & 15;
    *lanes &= *lanes - 1;
    lane
}
