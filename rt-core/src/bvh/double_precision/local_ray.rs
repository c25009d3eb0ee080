//! The f32 ray that goes through the tree in place of an f64 ray.

use super::crossing::ExactRay;
use super::error_free::{exponent, power_of_two, two_diff, two_product, two_sum};
use super::frame::Frame;
use crate::bvh::intersect::watertight::Shear;
use crate::bvh::traverse::single::{MIN_COMPONENT, RaySetup};

/// Parameters of entry and exit are lowered and raised by this part of themselves: more than the
/// rounding of two operations, and enough that the start of the f32 ray lies before the box.
const SLACK: f64 = 1.0 / (1u64 << 48) as f64;

/// The world's box is this much larger on all sides, in local space. It covers the rounding of
/// differences from the centre that are about as large as the box.
const OUTER: f64 = 1.0 / (1 << 20) as f64;

/// Largest local coordinate of the start of an f32 ray. The bounds of the filter and of the boxes
/// rest on it.
pub(super) const MAX_START: f64 = 1.25;

/// Limit of the exponents of the direction and of the ray's unit, so that nothing below overflows
/// or underflows.
const MAX_EXPONENT: i32 = 900;

/// How a ray is traced.
pub(super) enum Start {
    /// It misses the world's box.
    Miss,
    /// By an f32 ray through the tree.
    Tree(LocalRay),
    /// Triangle by triangle: the ray starts more than about 10¹³ sizes of the world away, so that
    /// neighbouring values of `t` are further apart than the filter allows, or its numbers are near
    /// the ends of the range of f64.
    Everything,
}

/// A ray in local space, at s = (t − shift) / unit.
#[derive(Clone, Copy)]
pub(super) struct LocalRay {
    pub(super) setup: RaySetup,
    shift: f64,
    /// A power of two, and its reciprocal.
    unit: f64,
    per_unit: f64,
    /// No hit in the ray's range has a larger s.
    pub(super) s_max: f32,
}

impl LocalRay {
    pub(super) const ZERO: LocalRay =
        LocalRay { setup: RaySetup::ZERO, shift: 0.0, unit: 1.0, per_unit: 1.0, s_max: 0.0 };

    /// Moves the ray to the box in f64 and rounds it. Of what is lost, the margin of the boxes and
    /// the bounds of the filter take account. `reciprocals` are those of the direction.
    #[inline(always)]
    pub(super) fn start(exact: &ExactRay, reciprocals: [f64; 3], frame: &Frame) -> Start {
        let ray = &exact.ray;
        let (o, d) = (ray.origin.to_array(), ray.dir.to_array());
        let (center, half) = (frame.center.to_array(), frame.half.to_array());
        let [kx, ky, kz] = exact.axes;
        let dir_exponent = exponent(d[kz]);
        let unit_exponent = frame.exponent - dir_exponent;
        let exponents = [dir_exponent, frame.exponent, unit_exponent];
        if exponents.iter().any(|k| k.abs() > MAX_EXPONENT) {
            return Start::Everything;
        }
        let outer = OUTER * power_of_two(frame.exponent);
        let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut from_center = [(0.0, 0.0); 3];
        for axis in 0..3 {
            let offset = two_diff(o[axis], center[axis]);
            from_center[axis] = offset;
            let reach = half[axis] + outer;
            if d[axis] == 0.0 {
                if offset.0.abs() > reach {
                    return Start::Miss;
                }
                continue;
            }
            let rcp = reciprocals[axis];
            let (t1, t2) = ((-reach - offset.0) * rcp, (reach - offset.0) * rcp);
            let (near, far) = (t1.min(t2), t1.max(t2));
            // Infinite ones become NaN, which max and min ignore.
            enter = enter.max(near - near.abs() * SLACK);
            exit = exit.min(far + far.abs() * SLACK);
        }
        if enter > exit || exit < ray.t_min || enter > ray.t_max {
            return Start::Miss;
        }
        let shift = ray.t_min.max(enter);
        // ---- The start in twice the precision of f64, because it is a small difference of large
        // numbers for a ray from far away.
        let (mut start, mut rcp) = ([0.0f32; 3], [0.0f32; 3]);
        let mut inside = true;
        let grow = power_of_two(dir_exponent);
        for axis in 0..3 {
            let (high, low) = from_center[axis];
            let (along, along_error) = two_product(shift, d[axis]);
            let (sum, sum_error) = two_sum(high, along);
            let local = frame.local(sum + (sum_error + (low + along_error)));
            inside &= local.abs() <= MAX_START;
            start[axis] = local as f32;
            // As for f32 rays, no reciprocal is infinite.
            let most = f64::from(1.0 / MIN_COMPONENT);
            rcp[axis] = (reciprocals[axis] * grow).clamp(-most, most) as f32;
        }
        if !inside {
            return Start::Everything;
        }
        let near = [0, 1, 2].map(|a| 2 * a + (rcp[a] < 0.0) as usize);
        // Not those of the exact ray, which are NaN where they underflow.
        let slope = |axis: usize| (d[axis] * reciprocals[kz]) as f32;
        let (sx, sy) = (slope(kx), slope(ky));
        let shear = Shear { kx, ky, kz, sx, sy, sz: rcp[kz] };
        let setup = RaySetup { origin: start, rcp, near, shear, t_min: 0.0 };
        let (unit, per_unit) = (power_of_two(unit_exponent), power_of_two(-unit_exponent));
        let local = LocalRay { setup, shift, unit, per_unit, s_max: 0.0 };
        Start::Tree(LocalRay { s_max: local.s_above(ray.t_max), ..local })
    }

    /// An s that is not below that of `t`. No path through the box is longer than 4.
    #[inline(always)]
    pub(super) fn s_above(&self, t: f64) -> f32 {
        // Rounding of the difference is relative to it, and smaller than the step.
        (((t - self.shift) * self.per_unit).min(8.0) as f32).next_up()
    }

    /// A `t` that is not above that of `s`.
    #[inline(always)]
    pub(super) fn t_below(&self, s: f32) -> f64 {
        (f64::from(s) * self.unit + self.shift).next_down()
    }

    /// A `t` that is not below that of `s`.
    #[inline(always)]
    pub(super) fn t_above(&self, s: f32) -> f64 {
        (f64::from(s) * self.unit + self.shift).next_up()
    }
}
