//! Traversal by rays that start far apart: each from the root, many in turns.
//!
//! Such rays share no part of their paths and little of the cache. What they wait for is memory, so
//! many of them are under way at once, from all blocks of a call. (Measured among one to four
//! million triangles, rays with random origins and directions: 1.6 to 2.1 times as fast as in pairs
//! with a common start of the traversal.)

use super::block_boxes::BlockSetup;
use super::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use super::packet::GROUPS;
use super::single::RaySetup;
use super::tree_view::TreeView;
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

/// Traces the rays of `blocks`, a set of at most sixteen blocks of `rays`, and writes the results
/// into `hits` (for occlusion, `prim` is 0 where something blocks the ray).
#[inline(always)]
pub(super) fn trace<S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    tree: &TreeView<'_>,
    rays: &[RayBlock],
    blocks: u16,
    hits: &mut [HitBlock],
    instance: u32,
) {
    let mut setups = [[RaySetup::ZERO; LANES]; GROUPS];
    let mut active = [0; GROUPS];
    for (b, rays) in rays.iter().enumerate().take(GROUPS).filter(|(b, _)| blocks >> b & 1 == 1) {
        active[b] = rays.active_lanes();
        setups[b] = BlockSetup::new(simd, rays).rays(rays);
    }
    let queue = Scattered { rays, setups: &setups, hits, active, blocks, instance };
    if Q::ANY {
        let mut queue = AnyRays::<T>(queue, PhantomData);
        traverse_interleaved::<ANY_IN_TURNS, _, _>(simd, tree, &mut queue);
    } else {
        let mut queue = ClosestRays::<T>(queue, PhantomData);
        traverse_interleaved::<CLOSEST_IN_TURNS, _, _>(simd, tree, &mut queue);
    }
}

/// The rays that have not been traced yet.
struct Scattered<'a, 'r> {
    rays: &'a [RayBlock],
    setups: &'r [[RaySetup; LANES]; GROUPS],
    hits: &'a mut [HitBlock],
    /// Lanes to trace, per block.
    active: [u16; GROUPS],
    /// Blocks to trace.
    blocks: u16,
    instance: u32,
}

impl Scattered<'_, '_> {
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
struct ClosestRays<'a, 'r, T>(Scattered<'a, 'r>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest> RayQueue<'r, S> for ClosestRays<'_, 'r, T> {
    type Leaf = ClosestLeaf<'r, T>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let (b, lane) = self.0.take(stack)?;
        let (ray, t_max) = (&self.0.setups[b][lane], self.0.rays[b].t_max[lane]);
        Some(RayTask { number: b * LANES + lane, ray, t_max, leaf: ClosestLeaf::new(ray, t_max) })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        let b = leaf.best;
        if b.found {
            let (h, lane) = (&mut self.0.hits[number / LANES], number % LANES);
            (h.t[lane], h.u[lane], h.v[lane]) = (b.t, b.u, b.v);
            (h.prim[lane], h.instance[lane]) = (b.prim, self.0.instance);
        }
    }
}

/// Asks whether there are hits.
struct AnyRays<'a, 'r, T>(Scattered<'a, 'r>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest> RayQueue<'r, S> for AnyRays<'_, 'r, T> {
    type Leaf = AnyLeaf<'r, T>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let (b, lane) = self.0.take(stack)?;
        let (ray, t_max) = (&self.0.setups[b][lane], self.0.rays[b].t_max[lane]);
        Some(RayTask { number: b * LANES + lane, ray, t_max, leaf: AnyLeaf::new(ray, t_max) })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        if leaf.found {
            self.0.hits[number / LANES].prim[number % LANES] = 0;
        }
    }
}
