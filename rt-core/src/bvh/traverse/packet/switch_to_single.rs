//! Traverses a subtree that only a few rays of a packet reach: the rays are traced individually, in
//! turns.
//!
//! Rays that diverge are spread over the groups, a lane here and one there, and every box and
//! triangle would still be tested against sixteen.

use super::Packet;
use crate::bvh::intersect::watertight::Shear;
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use crate::bvh::traverse::single::RaySetup;
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::ray::LANES;
use crate::stats::{Counter, count};
use fearless_simd::Simd;
use std::marker::PhantomData;

/// With this many rays or fewer. Not tuned; with it, shadow rays from a surface gained 6
/// % in the whole view of one million triangles (records `peers` before and after).
pub(super) const MAX_SINGLE_RAYS: usize = 4;

impl Packet {
    /// The data that a ray needs to continue alone: the packet's own numbers, so that its results
    /// keep the same bits.
    #[inline(always)]
    fn setup(&self, g: usize, lane: usize) -> RaySetup {
        let [kx, ky, kz] = self.axes;
        let of = |rows: &[[f32; LANES]; 3]| [rows[0][lane], rows[1][lane], rows[2][lane]];
        let [sx, sy, sz] = of(&self.shear[g]);
        let shear = Shear { kx, ky, kz, sx, sy, sz };
        RaySetup {
            origin: of(&self.origin[g]),
            rcp: of(&self.rcp[g]),
            near: self.near,
            shear,
            t_min: self.t_min[g][lane],
        }
    }

    /// The rays of `lanes` in the groups of `reached`, at most [`MAX_SINGLE_RAYS`], through the
    /// subtree at `start`. Returns the groups with new hits.
    #[inline(never)]
    pub(super) fn switch_to_single<S: Simd, T: TriangleTest, Q: HitQuery>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        start: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut setups = [self.setup(0, 0); MAX_SINGLE_RAYS];
                let mut at = [(0, 0); MAX_SINGLE_RAYS];
                let mut rays = 0;
                let mut groups = reached;
                while groups != 0 {
                    let g = groups.trailing_zeros() as usize & 15;
                    groups &= groups - 1;
                    let mut rest = lanes[g];
                    while rest != 0 {
                        let lane = rest.trailing_zeros() as usize & 15;
                        rest &= rest - 1;
                        setups[rays % MAX_SINGLE_RAYS] = self.setup(g, lane);
                        at[rays % MAX_SINGLE_RAYS] = (g, lane);
                        rays += 1;
                    }
                }
                debug_assert!(rays <= MAX_SINGLE_RAYS, "{rays} rays");
                count(Counter::Fallbacks, rays as u64);
                let rays = LaneRays {
                    setups: &setups,
                    at: &at,
                    next: 0,
                    len: rays,
                    start,
                    changed: 0,
                    packet: self,
                };
                if Q::ANY {
                    let mut queue = AnyRays::<T>(rays, PhantomData);
                    traverse_interleaved::<MAX_SINGLE_RAYS, _, _>(simd, tree, &mut queue);
                    queue.0.changed
                } else {
                    let mut queue = ClosestRays::<T>(rays, PhantomData);
                    traverse_interleaved::<MAX_SINGLE_RAYS, _, _>(simd, tree, &mut queue);
                    queue.0.changed
                }
            },
        )
    }
}

struct LaneRays<'a, 'r> {
    setups: &'r [RaySetup; MAX_SINGLE_RAYS],
    at: &'a [(usize, usize); MAX_SINGLE_RAYS],
    next: usize,
    len: usize,
    start: ChildRef,
    changed: u16,
    packet: &'a mut Packet,
}

impl<'r> LaneRays<'_, 'r> {
    /// The next ray: its number, set-up, group and lane.
    #[inline(always)]
    fn take(&mut self) -> Option<(usize, &'r RaySetup, usize, usize)> {
        if self.next >= self.len {
            return None;
        }
        let number = self.next % MAX_SINGLE_RAYS;
        self.next += 1;
        let (g, lane) = self.at[number];
        Some((number, &self.setups[number], g & 15, lane & 15))
    }
}

struct AnyRays<'a, 'r, T>(LaneRays<'a, 'r>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest> RayQueue<'r, S> for AnyRays<'_, 'r, T> {
    type Leaf = AnyLeaf<'r, T>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let (number, ray, g, lane) = self.0.take()?;
        let t_max = self.0.packet.t[g][lane];
        stack.push(self.0.start.0 as u64);
        Some(RayTask { number, ray, t_max, leaf: AnyLeaf::new(ray, t_max) })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        if leaf.found {
            let (g, lane) = self.0.at[number % MAX_SINGLE_RAYS];
            let (g, lane) = (g & 15, lane & 15);
            self.0.packet.hit[g] |= 1 << lane;
            self.0.packet.active[g] &= !(1 << lane);
            self.0.packet.t[g][lane] = -1.0;
            self.0.changed |= 1 << g;
        }
    }
}

struct ClosestRays<'a, 'r, T>(LaneRays<'a, 'r>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest> RayQueue<'r, S> for ClosestRays<'_, 'r, T> {
    type Leaf = ClosestLeaf<'r, T>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let (number, ray, g, lane) = self.0.take()?;
        let p = &self.0.packet;
        let found = p.hit[g] >> lane & 1 == 1;
        let best = ClosestTri {
            t: p.t[g][lane],
            u: p.u[g][lane],
            v: p.v[g][lane],
            prim: p.prim[g][lane],
            found,
        };
        let leaf = ClosestLeaf::continuing(ray, best);
        stack.push(self.0.start.0 as u64);
        Some(RayTask { number, ray, t_max: best.t, leaf })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        let b = leaf.best;
        if b.found {
            let (g, lane) = self.0.at[number % MAX_SINGLE_RAYS];
            let (g, lane) = (g & 15, lane & 15);
            let p = &mut self.0.packet;
            p.hit[g] |= 1 << lane;
            (p.t[g][lane], p.u[g][lane], p.v[g][lane], p.prim[g][lane]) = (b.t, b.u, b.v, b.prim);
            self.0.changed |= 1 << g;
        }
    }
}
