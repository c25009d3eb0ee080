//! Many rays in one call: eight take turns, so that one computes while others wait for memory.

use super::crossing::ExactRay;
use super::input::{HitF64, RayF64};
use super::leaf::{AnyLeaf, ClosestLeaf, Search, TreeRay};
use super::local_ray::{LocalRay, Start};
use super::nearest::Nearest;
use super::shared_start::{self, start_together};
use super::world::WorldF64;
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::streams::{StreamError, same_length};
use crate::bvh::traverse::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::LANES;
use fearless_simd::{Simd, dispatch};
use glam::DVec3;

/// Number of rays in turns, as for f32 worlds.
const IN_TURNS: usize = 8;

/// Rays that are prepared together. Their constants stay in the first-level cache.
const BATCH: usize = 32;

const NO_RAY: RayF64 = RayF64 { origin: DVec3::ZERO, dir: DVec3::ZERO, t_min: 0.0, t_max: 0.0 };

impl WorldF64 {
    /// The closest hits of many rays in any directions: those of [`WorldF64::closest`], bit for
    /// bit, in less time. The calling thread does the work.
    ///
    /// ```
    /// use rt_core::prelude::*;
    ///
    /// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    /// let mesh = MeshF64::new(corners, vec![[0, 1, 2]]);
    /// let world = WorldF64::from_mesh(mesh, &BuildOptions::default())?;
    /// let rays = [0.25, 5.0].map(|x| RayF64::new(DVec3::new(x, 0.25, 1.0), DVec3::NEG_Z));
    /// let mut hits = [None; 2];
    /// world.closest_of_rays(&rays, &mut hits).expect("an answer for each ray");
    /// assert!(hits[0].is_some() && hits[1].is_none());
    /// let mut blocked = [false; 2];
    /// world.occluded_of_rays(&rays, &mut blocked).expect("an answer for each ray");
    /// assert_eq!(blocked, [true, false]);
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn closest_of_rays(
        &self,
        rays: &[RayF64],
        hits: &mut [Option<HitF64>],
    ) -> Result<(), StreamError> {
        same_length(rays.len(), hits.len())?;
        hits.fill(None);
        dispatch!(self.level, simd => self.closest_batches(simd, rays, hits));
        Ok(())
    }

    /// Whether something lies in the range of each ray: the answers of [`WorldF64::occluded`].
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn occluded_of_rays(
        &self,
        rays: &[RayF64],
        blocked: &mut [bool],
    ) -> Result<(), StreamError> {
        same_length(rays.len(), blocked.len())?;
        blocked.fill(false);
        dispatch!(self.level, simd => self.occluded_batches(simd, rays, blocked));
        Ok(())
    }

    #[inline(never)]
    fn closest_batches<S: Simd>(&self, simd: S, rays: &[RayF64], hits: &mut [Option<HitF64>]) {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut batch = Batch::NONE;
                for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
                    batch.prepare(self, rays);
                    for i in batch.everything() {
                        hits[i] = self.closest_of_everything(&rays[i]);
                    }
                    let new = |ray| ClosestLeaf::new(&self.triangles, ray);
                    // The triangles are read when all of them are on their way from memory.
                    let mut nearest = [Nearest::none(0.0); BATCH];
                    let done = |i: usize, leaf: ClosestLeaf<'_>| {
                        if leaf.nearest.found {
                            self.triangles.prefetch_indices(leaf.nearest.number);
                            nearest[i & (BATCH - 1)] = leaf.nearest;
                        }
                    };
                    trace(simd, &TreeView::all(&self.tree.bvh), &batch, new, done);
                    for nearest in nearest.iter().filter(|n| n.found) {
                        self.triangles.prefetch_corners(nearest.number);
                    }
                    for (i, (ray, nearest)) in rays.iter().zip(&nearest).enumerate() {
                        if nearest.found {
                            hits[i] = self.hit(ray, nearest);
                        }
                    }
                }
            },
        );
    }

    #[inline(never)]
    fn occluded_batches<S: Simd>(&self, simd: S, rays: &[RayF64], blocked: &mut [bool]) {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut batch = Batch::NONE;
                for (rays, blocked) in rays.chunks(BATCH).zip(blocked.chunks_mut(BATCH)) {
                    batch.prepare(self, rays);
                    for i in batch.everything() {
                        blocked[i] = self.occluded_by_anything(&rays[i]);
                    }
                    let new = |ray| AnyLeaf::new(&self.triangles, ray);
                    let done = |i: usize, leaf: AnyLeaf<'_>| blocked[i] = leaf.found;
                    trace(simd, &TreeView::all(&self.tree.bvh), &batch, new, done);
                }
            },
        );
    }
}

/// Traces a batch: blocks of rays that start close together share the start of the traversal, and
/// all others go on their own from the root.
#[inline(always)]
fn trace<'r, S: Simd, L: Search<S>>(
    simd: S,
    tree: &TreeView<'_>,
    batch: &'r Batch,
    new: impl Fn(&'r TreeRay) -> L,
    mut done: impl FnMut(usize, L),
) {
    let mut apart = batch.in_tree;
    for first in (0..BATCH).step_by(LANES) {
        let active = (batch.in_tree >> first) as u16;
        let rays: &[TreeRay; LANES] = batch.rays[first..first + LANES].try_into().expect("a block");
        let setups = rays.each_ref().map(|ray| &ray.local.setup);
        // A few rays would share little.
        if active.count_ones() <= 8 || !start_together(&setups, active) {
            continue;
        }
        apart &= !(0xffff << first);
        let mut searches = rays.each_ref().map(&new);
        shared_start::trace(simd, tree, &setups, &mut searches, active);
        for (lane, search) in searches.into_iter().enumerate() {
            if active >> lane & 1 == 1 {
                done(first + lane, search);
            }
        }
    }
    if apart != 0 {
        let mut queue = Apart { batch, waiting: apart, new, done };
        traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
    }
}

/// Rays with their constants.
struct Batch {
    rays: [TreeRay; BATCH],
    /// Those that go through the tree, as bits.
    in_tree: u32,
    /// Those that are tested against every triangle.
    everything: u32,
}

impl Batch {
    const NONE: Batch = Batch {
        rays: [TreeRay { exact: ExactRay::of_nothing(NO_RAY), local: LocalRay::ZERO }; BATCH],
        in_tree: 0,
        everything: 0,
    };

    #[inline(always)]
    fn prepare(&mut self, world: &WorldF64, rays: &[RayF64]) {
        (self.in_tree, self.everything) = (0, 0);
        for (i, ray) in rays.iter().enumerate() {
            if !ray.is_valid() {
                continue;
            }
            let (exact, reciprocals) = ExactRay::new(ray);
            match LocalRay::start(&exact, reciprocals, &world.tree.frame) {
                Start::Miss => {}
                Start::Everything => self.everything |= 1 << i,
                Start::Tree(local) => {
                    self.in_tree |= 1 << i;
                    self.rays[i] = TreeRay { exact, local };
                }
            }
        }
    }

    fn everything(&self) -> impl Iterator<Item = usize> + use<> {
        let all = self.everything;
        (0..BATCH).filter(move |i| all >> i & 1 == 1)
    }
}

/// Rays that start at the root, each on its own.
struct Apart<'r, N, D> {
    batch: &'r Batch,
    waiting: u32,
    new: N,
    done: D,
}

impl<'r, S: Simd, L: Search<S>, N, D> RayQueue<'r, S> for Apart<'r, N, D>
where
    N: Fn(&'r TreeRay) -> L,
    D: FnMut(usize, L),
{
    type Leaf = L;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, L>> {
        if self.waiting == 0 {
            return None;
        }
        let number = self.waiting.trailing_zeros() as usize;
        self.waiting &= self.waiting - 1;
        stack.push(ChildRef::node(0).0 as u64);
        let ray = &self.batch.rays[number];
        let (setup, t_max) = (&ray.local.setup, ray.local.s_max);
        Some(RayTask { number, ray: setup, t_max, leaf: (self.new)(ray) })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: L) {
        (self.done)(number, leaf);
    }
}
