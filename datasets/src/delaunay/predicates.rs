//! The signs that decide a Delaunay triangulation, exact for points on integers of 40 bits.
//!
//! A determinant is first computed in `f64` with a bound on its rounding (J. R. Shewchuk,
//! "Adaptive precision floating-point arithmetic and fast robust geometric predicates", 1997), and
//! in integers where that does not tell its sign. Lattices and O-grids have a tie at most points:
//! integers cost a tenth of the expansions of the crate robust there.

use super::snap::BITS;

/// A point on integers.
pub(super) type Place = [i64; 3];

// Differences have 40 bits, minors of three rows 123, lifts 82: i128 holds each.
const _: () = assert!(3 * BITS + 3 < 127 && 2 * BITS + 2 < 128);

/// Bound on the rounding of the determinant, by the sum of the sizes of its terms; Shewchuk's
/// `isperrboundA`. Differences of the points are exact.
const INSPHERE_BOUND: f64 = (16.0 + 224.0 * ROUNDING) * ROUNDING;
/// Shewchuk's `o3derrboundA`.
const ORIENT_BOUND: f64 = (7.0 + 56.0 * ROUNDING) * ROUNDING;
const ROUNDING: f64 = 0.5 * f64::EPSILON;

fn minus(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Sign of the volume of the tetrahedron a, b, c, d: 1 if d lies on the side from which a, b, c run
/// counterclockwise (as VTK orders corners), 0 if they are coplanar.
pub(super) fn orientation(a: Place, b: Place, c: Place, d: Place) -> i32 {
    let [u, v, w] = [minus(b, a), minus(c, a), minus(d, a)];
    let [x, y, z] = [u, v, w].map(|r| r.map(|k| k as f64));
    let minors = [
        (y[1] * z[2], y[2] * z[1], x[0]),
        (y[2] * z[0], y[0] * z[2], x[1]),
        (y[0] * z[1], y[1] * z[0], x[2]),
    ];
    let (mut det, mut size) = (0.0, 0.0);
    for (p, q, factor) in minors {
        det += (p - q) * factor;
        size += (p.abs() + q.abs()) * factor.abs();
    }
    if det.abs() > ORIENT_BOUND * size {
        return if det > 0.0 { 1 } else { -1 };
    }
    let [x, y, z] = [u, v, w].map(|r| r.map(i128::from));
    let det = x[0] * (y[1] * z[2] - y[2] * z[1])
        + x[1] * (y[2] * z[0] - y[0] * z[2])
        + x[2] * (y[0] * z[1] - y[1] * z[0]);
    det.signum() as i32
}

/// 1 if e lies inside the sphere through a, b, c, d, whose orientation is 1; 0 if it lies on it.
pub(super) fn in_sphere(corners: [Place; 4], e: Place) -> i32 {
    let rows = corners.map(|c| minus(c, e));
    let float = rows.map(|r| r.map(|k| k as f64));
    let (det, size) = in_sphere_float(float);
    if det.abs() > INSPHERE_BOUND * size {
        return if det > 0.0 { 1 } else { -1 };
    }
    in_sphere_integer(rows)
}

/// The determinant, and the sum of the sizes of its terms.
fn in_sphere_float([a, b, c, d]: [[f64; 3]; 4]) -> (f64, f64) {
    // Minors of two rows in x and y, and their sizes.
    let minor = |p: [f64; 3], q: [f64; 3]| {
        let (r, s) = (p[0] * q[1], q[0] * p[1]);
        (r - s, r.abs() + s.abs())
    };
    let (ab, bc, cd, da) = (minor(a, b), minor(b, c), minor(c, d), minor(d, a));
    let (ac, bd) = (minor(a, c), minor(b, d));
    let lift = |p: [f64; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    let [az, bz, cz, dz] = [a[2].abs(), b[2].abs(), c[2].abs(), d[2].abs()];
    let abc = a[2] * bc.0 - b[2] * ac.0 + c[2] * ab.0;
    let bcd = b[2] * cd.0 - c[2] * bd.0 + d[2] * bc.0;
    let cda = c[2] * da.0 + d[2] * ac.0 + a[2] * cd.0;
    let dab = d[2] * ab.0 + a[2] * bd.0 + b[2] * da.0;
    let [al, bl, cl, dl] = [lift(a), lift(b), lift(c), lift(d)];
    let det = (cl * dab - dl * abc) + (al * bcd - bl * cda);
    let size = (az * bc.1 + bz * ac.1 + cz * ab.1) * dl
        + (bz * cd.1 + cz * bd.1 + dz * bc.1) * al
        + (cz * da.1 + dz * ac.1 + az * cd.1) * bl
        + (dz * ab.1 + az * bd.1 + bz * da.1) * cl;
    (det, size)
}

fn in_sphere_integer(rows: [Place; 4]) -> i32 {
    let [a, b, c, d] = rows.map(|r| r.map(i128::from));
    let minor = |p: [i128; 3], q: [i128; 3]| p[0] * q[1] - q[0] * p[1];
    let (ab, bc, cd, da) = (minor(a, b), minor(b, c), minor(c, d), minor(d, a));
    let (ac, bd) = (minor(a, c), minor(b, d));
    let lift = |p: [i128; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    let terms = [
        (lift(c), d[2] * ab + a[2] * bd + b[2] * da),
        (lift(d), -(a[2] * bc - b[2] * ac + c[2] * ab)),
        (lift(a), b[2] * cd - c[2] * bd + d[2] * bc),
        (lift(b), -(c[2] * da + d[2] * ac + a[2] * cd)),
    ];
    let mut above = [0u128; 2];
    let mut below = [0u128; 2];
    for (lift, minor) in terms {
        let side = if minor >= 0 { &mut above } else { &mut below };
        let [high, low] = product(lift.unsigned_abs(), minor.unsigned_abs());
        let (sum, carry) = side[1].overflowing_add(low);
        *side = [side[0] + high + u128::from(carry), sum];
    }
    above.cmp(&below) as i32
}

/// The product in 256 bits, the upper half first.
fn product(a: u128, b: u128) -> [u128; 2] {
    let half = |x: u128| [x >> 64, x & u128::from(u64::MAX)];
    let ([a1, a0], [b1, b0]) = (half(a), half(b));
    let low = a0 * b0;
    let (middle, carry) = (a1 * b0).overflowing_add(a0 * b1);
    let (low, more) = low.overflowing_add(middle << 64);
    [a1 * b1 + (middle >> 64) + (u128::from(carry) << 64) + u128::from(more), low]
}

/// Whether point `e` lies inside the sphere of four others, whose orientation is 1. Points are
/// given by their numbers.
///
/// On the sphere, the rule of O. Devillers and M. Teillaud ("Perturbations and vertex removal in a
/// 3D Delaunay triangulation", 2003) decides: each point is lifted off the paraboloid by an
/// infinitesimal height, which is larger by orders for larger numbers. Volumes keep their signs, so
/// no flat tetrahedron arises, and the triangulation is unique.
pub(super) fn conflicts(places: &[Place], corners: [u32; 4], e: u32) -> bool {
    let p = corners.map(|c| places[c as usize]);
    let at = places[e as usize];
    match in_sphere(p, at) {
        0 => {}
        sign => return sign > 0,
    }
    let mut order = [corners[0], corners[1], corners[2], corners[3], e];
    order.sort_unstable();
    for number in order.into_iter().rev() {
        let Some(i) = corners.iter().position(|c| *c == number) else {
            // Its own height takes it out of the sphere.
            return false;
        };
        // A corner's height lifts the sphere at `e` by its barycentric coordinate there.
        let mut with = p;
        with[i] = at;
        match orientation(with[0], with[1], with[2], with[3]) {
            0 => {}
            sign => return sign > 0,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn place() -> impl Strategy<Value = Place> {
        prop_oneof![
            prop::array::uniform3(0i64..=1 << BITS),
            prop::array::uniform3(0i64..4),
            prop::array::uniform3(0i64..4).prop_map(|p| p.map(|x| x << (BITS - 2))),
        ]
    }

    /// The determinant of small integers, by the definition.
    fn reference(corners: [Place; 4], e: Place) -> i32 {
        let rows = corners.map(|c| {
            let d = minus(c, e).map(i128::from);
            [d[0], d[1], d[2], d[0] * d[0] + d[1] * d[1] + d[2] * d[2]]
        });
        let mut det: i128 = 0;
        for (order, sign) in permutations() {
            det += sign * (0..4).map(|r| rows[r][order[r]]).product::<i128>();
        }
        // Shewchuk's sign is for the other orientation.
        -det.signum() as i32
    }

    fn permutations() -> Vec<([usize; 4], i128)> {
        let mut all = Vec::new();
        for i in 0..256usize {
            let p = [i & 3, i >> 2 & 3, i >> 4 & 3, i >> 6];
            if (0..4).all(|k| p.contains(&k)) {
                let swaps = (0..4).flat_map(|a| (0..a).map(move |b| (b, a)));
                let odd = swaps.filter(|&(b, a)| p[b] > p[a]).count() % 2;
                all.push((p, if odd == 1 { -1 } else { 1 }));
            }
        }
        all
    }

    #[test]
    fn the_middle_of_a_tetrahedron_is_inside_and_far_points_are_not() {
        let corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]];
        assert_eq!(orientation(corners[0], corners[1], corners[2], corners[3]), 1);
        assert_eq!(in_sphere(corners, [1, 1, 1]), 1);
        assert_eq!(in_sphere(corners, [4, 4, 4]), 0);
        assert_eq!(in_sphere(corners, [5, 4, 4]), -1);
    }

    #[test]
    fn products_have_256_bits() {
        assert_eq!(product(u128::MAX, u128::MAX), [u128::MAX - 1, 1]);
        assert_eq!(product(1 << 100, 1 << 60), [1 << 32, 0]);
    }

    proptest! {
        #[test]
        fn floats_and_integers_agree_and_swaps_change_the_sign(
            a in place(), b in place(), c in place(), d in place(), e in place(),
        ) {
            let sign = orientation(a, b, c, d);
            prop_assert_eq!(orientation(b, a, c, d), -sign);
            prop_assert_eq!(orientation(b, c, a, d), sign);
            let rows = [a, b, c, d].map(|p| minus(p, e));
            let inside = in_sphere([a, b, c, d], e);
            prop_assert_eq!(in_sphere_integer(rows), inside);
            prop_assert_eq!(in_sphere([b, a, c, d], e), -inside);
        }

        #[test]
        fn small_determinants_are_those_of_the_definition(
            p in prop::array::uniform5(prop::array::uniform3(0i64..1 << 20)),
        ) {
            let [a, b, c, d, e] = p;
            prop_assert_eq!(in_sphere([a, b, c, d], e), reference([a, b, c, d], e));
        }
    }
}
