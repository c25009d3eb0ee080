//! Small numerical functions with documented error behaviour.
//!
//! Lengths are in the unit of the scene. No function has a tolerance of its own.

mod nearest_of_triangle;
mod split_mix;

pub use nearest_of_triangle::{NearestOfTriangle, nearest_of_triangle};
pub use split_mix::{SplitMix64, mix64};

use glam::{DVec3, Vec3};

/// Axis-aligned box in `f32`. The empty box has `min > max` in every axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box. Growing it by a point gives that point.
    pub const EMPTY: Aabb =
        Aabb { min: Vec3::splat(f32::INFINITY), max: Vec3::splat(f32::NEG_INFINITY) };

    /// A box from two corners.
    pub fn new(min: Vec3, max: Vec3) -> Self {
        Aabb { min, max }
    }

    /// The smallest box around `points`; NaN coordinates are ignored.
    pub fn from_points<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        points.into_iter().fold(Aabb::EMPTY, |b, p| b.grown(*p))
    }

    /// The smallest box around this one and `p`.
    #[inline]
    pub fn grown(self, p: Vec3) -> Self {
        Aabb { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box around both.
    #[inline]
    pub fn union(self, o: Aabb) -> Self {
        Aabb { min: self.min.min(o.min), max: self.max.max(o.max) }
    }

    /// Whether the box contains no point.
    #[inline]
    pub fn is_empty(self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// The centre of the box.
    #[inline]
    pub fn center(self) -> Vec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// Edge lengths.
    #[inline]
    pub fn extent(self) -> Vec3 {
        self.max - self.min
    }

    /// Half the surface area, as the surface area heuristic uses it; 0 for the empty box.
    #[inline]
    pub fn half_area(self) -> f32 {
        let e = self.extent().max(Vec3::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// Radius of the sphere around [`Self::center`] that contains the box; 0 when empty.
    pub fn radius(self) -> f32 {
        if self.is_empty() { 0.0 } else { 0.5 * self.extent().length() }
    }

    /// The eight corners, x fastest.
    pub fn corners(self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            Vec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

/// Bound on the relative error of `n` chained `f32` roundings: n·u/(1−n·u), u = 2⁻²⁴ (Higham 2002,
/// eq. 3.1).
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f64 * (f32::EPSILON as f64 * 0.5);
    (nu / (1.0 - nu)) as f32
}

/// a·b − c·d with an error of at most 1.5 ulp (Kahan; Jeannerod, Louvet and Muller 2013).
#[inline]
pub fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    let err = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + err
}

/// Two unit vectors that complete the unit vector `n` to a right-handed basis, without a singular
/// direction (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
#[inline]
pub fn orthonormal_basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (
        Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3::new(b, sign + n.y * n.y * a, -n.y),
    )
}

/// `p` rounded to the nearest f32 point. The function exists to name the rounding.
#[inline]
pub fn round_to_f32(p: DVec3) -> Vec3 {
    p.as_vec3()
}

/// The upper median of `values`: the middle value, or the larger of the two middle ones. The result
/// is always one of the values; `None` if there are none. The order is that of [`f64::total_cmp`],
/// in which NaN is above infinity. The values are reordered.
///
/// ```
/// use rt_core::math::median_high;
///
/// assert_eq!(median_high(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
/// assert_eq!(median_high(&mut []), None);
/// ```
pub fn median_high(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Length of a vector of any size: a plain f32 norm would overflow or underflow beyond 10^±19.
#[cfg(feature = "render")]
#[inline]
pub(crate) fn length(v: Vec3) -> f32 {
    v.as_dvec3().length() as f32
}

/// The largest absolute coordinate.
#[inline]
pub fn max_abs(p: Vec3) -> f32 {
    p.abs().max_element()
}

/// 2^k as f32 for |k| <= 126.
#[inline]
pub fn exp2i(k: i32) -> f32 {
    f32::from_bits(((k.clamp(-126, 127) + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_one_of_the_values() {
        assert_eq!(median_high(&mut []), None);
        assert_eq!(median_high(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median_high(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0), "not the mean of two");
        assert_eq!(median_high(&mut [f64::NAN, 1.0, 2.0]), Some(2.0), "NaN is the largest");
        assert!(median_high(&mut [f64::NAN, 1.0]).is_some_and(f64::is_nan));
    }

    #[test]
    fn basis_is_orthonormal_in_every_direction() {
        for n in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::Z, -Vec3::Z, Vec3::new(0.6, -0.48, -0.64)] {
            let (t, b) = orthonormal_basis(n);
            for d in [t.dot(b), t.dot(n), b.dot(n), t.length() - 1.0, b.length() - 1.0] {
                assert!(d.abs() < 1e-6, "{n}: {d}");
            }
            assert!(t.cross(b).dot(n) > 0.999, "right-handed");
        }
    }

    #[test]
    fn difference_of_products_survives_cancellation() {
        // 1 + 2^-30 squared minus 1 + 2^-29: the naive form loses everything below 2^-53.
        let a = 1.0 + (-30f64).exp2();
        assert_eq!(difference_of_products(a, a, 1.0 + (-29f64).exp2(), 1.0), (-60f64).exp2());
    }
}
