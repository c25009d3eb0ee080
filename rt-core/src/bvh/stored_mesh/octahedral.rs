//! Unit normals in a few bits: the octahedron unfolded to a square (Meyer et al. 2010; measured by
//! Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT
//! 2014).

use glam::{DVec3, Vec3};

/// Bits of a coordinate, fewest and most. More than sixteen would not beat three `f32` by much.
pub(super) const BITS: std::ops::RangeInclusive<u32> = 3..=16;

/// The largest coordinate in the square: even, so that normals along an axis are exact.
fn largest(bits: u32) -> f32 {
    ((1u32 << bits) - 2) as f32
}

/// The two coordinates of a direction, each of `bits` bits.
pub(super) fn encode(n: Vec3, bits: u32) -> [u32; 2] {
    let n = n / (n.x.abs() + n.y.abs() + n.z.abs());
    let (x, y) = if n.z < 0.0 { folded(n.x, n.y) } else { (n.x, n.y) };
    let most = largest(bits);
    let lower = [x, y].map(|c| ((0.5 * c + 0.5) * most).floor().clamp(0.0, most - 1.0) as u32);
    // The nearest of the four points around.
    let around = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[i, j]| [lower[0] + i, lower[1] + j]);
    let mut best = (around[0], f64::INFINITY);
    for q in around {
        let angle = angle(n, decode(q, bits));
        if angle < best.1 {
            best = (q, angle);
        }
    }
    best.0
}

/// The unit vector of two coordinates.
pub(super) fn decode(q: [u32; 2], bits: u32) -> Vec3 {
    let most = largest(bits);
    let [x, y] = q.map(|q| (2.0 * q as f32 - most) / most);
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 { folded(x, y) } else { (x, y) };
    Vec3::new(x, y, z).normalize_or_zero()
}

/// The lower half of the octahedron lies outside the diagonals of the square.
fn folded(x: f32, y: f32) -> (f32, f32) {
    ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y))
}

/// The angle between two directions in radians, exact for small ones too, where the cosine is 1.
fn angle(a: Vec3, b: Vec3) -> f64 {
    let (a, b): (DVec3, DVec3) = (a.as_dvec3(), b.as_dvec3());
    a.cross(b).length().atan2(a.dot(b))
}

/// The fewest bits with which no normal is off by more than `tolerance` degrees. `None` when
/// sixteen do not suffice, or one of them is no direction.
pub(super) fn bits_for(normals: &[Vec3], tolerance: f64) -> Option<u32> {
    let direction = |n: &Vec3| {
        let length = n.length_squared();
        length.is_normal() && (n.x.abs() + n.y.abs() + n.z.abs()).is_normal()
    };
    // Neither 0 nor NaN is a tolerance.
    let wanted = tolerance > 0.0;
    if !wanted || !normals.iter().all(direction) {
        return None;
    }
    let error = |n: Vec3, bits: u32| angle(n, decode(encode(n, bits), bits)).to_degrees();
    let suffice = |&bits: &u32| normals.iter().all(|&n| error(n, bits) <= tolerance);
    BITS.into_iter().find(suffice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;

    #[test]
    fn normals_are_within_the_tolerance_and_along_axes_exact() {
        let mut r = Random::new(5);
        let mut normals: Vec<Vec3> = (0..4000).map(|_| r.direction() * 3.0).collect();
        let mut last = 0;
        for tolerance in [10.0, 1.0, 0.1, 0.01] {
            let bits = bits_for(&normals, tolerance).expect("sixteen bits suffice");
            assert!(bits > last, "{tolerance} degrees: {bits} bits");
            last = bits;
            for &n in &normals {
                let stored = decode(encode(n, bits), bits);
                assert!(angle(n, stored).to_degrees() <= tolerance);
                assert!((decode(encode(n, bits), bits).length() - 1.0).abs() < 1e-6);
            }
        }
        assert!(last <= 14, "{last} bits for a hundredth of a degree");
        assert_eq!(bits_for(&normals, 0.0), None);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for bits in BITS {
                assert_eq!([axis, -axis].map(|n| decode(encode(n, bits), bits)), [axis, -axis]);
            }
        }
        for none in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            normals[7] = none;
            assert_eq!(bits_for(&normals, 1.0), None);
        }
    }
}
