//! Whether a ray passes through a triangle within its range, exactly: in f64 with bounds on the
//! errors, and in exact arithmetic where the bounds leave it open.
//!
//! Edge functions are those of the watertight test (Woop, Benthin and Wald 2013): in the plane
//! across the main axis, from corners that are sheared along the ray. Their errors grow with the
//! distance times the triangle's size. Those of the volumes d · (b × c) grow with the square of the
//! distance, so a filter on these would decide nothing about a millimetre a kilometre away.

use super::error_free::{U, two_diff, two_product};
use super::exact::ExactCrossing;
use super::input::RayF64;
use glam::DVec3;
use std::cmp::Ordering;

/// Covers the rounding of bounds themselves.
const SAFE: f64 = 1.01;

/// What underflow may add to an edge function.
const UNDERFLOW: f64 = f64::MIN_POSITIVE;

/// A ray with its constants for the test.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExactRay {
    pub(super) ray: RayF64,
    /// Those across the ray, and the main axis.
    pub(super) axes: [usize; 3],
    sx: f64,
    sy: f64,
    sz: f64,
}

/// Bounds of the parameter of a hit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) lo: f64,
    pub(super) hi: f64,
}

impl Bounds {
    const UNKNOWN: Bounds = Bounds { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
}

/// A corner relative to the ray: its place across the ray, and along the main axis.
struct Sheared {
    x: f64,
    y: f64,
    /// Bound on the sum of the errors of x and y.
    error: f64,
    z: f64,
    z_error: f64,
}

/// An edge function and a bound on its error.
struct Edge {
    value: f64,
    error: f64,
}

impl Edge {
    /// The sign, where the bound decides it.
    fn sign(&self) -> Option<Ordering> {
        if self.error == 0.0 || self.value.abs() > self.error {
            return self.value.partial_cmp(&0.0);
        }
        None
    }
}

impl ExactRay {
    /// The ray's constants, and the reciprocals of its direction.
    #[inline(always)]
    pub(super) fn new(ray: &RayF64) -> (Self, [f64; 3]) {
        let d = ray.dir.to_array();
        let m = d.map(f64::abs);
        let xy = if m[0] >= m[1] { 0 } else { 1 };
        let kz = if m[xy] >= m[2] { xy } else { 2 };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][kz];
        let reciprocals = [1.0 / d[0], 1.0 / d[1], 1.0 / d[2]];
        let sz = reciprocals[kz];
        // A slope that underflows is not known to the last digit, nor is one from a reciprocal that
        // does: NaN leaves all to exact arithmetic.
        let slope = |d: f64| {
            let slope = d * sz;
            if d == 0.0 || (slope.is_normal() && sz.is_normal()) { slope } else { f64::NAN }
        };
        // No f64 is the parameter of a hit beyond these.
        let (t_min, t_max) = (ray.t_min.max(f64::MIN), ray.t_max.min(f64::MAX));
        let ray = RayF64 { t_min, t_max, ..*ray };
        let (sx, sy) = (slope(d[axes[0]]), slope(d[axes[1]]));
        (ExactRay { ray, axes, sx, sy, sz }, reciprocals)
    }

    /// Constants of a ray that is never traced.
    pub(super) const fn of_nothing(ray: RayF64) -> Self {
        ExactRay { ray, axes: [0; 3], sx: 0.0, sy: 0.0, sz: 0.0 }
    }

    fn shear(&self, corner: DVec3) -> Sheared {
        let [(x, x_rest), (y, y_rest), (z, z_rest)] =
            self.axes.map(|k| two_diff(corner[k], self.ray.origin[k]));
        let rest = x_rest.abs() + y_rest.abs();
        if self.sx == 0.0 && self.sy == 0.0 {
            return Sheared { x, y, error: SAFE * rest, z, z_error: z_rest.abs() };
        }
        // Slopes are at most 1 and rounded twice, products and differences once each.
        let (px, py) = (self.sx * z, self.sy * z);
        let (x, y) = (x - px, y - py);
        let rounding = 3.0 * (px.abs() + py.abs()) + (x.abs() + y.abs());
        let error = SAFE * (rest + 2.0 * z_rest.abs() + U * rounding) + UNDERFLOW;
        Sheared { x, y, error, z, z_error: z_rest.abs() }
    }

    /// The hit within the ray's range, if there is one, with bounds on its parameter.
    #[inline(never)]
    pub(super) fn crossing(&self, corners: [DVec3; 3]) -> Option<Bounds> {
        let [a, b, c] = corners.map(|p| self.shear(p));
        let edges = [edge(&b, &c), edge(&c, &a), edge(&a, &b)];
        let signs = [edges[0].sign(), edges[1].sign(), edges[2].sign()];
        let has = |sign: Ordering| signs.contains(&Some(sign));
        if has(Ordering::Less) && has(Ordering::Greater) {
            return None;
        }
        let mut exact = None;
        if signs.contains(&None) {
            let exact = exact.insert(ExactCrossing::new(&self.ray, corners));
            // The edge function here is the exact one divided by the main component.
            let turned = self.sz < 0.0;
            let sign = |corner: usize| {
                let side = exact.side(corner);
                signs[corner].unwrap_or(if turned { side.reverse() } else { side })
            };
            let signs = [sign(0), sign(1), sign(2)];
            let has = |sign: Ordering| signs.contains(&sign);
            if has(Ordering::Less) == has(Ordering::Greater) {
                return None;
            }
        } else if !has(Ordering::Less) && !has(Ordering::Greater) {
            // Seen edge-on, or without area.
            return None;
        }
        let bounds = self.parameter(&[a, b, c], &edges);
        let RayF64 { t_min, t_max, .. } = self.ray;
        let inside = if bounds.lo >= t_min && bounds.hi < t_max {
            true
        } else if bounds.hi < t_min || bounds.lo >= t_max {
            false
        } else {
            let exact = exact.unwrap_or_else(|| ExactCrossing::new(&self.ray, corners));
            let t = exact.t()?;
            t.compare_with(t_min).is_ge() && t.compare_with(t_max).is_lt()
        };
        inside.then_some(bounds)
    }

    /// Bounds of the parameter of a hit: a mean of the corners' with weights that are the edge
    /// functions, whose errors move it between the corners.
    fn parameter(&self, corners: &[Sheared; 3], edges: &[Edge; 3]) -> Bounds {
        let [a, b, c] = corners;
        let [u, v, w] = [edges[0].value, edges[1].value, edges[2].value];
        let error = edges.iter().map(|e| e.error).sum::<f64>();
        let (z0, z1) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
        let own = a.z_error.max(b.z_error).max(c.z_error);
        let det = u + v + w;
        let (lo, hi) = if det.abs() > 16.0 * error {
            // Weights first: products of edge functions and distances may underflow.
            let z = u / det * a.z + v / det * b.z + w / det * c.z;
            // Errors of weights as in the filter; eight roundings.
            let moved = 8.0 * error / det.abs() * (z1 - z0);
            let all = SAFE * (moved + own + 8.0 * U * z0.abs().max(z1.abs())) + UNDERFLOW;
            (z - all, z + all)
        } else {
            (z0 - own, z1 + own)
        };
        // Rounding of the reciprocal and of the product.
        let (t0, t1) = (lo * self.sz, hi * self.sz);
        let (lo, hi) = (t0.min(t1), t0.max(t1));
        let bounds = Bounds { lo: lo - 4.0 * U * lo.abs(), hi: hi + 4.0 * U * hi.abs() };
        let bounds = Bounds { lo: bounds.lo.next_down(), hi: bounds.hi.next_up() };
        if self.sz.is_normal() && bounds.lo.is_finite() && bounds.hi.is_finite() {
            bounds
        } else {
            Bounds::UNKNOWN
        }
    }

    /// Which of two hit triangles is nearer; equal where both cross the ray at the same point.
    #[cold]
    pub(super) fn compare(&self, first: [DVec3; 3], second: [DVec3; 3]) -> Ordering {
        let sorted = |corners: [DVec3; 3]| {
            let mut all = corners.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()));
            all.sort_unstable();
            all
        };
        if sorted(first) == sorted(second) {
            return Ordering::Equal;
        }
        let [t, other] = [first, second].map(|corners| ExactCrossing::new(&self.ray, corners).t());
        match (t, other) {
            (Some(t), Some(other)) => t.compare(&other),
            _ => Ordering::Equal,
        }
    }
}

/// The edge function of two corners.
fn edge(p: &Sheared, q: &Sheared) -> Edge {
    let (left, right) = (p.x * q.y, p.y * q.x);
    let value = left - right;
    if p.error == 0.0 && q.error == 0.0 {
        // Rays along an axis through the vertices and edges of grids: the coordinates are exact.
        if let Some(value) = difference_of_exact_products([p.x, q.y], [p.y, q.x]) {
            return Edge { value, error: 0.0 };
        }
    }
    let (p_size, q_size) = (p.x.abs() + p.y.abs(), q.x.abs() + q.y.abs());
    let inherited = p_size * q.error + q_size * p.error + p.error * q.error;
    let rounding = U * (left.abs() + right.abs() + value.abs());
    Edge { value, error: SAFE * (inherited + rounding) + UNDERFLOW }
}

/// A number with the sign of a·b − c·d, close to it; `None` when a product may underflow or
/// overflow.
fn difference_of_exact_products(ab: [f64; 2], cd: [f64; 2]) -> Option<f64> {
    let product = |[a, b]: [f64; 2]| {
        let (product, rest) = two_product(a, b);
        let held = (1e-250..1e250).contains(&product.abs());
        (held || a == 0.0 || b == 0.0).then_some((product, rest))
    };
    let ((left, left_rest), (right, right_rest)) = (product(ab)?, product(cd)?);
    // Rounding is monotone: products that differ after it differ in the same way before.
    Some(if left == right { left_rest - right_rest } else { left - right })
}
