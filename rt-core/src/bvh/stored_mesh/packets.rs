//! Many rays through a page at once.

use super::{StoredMesh, recent_hits};
use crate::bvh::compact::TrianglePlace;
use crate::bvh::query::{HitQuery, WatertightTest};
use crate::bvh::shape_packets::PacketShape;
use crate::bvh::traverse::incoherent;
use crate::bvh::traverse::packet::{Packet, PacketPart};
use crate::ray::{HitBlock, LANES, RayBlock};
use fearless_simd::Simd;

/// With fewer groups of sixteen rays, each block goes through a page by itself.
const FEWEST_GROUPS: usize = 3;

impl PacketShape for StoredMesh {
    fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        page: u32,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        places: &mut [[TrianglePlace; LANES]],
    ) {
        self.with_page(page, |page| {
            let view = page.view();
            incoherent::trace_keeping_places::<S, WatertightTest, Q>(
                simd, &view, rays, hits, 0, places,
            );
        });
    }

    fn trace_part<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        page: u32,
        packet: &mut Packet,
        part: PacketPart<'_>,
        found: impl FnMut(&Packet, usize),
    ) -> bool {
        if (part.reached.count_ones() as usize) < FEWEST_GROUPS {
            return false;
        }
        self.with_page(page, |page| {
            // The cache calls this from functions that have no instruction set.
            simd.vectorize(
                #[inline(always)]
                || packet.trace_part::<S, WatertightTest, Q>(simd, &page.view(), part, found),
            );
        });
        true
    }

    fn keep_places(&self, rays: &[RayBlock], hits: &[HitBlock], places: &[[TrianglePlace; LANES]]) {
        recent_hits::keep(self.key(), rays, hits, places);
    }
}
