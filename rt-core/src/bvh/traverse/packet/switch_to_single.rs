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

/// Rays under way at a time, as for rays in any direction.
const IN_TURNS: usize = 8;

impl Packet {
    /// The data that a ray needs to continue alone: the packet's own numbers, so that its results
    /// keep the same bits.
    #[inline(always)]
    pub(super) fn setup(&self, g: usize, lane: usize) -> RaySetup {
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

    /// The rays of `lanes` in the groups of `reached` through the subtree at `start`. Returns the
    /// groups with new hits.
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
                let mut leaving = std::mem::take(&mut self.leaving);
                leaving.clear();
                let mut groups = reached;
                while groups != 0 {
                    let g = groups.trailing_zeros() as usize & 15;
                    groups &= groups - 1;
                    let mut rest = lanes[g];
                    while rest != 0 {
                        let lane = rest.trailing_zeros() as usize & 15;
                        rest &= rest - 1;
                        leaving.push((g * LANES + lane, self.setup(g, lane)));
                    }
                }
                count(Counter::Fallbacks, leaving.len() as u64);
                let rays = LaneRays { rays: leaving.iter(), start, changed: 0, packet: self };
                let changed = if Q::ANY {
                    let mut queue = AnyRays::<T>(rays, PhantomData);
                    traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
                    queue.0.changed
                } else {
                    let mut queue = ClosestRays::<T>(rays, PhantomData);
                    traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
                    queue.0.changed
                };
                self.leaving = leaving;
                changed
            },
        )
    }
}

struct LaneRays<'a, 'r> {
    rays: std::slice::Iter<'r, (usize, RaySetup)>,
    start: ChildRef,
    changed: u16,
    packet: &'a mut Packet,
}

/// Group and lane of ray `number`.
#[inline(always)]
fn place(number: usize) -> (usize, usize) {
    ((number / LANES) & 15, number % LANES)
}

struct AnyRays<'a, 'r, T>(LaneRays<'a, 'r>, PhantomData<T>);

impl<'r, S: Simd, T: TriangleTest> RayQueue<'r, S> for AnyRays<'_, 'r, T> {
    type Leaf = AnyLeaf<'r, T>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        let &(number, ref ray) = self.0.rays.next()?;
        let (g, lane) = place(number);
        let t_max = self.0.packet.t[g][lane];
        stack.push(self.0.start.0 as u64);
        Some(RayTask { number, ray, t_max, leaf: AnyLeaf::new(ray, t_max) })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: Self::Leaf) {
        if leaf.found {
            let (g, lane) = place(number);
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
        let &(number, ref ray) = self.0.rays.next()?;
        let (g, lane) = place(number);
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
            let (g, lane) = place(number);
            let p = &mut self.0.packet;
            p.hit[g] |= 1 << lane;
            (p.t[g][lane], p.u[g][lane], p.v[g][lane], p.prim[g][lane]) = (b.t, b.u, b.v, b.prim);
            self.0.changed |= 1 << g;
        }
    }
}
