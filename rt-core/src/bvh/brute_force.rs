//! The slow reference: tests every triangle against the ray, in f64. Tests compare the traversal
//! with it.

use crate::mesh::TriMesh;
use crate::ray::Ray;
use glam::DVec3;

/// The closest triangle along `ray` (object space), as (t, triangle), tested with f64 edge
/// functions. Ties go to the lower index.
pub(crate) fn closest(mesh: &TriMesh, ray: &Ray) -> Option<(f64, u32)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let mut best: Option<(f64, u32)> = None;
    for i in (0..mesh.indices.len()).filter(|&i| mesh.is_renderable(i)) {
        let [a, b, c] = mesh.triangle(i).map(|p| p.as_dvec3() - o);
        // Edge functions as triple products: the sign tells on which side of each edge the ray
        // passes.
        let (u, v, w) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
        let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        let det = u + v + w;
        if !inside || det == 0.0 {
            continue;
        }
        let along = |p: DVec3| p.dot(d) / d.dot(d);
        let t = (u * along(a) + v * along(b) + w * along(c)) / det;
        let in_range = t >= ray.t_min as f64 && t < ray.t_max as f64;
        if in_range && best.is_none_or(|(bt, _)| t < bt) {
            best = Some((t, i as u32));
        }
    }
    best
}
