//! The trilinear interpolant of a cell along a straight line: a cubic in Bernstein form, and its
//! first root.
//!
//! Parker, Shirley, Livnat, Hansen and Sloan ("Interactive Ray Tracing for Isosurface Rendering",
//! Visualization 1998) expand the cubic into monomials and solve it in closed form. Marmitt, Kleer,
//! Wald, Friedrich and Slusallek ("Fast and Accurate Ray-Voxel Intersection", VMV 2004) isolate the
//! roots between the extrema and refine, because the closed form misses roots. Here the
//! coefficients are Bernstein coefficients, obtained by blossoming. All are averages of
//! interpolated values, so their signs are right, and equal signs prove that there is no root.

/// Trilinear values at the eight corners of the box from `p` to `q` inside a cell (0..=1 per axis),
/// x fastest.
#[inline(always)]
fn resample(v: &[f64; 8], p: &[f64; 3], q: &[f64; 3]) -> [f64; 8] {
    // (1−f)·a + f·b gives a and b exactly at 0 and 1, so a point on a face has the same value in
    // both cells.
    let mix = |a: f64, b: f64, f: f64| (1.0 - f) * a + f * b;
    let mut r = *v;
    for (axis, step) in [(0usize, 1usize), (1, 2), (2, 4)] {
        for i in 0..8 {
            if i & step == 0 {
                let (a, b) = (r[i], r[i | step]);
                r[i] = mix(a, b, p[axis]);
                r[i | step] = mix(a, b, q[axis]);
            }
        }
    }
    r
}

/// Bernstein coefficients on 0..=1 of the interpolant from `p` to `q`: the blossom of a trilinear
/// function, averaged over which coordinates are taken from `q`.
#[inline(always)]
pub(crate) fn along(corners: &[f64; 8], p: &[f64; 3], q: &[f64; 3]) -> [f64; 4] {
    let r = resample(corners, p, q);
    const THIRD: f64 = 1.0 / 3.0;
    [r[0], (r[1] + r[2] + r[4]) * THIRD, (r[3] + r[5] + r[6]) * THIRD, r[7]]
}

/// Value at `u`.
#[inline]
pub(crate) fn evaluate(b: &[f64; 4], u: f64) -> f64 {
    let w = 1.0 - u;
    ((b[0] * w + 3.0 * b[1] * u) * w + 3.0 * b[2] * u * u) * w + b[3] * u * u * u
}

/// Value and slope at `u`.
#[cfg(feature = "render")]
#[inline]
pub(crate) fn evaluate_with_slope(b: &[f64; 4], u: f64) -> (f64, f64) {
    (evaluate(b, u), slope(b, u))
}

#[inline]
fn slope(b: &[f64; 4], u: f64) -> f64 {
    let w = 1.0 - u;
    3.0 * (((b[1] - b[0]) * w + 2.0 * (b[2] - b[1]) * u) * w + (b[3] - b[2]) * u * u)
}

/// Smallest and largest coefficient. All values of the cubic are between them.
#[cfg(feature = "render")]
#[inline]
pub(crate) fn hull(b: &[f64; 4]) -> (f64, f64) {
    (b[0].min(b[1]).min(b[2].min(b[3])), b[0].max(b[1]).max(b[2].max(b[3])))
}

/// The coefficients on 0..=u and on u..=1 (de Casteljau).
#[cfg(any(test, feature = "render"))]
#[inline]
pub(crate) fn split(b: &[f64; 4], u: f64) -> ([f64; 4], [f64; 4]) {
    let m = |x: f64, y: f64| x + (y - x) * u;
    let (ab, bc, cd) = (m(b[0], b[1]), m(b[1], b[2]), m(b[2], b[3]));
    let (abc, bcd) = (m(ab, bc), m(bc, cd));
    let at = m(abc, bcd);
    ([b[0], ab, abc, at], [at, bcd, cd, b[3]])
}

/// The smallest u in 0..=1 where the cubic changes between "below" (< 0) and "not below" (≥ 0).
///
/// If the first and the last coefficient differ in this sense, there always is such a u. So two
/// cells that agree on the value at their common face cannot both miss a surface that passes
/// between them.
#[inline(always)]
pub(crate) fn first_change(b: &[f64; 4]) -> Option<f64> {
    let below = [b[0] < 0.0, b[1] < 0.0, b[2] < 0.0, b[3] < 0.0];
    if below[0] == below[1] && below[1] == below[2] && below[2] == below[3] {
        return None; // a Bernstein polynomial stays within its coefficients
    }
    change_between(b, below)
}

/// [`first_change`] of coefficients of which some are below zero and some are not.
#[inline]
fn change_between(b: &[f64; 4], below: [bool; 4]) -> Option<f64> {
    let changes = (below[0] != below[1]) as u32
        + (below[1] != below[2]) as u32
        + (below[2] != below[3]) as u32;
    if changes == 1 {
        return Some(refine(b, 0.0, 1.0)); // Descartes: exactly one root
    }
    // Split at the extrema, where the derivative d₀(1−u)² + 2 d₁u(1−u) + d₂u² is zero.
    let (d0, d1, d2) = (b[1] - b[0], b[2] - b[1], b[3] - b[2]);
    let (a, h) = (d0 - 2.0 * d1 + d2, d1 - d0);
    let discriminant = d1 * d1 - d0 * d2;
    let mut stops = [1.0, 1.0, 1.0];
    if discriminant > 0.0 {
        let k = -(h + discriminant.sqrt().copysign(h));
        let (x, y) = (k / a, d0 / k);
        let inside = |u: f64| if u > 0.0 && u < 1.0 { u } else { 1.0 };
        let (x, y) = (inside(x), inside(y));
        stops = [x.min(y), x.max(y), 1.0];
    }
    let mut lo = 0.0;
    for hi in stops {
        if (evaluate(b, hi) < 0.0) != below[0] {
            return Some(refine(b, lo, hi));
        }
        lo = hi;
    }
    None
}

/// Finds the change between `lo` and `hi`, whose values differ in sign, with Newton's method
/// restricted to a shrinking bracket.
#[inline]
fn refine(b: &[f64; 4], mut lo: f64, mut hi: f64) -> f64 {
    let lo_below = evaluate(b, lo) < 0.0;
    let (flo, fhi) = (evaluate(b, lo), evaluate(b, hi));
    // Starts with the secant, which is exact when the cubic is a line. In smooth data it nearly is.
    let mut u = lo + (hi - lo) * (flo / (flo - fhi));
    for _ in 0..64 {
        if !(u > lo && u < hi) {
            u = 0.5 * (lo + hi);
        }
        let f = evaluate(b, u);
        if (f < 0.0) == lo_below {
            lo = u;
        } else {
            hi = u;
        }
        let step = f / slope(b, u);
        // 10⁻¹³ of a cell is far below the resolution of f32 output.
        if step.abs() < 1e-13 || hi - lo < 1e-13 {
            return (u - step).clamp(lo, hi);
        }
        u -= step;
    }
    0.5 * (lo + hi)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic numbers in -1..1.
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut s = seed;
        move || {
            s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (s >> 11) as f64 * (-52f64).exp2() - 1.0
        }
    }

    /// Trilinear interpolation written out as a sum over corners.
    fn trilinear(v: &[f64; 8], p: [f64; 3]) -> f64 {
        (0..8)
            .map(|i| {
                v[i] * (0..3)
                    .map(|a| if i >> a & 1 == 1 { p[a] } else { 1.0 - p[a] })
                    .product::<f64>()
            })
            .sum()
    }

    #[test]
    fn the_cubic_is_the_interpolant_along_the_line() {
        let mut r = numbers(1);
        for _ in 0..1000 {
            let v: [f64; 8] = std::array::from_fn(|_| r());
            let p: [f64; 3] = std::array::from_fn(|_| 0.5 + 0.5 * r());
            let q: [f64; 3] = std::array::from_fn(|_| 0.5 + 0.5 * r());
            let b = along(&v, &p, &q);
            for k in 0..=8 {
                let u = k as f64 / 8.0;
                let at = std::array::from_fn(|a| p[a] + u * (q[a] - p[a]));
                assert!((evaluate(&b, u) - trilinear(&v, at)).abs() < 1e-14);
            }
            let (left, right) = split(&b, 0.375);
            assert!((evaluate(&left, 0.5) - evaluate(&b, 0.1875)).abs() < 1e-14);
            assert!((evaluate(&right, 0.5) - evaluate(&b, 0.6875)).abs() < 1e-14);
        }
    }

    #[test]
    fn first_change_agrees_with_a_fine_scan() {
        let mut r = numbers(2);
        let mut found = 0;
        for case in 0..20_000 {
            let mut b: [f64; 4] = std::array::from_fn(|_| r());
            if case % 5 == 0 {
                b[0] *= 1e-12; // a root next to the entry
            }
            let steps = 2000;
            let below0 = b[0] < 0.0;
            let scan =
                (1..=steps).find(|&k| (evaluate(&b, k as f64 / steps as f64) < 0.0) != below0);
            let root = first_change(&b);
            if let Some(k) = scan {
                let u = root.unwrap_or_else(|| panic!("{b:?}: missed the change before {k}"));
                // The scan may step over a close pair of roots before the root it found; the solver
                // must not.
                assert!(u <= k as f64 / steps as f64 + 1e-12, "{b:?}");
                assert!(evaluate(&b, u).abs() < 1e-12, "{b:?} at {u}: {}", evaluate(&b, u));
                found += 1;
            } else if let Some(u) = root {
                let touch = evaluate(&b, u).abs();
                assert!(
                    touch < 1e-12 && slope(&b, u).abs() < 0.1,
                    "{b:?}: change at {u} that the scan denies"
                );
            }
        }
        assert!(found > 8000);
    }

    #[test]
    fn zero_at_the_ends_follows_the_not_below_convention() {
        assert_eq!(first_change(&[-1.0, -0.6, -0.3, 0.0]), Some(1.0));
        assert_eq!(first_change(&[0.0, 0.3, 0.6, 1.0]), None);
        assert_eq!(first_change(&[0.0, -0.3, -0.6, -1.0]), Some(0.0));
        assert_eq!(first_change(&[0.0; 4]), None);
    }
}
