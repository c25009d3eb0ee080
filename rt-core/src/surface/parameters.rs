//! Points of materials with a [`crate::material_maps::MaterialMaps`].

use super::{ResolvedInstance, Source};
use crate::material_maps::{BsdfParameters, MaterialEvalContext, SurfaceParameters};
use crate::mesh::PerElement;
use crate::ray::{Hit, Ray};
use crate::shapes::{Shape, ShapeHit};
use glam::Vec3;

impl ResolvedInstance<'_> {
    /// The surface parameters at the point that `ray` hit, where they differ from the material;
    /// `normal` is the shading normal, which may be perturbed.
    #[inline]
    pub(crate) fn parameters(
        &self,
        ray: &Ray,
        hit: &Hit,
        normal: &mut Vec3,
    ) -> Option<SurfaceParameters> {
        if self.material.maps.is_some() { self.evaluate_maps(ray, hit, normal) } else { None }
    }

    #[cold]
    #[inline(never)]
    fn evaluate_maps(&self, ray: &Ray, hit: &Hit, normal: &mut Vec3) -> Option<SurfaceParameters> {
        let maps = self.material.maps.as_ref()?;
        let (mesh, point, object_normal, flat) = match self.source {
            Source::Mesh(mesh) => {
                let corner = mesh.indices[hit.prim as usize].map(|k| k as usize);
                let [a, b, c] = corner.map(|k| mesh.positions[k].as_dvec3());
                let (u, v) = (hit.u as f64, hit.v as f64);
                let point = mesh.origin + a + (b - a) * u + (c - a) * v;
                let own = self.shading_normals(mesh).map(|n| match n.per {
                    PerElement::Vertex => {
                        let [x, y, z] = corner.map(|k| n.values[k]);
                        x * (1.0 - hit.u - hit.v) + y * hit.u + z * hit.v
                    }
                    PerElement::Face => n.values[hit.prim as usize],
                });
                let flat = (b - a).cross(c - a).normalize_or_zero().as_vec3();
                (Some(mesh), point, own.and_then(Vec3::try_normalize).unwrap_or(flat), flat)
            }
            Source::Stored(_) | Source::Shape(_) => {
                let shape: &dyn Shape = match self.source {
                    Source::Stored(mesh) => mesh,
                    Source::Shape(shape) => shape,
                    Source::Mesh(_) => return None,
                };
                let s = shape.surface(
                    hit.prim,
                    &ShapeHit { t: hit.t, u: hit.u, v: hit.v },
                    &self.object_ray(ray),
                );
                let smooth = s.shading_normal.filter(|_| !self.material.flat);
                let normal = smooth.and_then(Vec3::try_normalize).unwrap_or(s.normal);
                (None, shape.origin() + s.point.as_dvec3(), normal, s.normal)
            }
        };
        let world = |n: Vec3| self.normal_from_object.map_or(n, |m| (m * n).normalize_or_zero());
        let flipped = world(object_normal).dot(*normal) < 0.0;
        let face_normal = world(flat);
        let place = MaterialEvalContext {
            primitive: hit.prim,
            uv: [hit.u, hit.v],
            point,
            object_normal,
            flipped,
            mesh,
            linear: self.render_from_object.matrix3,
            view: -ray.dir.as_dvec3().normalize_or_zero().as_vec3(),
            face_normal: if face_normal.dot(ray.dir) > 0.0 { -face_normal } else { face_normal },
            outward: if flipped { -*normal } else { *normal },
        };
        let emission = self.material.emission.into();
        let bsdf =
            maps.evaluate(BsdfParameters::of(&self.material.model, emission, *normal), &place);
        if bsdf.normal.is_finite() && bsdf.normal != Vec3::ZERO {
            *normal = bsdf.normal;
        }
        Some(bsdf.apply(self.material.model))
    }
}
