//! Traversal by rays that start far apart: each from the root, many in turns.
//!
//! Such rays share no part of their paths and little of the cache. What they wait for is memory, so
//! many of them are under way at once, from all blocks of a call. (Measured among one to four
//! million triangles, rays with random origins and directions: 1.6 to 2.1 times as fast as in pairs
//! with a common start of the traversal.)

use super::block_boxes::BlockSetup;
use super::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use super::leaf_kind::LeafKind;
use super::packet::GROUPS;
use super::single::RaySetup;
use super::tree_view::TreeView;
use crate::bvh::compact::TrianglePlace;
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf};
use crate::ray::{HitBlock, LANES, RayBlock};
use fearless_simd::Simd;
use std::marker::PhantomData;

/// Number of rays in turns. Twelve to closest hits take 6 % (among a million triangles) and 9 %
/// (ten million) less time than eight, and sixteen no less than twelve. Questions of yes or no keep
/// less for each ray: sixteen take 17 % and 29 % less. Among 100,000 triangles all are even. (AMD
/// EPYC, bench/runs/2026-11-27-2core-avx-512-amd-epyc/rays-in-turns-eight-or-more.csv.)
const CLOSEST_IN_TURNS: usize = 12;
const ANY_IN_TURNS: usize = 16;

/// At most sixteen blocks, of which some are to be traced.
#[derive(Clone, Copy)]
pub(super) struct BlockSet<'a> {
    pub(super) rays: &'a [RayBlock],
    pub(super) chosen: u16,
}

/// Traces the rays of the chosen blocks and writes the results into `hits`, as long as there are
/// blocks (for occlusion, `prim` is 0 where something blocks the ray). `places` gets where the
/// closest triangles lie, for as many blocks as it has rows, in trees that keep it.
#[inline(always)]
pub(super) fn trace<S, T, Q, K>(
    simd: S,
    tree: &TreeView<'_>,
    kind: K,
    set: BlockSet<'_>,
    hits: &mut [HitBlock],
    places: &mut [[TrianglePlace; LANES]],
    instance: u32,
) where
    S: Simd,
    T: TriangleTest,
    Q: HitQuery,
    K: for<'r> LeafKind<'r>,
{
    let BlockSet { rays, chosen: blocks } = set;
    let mut setups = [[RaySetup::ZERO; LANES]; GROUPS];
    let mut active = [0; GROUPS];
    for (b, rays) in rays.iter().enumerate().take(GROUPS).filter(|(b, _)| blocks >> b & 1 == 1) {
        active[b] = rays.active_lanes();
        setups[b] = BlockSetup::new(simd, rays).rays(rays);
    }
    let setups = &setups;
    let queue = Scattered { rays, setups, hits, places, active, blocks, instance, kind };
    if Q::ANY {
        let mut queue = AnyRays::<T, K>(queue, PhantomData);
        traverse_interleaved::<ANY_IN_TURNS, _, _>(simd, tree, &mut queue);
    } else {
        let mut queue = ClosestRays::<T, K>(queue, PhantomData);
        traverse_interleaved::<CLOSEST_IN_TURNS, _, _>(simd, tree, &mut queue);
    }
}

/// The rays that have not been traced yet.
struct Scattered<'a, 'r, K> {
    rays: &'a [RayBlock],
    setups: &'r [[RaySetup; LANES]; GROUPS],
    hits: &'a mut [HitBlock],
    places: &'a mut [[TrianglePlace; LANES]],
    /// Lanes to trace, per block.
    active: [u16; GROUPS],
    /// Blocks to trace.
    blocks: u16,
    instance: u32,
    kind: K,
}

impl<K> Scattered<'_, '_, K> {
    /// The block and the lane of the next ray.
    #[inline(always)]
    fn take(&mut self, stack: &mut RayStack<'_>) -> Option<(usize, usize)> {
        while self.blocks != 0 {
            let b = self.blocks.trailing_zeros() as usize & 15;
            let lanes = self.active[b];
            if lanes == 0 {
                self.blocks &= self.blocks - 1;
                continue;
            }
            self.active[b] = lanes & (lanes - 1);
            stack.push(ChildRef::node(0).0 as u64);
            return Some((b, lanes.trailing_zeros() as usize & 15));
        }
        None
    }
}

/// Asks for the closest hits.
struct ClosestRays<'a, 'r, T, K>(Scattered<'a, 'r, K>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest, K: LeafKind<'r>> RayQueue<'r, S> for ClosestRays<'_, 'r, T, K> {
    type Leaf = K::Leaf<S, ClosestLeaf<'r, T>>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let (b, lane) = self.0.take(stack)?;
        let (ray, t_max) = (&self.0.setups[b][lane], self.0.rays[b].t_max[lane]);
        let leaf = self.0.kind.around(ray, ClosestLeaf::new(ray, t_max));
        Some(RayTask { number: b * LANES + lane, ray, t_max, leaf })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        let (leaf, place) = K::found(leaf);
        let b = leaf.best;
        if let (Some(places), Some(place)) = (self.0.places.get_mut(number / LANES), place) {
            places[number % LANES] = place;
        }
        if b.found {
            let (h, lane) = (&mut self.0.hits[number / LANES], number % LANES);
            (h.t[lane], h.u[lane], h.v[lane]) = (b.t, b.u, b.v);
            (h.prim[lane], h.instance[lane]) = (b.prim, self.0.instance);
        }
    }
}

/// Asks whether there are hits.
struct AnyRays<'a, 'r, T, K>(Scattered<'a, 'r, K>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest, K: LeafKind<'r>> RayQueue<'r, S> for AnyRays<'_, 'r, T, K> {
    type Leaf = K::Leaf<S, AnyLeaf<'r, T>>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let (b, lane) = self.0.take(stack)?;
        let (ray, t_max) = (&self.0.setups[b][lane], self.0.rays[b].t_max[lane]);
        let leaf = self.0.kind.around(ray, AnyLeaf::new(ray, t_max));
        Some(RayTask { number: b * LANES + lane, ray, t_max, leaf })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        if K::found(leaf).0.found {
            self.0.hits[number / LANES].prim[number % LANES] = 0;
        }
    }
}
