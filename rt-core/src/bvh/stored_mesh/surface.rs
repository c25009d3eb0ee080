//! The triangles of a stored mesh that rays have hit, for shading.

use super::StoredMesh;
use super::attributes::HitAttributes;
use super::page::PageHit;
use super::recent_hits;
use crate::bvh::compact::TrianglePlace;
use crate::bvh::traverse::block_hits::set_bits;
use crate::ray::{HitBlock, LANES, Ray};
use crate::shapes::ShapeHit;
use glam::Vec3;

/// A triangle that a ray has hit, relative to the mesh's origin, and what the point has beside its
/// place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TriangleHit {
    pub(crate) corners: [Vec3; 3],
    pub(crate) attributes: HitAttributes,
}

impl StoredMesh {
    /// The triangle that `ray` hits in page `page`. `None` when the page cannot be read any more.
    pub(crate) fn triangle_hit(&self, page: u32, hit: &ShapeHit, ray: &Ray) -> Option<TriangleHit> {
        let hits = HitBlock { t: [hit.t; LANES], prim: [page; LANES], ..HitBlock::MISS };
        let hits = HitBlock { u: [hit.u; LANES], v: [hit.v; LANES], ..hits };
        let mut triangle = None;
        self.triangle_hits(1, &[*ray; LANES], &hits, true, |_, found| triangle = Some(found));
        triangle
    }

    /// [`StoredMesh::triangle_hit`] of each of the `lanes`: pages are looked up once for all that
    /// have hit them, and their attributes are read where they are `wanted`. `found` gets lanes in
    /// any order.
    pub(crate) fn triangle_hits(
        &self,
        lanes: u16,
        rays: &[Ray; LANES],
        hits: &HitBlock,
        wanted: bool,
        mut found: impl FnMut(usize, TriangleHit),
    ) {
        let places = recent_hits::find(self.key(), lanes, rays, hits);
        let mut left = lanes;
        while left != 0 {
            let page = hits.prim[left.trailing_zeros() as usize & 15];
            let same = set_bits(left).filter(|&l| hits.prim[l] == page);
            let same = same.fold(0u16, |lanes, l| lanes | 1 << l);
            left &= !same;
            self.triangles_of_page(page, same, rays, hits, wanted, &places, &mut found);
        }
    }

    fn triangles_of_page(
        &self,
        page: u32,
        lanes: u16,
        rays: &[Ray; LANES],
        hits: &HitBlock,
        wanted: bool,
        places: &[TrianglePlace; LANES],
        found: &mut impl FnMut(usize, TriangleHit),
    ) {
        let (mut triangles, mut known) = ([PageHit::NONE; LANES], 0u16);
        self.with_page(page, |p| {
            p.triangles_at(self.level, lanes, places, |lane, triangle| {
                known |= 1 << lane;
                triangles[lane] = triangle;
            });
        });
        for lane in set_bits(lanes & !known) {
            // The same hit by a ray that ends there: it meets few boxes.
            let (ray, t) = (&rays[lane], hits.t[lane]);
            let to_hit = Ray { t_min: t, t_max: t.next_up(), ..*ray };
            if let Some(triangle) = self.hit(page, &to_hit).or_else(|| self.hit(page, ray)) {
                known |= 1 << lane;
                triangles[lane] = triangle;
            }
        }
        let mut attributes = [HitAttributes::default(); LANES];
        if wanted {
            self.with_attributes(page, |all| {
                for lane in set_bits(known) {
                    let (u, v) = (hits.u[lane], hits.v[lane]);
                    attributes[lane] = all.at(triangles[lane].id, [1.0 - u - v, u, v]);
                }
            });
        }
        for lane in set_bits(known) {
            let (corners, attributes) = (triangles[lane].corners, attributes[lane]);
            found(lane, TriangleHit { corners, attributes });
        }
    }
}
