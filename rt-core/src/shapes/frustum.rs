//! Intersection of a line with a truncated cone between two planes perpendicular to its axis.
//! [`super::Tubes`] (round ends) and [`super::Cylinders`] (flat or open ends) share it.

use glam::DVec3;

/// A solid of revolution around the axis through a point `a` along `v`: the points p with z₀ ≤
/// (p−a)·v ≤ z₁ and |(p−a) × v| ≤ w_a + w_z·(p−a)·v. Everything is scaled by |v|, so nothing needs
/// to be normalised.
pub(super) struct Frustum {
    pub(super) v: DVec3,
    pub(super) z0: f64,
    pub(super) z1: f64,
    pub(super) w_a: f64,
    pub(super) w_z: f64,
}

/// One end of the interval in which a line is inside the solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct End {
    pub(super) t: f64,
    /// Whether the end is on one of the two end planes, not on the lateral surface.
    pub(super) on_plane: bool,
}

impl Frustum {
    /// The interval of the line `q + t·d` (`q` relative to the frustum's point `a`) inside the
    /// solid.
    ///
    /// The lateral surface is f(t) = |P + t·D|² − (W₀ + t·W₁)² = 0 with P = q × v and D = d × v.
    /// With these cross products, the radius of a tube a million times longer than thick keeps ten
    /// digits; with the expanded form |p|²|v|² − (p·v)² it keeps four.
    #[inline]
    pub(super) fn interval(&self, q: DVec3, d: DVec3) -> Option<[End; 2]> {
        // The interval between the planes.
        let (qv, dv) = (q.dot(self.v), d.dot(self.v));
        let (ta, tb) = if dv == 0.0 {
            if qv < self.z0 || qv > self.z1 {
                return None;
            }
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            let (x, y) = ((self.z0 - qv) / dv, (self.z1 - qv) / dv);
            if x < y { (x, y) } else { (y, x) }
        };

        // The parabola f is expanded around the point of the slab that is nearest to its vertex.
        // There the constant term is only the difference of two nearly equal lengths, however far
        // the ray's origin is.
        let (p, dd) = (q.cross(self.v), d.cross(self.v));
        let w0 = self.w_a + self.w_z * qv;
        let w1 = self.w_z * dv;
        let a = dd.length_squared() - w1 * w1;
        let vertex = (w0 * w1 - p.dot(dd)) / a;
        let s = if vertex.is_finite() { vertex.max(ta).min(tb) } else { 0.5 * (ta + tb) };
        if !s.is_finite() {
            return None; // perpendicular to the axis and without direction: not a ray
        }
        let (ps, ws) = (p + s * dd, w0 + s * w1);
        let b = ps.dot(dd) - ws * w1;
        let r = ps.length();
        let c = (r - ws) * (r + ws);
        let discriminant = b * b - a * c;

        // Roots relative to s. The solid is f ≤ 0.
        let plane = |t: f64| End { t, on_plane: true };
        let side = |t: f64| End { t: s + t, on_plane: false };
        let (near, far) = if discriminant < 0.0 {
            if c > 0.0 {
                return None;
            }
            (plane(ta), plane(tb))
        } else {
            let k = -(b + discriminant.sqrt().copysign(b));
            if k == 0.0 {
                // b = 0 and a·c = 0: f is constant, or a parabola that touches zero.
                if a > 0.0 {
                    (side(0.0), side(0.0))
                } else if c <= 0.0 {
                    (plane(ta), plane(tb))
                } else {
                    return None;
                }
            } else {
                let (x, y) = (k / a, c / k);
                if a > 0.0 {
                    (side(x.min(y)), side(x.max(y)))
                } else if a < 0.0 {
                    // The line is steeper than the cone: it is inside before the first root (one
                    // nappe) and after the second (the other). The slab contains only one nappe, so
                    // the longer interval is used.
                    let (lo, hi) = (s + x.min(y), s + x.max(y));
                    if lo - ta > tb - hi {
                        (plane(ta), side(x.min(y)))
                    } else {
                        (side(x.max(y)), plane(tb))
                    }
                } else if b > 0.0 {
                    (plane(ta), side(y))
                } else {
                    (side(y), plane(tb))
                }
            }
        };
        let near = if near.t < ta { plane(ta) } else { near };
        let far = if far.t > tb { plane(tb) } else { far };
        (near.t <= far.t).then_some([near, far])
    }
}
