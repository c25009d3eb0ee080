//! Many rays through a world of several instances.

use super::blas::leaf_primitive_ids;
use super::entry_blocks::EntryBlocks;
use super::instance_filter::InstanceFilter;
use super::query::{HitQuery, TriangleTest};
use super::streams::{Coherence, TraversalScratch};
use super::world::World;
use crate::bvh::traverse::block_entries::traverse_block;
use crate::bvh::traverse::packet::PacketLimits;
use crate::bvh::traverse::single::inflate_t;
use crate::bvh::traverse::timed_choice::TimedChoice;
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use fearless_simd::Simd;
use std::cell::Cell;

// The ways through the upper level.

/// Instance by instance, each with all rays that may meet it: fast for a few large instances.
const BY_INSTANCE: usize = 0;
/// Sixteen rays together through the upper level and the instances that some of them meet.
const IN_BLOCKS: usize = 1;
/// Ray by ray: fast where rays part before they reach an instance.
const BY_RAY: usize = 2;

/// For closest hits and for occlusion.
type Choices = [TimedChoice<3>; 2];

thread_local! {
    /// The fastest way for coherent and for incoherent rays. Instances can be a few large ones, or
    /// a hundred thousand that are smaller than a pixel, and rays that are coherent over one
    /// surface are not over many.
    static CHOICES: Cell<[Choices; 2]> = const {
        Cell::new([[TimedChoice::new(IN_BLOCKS); 2], [TimedChoice::new(BY_RAY); 2]])
    };
}

/// When a packet may hit more instances than this, it is traced in blocks: most of its rays hit
/// only a few of them.
const MOST_CANDIDATES: usize = 16;

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
        let mut choices = CHOICES.get();
        let choice = &mut choices[coherence as usize][Q::ANY as usize];
        let coherent = coherence == Coherence::Coherent;
        let (way, start) = choice.next(|way| way != BY_INSTANCE || coherent);
        match way {
            // Ray by ray through the upper level, they would share no work.
            _ if !coherent && !self.few.is_empty() => {
                for &id in self.few.iter().filter(|&&id| self.allows(filter, id)) {
                    let entry = self.entry(id);
                    self.trace_entry::<S, T, Q>(
                        simd, entry, rays, hits, filter, scratch, coherence,
                    );
                }
                return;
            }
            BY_INSTANCE => self.trace_by_instance::<S, T, Q>(simd, rays, hits, filter, scratch),
            IN_BLOCKS => self.trace_blocks::<S, T, Q>(simd, rays, hits, filter),
            _ => self.trace_single_rays::<S, T, Q>(simd, rays, hits, filter),
        }
        let seconds = start.map_or(0.0, |start| start.elapsed().as_secs_f32());
        choice.learn(seconds / rays.len().max(1) as f32);
        CHOICES.set(choices);
    }

    /// Those entries whose boxes the packet intersects, nearest first.
    fn trace_by_instance<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
    ) {
        scratch.candidates.clear();
        if self.only.is_none() && scratch.outer.load(simd, rays, &PacketLimits::NONE) {
            scratch.outer.collect(simd, &TreeView::all(&self.tlas), &mut scratch.candidates);
            let mut order = std::mem::take(&mut scratch.order);
            order.clear();
            for &(distance, leaf) in &scratch.candidates {
                let met = leaf_primitive_ids(&self.tlas.units, leaf).iter();
                let met = met.filter(|&&id| self.allows(filter, id));
                order.extend(met.map(|&i| (distance, i)));
            }
            let use_packets = order.len() <= MOST_CANDIDATES;
            if use_packets {
                order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                for &(distance, id) in &order {
                    if all_resolved::<Q>(rays, hits, distance) {
                        break;
                    }
                    let (entry, coherence) = (self.entry(id), Coherence::Coherent);
                    self.trace_entry::<S, T, Q>(
                        simd, entry, rays, hits, filter, scratch, coherence,
                    );
                }
            }
            scratch.order = order;
            if use_packets {
                return;
            }
        }
        self.trace_blocks::<S, T, Q>(simd, rays, hits, filter);
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

/// Whether nothing at `distance` or farther can change an answer.
fn all_resolved<Q: HitQuery>(rays: &[RayBlock], hits: &[HitBlock], distance: f32) -> bool {
    rays.iter().zip(hits).all(|(r, h)| {
        (0..LANES).all(|lane| {
            let found = h.prim[lane] != NO_HIT;
            let idle = r.t_max[lane] <= r.t_min[lane];
            idle || found && (Q::ANY || inflate_t(h.t[lane]) < distance)
        })
    })
}
