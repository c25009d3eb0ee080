//! Test of an f32 ray against the rounded triangles of two leaves, eight at a time: which are
//! surely missed, which surely hit, and how far along.
//!
//! The test is that of [`crate::bvh::intersect::watertight`], with bounds on the distance from the
//! result for the f64 ray and the f64 triangles.

use super::build::LeafFloats;
use crate::bvh::intersect::watertight::Shear;
use crate::bvh::traverse::single::RaySetup;
use crate::bvh::traverse::three;
use crate::bvh::traverse::triangle_leaf::both_rows;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8};

/// Largest error of a sheared coordinate.
///
/// Coordinates of corners are at most 1 and those of the start at most
/// [`super::local_ray::MAX_START`], so differences are at most 2¼ and sheared ones at most 4½. In
/// units of 2⁻²⁵: rounding of the corner 1, of the start 2, of the difference 4, for two axes; of
/// the slope times the difference 2¼; of the product 4; of the last difference 8. Together 28¼.
const SHEARED: f32 = 1.0 / (1 << 20) as f32;

/// Bound on the error of an edge function, as a factor of the sum of the magnitudes of all sheared
/// coordinates: [`SHEARED`] for the coordinates, and 0.28 · [`SHEARED`] for the rounding of
/// products of coordinates of at most 4½.
const EDGE: f32 = 1.5 * SHEARED;

/// Largest error of a depth that is not due to the edge functions. In units of 2⁻²⁵: rounding of
/// the coordinate along the main axis 7, of the weights and their products with at most 2¼ 27, of
/// the slope 2¼ and of the product with it 4½. Together 40¾.
const DEPTH: f32 = 1.0 / (1 << 19) as f32;

/// Lanes that are not surely missed.
pub(super) struct Filtered {
    /// Lanes that may be hit.
    pub(super) possible: u32,
    /// Those that are hit, unless the hit is outside of the ray's range.
    pub(super) certain: u32,
    /// The hit lies between these parameters of the f32 ray.
    pub(super) near: [f32; 8],
    pub(super) far: [f32; 8],
}

/// Tests the triangles of two leaves, the first leaf's in the low lanes.
#[inline(always)]
pub(super) fn filter<S: Simd>(
    simd: S,
    leaves: [&LeafFloats; 2],
    ray: &RaySetup,
) -> Option<Filtered> {
    let Shear { kx, ky, kz, sx, sy, sz } = ray.shear;
    let axes = [kx, ky, kz];
    let splat = |x: f32| f32x8::splat(simd, x);
    let o: [f32x8<S>; 3] = three!(|k| splat(ray.origin[axes[k]]));
    let a: [f32x8<S>; 3] = three!(|k| both_rows(simd, leaves, axes[k]) - o[k]);
    let b: [f32x8<S>; 3] = three!(|k| both_rows(simd, leaves, 3 + axes[k]) - o[k]);
    let c: [f32x8<S>; 3] = three!(|k| both_rows(simd, leaves, 6 + axes[k]) - o[k]);
    let (sx, sy, sz) = (splat(sx), splat(sy), splat(sz));
    let (ax, ay) = (a[0] - sx * a[2], a[1] - sy * a[2]);
    let (bx, by) = (b[0] - sx * b[2], b[1] - sy * b[2]);
    let (cx, cy) = (c[0] - sx * c[2], c[1] - sy * c[2]);
    let u = bx * cy - by * cx;
    let v = cx * ay - cy * ax;
    let w = ax * by - ay * bx;
    let size = (ax.abs() + ay.abs()) + (bx.abs() + by.abs()) + (cx.abs() + cy.abs());
    let error = (size + splat(2.0 * SHEARED)) * splat(EDGE);
    let (least, most) = (u.min(v).min(w), u.max(v).max(w));
    let possible = least.simd_ge(-error) | most.simd_le(error);
    if !possible.any_true() {
        return None;
    }
    let certain = least.simd_gt(error) | most.simd_lt(-error);
    // ---- Depth: a mean of the corners' with weights that are wrong by at most 8 error / |det|
    // together, or anywhere between the corners'.
    let det = u + v + w;
    let (z0, z1) = (a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2]));
    let good = det.abs().simd_gt(error * splat(16.0));
    let scale = splat(1.0) / det;
    let z = (u * scale) * a[2] + (v * scale) * b[2] + (w * scale) * c[2];
    let half = (z1 - z0) * (error * scale).abs() * splat(8.0);
    let lo = good.select((z - half).max(z0), z0) * sz;
    let hi = good.select((z + half).min(z1), z1) * sz;
    let near = lo.min(hi) - splat(DEPTH);
    let far = lo.max(hi) + splat(DEPTH);
    Some(Filtered {
        possible: possible.to_bitmask() as u32,
        certain: certain.to_bitmask() as u32,
        near: near.to_array(),
        far: far.to_array(),
    })
}
