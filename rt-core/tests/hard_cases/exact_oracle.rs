//! The reference for rays in f64: tests every triangle with rational numbers.

use num_bigint::{BigInt, Sign};
use rt_core::bvh::{HitF64, MeshF64, RayF64};
use rt_core::glam::DVec3;

/// The smallest power of two that all f64 are multiples of.
const SMALLEST: i32 = -1074;

/// x · 2¹⁰⁷⁴.
fn big(x: f64) -> BigInt {
    assert!(x.is_finite(), "{x} is no rational number");
    let bits = x.abs().to_bits();
    let (exponent, fraction) = ((bits >> 52) as i32, bits & ((1 << 52) - 1));
    let (integer, k) =
        if exponent == 0 { (fraction, SMALLEST) } else { (fraction | 1 << 52, exponent - 1075) };
    let magnitude = BigInt::from(integer) << (k - SMALLEST) as u32;
    if x < 0.0 { -magnitude } else { magnitude }
}

type Vector = [BigInt; 3];

fn vector(p: DVec3) -> Vector {
    p.to_array().map(big)
}

fn minus(p: &Vector, q: &Vector) -> Vector {
    [0, 1, 2].map(|k| &p[k] - &q[k])
}

/// The determinant of three rows.
fn determinant([p, q, r]: [&Vector; 3]) -> BigInt {
    &p[0] * (&q[1] * &r[2] - &q[2] * &r[1]) - &p[1] * (&q[0] * &r[2] - &q[2] * &r[0])
        + &p[2] * (&q[0] * &r[1] - &q[1] * &r[0])
}

/// The parameter t = numerator / denominator of a hit, denominator above zero.
#[derive(Clone)]
pub(crate) struct ExactHit {
    numerator: BigInt,
    denominator: BigInt,
    pub(crate) mesh: u32,
    pub(crate) prim: u32,
}

impl ExactHit {
    /// How many units in the last place `t` is from the exact parameter, rounded up.
    fn ulps(&self, t: f64) -> f64 {
        let ulp = big(t.abs().next_up()) - big(t.abs());
        let error = big(t) * &self.denominator - (&self.numerator << -SMALLEST as u32);
        let (error, unit) = (error.magnitude(), (ulp * &self.denominator));
        // A hundredth is enough.
        let hundredths = (error * 100u32 + unit.magnitude() - 1u32) / unit.magnitude();
        hundredths.iter_u64_digits().rev().fold(0.0, |all, d| all * 2f64.powi(64) + d as f64)
            / 100.0
    }

    /// Whether t >= limit.
    fn at_least(&self, limit: f64) -> bool {
        let limit = limit.clamp(f64::MIN, f64::MAX);
        &self.numerator << -SMALLEST as u32 >= big(limit) * &self.denominator
    }

    fn is_before(&self, other: &ExactHit) -> bool {
        &self.numerator * &other.denominator < &other.numerator * &self.denominator
    }
}

/// The hit of a ray's line with one triangle, edges and corners included.
fn hit(ray: &RayF64, corners: [DVec3; 3]) -> Option<(BigInt, BigInt)> {
    let (o, d) = (vector(ray.origin), vector(ray.dir));
    let [a, b, c] = corners.map(vector);
    let (e1, e2, s) = (minus(&b, &a), minus(&c, &a), minus(&o, &a));
    // Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997, equation 4:
    // a formula of its own, apart from the library's.
    let det = determinant([&d, &e2, &e1]);
    let zero = BigInt::ZERO;
    let (u, v, t) =
        (determinant([&d, &e2, &s]), determinant([&s, &e1, &d]), determinant([&s, &e1, &e2]));
    let (det, u, v, t) =
        if det.sign() == Sign::Minus { (-det, -u, -v, -t) } else { (det, u, v, t) };
    let inside = det > zero && u >= zero && v >= zero && &u + &v <= det;
    // Both have the same powers of 2¹⁰⁷⁴, but for one of the direction's, which t lacks.
    inside.then_some((t, det))
}

/// The closest hit in the ray's range: the lowest mesh's lowest triangle of several.
pub(crate) fn closest(meshes: &[&MeshF64], ray: &RayF64) -> Option<ExactHit> {
    let mut best: Option<ExactHit> = None;
    for (m, mesh) in meshes.iter().enumerate() {
        for prim in 0..mesh.indices.len() {
            let Some(corners) = mesh.triangle(prim) else { continue };
            let Some((numerator, denominator)) = hit(ray, corners) else { continue };
            let (m, prim) = (m as u32, prim as u32);
            let found = ExactHit { numerator, denominator, mesh: m, prim };
            let in_range = found.at_least(ray.t_min) && !found.at_least(ray.t_max);
            if in_range && best.as_ref().is_none_or(|b| found.is_before(b)) {
                best = Some(found);
            }
        }
    }
    best
}

/// Compares an answer with the exact one. Returns the error of t in ulp.
pub(crate) fn check(
    meshes: &[&MeshF64],
    ray: &RayF64,
    found: Option<HitF64>,
    what: &str,
) -> Option<f64> {
    let exact = closest(meshes, ray);
    match (exact, found) {
        (None, None) => None,
        (Some(exact), Some(hit)) => {
            let wanted = (exact.mesh, exact.prim);
            assert_eq!((hit.mesh, hit.prim), wanted, "{what}: {ray:?}: {hit:?}");
            let ulps = exact.ulps(hit.t);
            assert!(ulps <= 2.0, "{what}: {ray:?}: {hit:?} is {ulps} ulp off");
            let weights = hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v <= 1.0 + f64::EPSILON;
            assert!(weights, "{what}: {ray:?}: {hit:?}");
            Some(ulps)
        }
        (exact, found) => panic!(
            "{what}: {ray:?}: found {found:?}, exactly {:?}",
            exact.map(|e| (e.mesh, e.prim))
        ),
    }
}
