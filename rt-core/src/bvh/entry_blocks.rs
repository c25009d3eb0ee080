//! Sixteen rays through the entries of the upper level that they meet.

use super::entry::Entry;
use super::instance_filter::InstanceFilter;
use super::layout::wide::{ChildRef, Unit};
use super::query::{HitQuery, TriangleTest};
use super::streams::merge_hits;
use super::traverse::single::{RaySetup, traverse_from};
use super::traverse::tree_view::TreeView;
use super::world::{InstanceAny, InstanceClosest, World};
use crate::bvh::traverse::block_entries::BlockEntries;
use crate::bvh::traverse::block_hits::{limits_of, set_bits};
use crate::bvh::traverse::incoherent;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use fearless_simd::Simd;
use std::marker::PhantomData;

/// With this many rays or fewer, each ray enters an instance by itself.
const MAX_SINGLE_RAYS: u32 = 3;

/// A block on its way through the upper level.
pub(super) struct EntryBlocks<'a, T, Q> {
    world: &'a World,
    rays: &'a RayBlock,
    hits: &'a mut HitBlock,
    filter: InstanceFilter<'a>,
    kind: PhantomData<(T, Q)>,
}

impl<'a, T, Q> EntryBlocks<'a, T, Q> {
    pub(super) fn new(
        world: &'a World,
        rays: &'a RayBlock,
        hits: &'a mut HitBlock,
        filter: InstanceFilter<'a>,
    ) -> Self {
        EntryBlocks { world, rays, hits, filter, kind: PhantomData }
    }
}

impl<S: Simd, T: TriangleTest, Q: HitQuery> BlockEntries<S> for EntryBlocks<'_, T, Q> {
    type Query = Q;

    #[inline(always)]
    fn leaf(
        &mut self,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        lanes: u16,
        t: &mut [f32; LANES],
        active: &mut u16,
    ) {
        let world = self.world;
        if let Some(entry) = world.entry_of_leaf(units, leaf, self.filter) {
            self.enter(simd, entry, lanes & *active, t, active);
        }
    }

    #[inline(never)]
    fn subtree(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        start: ChildRef,
        setups: &[RaySetup; LANES],
        lanes: u16,
        t: &mut [f32; LANES],
        active: &mut u16,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                for lane in set_bits(lanes) {
                    let (ray, setup) = (self.rays.get(lane), &setups[lane]);
                    if Q::ANY {
                        let mut leaves = InstanceAny::<T>::new(self.world, &ray, self.filter);
                        traverse_from(simd, tree, setup, t[lane], start, &mut leaves);
                        if leaves.found {
                            self.hits.prim[lane] = 0;
                            *active &= !(1 << lane);
                        }
                    } else {
                        let mut leaves = InstanceClosest::<T>::new(self.world, &ray, self.filter);
                        leaves.best = self.hits.get(lane);
                        traverse_from(simd, tree, setup, t[lane], start, &mut leaves);
                        if let Some(best) = leaves.best {
                            self.hits.set(lane, leaves.best);
                            t[lane] = best.t;
                        }
                    }
                }
            },
        );
    }
}

impl<T: TriangleTest, Q: HitQuery> EntryBlocks<'_, T, Q> {
    /// The rays of `lanes` through one entry.
    #[inline(always)]
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        entry: Entry<'_>,
        lanes: u16,
        t: &mut [f32; LANES],
        active: &mut u16,
    ) {
        let (mut local, mut moved) = (RayBlock::INACTIVE, [0.0; LANES]);
        let limits = limits_of::<Q>(self.rays, self.hits);
        let inside =
            entry.placement().enter_block(self.rays, lanes, &limits, &mut local, &mut moved);
        if inside == 0 {
            return;
        }
        let mut found = HitBlock::MISS;
        match entry.triangles(self.filter) {
            Some(tree) if inside.count_ones() > MAX_SINGLE_RAYS => {
                let (local, found) =
                    (std::slice::from_ref(&local), std::slice::from_mut(&mut found));
                incoherent::trace::<S, T, Q>(simd, &tree, local, found, entry.number());
                if !Q::ANY {
                    entry.resolve(found);
                }
            }
            None if inside.count_ones() > MAX_SINGLE_RAYS
                && let Some(shape) = entry.packet_shape() =>
            {
                let local = std::slice::from_ref(&local);
                let found = std::slice::from_mut(&mut found);
                shape.trace::<S, Q>(simd, local, found, entry.number());
            }
            _ => {
                for lane in set_bits(inside) {
                    let ray = local.get(lane);
                    if Q::ANY {
                        let hit = entry.occluded::<S, T>(simd, &ray, self.filter);
                        found.prim[lane] = if hit { 0 } else { NO_HIT };
                    } else {
                        found.set(lane, entry.closest::<S, T>(simd, &ray, self.filter));
                    }
                }
            }
        }
        let nearer = merge_hits::<Q>(self.hits, &found, &moved, inside);
        if Q::ANY {
            *active &= !nearer;
        } else {
            for lane in 0..LANES {
                t[lane] = if nearer >> lane & 1 == 1 { self.hits.t[lane] } else { t[lane] };
            }
        }
    }
}
