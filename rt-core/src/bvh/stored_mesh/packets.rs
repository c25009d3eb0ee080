//! Many rays through a page at once.

use super::page::Page;
use super::{StoredMesh, recent_hits};
use crate::bvh::compact::TrianglePlace;
use crate::bvh::query::{HitQuery, WatertightTest};
use crate::bvh::shape_packets::{PacketRoom, PacketShape};
use crate::bvh::traverse::meshlets;
use crate::bvh::traverse::packet::{Packet, PacketLimits, PacketPart};
use crate::ray::{HitBlock, LANES, RayBlock};
use fearless_simd::Simd;

/// With fewer groups of sixteen rays, each goes through a page by itself.
const FEWEST_GROUPS: usize = 3;

impl PacketShape for StoredMesh {
    fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        page: u32,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        room: PacketRoom<'_>,
    ) {
        self.with_page(page, |page| page.trace::<S, Q>(simd, rays, hits, room));
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
            packet.trace_part::<S, WatertightTest, Q>(simd, &page.view(), part, found);
        });
        true
    }

    fn keep_places(&self, rays: &[RayBlock], hits: &[HitBlock], places: &[[TrianglePlace; LANES]]) {
        recent_hits::keep(self.key(), rays, hits, places);
    }
}

impl Page {
    /// At most sixteen blocks through the page; the primitives of hits are its triangles.
    fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        PacketRoom { packet, places }: PacketRoom<'_>,
    ) {
        let tree = self.view();
        if rays.len() >= FEWEST_GROUPS && packet.load(simd, rays, &PacketLimits::NONE) {
            packet.trace::<S, WatertightTest, Q>(simd, &tree);
            packet.store::<Q>(hits, 0);
            places.copy_from_slice(&packet.place[..places.len()]);
        } else {
            meshlets::trace_blocks::<S, WatertightTest, Q>(simd, &tree, rays, hits, 0, places);
        }
    }
}
