//! Tests every triangle against every ray in f64. It is slow and short, and serves as the reference
//! for fast tracers.

use super::Tracer;
use crate::rays::{HitBlock, LANES, NO_HIT, RayBlock};
use glam::DVec3;
use rt_core::mesh::TriMesh;

/// All triangles of a mesh in f64.
pub struct BruteForce {
    triangles: Vec<[DVec3; 3]>,
}

impl BruteForce {
    /// Prepares a mesh. Triangles that cannot be rendered are ignored.
    pub fn new(mesh: &TriMesh) -> BruteForce {
        let corners = |i: usize| {
            if mesh.is_renderable(i) {
                mesh.triangle(i).map(|p| p.as_dvec3())
            } else {
                [DVec3::NAN; 3]
            }
        };
        BruteForce { triangles: (0..mesh.num_triangles()).map(corners).collect() }
    }

    /// Distance, triangle and barycentric coordinates of the closest hit in `tmin..=tmax`. The edge
    /// functions are volumes of origin and edge (Pluecker form). Both triangles of an edge get the
    /// same number, so no ray passes between them.
    pub fn closest_hit(
        &self,
        o: DVec3,
        d: DVec3,
        tmin: f64,
        tmax: f64,
    ) -> Option<(f64, u32, f64, f64)> {
        let mut best: Option<(f64, u32, f64, f64)> = None;
        for (i, &[a, b, c]) in self.triangles.iter().enumerate() {
            let (a, b, c) = (a - o, b - o, c - o);
            let (u, v, w) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
            let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
            let sum = u + v + w;
            if !inside || sum == 0.0 {
                continue;
            }
            let t = (a * u + b * v + c * w).dot(d) / sum / d.length_squared();
            if t >= tmin && t <= tmax && best.is_none_or(|h| t < h.0) {
                best = Some((t, i as u32, v / sum, w / sum));
            }
        }
        best
    }

    fn lane(&self, r: &RayBlock, l: usize) -> Option<(f64, u32, f64, f64)> {
        let o = DVec3::new(r.ox[l].into(), r.oy[l].into(), r.oz[l].into());
        let d = DVec3::new(r.dx[l].into(), r.dy[l].into(), r.dz[l].into());
        self.closest_hit(o, d, r.t_min[l].into(), r.t_max[l].into())
    }
}

impl Tracer for BruteForce {
    fn name(&self) -> String {
        "every triangle, f64".into()
    }

    fn closest(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        for (r, h) in rays.iter().zip(hits) {
            for l in 0..LANES {
                (h.t[l], h.prim[l], h.u[l], h.v[l]) = match self.lane(r, l) {
                    Some((t, prim, u, v)) => (t as f32, prim, u as f32, v as f32),
                    None => (f32::INFINITY, NO_HIT, 0.0, 0.0),
                };
            }
        }
    }

    fn occluded(&self, rays: &[RayBlock], masks: &mut [u16]) {
        for (r, m) in rays.iter().zip(masks) {
            *m = (0..LANES).fold(0, |m, l| m | u16::from(self.lane(r, l).is_some()) << l);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn distance_and_weights_of_a_known_hit() {
        let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0], vec![[0, 1, 2]]);
        let b = BruteForce::new(&mesh);
        let down = DVec3::new(0.0, 0.0, -2.0);
        let (t, prim, u, v) =
            b.closest_hit(DVec3::new(1.0, 2.0, 3.0), down, 0.0, f64::INFINITY).unwrap();
        assert_eq!((t, prim, u, v), (1.5, 0, 0.25, 0.5));
        assert_eq!(
            b.closest_hit(DVec3::new(1.0, 2.0, 3.0), down, 0.0, 1.4),
            None,
            "tmax is honoured"
        );
        assert_eq!(
            b.closest_hit(DVec3::new(1.0, 2.0, 3.0), down, 1.6, 9.0),
            None,
            "tmin is honoured"
        );
        assert_eq!(b.closest_hit(DVec3::new(3.0, 3.0, 3.0), down, 0.0, 9.0), None, "outside");
    }

    #[test]
    fn a_triangle_with_a_nan_vertex_is_never_hit() {
        let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::NAN], vec![[0, 1, 2], [0, 1, 7]]);
        let b = BruteForce::new(&mesh);
        assert_eq!(b.closest_hit(DVec3::new(0.1, 0.1, 1.0), DVec3::NEG_Z, 0.0, 9.0), None);
    }
}
