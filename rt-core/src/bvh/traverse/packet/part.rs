//! Some of a packet's rays through another tree in the same space, a page of a stored mesh: what
//! the packet knows of its rays serves there too, and nothing is loaded again.

use super::{GROUPS, Packet, Row, load_row};
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::block_hits::{limits_of, set_bits};
use crate::bvh::traverse::single::inflate_t;
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use fearless_simd::{Simd, SimdBase};

/// Some rays of the packet, all of whose rays and hits are here: the lanes `lanes[g]` of each group
/// g in `reached`.
#[derive(Clone, Copy)]
pub(crate) struct PacketPart<'a> {
    pub(crate) rays: &'a [RayBlock],
    pub(crate) hits: &'a [HitBlock],
    pub(crate) reached: u16,
    pub(crate) lanes: &'a [u16; LANES],
}

impl Packet {
    /// Traces a part of the loaded rays through `tree`, up to the closest hits that they have.
    /// Calls `found` for each group with hits in the tree, which [`Packet::hits_of`] has then. The
    /// rays are left as they were before.
    #[inline(always)]
    pub(crate) fn trace_part<S: Simd, T: TriangleTest, Q: HitQuery>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        part: PacketPart<'_>,
        mut found: impl FnMut(&Packet, usize),
    ) {
        let mut kept: [(Row, u16); GROUPS] = [([0.0; LANES], 0); GROUPS];
        let (kept_t, mut entered) = (self.group_t, 0);
        for g in set_bits(part.reached) {
            let on = self.active[g] & part.lanes[g];
            if on == 0 {
                continue;
            }
            kept[g] = (self.t[g], self.active[g]);
            let limits = limits_of::<Q>(&part.rays[g], &part.hits[g]);
            for lane in 0..LANES {
                self.t[g][lane] = if on >> lane & 1 == 1 { limits[lane] } else { -1.0 };
            }
            // Number 0 at the limit: nothing at exactly the limit wins.
            (self.active[g], self.hit[g], self.prim[g]) = (on, 0, [0; LANES]);
            self.group_t[g] = inflate_t(load_row(simd, &self.t[g]).reduce_max());
            entered |= 1 << g;
        }
        if entered == 0 {
            return;
        }
        let groups = std::mem::replace(&mut self.groups, entered);
        self.keeps_places = true;
        self.trace::<S, T, Q>(simd, tree);
        self.keeps_places = false;
        self.groups = groups;
        for g in set_bits(entered) {
            if self.hit[g] != 0 {
                found(self, g);
            }
            (self.t[g], self.active[g]) = kept[g];
        }
        self.group_t = kept_t;
    }

    /// The hits of group `g`.
    #[inline(always)]
    pub(crate) fn hits_of(&self, g: usize) -> HitBlock {
        let mut hits = HitBlock::MISS;
        for lane in 0..LANES {
            let on = self.hit[g] >> lane & 1 == 1;
            hits.prim[lane] = if on { self.prim[g][lane] } else { NO_HIT };
        }
        (hits.t, hits.u, hits.v) = (self.t[g], self.u[g], self.v[g]);
        hits
    }
}
