//! The f32 space of the tree: the world's box moved to zero and scaled by a power of two, so that
//! the largest coordinate is between ½ and 1.

use super::error_free::{exponent, power_of_two};
use crate::math::Aabb;
use glam::{DVec3, Vec3};

/// Boxes are wider than the triangles by this much in local space, along each axis.
///
/// It covers the rounding of rays: at a distance of the true hit, the point of the f32 ray differs
/// from that of the f64 ray by the rounding of its origin, whose coordinates are below 2 (2⁻²⁴),
/// and of its direction, whose largest component is below 2, over a distance of at most 2½ (2½ ·
/// 2⁻²⁴). So the f32 ray enters every box whose triangle the f64 ray hits, and at a distance not
/// beyond that hit. The rounding of the slab test itself is covered as for f32 worlds, by
/// [`crate::bvh::traverse::single::BOX_SLACK`].
const MARGIN: f64 = 1.0 / (1 << 22) as f64;

/// Smallest exponent of a frame. A smaller world fills a part of the local space and costs time.
const MIN_EXPONENT: i32 = -900;

/// local = (world − center) / 2ᵉ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) center: DVec3,
    pub(super) exponent: i32,
    /// 2⁻ᵉ.
    scale: f64,
    /// Half the edge lengths of the world's box, in world units.
    pub(super) half: DVec3,
}

impl Frame {
    /// The frame of a world between `min` and `max`.
    pub(super) fn of(min: DVec3, max: DVec3) -> Frame {
        let center = 0.5 * min + 0.5 * max;
        let half = (max - center).max(center - min);
        let size = half.max_element();
        // Above 2¹⁰²² local coordinates are up to 4, where the filter's bounds do not hold; rays
        // are then tested against every triangle: see local_ray.
        let exponent =
            if size.is_normal() { (exponent(size) + 1).clamp(MIN_EXPONENT, 1022) } else { 0 };
        Frame { center, exponent, scale: power_of_two(-exponent), half }
    }

    /// A difference from the centre in local space.
    #[inline(always)]
    pub(super) fn local(&self, offset: f64) -> f64 {
        offset * self.scale
    }

    /// The corner in local space, rounded once.
    pub(super) fn corner(&self, p: DVec3) -> Vec3 {
        ((p - self.center) * self.scale).as_vec3()
    }

    /// The box of a triangle in local space, rounded outwards and widened by [`MARGIN`].
    pub(super) fn bounds(&self, corners: [DVec3; 3]) -> Aabb {
        let [a, b, c] = corners.map(|p| (p - self.center) * self.scale);
        let outwards =
            |v: DVec3, step: fn(f32) -> f32| Vec3::from_array(v.to_array().map(|x| step(x as f32)));
        let (lo, hi) = (a.min(b).min(c) - MARGIN, a.max(b).max(c) + MARGIN);
        Aabb::new(outwards(lo, f32::next_down), outwards(hi, f32::next_up))
    }
}
