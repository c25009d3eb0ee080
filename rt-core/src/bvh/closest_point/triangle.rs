//! The point of a triangle that is closest to a given one.

use glam::DVec3;

/// Squared distance, and weights of the second and third corners at the closest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nearest {
    pub(super) distance2: f64,
    pub(super) u: f64,
    pub(super) v: f64,
}

/// The closest point to zero of the triangle with `corners`. Triangles without area are segments or
/// points.
pub(super) fn nearest_of_triangle(corners: [DVec3; 3]) -> Nearest {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let area2 = normal.length_squared();
    // Weights of the point of the plane below zero (Ericson, "Real-Time Collision Detection" 2005,
    // section 3.4).
    let u = -a.cross(ac).dot(normal) / area2;
    let v = -ab.cross(a).dot(normal) / area2;
    if area2 > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
        let height = a.dot(normal);
        return Nearest { distance2: height * height / area2, u, v };
    }
    let edges = [
        nearest_of_segment(a, b, |s| (s, 0.0)),
        nearest_of_segment(a, c, |s| (0.0, s)),
        nearest_of_segment(b, c, |s| (1.0 - s, s)),
    ];
    edges[1..].iter().fold(edges[0], |n, e| if e.distance2 < n.distance2 { *e } else { n })
}

fn nearest_of_segment(p: DVec3, q: DVec3, weights: impl Fn(f64) -> (f64, f64)) -> Nearest {
    let along = q - p;
    let length2 = along.length_squared();
    let s = if length2 > 0.0 { (-p.dot(along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    let (u, v) = weights(s);
    Nearest { distance2: (p + along * s).length_squared(), u, v }
}
