//! A packet of rays through the entries of the upper level that they meet.

use super::entry::Entry;
use super::instance_filter::InstanceFilter;
use super::layout::wide::{ChildRef, Unit};
use super::query::{HitQuery, TriangleTest};
use super::streams::{merge_hits, trace_tree};
use super::world::World;
use crate::bvh::traverse::block_hits::{limits_of, set_bits};
use crate::bvh::traverse::incoherent;
use crate::bvh::traverse::packet::{GROUPS, Packet, PacketEntries};
use crate::ray::{HitBlock, LANES, RayBlock};
use fearless_simd::Simd;
use std::marker::PhantomData;

/// With fewer groups of sixteen rays, each goes through an entry by itself.
const FEWEST_GROUPS: usize = 3;

/// Buffers of [`GROUPS`] blocks each.
pub(super) struct EntryRoom<'a> {
    pub(super) packet: &'a mut Packet,
    pub(super) local: &'a mut [RayBlock],
    pub(super) moved: &'a mut [[f64; LANES]],
    pub(super) local_hits: &'a mut [HitBlock],
}

/// A packet on its way through the upper level.
pub(super) struct EntryPackets<'a, T, Q> {
    world: &'a World,
    rays: &'a [RayBlock],
    hits: &'a mut [HitBlock],
    filter: InstanceFilter<'a>,
    room: EntryRoom<'a>,
    kind: PhantomData<(T, Q)>,
}

impl<'a, T, Q> EntryPackets<'a, T, Q> {
    pub(super) fn new(
        world: &'a World,
        rays: &'a [RayBlock],
        hits: &'a mut [HitBlock],
        filter: InstanceFilter<'a>,
        room: EntryRoom<'a>,
    ) -> Self {
        EntryPackets { world, rays, hits, filter, room, kind: PhantomData }
    }
}

impl<S: Simd, T: TriangleTest, Q: HitQuery> PacketEntries<S> for EntryPackets<'_, T, Q> {
    type Query = Q;

    #[inline(always)]
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        let world = self.world;
        let Some(entry) = world.entry_of_leaf(units, leaf, self.filter) else { return 0 };
        let changed = self.enter(simd, entry, reached, lanes);
        for g in set_bits(changed) {
            packet.left().lower::<Q>(g, &self.hits[g]);
        }
        changed
    }
}

impl<T: TriangleTest, Q: HitQuery> EntryPackets<'_, T, Q> {
    /// The rays `lanes` of the groups `reached` through one entry. Returns the groups with nearer
    /// hits.
    #[inline(always)]
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        entry: Entry<'_>,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        let EntryRoom { packet, local, moved, local_hits } = &mut self.room;
        let (mut n, mut entered) = (0, [(0, 0); GROUPS]);
        for g in set_bits(reached) {
            let limits = limits_of::<Q>(&self.rays[g], &self.hits[g]);
            let (local, moved) = (&mut local[n & 15], &mut moved[n & 15]);
            let inside =
                entry.placement().enter_block(&self.rays[g], lanes[g], &limits, local, moved);
            if inside != 0 {
                entered[n & 15] = (g, inside);
                n += 1;
            }
        }
        let (local, local_hits) = (&local[..n], &mut local_hits[..n]);
        local_hits.fill(HitBlock::MISS);
        match entry.triangles(self.filter) {
            Some(tree) if n < FEWEST_GROUPS => {
                incoherent::trace::<S, T, Q>(simd, &tree, local, local_hits, entry.number());
                if !Q::ANY {
                    entry.resolve(local_hits);
                }
            }
            _ => trace_tree::<S, T, Q>(simd, entry, local, local_hits, self.filter, packet),
        }
        let mut changed = 0;
        for (i, &(g, inside)) in entered[..n].iter().enumerate() {
            let nearer = merge_hits::<Q>(&mut self.hits[g], &local_hits[i], &moved[i], inside);
            changed |= u16::from(nearer != 0) << g;
        }
        changed
    }
}
