//! Where the triangles lie that the rays of a thread have hit last. Shading asks for the surface at
//! a hit soon after it was found; with its place, no second search is needed.
//!
//! A hit says which page it lies in, and not which triangle. The same ray, hit at the same distance
//! in the same page, has hit the same triangle: what is found here is what a search would find.

use crate::bvh::compact::TrianglePlace;
use crate::bvh::traverse::block_hits::set_bits;
use crate::ray::{HitBlock, LANES, NO_HIT, Ray, RayBlock};
use std::cell::Cell;

/// Sets of hits that a thread keeps, as a power of two: a few times those of a tile, so that few of
/// them push out others.
const SETS_LOG2: u32 = 11;
/// Hits of a set, the newest first.
const WAYS: usize = 2;

/// A hit, as bits: the ray's origin and direction, and the distance.
type HitBits = [u32; 7];

#[derive(Clone, Copy)]
struct RecentHit {
    /// Of the mesh; different for any two of a process.
    mesh: u64,
    page: u32,
    bits: HitBits,
    place: TrianglePlace,
}

thread_local! {
    static RECENT: Cell<Option<Box<[[RecentHit; WAYS]]>>> = const { Cell::new(None) };
}

fn without_hits() -> Box<[[RecentHit; WAYS]]> {
    let none = RecentHit { mesh: u64::MAX, page: 0, bits: [0; 7], place: TrianglePlace::NONE };
    vec![[none; WAYS]; 1 << SETS_LOG2].into()
}

/// Where a hit is kept. Neighbouring rays differ in the low bits of their directions (Fibonacci
/// hashing: Knuth, The Art of Computer Programming, volume 3, section 6.4).
#[inline(always)]
fn set_of(bits: &HitBits) -> usize {
    let mixed = bits[3] ^ bits[4].rotate_left(11) ^ bits[5].rotate_left(22) ^ bits[6];
    (mixed.wrapping_mul(0x9e37_79b9) >> (u32::BITS - SETS_LOG2)) as usize
}

#[inline(always)]
fn bits_of(ray: &Ray, t: f32) -> HitBits {
    let (o, d) = (ray.origin, ray.dir);
    [o.x, o.y, o.z, d.x, d.y, d.z, t].map(f32::to_bits)
}

/// Keeps the places of closest hits in a mesh.
pub(super) fn keep(
    mesh: u64,
    rays: &[RayBlock],
    hits: &[HitBlock],
    places: &[[TrianglePlace; LANES]],
) {
    let mut recent = RECENT.take().unwrap_or_else(without_hits);
    for ((rays, hits), places) in rays.iter().zip(hits).zip(places) {
        for lane in 0..LANES {
            let (page, place) = (hits.prim[lane], places[lane]);
            if page == NO_HIT || place == TrianglePlace::NONE {
                continue;
            }
            let bits = bits_of(&rays.get(lane), hits.t[lane]);
            let set = &mut recent[set_of(&bits)];
            *set = [RecentHit { mesh, page, bits, place }, set[0]];
        }
    }
    RECENT.set(Some(recent));
}

/// The places of the triangles that the rays of `lanes` have hit in a mesh; none where one is not
/// known any more.
pub(super) fn find(
    mesh: u64,
    lanes: u16,
    rays: &[Ray; LANES],
    hits: &HitBlock,
) -> [TrianglePlace; LANES] {
    let mut places = [TrianglePlace::NONE; LANES];
    let Some(recent) = RECENT.take() else { return places };
    for lane in set_bits(lanes) {
        let bits = bits_of(&rays[lane], hits.t[lane]);
        let wanted = (mesh, hits.prim[lane], bits);
        let set = &recent[set_of(&bits)];
        if let Some(hit) = set.iter().find(|hit| (hit.mesh, hit.page, hit.bits) == wanted) {
            places[lane] = hit.place;
        }
    }
    RECENT.set(Some(recent));
    places
}
