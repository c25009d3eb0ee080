//! Back faces of triangles that look different from their front faces
//! (`vtkActor::SetBackfaceProperty`).
//!
//! OpenGL tests each fragment for its side. In rt-core, materials belong to instances, so the back
//! faces are a second shape. Rays hit its triangles only from behind, slightly in front of the
//! surface itself.

use rt_core::glam::{DVec3, Vec3};
use rt_core::math::Aabb;
use rt_core::mesh::{PerElement, TriMesh};
use rt_core::ray::Ray;
use rt_core::shapes::{Shape, ShapeHit, ShapeSurface};
use std::sync::Arc;

/// Factor on the ray parameter of a hit: a few f32 roundings nearer than the surface.
const DEPTH_BIAS: f64 = 1.0 - 1e-6;

/// The back faces of a mesh; see the module documentation.
pub(super) struct BackFaces {
    mesh: Arc<TriMesh>,
}

impl BackFaces {
    pub(super) fn of(mesh: Arc<TriMesh>) -> BackFaces {
        BackFaces { mesh }
    }

    fn corners(&self, prim: u32) -> Option<[DVec3; 3]> {
        let i = prim as usize;
        self.mesh.is_renderable(i).then(|| self.mesh.triangle(i).map(|p| p.as_dvec3()))
    }
}

impl Shape for BackFaces {
    fn num_primitives(&self) -> usize {
        self.mesh.indices.len()
    }

    fn origin(&self) -> DVec3 {
        self.mesh.origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        match self.corners(prim) {
            Some(_) => {
                let [a, b, c] = self.mesh.triangle(prim as usize);
                // Padded by a few roundings: rays that run along a flat box would miss it.
                let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
                let pad = (lo.abs().max(hi.abs()) * 4.0 * f32::EPSILON)
                    .max(Vec3::splat(f32::MIN_POSITIVE));
                Aabb { min: lo - pad, max: hi + pad }
            }
            None => Aabb::EMPTY,
        }
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let [a, b, c] = self.corners(prim)?;
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        // Möller and Trumbore 1997, in f64.
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(e2);
        let det = e1.dot(p);
        // A normal along the ray means a hit from behind.
        if det >= 0.0 {
            return None;
        }
        let s = o - a;
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = d.dot(q) / det;
        if u < 0.0 || v < 0.0 || u + v > 1.0 {
            return None;
        }
        let t = (e2.dot(q) / det * DEPTH_BIAS) as f32;
        (t >= ray.t_min && t < ray.t_max).then_some(ShapeHit { t, u: u as f32, v: v as f32 })
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, _: &Ray) -> ShapeSurface {
        let i = prim as usize;
        let [a, b, c] = self.mesh.triangle(i).map(|p| p.as_dvec3());
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let face = (b - a).cross(c - a).as_vec3().normalize_or_zero();
        let shading = self.mesh.normals.as_ref().and_then(|n| match n.per {
            PerElement::Face => n.values.get(i).copied(),
            PerElement::Vertex => {
                let [x, y, z] = self.mesh.indices[i].map(|k| n.values.get(k as usize).copied());
                Some(x? * (1.0 - hit.u - hit.v) + y? * hit.u + z? * hit.v)
            }
        });
        let point = (a + (b - a) * u + (c - a) * v).as_vec3();
        ShapeSurface {
            point,
            point_error: point.abs().max_element() * 4.0 * f32::EPSILON,
            normal: face,
            shading_normal: shading,
            scalar: None,
            color: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::mesh::Attribute;

    #[test]
    fn backs_are_met_from_behind_only_and_before_the_surface() {
        let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        let back_faces = BackFaces::of(Arc::new(mesh));
        // The normal is +z.
        let from = |z: f32| Ray::new(Vec3::new(0.25, 0.25, z), Vec3::new(0.0, 0.0, -z.signum()));
        assert_eq!(back_faces.closest(0, &from(2.0)), None);
        let hit = back_faces.closest(0, &from(-2.0)).expect("the back");
        assert!(hit.t < 2.0 && hit.t > 1.9999, "{hit:?}");
        let s = back_faces.surface(0, &hit, &from(-2.0));
        assert_eq!((s.normal, s.point.z), (Vec3::Z, 0.0));
    }

    #[test]
    fn backs_with_smooth_normals_keep_the_normal_of_the_triangle_for_rays() {
        // Rays that start along a smooth normal would start on the wrong side of the triangle.
        let smooth = Vec3::new(0.8, 0.0, 0.6);
        let mut mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        mesh.normals = Some(Attribute { per: PerElement::Vertex, values: vec![smooth; 3] });
        let back_faces = BackFaces::of(Arc::new(mesh));
        let ray = Ray::new(Vec3::new(0.25, 0.25, -2.0), Vec3::Z);
        let hit = back_faces.closest(0, &ray).expect("the back");
        let s = back_faces.surface(0, &hit, &ray);
        assert_eq!(s.normal, Vec3::Z);
        let shading = s.shading_normal.expect("the mesh has normals");
        assert!((shading - smooth).length() < 1e-6, "{shading}");
    }
}
