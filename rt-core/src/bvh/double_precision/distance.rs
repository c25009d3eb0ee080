//! The parameter of a hit to 2 ulp, and the weights of the corners.
//!
//! The quotient n · (a − o) / n · d has errors of many ulp where the triangle is slender or seen at
//! a slant. One step of iterative refinement (Higham 2002, chapter 12) removes them: at the point
//! that the quotient gives, the offset from the plane is computed from differences with all their
//! digits. What it may still be wrong by is bounded. Where that is too much, as for rays that are
//! short compared with the triangle, products keep all digits as well; where that is not enough,
//! the exact ratio is rounded.

use super::error_free::{U, two_diff, two_product, two_sum};
use super::exact::ExactCrossing;
use super::input::RayF64;
use glam::DVec3;

/// Magnitudes of determinants between which nothing underflows or overflows.
const ORDINARY: std::ops::Range<f64> = 1e-240..1e240;

/// A hit's parameter and weights of the second and third corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub(super) t: f64,
    pub(super) u: f64,
    pub(super) v: f64,
}

/// Where a ray hits a triangle. Depends on nothing else, so it is the same whatever way led here.
#[inline(always)]
pub(super) fn hit_point(ray: &RayF64, corners: [DVec3; 3]) -> Point {
    refined(ray, corners).unwrap_or_else(|| exact(ray, corners))
}

#[cold]
#[inline(never)]
fn exact(ray: &RayF64, corners: [DVec3; 3]) -> Point {
    let crossing = ExactCrossing::new(ray, corners);
    let weight = |corner| crossing.weight(corner).map_or(0.0, |w| w.rounded());
    Point { t: crossing.t().map_or(0.0, |t| t.rounded()), u: weight(1), v: weight(2) }
}

/// The refined quotient, where its error is surely small enough.
#[inline(always)]
fn refined(ray: &RayF64, [a, b, c]: [DVec3; 3]) -> Option<Point> {
    let (o, d) = (ray.origin, ray.dir);
    let (e1, e2) = (b - a, c - a);
    // ---- The normal, and the sum of the magnitudes in it, to which its errors are proportional:
    // two roundings of edges, one of the product, one of the difference.
    let n =
        DVec3::new(e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x);
    let (m1, m2) = (e1.abs(), e2.abs());
    let size =
        DVec3::new(m1.y * m2.z + m1.z * m2.y, m1.z * m2.x + m1.x * m2.z, m1.x * m2.y + m1.y * m2.x);
    let det = n.dot(d);
    let det_error = 8.0 * U * size.dot(d.abs());
    let distance = a - o;
    let t0 = n.dot(distance) / det;
    // ---- The first corner relative to the point at t0: exact but for its last rounding.
    let (mut q, mut q_rest, mut small) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for axis in 0..3 {
        let (from, from_rest) = two_diff(a[axis], o[axis]);
        let (along, along_rest) = two_product(t0, d[axis]);
        let (near, near_rest) = two_diff(from, along);
        q[axis] = near;
        q_rest[axis] = near_rest + (from_rest - along_rest);
        small[axis] = near_rest.abs() + from_rest.abs() + along_rest.abs();
    }
    let offset = Offset {
        value: n.dot(q + q_rest),
        error: size.dot(9.0 * U * q.abs() + (4.0 * U + 4.0 * U) * small),
    };
    // With half an ulp for the last sum, t is at most one and a half from the exact value.
    let step = |offset: Offset| {
        let step = offset.value / det;
        let t = t0 + step;
        let error = 1.1 * (offset.error + step.abs() * det_error) / det.abs();
        let ordinary = ORDINARY.contains(&(det * t).abs()) && ORDINARY.contains(&t.abs());
        (ordinary && error + 2.0 * U * step.abs() <= U * t.abs()).then_some(t)
    };
    if !(det.abs() > 64.0 * det_error && ORDINARY.contains(&det.abs())) {
        return None;
    }
    let t = match step(offset) {
        Some(t) => t,
        None => step(Offset::in_two_parts([a, b, c], [e1, e2], size, [q, q_rest, small]))?,
    };
    let q = q + q_rest;
    // ---- Weights, in the coordinate plane where the triangle is largest.
    let m = n.abs();
    let xy = if m.x >= m.y { 0 } else { 1 };
    let k = if m[xy] >= m.z { xy } else { 2 };
    // Slivers: weights to eight digits at least.
    let precise = size[k] * U < 1e-9 * m[k];
    if !precise || !ORDINARY.contains(&m[k]) {
        return None;
    }
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let u = (q[j] * e2[i] - q[i] * e2[j]) / n[k];
    let v = (e1[j] * q[i] - e1[i] * q[j]) / n[k];
    let u = u.clamp(0.0, 1.0);
    Some(Point { t, u, v: v.clamp(0.0, 1.0 - u) })
}

/// The offset of a point from a triangle's plane, times the length of n.
struct Offset {
    value: f64,
    error: f64,
}

impl Offset {
    /// n · q, where both are sums of two parts: for rays that are short compared with the triangle.
    /// `size` are the magnitudes in n, and `q` the parts of the corner relative to the point, with
    /// the sums of the magnitudes in the small part.
    #[inline(always)]
    fn in_two_parts(
        [a, b, c]: [DVec3; 3],
        [e1, e2]: [DVec3; 2],
        size: DVec3,
        [q, q_rest, small]: [DVec3; 3],
    ) -> Offset {
        let (mut f1, mut f2) = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            f1[axis] = two_diff(b[axis], a[axis]).1;
            f2[axis] = two_diff(c[axis], a[axis]).1;
        }
        let (mut sum, mut rest) = (0.0, 0.0);
        for (k, i, j) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            let (left, left_rest) = two_product(e1[i], e2[j]);
            let (right, right_rest) = two_product(e1[j], e2[i]);
            let (n, difference_rest) = two_diff(left, right);
            let edges = (e1[i] * f2[j] + f1[i] * e2[j]) - (e1[j] * f2[i] + f1[j] * e2[i]);
            let n_rest = (difference_rest + (left_rest - right_rest)) + edges;
            let (product, product_rest) = two_product(n, q[k]);
            let (next, sum_rest) = two_sum(sum, product);
            sum = next;
            rest += (sum_rest + product_rest) + (n * q_rest[k] + n_rest * q[k]);
        }
        // Each of the small terms is at most 8 U size · |q| or size · small. They have a dozen
        // roundings, and products of two small parts are left out.
        let error = size.dot(200.0 * U * U * q.abs() + 40.0 * U * small);
        let value = sum + rest;
        Offset { value, error: error + U * value.abs() }
    }
}
