//! Traces many rays in one call: in packets for coherent rays, and with a shared start of the
//! traversal for incoherent ones.

use super::entry::Entry;
use super::instance_filter::InstanceFilter;
use super::options::Robustness;
use super::placement::ORDINARY_LENGTHS;
use super::placement::Placement;
use super::query::{AnyHit, ClosestHit, FastTest, HitQuery, TriangleTest, WatertightTest};
use super::world::{World, with_ordinary_length};
use crate::bvh::traverse::block_hits::limits_of;
use crate::bvh::traverse::incoherent;
use crate::bvh::traverse::packet::{GROUPS, Packet, PacketLimits};
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{Hit, HitBlock, LANES, NO_HIT, Ray, RayBlock};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch, f32x16, mask32x16};
use std::cell::RefCell;

/// Per-thread buffers: a packet is 24 KiB, too large to clear for every call.
pub(super) struct TraversalScratch {
    /// Packets against instances' boxes and against triangles.
    pub(super) outer: Box<Packet>,
    pub(super) inner: Box<Packet>,
    /// A packet's rays in an instance's local space, and how far their origins were moved.
    pub(super) local: Vec<RayBlock>,
    pub(super) moved: Vec<[f64; LANES]>,
    pub(super) local_hits: Vec<HitBlock>,
}

thread_local! {
    static SCRATCH: RefCell<TraversalScratch> = RefCell::new(TraversalScratch::new());
}

impl TraversalScratch {
    pub(super) fn new() -> Self {
        TraversalScratch {
            outer: Packet::new(),
            inner: Packet::new(),
            local: Vec::new(),
            moved: Vec::new(),
            local_hits: Vec::new(),
        }
    }
}

/// Slices of different lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{rays} blocks of rays, but room for the answers of {answers}: give as many of these as of rays"
)]
pub struct StreamError {
    /// Blocks of rays.
    pub rays: usize,
    /// Blocks, or masks, of the answers.
    pub answers: usize,
}

pub(super) fn same_length(rays: usize, answers: usize) -> Result<(), StreamError> {
    if rays == answers { Ok(()) } else { Err(StreamError { rays, answers }) }
}

/// Coherence of neighbouring rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coherence {
    /// Similar directions: to one light, or through neighbouring pixels.
    Coherent,
    /// Any directions.
    Incoherent,
}

impl World {
    /// The closest hits of many rays, in order. Neighbouring rays should be similar (a tile of
    /// pixels, rays to one light): they are traced as packets of up to 256, split where rays differ
    /// too much. Lanes with `t_max <= t_min` are misses.
    ///
    /// The answers are those of [`World::closest`], bit for bit.
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn closest_coherent(
        &self,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
    ) -> Result<(), StreamError> {
        same_length(rays.len(), hits.len())?;
        self.closest_stream(rays, hits, Coherence::Coherent, InstanceFilter::All);
        Ok(())
    }

    /// Occlusion of many similar rays: bit `lane` of `out[block]` is set when that ray is blocked.
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn occluded_coherent(&self, rays: &[RayBlock], out: &mut [u16]) -> Result<(), StreamError> {
        same_length(rays.len(), out.len())?;
        self.occluded_stream(rays, out, Coherence::Coherent, InstanceFilter::All);
        Ok(())
    }

    /// As [`World::closest_coherent`] for rays in any direction (ambient occlusion, glossy and path
    /// tracing). Rays of one block should start close to one another: they share the traversal
    /// while their paths through the tree agree.
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn closest_incoherent(
        &self,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
    ) -> Result<(), StreamError> {
        same_length(rays.len(), hits.len())?;
        self.closest_stream(rays, hits, Coherence::Incoherent, InstanceFilter::All);
        Ok(())
    }

    /// As [`World::occluded_coherent`] for rays in any direction.
    ///
    /// # Errors
    /// When the slices differ in length; then no ray is traced.
    pub fn occluded_incoherent(
        &self,
        rays: &[RayBlock],
        out: &mut [u16],
    ) -> Result<(), StreamError> {
        same_length(rays.len(), out.len())?;
        self.occluded_stream(rays, out, Coherence::Incoherent, InstanceFilter::All);
        Ok(())
    }

    /// Whether an instance of `filter` blocks each ray. All slices have the same length.
    pub(crate) fn occluded_stream(
        &self,
        rays: &[RayBlock],
        out: &mut [u16],
        coherence: Coherence,
        filter: InstanceFilter<'_>,
    ) {
        debug_assert_eq!(rays.len(), out.len(), "checked by the caller");
        if self.excludes_all(filter) {
            out.fill(0);
            return;
        }
        dispatch!(self.level, simd => match self.robustness {
            Robustness::Fast => {
                self.occluded_blocks::<_, FastTest>(simd, rays, out, coherence, filter)
            }
            Robustness::Watertight => {
                self.occluded_blocks::<_, WatertightTest>(simd, rays, out, coherence, filter)
            }
        })
    }

    /// Whether there is only one instance, and `filter` excludes it.
    fn excludes_all(&self, filter: InstanceFilter<'_>) -> bool {
        match self.only_entry() {
            Some(Entry::Instance { number, .. }) => !filter.has(number as usize),
            Some(Entry::Group(_)) | None => false,
        }
    }

    fn occluded_blocks<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        rays: &[RayBlock],
        out: &mut [u16],
        coherence: Coherence,
        filter: InstanceFilter<'_>,
    ) {
        SCRATCH.with_borrow_mut(|scratch| {
            let single = self.single_tree(filter).filter(|_| coherence == Coherence::Coherent);
            let mut hits = [HitBlock::MISS; GROUPS];
            for (r, out) in rays.chunks(GROUPS).zip(out.chunks_mut(GROUPS)) {
                let n = r.len();
                if let Some((_, tree, limits)) = &single
                    && scratch.inner.load(simd, r, limits)
                {
                    scratch.inner.trace::<S, T, AnyHit>(simd, tree);
                    out.copy_from_slice(&scratch.inner.hit[..n]);
                    continue;
                }
                let hits = &mut hits[..n];
                self.trace_group::<S, T, AnyHit>(simd, r, hits, coherence, filter, scratch);
                for (o, h) in out.iter_mut().zip(hits) {
                    *o = (0..LANES).fold(0, |m, l| m | ((h.prim[l] != NO_HIT) as u16) << l);
                }
            }
        });
    }

    /// The only entry of the upper level, when it is a hierarchy of triangles whose local space is
    /// render space: packets then skip the upper level.
    fn single_tree<'a>(
        &'a self,
        filter: InstanceFilter<'a>,
    ) -> Option<(Entry<'a>, TreeView<'a>, PacketLimits)> {
        let only = self.only_entry()?;
        Some((only, only.triangles(filter)?, only.placement().limits()?))
    }

    /// The closest hit of each ray with an instance of `filter`. All slices have the same length.
    pub(crate) fn closest_stream(
        &self,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        coherence: Coherence,
        filter: InstanceFilter<'_>,
    ) {
        debug_assert_eq!(rays.len(), hits.len(), "checked by the caller");
        if self.excludes_all(filter) {
            hits.fill(HitBlock::MISS);
            return;
        }
        dispatch!(self.level, simd => match self.robustness {
            Robustness::Fast => {
                self.closest_blocks::<_, FastTest>(simd, rays, hits, coherence, filter)
            }
            Robustness::Watertight => {
                self.closest_blocks::<_, WatertightTest>(simd, rays, hits, coherence, filter)
            }
        })
    }

    fn closest_blocks<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        coherence: Coherence,
        filter: InstanceFilter<'_>,
    ) {
        SCRATCH.with_borrow_mut(|scratch| {
            let single = self.single_tree(filter).filter(|_| coherence == Coherence::Coherent);
            for (r, h) in rays.chunks(GROUPS).zip(hits.chunks_mut(GROUPS)) {
                if let Some((entry, tree, limits)) = &single
                    && scratch.inner.load(simd, r, limits)
                {
                    scratch.inner.trace::<S, T, ClosestHit>(simd, tree);
                    scratch.inner.store_all(simd, h, entry.number());
                    entry.resolve(h);
                    continue;
                }
                self.trace_group::<S, T, ClosestHit>(simd, r, h, coherence, filter, scratch);
            }
        });
    }

    /// At most sixteen blocks of any kind.
    fn trace_group<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        coherence: Coherence,
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
    ) {
        hits.fill(HitBlock::MISS);
        if any_unusual_length(simd, rays) {
            self.trace_single_rays::<S, T, Q>(simd, rays, hits, filter);
            return;
        }
        match coherence {
            Coherence::Coherent => {
                self.trace_coherent::<S, T, Q>(simd, rays, hits, filter, scratch)
            }
            Coherence::Incoherent => {
                self.trace_incoherent::<S, T, Q>(simd, rays, hits, filter, scratch)
            }
        }
    }

    /// Blocks of rays in any direction.
    fn trace_incoherent<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
    ) {
        let Some(only) = self.only_entry() else {
            let coherence = Coherence::Incoherent;
            self.trace_several::<S, T, Q>(simd, rays, hits, filter, scratch, coherence);
            return;
        };
        match only.triangles(filter) {
            Some(tree) if only.placement().accepts_blocks(simd, rays) => {
                incoherent::trace::<S, T, Q>(simd, &tree, rays, hits, only.number());
                if !Q::ANY {
                    only.resolve(hits);
                }
            }
            _ => {
                let coherence = Coherence::Incoherent;
                self.trace_entry::<S, T, Q>(simd, only, rays, hits, filter, scratch, coherence)
            }
        }
    }

    /// At most sixteen blocks.
    fn trace_coherent<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
    ) {
        if let Some(only) = self.only_entry()
            && only.triangles(filter).is_some()
        {
            let coherence = Coherence::Coherent;
            self.trace_entry::<S, T, Q>(simd, only, rays, hits, filter, scratch, coherence);
            return;
        }
        let coherence = Coherence::Coherent;
        self.trace_several::<S, T, Q>(simd, rays, hits, filter, scratch, coherence);
    }

    pub(super) fn trace_single_rays<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
    ) {
        for (r, h) in rays.iter().zip(hits) {
            for lane in 0..LANES {
                let ray = r.get(lane);
                if !ray.is_valid() {
                    continue;
                }
                count(Counter::Fallbacks, 1);
                let mut room = Ray::UNSET;
                let (ray, unit) = with_ordinary_length(&ray, &mut room);
                if Q::ANY {
                    if self.occluded_in::<S, T>(simd, ray, filter) {
                        h.prim[lane] = 0;
                    }
                } else {
                    let hit = self.closest_in::<S, T>(simd, ray, filter);
                    h.set(lane, hit.map(|c| Hit { t: c.t * unit, ..c }));
                }
            }
        }
    }

    /// One entry against blocks whose closest hits so far are in `hits`; merges the nearer ones.
    #[allow(clippy::too_many_arguments, reason = "the state of one call of the loop above")]
    pub(super) fn trace_entry<S: Simd, T: TriangleTest, Q: HitQuery>(
        &self,
        simd: S,
        entry: Entry<'_>,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        filter: InstanceFilter<'_>,
        scratch: &mut TraversalScratch,
        coherence: Coherence,
    ) {
        let placement = entry.placement();
        let single = self.only.is_some();
        if coherence == Coherence::Coherent && single && placement.accepts_blocks(simd, rays) {
            trace_tree::<S, T, Q>(simd, entry, rays, hits, filter, &mut scratch.inner);
            return;
        }
        let n = rays.len();
        scratch.local.resize(n, RayBlock::INACTIVE);
        scratch.moved.resize(n, [0.0; LANES]);
        scratch.local_hits.resize(n, HitBlock::MISS);
        let (local, moved) = (&mut scratch.local[..n], &mut scratch.moved[..n]);
        to_local_space::<S, Q>(simd, placement, rays, hits, local, moved);
        let local_hits = &mut scratch.local_hits[..n];
        local_hits.fill(HitBlock::MISS);
        let local = &scratch.local[..n];
        trace_tree::<S, T, Q>(simd, entry, local, local_hits, filter, &mut scratch.inner);
        for ((h, new), moved) in hits.iter_mut().zip(local_hits).zip(&scratch.moved) {
            merge_hits::<Q>(h, new, moved, u16::MAX);
        }
    }
}

/// Whether an active ray's direction is so short or long that the single-ray code rescales it. A
/// NaN direction is left to the packet.
#[inline(never)]
pub(super) fn any_unusual_length<S: Simd>(simd: S, rays: &[RayBlock]) -> bool {
    simd.vectorize(
        #[inline(always)]
        || {
            let row = |r: &[f32; LANES]| f32x16::from_slice(simd, r);
            let shortest = f32x16::splat(simd, *ORDINARY_LENGTHS.start());
            let longest = f32x16::splat(simd, *ORDINARY_LENGTHS.end());
            let mut unusual = mask32x16::splat(simd, false);
            for r in rays {
                let m = row(&r.dx).abs().max(row(&r.dy).abs()).max(row(&r.dz).abs());
                let active = row(&r.t_max).simd_gt(row(&r.t_min));
                unusual |= (m.simd_lt(shortest) | m.simd_gt(longest)) & active;
            }
            unusual.any_true()
        },
    )
}

/// The rays in an instance's local space, limited to what is nearer than `hits`.
#[inline(never)]
fn to_local_space<S: Simd, Q: HitQuery>(
    simd: S,
    placement: &Placement,
    rays: &[RayBlock],
    hits: &[HitBlock],
    local: &mut [RayBlock],
    moved: &mut [[f64; LANES]],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            for (((r, h), local), moved) in rays.iter().zip(hits).zip(local).zip(moved) {
                let limits = limits_of::<Q>(r, h);
                placement.enter_block(r, r.active_lanes(), &limits, local, moved);
            }
        },
    );
}

/// Merges the hits of `lanes` in one entry, of rays that were moved by `moved`, into `hits`.
/// Returns the lanes with a nearer hit.
#[inline(always)]
pub(super) fn merge_hits<Q: HitQuery>(
    hits: &mut HitBlock,
    new: &HitBlock,
    moved: &[f64; LANES],
    lanes: u16,
) -> u16 {
    let mut nearer = 0u16;
    for lane in 0..LANES {
        let found = (lanes >> lane & 1 == 1) & (new.prim[lane] != NO_HIT);
        let by = moved[lane];
        let t = if by != 0.0 { (f64::from(new.t[lane]) + by) as f32 } else { new.t[lane] };
        let tie = (t == hits.t[lane]) & (new.instance[lane] < hits.instance[lane]);
        let better = found & (Q::ANY | (t < hits.t[lane]) | tie);
        nearer |= u16::from(better) << lane;
        hits.t[lane] = if better { t } else { hits.t[lane] };
        hits.u[lane] = if better { new.u[lane] } else { hits.u[lane] };
        hits.v[lane] = if better { new.v[lane] } else { hits.v[lane] };
        hits.prim[lane] = if better { new.prim[lane] } else { hits.prim[lane] };
        hits.instance[lane] = if better { new.instance[lane] } else { hits.instance[lane] };
    }
    nearer
}

/// Blocks in local space against one entry: as one packet when the rays agree in octant and
/// dominant axis, else in smaller packets, else one by one.
pub(super) fn trace_tree<S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    entry: Entry<'_>,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    filter: InstanceFilter<'_>,
    packet: &mut Packet,
) {
    let Some(tree) = entry.triangles(filter) else {
        if let Some(shape) = entry.packet_shape() {
            shape.trace::<S, Q>(simd, rays, hits, entry.number());
            return;
        }
        trace_tree_by_single_rays::<S, T, Q>(simd, entry, rays, hits, filter);
        return;
    };
    let number = entry.number();
    // Packets of 16 blocks, then of 4; blocks whose rays diverge share the start of the traversal.
    for (r, h) in rays.chunks(GROUPS).zip(hits.chunks_mut(GROUPS)) {
        if packet.load(simd, r, &PacketLimits::NONE) {
            packet.trace::<S, T, Q>(simd, &tree);
            packet.store::<Q>(h, number);
            continue;
        }
        for (r, h) in r.chunks(4).zip(h.chunks_mut(4)) {
            if packet.load(simd, r, &PacketLimits::NONE) {
                packet.trace::<S, T, Q>(simd, &tree);
                packet.store::<Q>(h, number);
                continue;
            }
            incoherent::trace::<S, T, Q>(simd, &tree, r, h, number);
        }
    }
    if !Q::ANY {
        entry.resolve(hits);
    }
}

fn trace_tree_by_single_rays<S: Simd, T: TriangleTest, Q: HitQuery>(
    simd: S,
    entry: Entry<'_>,
    rays: &[RayBlock],
    hits: &mut [HitBlock],
    filter: InstanceFilter<'_>,
) {
    for (r, h) in rays.iter().zip(hits) {
        for lane in 0..LANES {
            let ray: Ray = r.get(lane);
            if !ray.is_valid() {
                continue;
            }
            count(Counter::Fallbacks, 1);
            if Q::ANY {
                if entry.occluded::<S, T>(simd, &ray, filter) {
                    h.prim[lane] = 0;
                }
            } else if let Some(hit) = entry.closest::<S, T>(simd, &ray, filter) {
                h.set(lane, Some(hit));
            }
        }
    }
}
