//! Rounded cones: the convex hull of two spheres, which is one segment of a tube.
//!
//! Geometry in the half plane (z along the axis, ρ away from it), with L the distance of the
//! centres and sin α = (r_a − r_b)/L: the common tangent has the normal (sin α, cos α). It touches
//! the spheres at z = r_a sin α and z = L + r_b sin α. The signed distance is the distance to
//! sphere a before the tangent's foot, to the tangent line between the two points of contact, and
//! to sphere b after them (own derivation; the same body as in Han, Wald, Usher, Wu, Wang,
//! Pascucci, Hansen and Johnson, "Ray Tracing Generalized Tube Primitives", EuroVis 2019, section
//! 3, and Quilez' `sdRoundCone`).
//!
//! A ray is intersected with three convex solids that cover the hull: the two spheres and the
//! truncated cone between the two tangent circles. The hull's interval is the union of the three
//! intervals. The cone's flat ends lie inside the spheres, so there is no seam through which a ray
//! can leak.

use super::frustum::Frustum;
use super::sphere::ray_sphere;
use glam::DVec3;

/// The part of the surface that a point is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// The sphere around `a`.
    Start,
    /// The cone between.
    Body,
    /// The sphere around `a + v`.
    End,
}

/// The convex hull of the spheres (a, ra) and (a + v, rb).
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundedCone {
    pub(super) a: DVec3,
    pub(super) v: DVec3,
    pub(super) ra: f64,
    pub(super) rb: f64,
}

/// The surface point nearest to a given point.
pub(super) struct Nearest {
    /// Signed distance, negative inside.
    pub(super) distance: f64,
    /// Outward unit normal.
    pub(super) normal: DVec3,
    /// Position along the axis: 0 on the sphere around `a`, 1 on the other, linear between the
    /// tangent circles.
    pub(super) along: f64,
}

impl RoundedCone {
    /// Whether one sphere contains the other (equal centres included), so that the hull is the
    /// larger sphere.
    #[inline]
    pub(super) fn is_sphere(&self) -> bool {
        let dr = self.ra - self.rb;
        self.v.length_squared() <= dr * dr
    }

    /// Entry and exit of the line `o + t·d`, with the part of the surface they are on.
    #[inline]
    pub(super) fn interval(&self, o: DVec3, d: DVec3) -> Option<[(f64, Part); 2]> {
        let dd = d.length_squared();
        let oa = self.a - o;
        let dr = self.ra - self.rb;
        let vv = self.v.length_squared();
        if vv <= dr * dr {
            let (c, r, part) = if dr >= 0.0 {
                (oa, self.ra, Part::Start)
            } else {
                (oa + self.v, self.rb, Part::End)
            };
            return ray_sphere(c, d, dd, r).map(|(t0, t1)| [(t0, part), (t1, part)]);
        }

        // Most rays that hit the box of a thin diagonal segment miss the segment. Compares the
        // distance of the two lines first, unless they are so parallel that their common normal is
        // only rounding.
        let n = d.cross(self.v);
        let nn = n.length_squared();
        let r_max = self.ra.max(self.rb);
        let gap = n.dot(oa);
        if nn > 1e-12 * dd * vv && gap * gap > 1.000_001 * r_max * r_max * nn {
            return None;
        }

        let frustum = {
            // w = ρ·|v| on the cone: ρ = (r_a − z sin α)/cos α.
            let k = 1.0 / (vv - dr * dr).sqrt();
            Frustum {
                v: self.v,
                z0: self.ra * dr,
                z1: vv + self.rb * dr,
                w_a: self.ra * vv * k,
                w_z: -dr * k,
            }
        };
        let mut hull: Option<[(f64, Part); 2]> = None;
        let mut add = |t0: f64, t1: f64, part: Part| {
            let h = hull.get_or_insert([(t0, part), (t1, part)]);
            if t0 < h[0].0 {
                h[0] = (t0, part);
            }
            if t1 > h[1].0 {
                h[1] = (t1, part);
            }
        };
        // The body comes first: where it ties with a sphere, on the tangent circle, the hit is on
        // the body.
        if let Some([near, far]) = frustum.interval(-oa, d) {
            add(near.t, far.t, Part::Body);
        }
        if let Some((t0, t1)) = ray_sphere(oa, d, dd, self.ra) {
            add(t0, t1, Part::Start);
        }
        if let Some((t0, t1)) = ray_sphere(oa + self.v, d, dd, self.rb) {
            add(t0, t1, Part::End);
        }
        hull
    }

    /// The surface point nearest to `p`.
    pub(super) fn nearest(&self, p: DVec3) -> Nearest {
        let q = p - self.a;
        let sphere = |q: DVec3, r: f64, along: f64| {
            let len = q.length();
            let normal = if len > 0.0 { q / len } else { DVec3::Z };
            Nearest { distance: len - r, normal, along }
        };
        let dr = self.ra - self.rb;
        let length = self.v.length();
        if length <= dr.abs() {
            return if dr >= 0.0 {
                sphere(q, self.ra, 0.0)
            } else {
                sphere(q - self.v, self.rb, 1.0)
            };
        }
        let e = self.v / length;
        let sin = dr / length;
        let cos = ((1.0 - sin) * (1.0 + sin)).sqrt();
        let z = q.dot(e);
        // Projected twice: the first projection leaves the rounding of a long q in the axial
        // direction.
        let radial = q - z * e;
        let radial = radial - radial.dot(e) * e;
        let rho = radial.length();
        let m = cos * z - sin * rho;
        if m < 0.0 {
            sphere(q, self.ra, 0.0)
        } else if m > cos * length {
            sphere(q - self.v, self.rb, 1.0)
        } else {
            let outward = if rho > 0.0 { radial / rho } else { e.any_orthonormal_vector() };
            Nearest {
                distance: cos * rho + sin * z - self.ra,
                normal: sin * e + cos * outward,
                along: m / (cos * length),
            }
        }
    }
}
