//! The point of a triangle that is closest to a given one.

use glam::DVec3;

/// The point of a triangle that is closest to the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestOfTriangle {
    /// Square of its distance.
    pub distance2: f64,
    /// Weight of the second corner there.
    pub u: f64,
    /// Weight of the third corner there.
    pub v: f64,
}

/// The closest point to the origin of the triangle with `corners`, in `f64`. Triangles without area
/// are segments or points.
///
/// ```
/// use rt_core::{glam::DVec3, math::{NearestOfTriangle, nearest_of_triangle}};
/// let corners = [[-1.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 5.0, 3.0]].map(DVec3::from);
/// let NearestOfTriangle { distance2, u, v } = nearest_of_triangle(corners);
/// assert_eq!([distance2, u, v], [9.0, 0.5, 0.0]);
/// ```
pub fn nearest_of_triangle(corners: [DVec3; 3]) -> NearestOfTriangle {
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
        return NearestOfTriangle { distance2: height * height / area2, u, v };
    }
    let edges = [
        nearest_of_segment(a, b, |s| (s, 0.0)),
        nearest_of_segment(a, c, |s| (0.0, s)),
        nearest_of_segment(b, c, |s| (1.0 - s, s)),
    ];
    edges[1..].iter().fold(edges[0], |n, e| if e.distance2 < n.distance2 { *e } else { n })
}

fn nearest_of_segment(
    p: DVec3,
    q: DVec3,
    weights: impl Fn(f64) -> (f64, f64),
) -> NearestOfTriangle {
    let along = q - p;
    let length2 = along.length_squared();
    let s = if length2 > 0.0 { (-p.dot(along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    let (u, v) = weights(s);
    NearestOfTriangle { distance2: (p + along * s).length_squared(), u, v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_place_of_a_triangle_is_nearer_than_the_nearest() {
        let flat = [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.5), DVec3::new(0.3, 1.0, -0.2)];
        // Without area: a segment, and a point.
        let segment = [flat[0], flat[1], flat[1]];
        for triangle in [flat, segment, [flat[2]; 3]] {
            let [a, b, c] = triangle;
            for k in 0..343 {
                let at =
                    DVec3::new(f64::from(k % 7), f64::from(k / 7 % 7), f64::from(k / 49)) - 3.0;
                let mut dense = f64::INFINITY;
                for i in 0..=100 {
                    for j in 0..=100 - i {
                        let (u, v) = (f64::from(i) / 100.0, f64::from(j) / 100.0);
                        dense = dense.min((a + (b - a) * u + (c - a) * v).distance(at));
                    }
                }
                let nearest = nearest_of_triangle(triangle.map(|p| p - at));
                let exact = nearest.distance2.sqrt();
                assert!(exact <= dense + 1e-12 && dense - exact < 0.03, "{at}: {exact} {dense}");
                let place = a + (b - a) * nearest.u + (c - a) * nearest.v;
                assert!((place.distance(at) - exact).abs() < 1e-12, "{at}");
            }
        }
    }
}
