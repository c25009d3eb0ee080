//! Unit normals of the triangles that rays hit.

use crate::world::Corners;
use rt_core::glam::DVec3;
use rt_core::ray::{HitBlock, LANES};

/// Rays whose triangles are read before the first normal is computed. The arrays are rarely in the
/// caches, and reads that do not wait for arithmetic are under way together. To read all numbers of
/// corners first, and then the corners, gained nothing more.
const TOGETHER: usize = 4 * LANES;

/// Writes the unit normal of each hit's triangle, on the side from which its corners are seen
/// counter-clockwise: zero where nothing is hit, for triangles without area, and for those of
/// arrays that were changed since the build.
pub(crate) fn write_normals(corners: &[Corners<'_>], hits: &[HitBlock], normals: &mut [[f32; 3]]) {
    let mut triangles = [[[0f32; 3]; 3]; TOGETHER];
    for (hits, normals) in hits.chunks(TOGETHER / LANES).zip(normals.chunks_mut(TOGETHER)) {
        for (i, triangle) in triangles.iter_mut().enumerate().take(normals.len()) {
            let hit = hits[i / LANES].get(i % LANES);
            let found = hit.and_then(|h| corners.get(h.instance as usize)?.triangle(h.prim));
            *triangle = found.unwrap_or_default();
        }
        for (normal, triangle) in normals.iter_mut().zip(&triangles) {
            *normal = unit_normal(*triangle);
        }
    }
}

/// The unit normal of a triangle; zero for one without area. In f64, so that triangles of any size
/// have one.
#[inline]
pub(crate) fn unit_normal(triangle: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = triangle.map(|p| DVec3::from(p.map(f64::from)));
    (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array()
}
