//! What surfaces need of the triangle that a ray has hit, in a mesh in memory or in a stored one.

use super::ResolvedInstance;
use crate::bvh::StoredMesh;
use crate::material::ColorSource;
use crate::mesh::{Attribute, PerElement, TriMesh};
use crate::ray::{Hit, Ray};
use crate::shapes::ShapeHit;
use glam::{Vec2, Vec3};

/// A triangle that a ray has hit, in object space.
pub(super) struct HitTriangle {
    pub(super) corners: [Vec3; 3],
    /// Normal for shading at the hit, of any length; `None` for the face's.
    pub(super) normal: Option<Vec3>,
    /// Colour at the hit: linear RGBA.
    pub(super) color: [f32; 4],
}

impl ResolvedInstance<'_> {
    #[inline(always)]
    pub(super) fn mesh_triangle(&self, mesh: &TriMesh, hit: &Hit) -> HitTriangle {
        let corner = mesh.indices[hit.prim as usize].map(|k| k as usize);
        let (u, v) = (hit.u, hit.v);
        let weights @ [w, ..] = [1.0 - u - v, u, v];
        let normal = self.shading_normals(mesh).map(|normals| match normals.per {
            PerElement::Vertex => {
                let [x, y, z] = corner.map(|k| normals.values[k]);
                x * w + y * u + z * v
            }
            PerElement::Face => normals.values[hit.prim as usize],
        });
        let color = self.mesh_color(mesh, corner, hit.prim, weights);
        HitTriangle { corners: corner.map(|k| mesh.positions[k]), normal, color }
    }

    /// `None` when its page cannot be read any more.
    pub(super) fn stored_triangle(
        &self,
        mesh: &StoredMesh,
        ray: &Ray,
        hit: &Hit,
    ) -> Option<HitTriangle> {
        let at = ShapeHit { t: hit.t, u: hit.u, v: hit.v };
        let found = mesh.triangle_hit(hit.prim, &at, &self.object_ray(ray))?;
        let a = found.attributes;
        let normal = a.normal.filter(|_| !self.material.flat);
        let color = self.shape_color(hit.prim, a.color, a.scalar);
        Some(HitTriangle { corners: found.corners, normal, color })
    }

    /// Normals to interpolate, if the material uses them.
    #[inline(always)]
    pub(super) fn shading_normals<'m>(&self, mesh: &'m TriMesh) -> Option<&'m Attribute<Vec3>> {
        mesh.normals.as_ref().filter(|_| !self.material.flat)
    }

    #[inline(always)]
    pub(super) fn mesh_color(
        &self,
        mesh: &TriMesh,
        corner: [usize; 3],
        prim: u32,
        [w, u, v]: [f32; 3],
    ) -> [f32; 4] {
        match &self.material.color_source {
            ColorSource::Attribute => self.colors.map(|c| {
                self.material.color_transfer.apply(interpolate4(c, corner, prim, [w, u, v]))
            }),
            ColorSource::Constant => None,
            ColorSource::Scalars(map) => self.scalars.map(|s| {
                let value = match s.per {
                    PerElement::Vertex => {
                        let [x, y, z] = corner.map(|k| s.values[k]);
                        x * w + y * u + z * v
                    }
                    PerElement::Face => s.values[prim as usize],
                };
                self.material.color_transfer.apply(map.lookup(value))
            }),
            ColorSource::Texture(texture) => mesh.texcoords.as_ref().map(|uv| {
                let [x, y, z] = corner.map(|k| uv[k]);
                let at: Vec2 = x * w + y * u + z * v;
                let [r, g, b, a] = texture.sample(at);
                let [mr, mg, mb] = self.material.color;
                [r * mr, g * mg, b * mb, a]
            }),
        }
        .unwrap_or_else(|| self.constant())
    }
}

#[inline]
fn interpolate4(
    a: &Attribute<[f32; 4]>,
    corner: [usize; 3],
    prim: u32,
    [w, u, v]: [f32; 3],
) -> [f32; 4] {
    match a.per {
        PerElement::Vertex => {
            let [x, y, z] = corner.map(|k| a.values[k]);
            std::array::from_fn(|c| x[c] * w + y[c] * u + z[c] * v)
        }
        PerElement::Face => a.values[prim as usize],
    }
}
