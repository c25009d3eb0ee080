//! A packet through the upper level of a world: the rays that meet an instance's box are handed on,
//! nearest instances first.

use super::{IntervalsAndRays, Packet, PacketLeaf, Row, SeparateOrigins};
use crate::bvh::Unit;
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::HitQuery;
use crate::bvh::traverse::packet::GROUPS;
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{HitBlock, LANES, NO_HIT};
use fearless_simd::Simd;

/// What the rays of a packet still search for.
pub(crate) struct RaysLeft<'p> {
    /// Distances beyond which nothing is searched: the closest hits so far, or the rays' limits.
    pub(crate) t: &'p mut [Row; GROUPS],
    /// Lanes that still search, per group.
    pub(crate) active: &'p mut [u16; GROUPS],
}

impl RaysLeft<'_> {
    /// Nothing farther than `hits` is searched by the rays of group `g`; for occlusion, nothing by
    /// those that are blocked.
    #[inline(always)]
    pub(crate) fn lower<Q: HitQuery>(&mut self, g: usize, hits: &HitBlock) {
        for lane in 0..LANES {
            let found = hits.prim[lane] != NO_HIT;
            let t = if Q::ANY { -1.0 } else { hits.t[lane] };
            self.t[g][lane] = if found { t } else { self.t[g][lane] };
            self.active[g] &= !(u16::from(Q::ANY & found) << lane);
        }
    }
}

/// Traces what the leaves of the upper level refer to.
pub(crate) trait PacketEntries<S: Simd> {
    /// What is asked about the rays.
    type Query: HitQuery;

    /// Traces the rays `lanes[g]` of each group g in `reached` of the packet through the entries of
    /// a leaf. Returns the groups of which some ray has less left to search ([`Packet::left`]).
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16;
}

impl Packet {
    /// What its rays still search for.
    #[inline(always)]
    pub(crate) fn left(&mut self) -> RaysLeft<'_> {
        RaysLeft { t: &mut self.t, active: &mut self.active }
    }

    /// Sends the loaded rays to the leaves of the upper level whose boxes they enter. Every ray is
    /// tested against the boxes: moving one into an instance's space costs more than the test.
    pub(crate) fn visit_entries<S: Simd, E: PacketEntries<S>>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        entries: &mut E,
    ) {
        // No node has fewer rays than one: none leaves the packet.
        self.walk::<S, _, IntervalsAndRays>(simd, tree, &mut Entries(entries), 0);
    }
}

struct Entries<'a, E>(&'a mut E);

impl<S: Simd, E: PacketEntries<S>> PacketLeaf<S> for Entries<'_, E> {
    type Origin = SeparateOrigins;

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
        self.0.leaf(packet, simd, units, leaf, reached, lanes)
    }

    fn switch_to_single(
        &mut self,
        _: &mut Packet,
        _: S,
        _: &TreeView<'_>,
        _: ChildRef,
        _: u16,
        _: &[u16; LANES],
    ) -> u16 {
        0
    }
}
