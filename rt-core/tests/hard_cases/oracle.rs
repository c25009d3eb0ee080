//! The slow reference: tests every triangle in f64 and bounds the error of an f32 result.

use rt_core::glam::DVec3;
use rt_core::mesh::TriMesh;
use rt_core::ray::{Hit, Ray};

/// Unit roundoff of f32.
const U: f64 = 1.0 / (1u64 << 24) as f64;
/// Number of roundings allowed. The test has about ten in a chain; the worst seen over all tests
/// here is 3.
const ROUNDINGS: f64 = 8.0;

/// Intersection of a ray with one triangle's plane, in f64.
pub(crate) struct PlaneIntersection {
    pub(crate) t: f64,
    /// Smallest barycentric weight: negative outside, zero on an edge.
    pub(crate) depth: f64,
    /// Largest errors that rounding may cause in `t` and `depth`.
    pub(crate) t_error: f64,
    depth_error: f64,
    /// Largest change of `depth` when the ray moves by one unit of length.
    pub(crate) depth_per_length: f64,
}

/// `None` when the ray lies in the plane, or the triangle has no area.
pub(crate) fn intersect_plane(
    corners: [DVec3; 3],
    origin: DVec3,
    dir: DVec3,
) -> Option<PlaneIntersection> {
    let [a, b, c] = corners.map(|p| p - origin);
    let (e1, e2) = (b - a, c - a);
    let n = e1.cross(e2);
    let det = n.dot(dir);
    if det == 0.0 || !det.is_finite() {
        return None;
    }
    let (u, v, w) = (dir.dot(c.cross(b)), dir.dot(a.cross(c)), dir.dot(b.cross(a)));
    let sum = u + v + w;
    let depth = (u / sum).min(v / sum).min(w / sum);
    let t = n.dot(a) / det;
    // ---- Errors: positions relative to the ray have rounding errors in proportion to their size.
    // On a slanted or slender triangle they cause a larger error of t.
    let cos = (det / (n.length() * dir.length())).abs();
    let length = e1.length().max(e2.length()).max((e2 - e1).length());
    let reach = corners.iter().map(|p| (*p - origin).abs().max_element()).fold(0.0, f64::max);
    let slender = length * length / n.length();
    let t_error = ROUNDINGS * U * (reach + length * slender) / (dir.length() * cos);
    let depth_per_length = slender / length / cos;
    let depth_error = ROUNDINGS * U * (reach + length) * depth_per_length;
    Some(PlaneIntersection { t, depth, t_error, depth_error, depth_per_length })
}

/// Compares `found` with the result of testing every triangle of `mesh` (`world_origin` is the
/// origin of render space). The range is the ray's. Returns the error of t as a fraction of the
/// allowed error, or `None` for a miss.
pub(crate) fn check(
    mesh: &TriMesh,
    world_origin: DVec3,
    ray: &Ray,
    found: Option<Hit>,
    what: &str,
) -> Option<f64> {
    let (o, d) = (ray.origin.as_dvec3() + world_origin - mesh.origin, ray.dir.as_dvec3());
    let at = |i: usize| mesh.triangle(i).map(|p| p.as_dvec3());
    let (t_min, t_max) = (ray.t_min as f64, ray.t_max as f64);
    // The nearest triangle that is hit with any rounding.
    let mut sure: Option<(f64, f64, usize)> = None;
    for i in (0..mesh.num_triangles()).filter(|&i| mesh.is_renderable(i)) {
        let Some(m) = intersect_plane(at(i), o, d) else { continue };
        let certain =
            m.depth > m.depth_error && m.t - m.t_error >= t_min && m.t + m.t_error < t_max;
        if certain && sure.is_none_or(|(t, e, _)| m.t + m.t_error < t + e) {
            sure = Some((m.t, m.t_error, i));
        }
    }
    let Some(h) = found else {
        assert!(
            sure.is_none(),
            "{what}: {ray:?} misses, but surely hits (t, error, triangle) {sure:?}"
        );
        return None;
    };
    assert!(h.t >= ray.t_min && h.t < ray.t_max, "{what}: {ray:?}: {h:?} is outside the range");
    let m = intersect_plane(at(h.prim as usize), o, d);
    let m = m
        .unwrap_or_else(|| panic!("{what}: {ray:?}: {h:?} is parallel to the ray, or no triangle"));
    assert!(
        m.depth >= -m.depth_error,
        "{what}: {ray:?}: {h:?} is {} outside its triangle",
        -m.depth
    );
    let error = (h.t as f64 - m.t).abs() / m.t_error;
    assert!(
        error <= 1.0,
        "{what}: {ray:?}: {h:?} should have t {}: {error} times the allowed error",
        m.t
    );
    if let Some((t, e, i)) = sure {
        assert!(
            h.t as f64 - m.t_error <= t + e,
            "{what}: {ray:?}: {h:?} lies behind triangle {i} at {t}"
        );
    }
    Some(error * ROUNDINGS)
}
