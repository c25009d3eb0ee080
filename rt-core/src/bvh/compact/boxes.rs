//! Boxes with 8 bits per plane, never smaller than the box that they stand for.
//!
//! A plane is `origin + q · 2^e` in f32, and the sum is monotone in q. The product is exact, so a
//! fused operation has the same result; or it is infinite, and then a fused one may be finite. The
//! coder computes both, and moves q outwards until both are outside: so rounding is part of the
//! proof, whatever instructions a reader has.

use crate::math::{Aabb, exp2i};

/// The lattice of planes of one meshlet.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Lattice {
    pub(super) origin: [f32; 3],
    /// Exponents of the steps, -126 to 127.
    pub(super) exponents: [i32; 3],
}

/// Exponents that a lattice may have.
pub(super) const EXPONENTS: std::ops::RangeInclusive<i32> = -126..=127;

const LAST: u8 = 255;

/// The plane `q` of a lattice with this origin and step.
#[inline(always)]
pub(super) fn plane(origin: f32, step: f32, q: u8) -> f32 {
    origin + f32::from(q) * step
}

/// The plane without overflow. Where it is outside, so is a fused one, which is the same rounded to
/// f32.
fn wide_plane(origin: f32, step: f32, q: u8) -> f64 {
    f64::from(origin) + f64::from(q) * f64::from(step)
}

impl Lattice {
    /// The finest lattice over `bounds`, which are finite and not empty.
    pub(super) fn over(bounds: Aabb) -> Lattice {
        let (origin, hi) = (bounds.min.to_array(), bounds.max.to_array());
        let exponents = std::array::from_fn(|a| {
            let extent = f64::from(hi[a]) - f64::from(origin[a]);
            let fine = (extent / f64::from(LAST)).log2().floor();
            let mut e = (fine as i32).clamp(*EXPONENTS.start(), *EXPONENTS.end());
            // Ends: at 127 the last plane is beyond all finite numbers.
            let too_low = |step: f32| {
                plane(origin[a], step, LAST) < hi[a]
                    || wide_plane(origin[a], step, LAST) < f64::from(hi[a])
            };
            while e < 127 && too_low(exp2i(e)) {
                e += 1;
            }
            e
        });
        Lattice { origin, exponents }
    }

    /// The steps.
    #[inline(always)]
    pub(super) fn steps(&self) -> [f32; 3] {
        self.exponents.map(exp2i)
    }

    /// The numbers of the planes around `b`, which lies in the bounds: lowest and highest per axis.
    pub(super) fn around(&self, b: Aabb) -> [[u8; 2]; 3] {
        let steps = self.steps();
        std::array::from_fn(|a| {
            let (o, step) = (self.origin[a], steps[a]);
            let near = |x: f32| ((f64::from(x) - f64::from(o)) / f64::from(step)).clamp(0.0, 255.0);
            let (mut lo, mut hi) = (near(b.min[a]).floor() as u8, near(b.max[a]).ceil() as u8);
            // Plane 0 is the lowest coordinate of the bounds, the last is not below the highest.
            let above =
                |q: u8, x: f32| plane(o, step, q) > x || wide_plane(o, step, q) > f64::from(x);
            let below =
                |q: u8, x: f32| plane(o, step, q) < x || wide_plane(o, step, q) < f64::from(x);
            while lo > 0 && above(lo, b.min[a]) {
                lo -= 1;
            }
            while hi < LAST && below(hi, b.max[a]) {
                hi += 1;
            }
            [lo, hi]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;
    use glam::Vec3;

    #[test]
    fn boxes_are_never_smaller_than_what_they_stand_for() {
        let mut r = Random::new(4);
        for case in 0..20_000 {
            let size = exp2i((r.bits() % 250) as i32 - 125);
            let far = exp2i((r.bits() % 250) as i32 - 125);
            let flat = Vec3::from_array([0, 1, 2].map(|a| ((case >> a & 1) == 0) as u32 as f32));
            let corner = r.direction() * far;
            let points: Vec<Vec3> = (0..6)
                .map(|_| corner + r.direction() * r.unit() * size * flat)
                .filter(|p| p.is_finite())
                .collect();
            let whole = Aabb::from_points(&points);
            let lattice = Lattice::over(whole);
            let steps = lattice.steps();
            for pair in points.windows(2) {
                let b = Aabb::from_points(pair);
                let planes = lattice.around(b);
                for a in 0..3 {
                    let at = |q: u8| plane(lattice.origin[a], steps[a], q);
                    let [lo, hi] = planes[a];
                    assert!(at(lo) <= b.min[a] && at(hi) >= b.max[a], "{case}: {b:?} {lattice:?}");
                    let fused = |q: u8| f32::from(q).mul_add(steps[a], lattice.origin[a]);
                    assert!(fused(lo) <= b.min[a] && fused(hi) >= b.max[a], "{case}: {b:?}");
                    // Not much larger either, where the numbers have room for it.
                    let slack =
                        2.0 * steps[a] + 4.0 * f32::EPSILON * b.max[a].abs().max(b.min[a].abs());
                    assert!(b.min[a] - at(lo) <= slack && at(hi) - b.max[a] <= slack, "{case}");
                }
            }
        }
    }

    #[test]
    fn the_largest_boxes_have_planes_outside() {
        let b = Aabb::new(Vec3::splat(f32::MIN), Vec3::splat(f32::MAX));
        let lattice = Lattice::over(b);
        let [lo, hi] = lattice.around(b)[0];
        let step = lattice.steps()[0];
        assert!(plane(f32::MIN, step, lo) <= f32::MIN);
        assert!(plane(f32::MIN, step, hi) >= f32::MAX);
        // 255 steps of the finest lattice are infinite by themselves, and end below the box.
        assert!(f32::from(lo).mul_add(step, f32::MIN) <= f32::MIN);
        assert!(f32::from(hi).mul_add(step, f32::MIN) >= f32::MAX);
    }
}
