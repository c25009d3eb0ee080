//! Rays through the entries of the upper level, many in turns.
//!
//! A ray among thousands of instances follows references from node to node, to a placement, and on
//! into the instance's own tree, and waits for memory at each. Here a ray takes one step, be it in
//! the upper level or in an instance, requests the memory of its next one, and lets the others have
//! theirs. Each ray has one stack: what it has still to visit of the upper level lies below what it
//! has still to visit of the instance that it is in.

use super::entry::Entry;
use super::instance_filter::InstanceFilter;
use super::layout::wide::{CHILD_ROW, ChildRef, MAX_DEPTH};
use super::query::{HitQuery, TriangleTest};
use super::world::World;
use crate::bvh::traverse::block_boxes::BlockSetup;
use crate::bvh::traverse::interleaved::{NodeHits, RayStack, open_node, pop_nearer};
use crate::bvh::traverse::packet::GROUPS;
use crate::bvh::traverse::single::{LeafTest, RaySetup, inflate_t};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::ray::{Hit, HitBlock, LANES, Ray, RayBlock};
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::Simd;
use std::marker::PhantomData;

/// Number of rays in turns.
const IN_TURNS: usize = 12;

/// The rays of a call.
struct Rays<'r> {
    blocks: &'r [RayBlock],
    setups: &'r [[RaySetup; LANES]; GROUPS],
    /// Lanes that have not been traced yet, per block.
    waiting: [u16; GROUPS],
    block: usize,
}

impl Rays<'_> {
    /// The block and the lane of the next ray.
    #[inline(always)]
    fn take(&mut self) -> Option<(usize, usize)> {
        while self.block < self.blocks.len() {
            let lanes = self.waiting[self.block & 15];
            if lanes != 0 {
                self.waiting[self.block & 15] = lanes & (lanes - 1);
                return Some((self.block & 15, lanes.trailing_zeros() as usize & 15));
            }
            self.block += 1;
        }
        None
    }
}

/// The instance, or group of meshes, that a ray is in.
#[derive(Clone, Copy)]
struct Inside<'w> {
    entry: Entry<'w>,
    /// How far along the ray its origin was moved.
    moved: f64,
    /// The part of the stack that belongs to the upper level.
    base: usize,
}

/// A ray under way.
struct Lane<'w, 'r, T, Q> {
    number: (usize, usize),
    ray: Ray,
    upper: &'r RaySetup,
    /// The ray in the local space of `inside`, if any.
    local: RaySetup,
    inside: Option<Inside<'w>>,
    /// The tree of `inside`, or of the upper level.
    tree: TreeView<'w>,
    skip_t: f32,
    /// The next node or leaf, or [`ChildRef::NONE`].
    current: ChildRef,
    /// Leaves with triangles to test before it: a set of slots of the node at `parent`.
    leaves: u32,
    parent: usize,
    /// The closest hit in `inside`, and that of all entries before it.
    triangle: ClosestTri,
    best: Option<Hit>,
    kind: PhantomData<(T, Q)>,
}

const NO_TRIANGLE: ClosestTri = ClosestTri { t: 0.0, u: 0.0, v: 0.0, prim: 0, found: false };

impl<'w, 'r, T: TriangleTest, Q: HitQuery> Lane<'w, 'r, T, Q> {
    #[inline(always)]
    fn new(tlas: TreeView<'w>, rays: &mut Rays<'r>) -> Option<Self> {
        let (block, lane) = rays.take()?;
        let ray = rays.blocks[block].get(lane);
        Some(Lane {
            number: (block, lane),
            ray,
            upper: &rays.setups[block][lane],
            local: RaySetup::ZERO,
            inside: None,
            tree: tlas,
            skip_t: inflate_t(ray.t_max),
            current: ChildRef::node(0),
            leaves: 0,
            parent: 0,
            triangle: NO_TRIANGLE,
            best: None,
            kind: PhantomData,
        })
    }

    /// One step: tests the leaves that the last one found, then the next node, or enters or leaves
    /// an instance. Returns true when the ray is answered.
    #[inline(always)]
    fn step<S: Simd>(
        &mut self,
        simd: S,
        world: &'w World,
        filter: InstanceFilter<'w>,
        stack: &mut RayStack<'_>,
    ) -> bool {
        if self.leaves != 0 {
            self.test_leaves(simd);
            if Q::ANY && self.triangle.found {
                return true;
            }
            self.leaves = 0;
        }
        if self.current == ChildRef::NONE {
            let Some(inside) = self.inside.take() else { return true };
            self.leave(world, inside, stack);
        } else if self.current.is_leaf() {
            self.enter(simd, world, filter, stack);
            if Q::ANY && self.triangle.found {
                return true;
            }
        } else {
            self.visit_node(simd, stack);
        }
        prefetch::<4, _>(self.tree.units, self.current.unit());
        self.leaves == 0 && self.current == ChildRef::NONE && self.inside.is_none()
    }

    #[inline(always)]
    fn visit_node<S: Simd>(&mut self, simd: S, stack: &mut RayStack<'_>) {
        let (ray, base) = match &self.inside {
            Some(inside) => (&self.local, inside.base),
            None => (self.upper, 0),
        };
        // Entries wait for their turn by distance; triangles are tested together.
        let together = self.inside.is_some();
        let at = self.current.unit();
        let NodeHits { leaves, next } =
            open_node::<S, Q>(simd, &self.tree, at, ray, self.skip_t, together, stack);
        (self.leaves, self.parent) = (leaves, at);
        self.current = match next {
            Some(next) => next,
            None => pop_nearer(stack, base, self.skip_t),
        };
    }

    #[inline(always)]
    fn test_leaves<S: Simd>(&mut self, simd: S) {
        count(Counter::Leaves, self.leaves.count_ones() as u64);
        let units = self.tree.units;
        let refs = units[self.parent + CHILD_ROW].bits();
        if Q::ANY {
            let mut leaf = AnyLeaf::<T>::new(&self.local, self.triangle.t);
            leaf.test_many(simd, units, refs, self.leaves, &mut self.skip_t);
            self.triangle.found = leaf.found;
        } else {
            let mut leaf = ClosestLeaf::<T>::continuing(&self.local, self.triangle);
            leaf.test_many(simd, units, refs, self.leaves, &mut self.skip_t);
            self.triangle = leaf.best;
        }
    }

    /// Enters the entry in the current leaf of the upper level.
    #[inline(always)]
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        world: &'w World,
        filter: InstanceFilter<'w>,
        stack: &mut RayStack<'_>,
    ) {
        let entry = world.entry_of_leaf(self.tree.units, self.current, filter);
        self.current = ChildRef::NONE;
        if let Some(entry) = entry {
            // One ulp past the best so far: a tie may go to this entry.
            let limit = self.best.map_or(self.ray.t_max, |b| b.t.next_up());
            let mut local = Ray::UNSET;
            let moved = entry.placement().enter(&self.ray, limit, &mut local);
            if local.t_max > local.t_min {
                match entry.triangles(filter) {
                    Some(tree)
                        if tree.meshlets() == 0
                            && entry.depth() + world.tlas.depth <= MAX_DEPTH =>
                    {
                        self.inside = Some(Inside { entry, moved, base: stack.len() });
                        self.local = RaySetup::new(&local);
                        self.tree = tree;
                        self.skip_t = inflate_t(local.t_max);
                        self.current = ChildRef::node(0);
                        self.triangle = ClosestTri { t: local.t_max, ..NO_TRIANGLE };
                        return;
                    }
                    _ if Q::ANY => {
                        self.triangle.found = entry.occluded::<S, T>(simd, &local, filter);
                    }
                    _ => {
                        if let Some(hit) = entry.closest::<S, T>(simd, &local, filter) {
                            self.keep_nearer(hit, moved);
                        }
                    }
                }
            }
        }
        self.current = pop_nearer(stack, 0, self.skip_t);
    }

    /// Goes back to the upper level.
    #[inline(always)]
    fn leave(&mut self, world: &'w World, inside: Inside<'w>, stack: &mut RayStack<'_>) {
        self.tree = TreeView::all(&world.tlas);
        self.skip_t = inflate_t(self.best.map_or(self.ray.t_max, |b| b.t));
        let ClosestTri { t, u, v, prim, found } = self.triangle;
        if found {
            let (instance, prim) = inside.entry.owner(prim);
            self.keep_nearer(Hit { t, u, v, prim, instance }, inside.moved);
        }
        self.current = pop_nearer(stack, 0, self.skip_t);
    }

    /// Keeps a hit of a ray that was moved by `moved` where it is nearer than the best one.
    #[inline(always)]
    fn keep_nearer(&mut self, hit: Hit, moved: f64) {
        let t = if moved == 0.0 { hit.t } else { (f64::from(hit.t) + moved) as f32 };
        let better = self.best.is_none_or(|b| t < b.t || (t == b.t && hit.instance < b.instance));
        if better {
            self.best = Some(Hit { t, ..hit });
            self.skip_t = inflate_t(t);
        }
    }
}

/// Traces at most sixteen blocks of rays whose directions have ordinary lengths; for occlusion,
/// `prim` is 0 where something blocks the ray.
pub(super) fn trace<'w, S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    world: &'w World,
    blocks: &[RayBlock],
    hits: &mut [HitBlock],
    filter: InstanceFilter<'w>,
) {
    simd.vectorize(
        #[inline(always)]
        || trace_body::<S, T, Q>(simd, world, blocks, hits, filter),
    );
}

#[inline(always)]
fn trace_body<'w, S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    world: &'w World,
    blocks: &[RayBlock],
    hits: &mut [HitBlock],
    filter: InstanceFilter<'w>,
) {
    let mut setups = [[RaySetup::ZERO; LANES]; GROUPS];
    let mut waiting = [0; GROUPS];
    for ((block, setups), waiting) in blocks.iter().zip(&mut setups).zip(&mut waiting) {
        *waiting = block.active_lanes();
        *setups = BlockSetup::new(simd, block).rays(block);
    }
    let blocks = &blocks[..blocks.len().min(GROUPS)];
    let mut rays = Rays { blocks, setups: &setups, waiting, block: 0 };
    let tlas = TreeView::all(&world.tlas);
    let mut memory = [const { StackMemory::new() }; IN_TURNS];
    let mut stacks = memory.each_mut().map(Stack::empty);
    let mut lanes: [Option<Lane<'w, '_, T, Q>>; IN_TURNS] = [const { None }; IN_TURNS];
    let mut under_way = 0;
    for lane in &mut lanes {
        *lane = Lane::new(tlas, &mut rays);
        under_way += usize::from(lane.is_some());
    }
    let mut i = 0;
    while under_way > 0 {
        let stack = &mut stacks[i];
        let Some(lane) = &mut lanes[i] else { break };
        if !lane.step(simd, world, filter, stack) {
            i += 1;
        } else {
            let (block, number) = lane.number;
            if Q::ANY {
                if lane.triangle.found {
                    hits[block].prim[number] = 0;
                }
            } else if lane.best.is_some() {
                hits[block].set(number, lane.best);
            }
            stack.clear();
            if let Some(next) = Lane::new(tlas, &mut rays) {
                *lane = next;
                i += 1;
            } else {
                // The last ray moves to the free place.
                under_way -= 1;
                lanes.swap(i, under_way);
                stacks.swap(i, under_way);
            }
        }
        if i >= under_way {
            i = 0;
        }
    }
}
