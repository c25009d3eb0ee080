//! Many rays through a world of several instances.

use super::entries_in_turns;
use super::entry_blocks::EntryBlocks;
use super::entry_packets::{EntryPackets, EntryRoom};
use super::instance_filter::InstanceFilter;
use super::query::{HitQuery, TriangleTest};
use super::streams::{Coherence, TraversalScratch};
use super::world::World;
use crate::bvh::traverse::block_entries::traverse_block;
use crate::bvh::traverse::packet::{GROUPS, PacketLimits};
use crate::bvh::traverse::timed_choice::TimedChoice;
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use fearless_simd::Simd;
use std::cell::RefCell;

/// Number of ways through the upper level.
pub(super) const WAYS: usize = 4;

/// Entry by entry, each with the rays of a packet that meet it: fast where many of them do.
const BY_ENTRY: usize = 0;
/// Sixteen rays together through the upper level and the instances that some of them meet.
const IN_BLOCKS: usize = 1;
/// Ray by ray: fast where rays part before they reach an instance.
const BY_RAY: usize = 2;
/// Ray by ray, many in turns: fast where such rays wait for memory.
const IN_TURNS: usize = 3;

/// The fastest way for rays of one kind: after packets that met something, and after those that
/// met nothing. Both come in runs, in the image and along it: packets among trees are fastest ray
/// by ray, those in the sky above are answered together. (Measured on 20,000 trees of which a tenth
/// of the image is covered: 0.85 of the time of one choice for both.)
#[derive(Clone, Copy)]
struct Choice {
    ways: [TimedChoice<WAYS>; 2],
    met: bool,
}

impl Choice {
    /// `first` is taken for the fastest way at first.
    const fn new(first: usize) -> Choice {
        Choice { ways: [TimedChoice::new(first); 2], met: false }
    }
}

thread_local! {
    /// For coherent and for incoherent rays, for closest hits and for occlusion. Instances can be a
    /// few large ones, or a hundred thousand that are smaller than a pixel, and rays that are
    /// coherent over one surface are not over many.
    static CHOICES: RefCell<[[Choice; 2]; 2]> =
        const { RefCell::new([[Choice::new(IN_BLOCKS); 2], [Choice::new(BY_RAY); 2]]) };
}

/// Calls `work` with the thread's choice for such rays.
fn with_choice<Q: HitQuery, R>(coherence: Coherence, work: impl FnOnce(&mut Choice) -> R) -> R {
    CHOICES.with_borrow_mut(|choices| work(&mut choices[coherence as usize][Q::ANY as usize]))
}

impl World {
    /// At most sixteen blocks through the upper level.
    pub(super) fn trace_several<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
        coherence: Coherence,
    ) {
        let coherent = coherence == Coherence::Coherent;
        // Ray by ray through the upper level, they would share no work.
        if !coherent && !self.few.is_empty() {
            for &id in self.few.iter().filter(|&&id| self.allows(filter, id)) {
                let entry = self.entry(id);
                self.trace_entry::<S, T, Q>(simd, entry, rays, hits, filter, scratch, coherence);
            }
            return;
        }
        let (met, (way, start)) = with_choice::<Q, _>(coherence, |choice| {
            (choice.met, choice.ways[choice.met as usize].next(|way| way != BY_ENTRY || coherent))
        });
        self.trace_in_way::<S, T, Q>(way, simd, rays, hits, filter, scratch);
        let seconds = start.map_or(0.0, |start| start.elapsed().as_secs_f32());
        with_choice::<Q, _>(coherence, |choice| {
            choice.ways[met as usize].learn(seconds / rays.len().max(1) as f32);
            choice.met = hits.iter().any(|h| h.prim.iter().any(|&prim| prim != NO_HIT));
        });
    }

    /// At most sixteen blocks through the upper level in one of the ways; all give the same bits.
    pub(super) fn trace_in_way<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        way: usize,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
    ) {
        match way {
            BY_ENTRY => self.trace_by_entry::<S, T, Q>(simd, rays, hits, filter, scratch),
            IN_BLOCKS => self.trace_blocks::<S, T, Q>(simd, rays, hits, filter),
            IN_TURNS => entries_in_turns::trace::<S, T, Q>(simd, self, rays, hits, filter),
            _ => self.trace_single_rays::<S, T, Q>(simd, rays, hits, filter),
        }
    }

    /// Entry by entry, each with all rays of the packet that meet its box.
    fn trace_by_entry<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
    ) {
        let TraversalScratch { outer, inner, local, moved, local_hits } = scratch;
        if outer.load(simd, rays, &PacketLimits::NONE) {
            local.resize(GROUPS, RayBlock::INACTIVE);
            moved.resize(GROUPS, [0.0; LANES]);
            local_hits.resize(GROUPS, HitBlock::MISS);
            let room = EntryRoom { packet: inner, local, moved, local_hits };
            let mut entries = EntryPackets::<T, Q>::new(self, rays, hits, filter, room);
            outer.visit_entries(simd, &TreeView::all(&self.tlas), &mut entries);
        } else {
            self.trace_blocks::<S, T, Q>(simd, rays, hits, filter);
        }
    }

    /// Blocks of similar rays that meet many entries, sixteen rays together.
    fn trace_blocks<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
    ) {
        for (rays, hits) in rays.iter().zip(hits) {
            let active = rays.active_lanes();
            let mut entries = EntryBlocks::<T, Q>::new(self, rays, hits, filter);
            traverse_block(simd, &self.tlas, rays, active, &mut entries);
        }
    }
}
