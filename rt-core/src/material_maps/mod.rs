//! Surface parameters that vary over a surface, besides its colour: the shading normal, metalness,
//! roughness, emission, and occlusion.
//!
//! The renderer evaluates a material's [`MaterialMaps`] once for each shaded point; materials
//! without maps cost nothing extra. [`TextureMaps`] reads textures; programs implement the trait
//! for other sources (attributes, procedures).

mod texture_maps;

pub use texture_maps::{MapConvention, TextureMaps};

use crate::mesh::TriMesh;
use crate::surface_model::SurfaceModel;
use glam::{DMat3, DVec3, Vec2, Vec3};

/// Surface parameters at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfParameters {
    /// Unit shading normal in world axes, on the lit side.
    pub normal: Vec3,
    /// 0 dielectric to 1 metal, if the model uses it.
    pub metallic: f32,
    /// 0 mirror to 1 rough, if the model uses it.
    pub roughness: f32,
    /// Reflectance at normal incidence of the dielectric part, if the model uses it.
    pub specular: f32,
    /// Emitted radiance, linear RGB.
    pub emission: Vec3,
    /// Share of ambient and reflected light that arrives here (glTF's occlusion). Path tracing
    /// ignores it and computes the occlusion.
    pub ambient: f32,
    /// Share of the lights' direct light that arrives here.
    pub direct: f32,
}

/// The point at which a [`MaterialMaps`] is evaluated.
#[non_exhaustive]
pub struct MaterialEvalContext<'a> {
    /// Primitive of the geometry.
    pub primitive: u32,
    /// Surface coordinates of the hit: on triangles the weights of the second and third corner.
    pub uv: [f32; 2],
    /// The point in the geometry's coordinates, before the instance's transform.
    pub point: DVec3,
    /// Unit shading normal in the geometry's coordinates, as the geometry defines it: not turned
    /// towards the viewer.
    pub object_normal: Vec3,
    /// Whether the material's sides flip it.
    pub flipped: bool,
    /// The mesh, if the geometry is one.
    pub mesh: Option<&'a TriMesh>,
    pub(crate) linear: DMat3,
    /// Unit shading normal in world axes, not flipped.
    pub(crate) outward: Vec3,
    /// Unit, in world axes: the direction to the ray's origin, and the face normal on that side.
    pub(crate) view: Vec3,
    pub(crate) face_normal: Vec3,
}

impl MaterialEvalContext<'_> {
    /// Weights of the corners of a triangle.
    pub fn weights(&self) -> [f32; 3] {
        [1.0 - self.uv[0] - self.uv[1], self.uv[0], self.uv[1]]
    }

    /// The same point as a point of `mesh`, for shapes that represent a mesh's triangles with the
    /// same primitives and hits.
    pub fn with_mesh<'m>(&self, mesh: &'m TriMesh) -> MaterialEvalContext<'m> {
        let MaterialEvalContext {
            primitive,
            uv,
            point,
            object_normal,
            flipped,
            linear,
            outward,
            view,
            face_normal,
            ..
        } = *self;
        MaterialEvalContext {
            primitive,
            uv,
            point,
            object_normal,
            flipped,
            mesh: Some(mesh),
            linear,
            outward,
            view,
            face_normal,
        }
    }

    /// Transforms a direction along the surface from the geometry's coordinates to world axes (any
    /// length).
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        (self.linear * v.as_dvec3()).normalize_or_zero().as_vec3()
    }

    /// Corners of the triangle.
    fn corners(&self) -> Option<(&TriMesh, [usize; 3])> {
        let mesh = self.mesh?;
        Some((mesh, mesh.indices.get(self.primitive as usize)?.map(|k| k as usize)))
    }

    /// Texture coordinates of the mesh at this point.
    pub fn texcoord(&self) -> Option<Vec2> {
        let (mesh, corners) = self.corners()?;
        let uv = mesh.texcoords.as_ref()?;
        let [x, y, z] = corners.map(|k| uv[k]);
        let [w, u, v] = self.weights();
        Some(x * w + y * u + z * v)
    }

    /// The direction in which the first texture coordinate grows, and the sign of the bitangent (1
    /// when normal, tangent and bitangent are right-handed, else -1): the mesh's own tangents, else
    /// from the triangle's texture coordinates.
    pub fn tangent(&self) -> Option<(Vec3, f32)> {
        let (mesh, corners) = self.corners()?;
        if let Some(tangents) = &mesh.tangents {
            let [x, y, z] = corners.map(|k| tangents[k]);
            let [w, u, v] = self.weights();
            let mixed = x * w + y * u + z * v;
            return Some((mixed.truncate(), if mixed.w < 0.0 { -1.0 } else { 1.0 }));
        }
        let uv = mesh.texcoords.as_ref()?;
        self.tangent_of(corners.map(|k| uv[k]))
    }

    /// As [`MaterialEvalContext::tangent`], for other texture coordinates at the triangle's
    /// corners; `None` where they do not span an area.
    pub fn tangent_of(&self, uv: [Vec2; 3]) -> Option<(Vec3, f32)> {
        let (mesh, corners) = self.corners()?;
        let [a, b, c] = corners.map(|k| mesh.positions[k].as_dvec3());
        let ([e1, e2], [s, t]) =
            ([b - a, c - a], [(uv[1] - uv[0]).as_dvec2(), (uv[2] - uv[0]).as_dvec2()]);
        let det = s.x * t.y - t.x * s.y;
        // dP/du and dP/dv solve e1 = s.x dP/du + s.y dP/dv and the same with e2 and t.
        let (du, dv) = ((e1 * t.y - e2 * s.y) / det, (e2 * s.x - e1 * t.x) / det);
        let (du, dv) = (du.normalize_or_zero(), dv.normalize_or_zero());
        if du == DVec3::ZERO || dv == DVec3::ZERO {
            return None;
        }
        let sense = self.object_normal.as_dvec3().cross(du).dot(dv);
        Some((du.as_vec3(), if sense < 0.0 { -1.0 } else { 1.0 }))
    }

    /// The world normal for `bend`, a normal in the space of (tangent, bitangent, shading normal),
    /// as glTF defines it: the frame belongs to the geometry's outside and is flipped with it.
    /// `None` where there is no such frame. A normal is bent less when the mirrored view would
    /// point below the face: such points would be black (Keller et al., "The Iray Light Transport
    /// Simulation and Rendering System", 2017, appendix A.3).
    pub fn perturbed_normal(&self, (tangent, sense): (Vec3, f32), bend: Vec3) -> Option<Vec3> {
        let normal = self.frame(self.outward, tangent, sense, bend)?;
        Some(self.limited_to_visible(if self.flipped { -normal } else { normal }))
    }

    /// As [`MaterialEvalContext::perturbed_normal`], with the convention of VTK's shader: the
    /// normal is first turned towards the viewer, the tangent stays, and the bitangent is their
    /// cross product.
    pub fn perturbed_normal_after_flip(&self, tangent: Vec3, bend: Vec3) -> Option<Vec3> {
        self.frame(if self.flipped { -self.outward } else { self.outward }, tangent, 1.0, bend)
    }

    /// `n`, or the nearest normal in the plane of `n` and the view for which the mirrored view just
    /// grazes the face.
    fn limited_to_visible(&self, n: Vec3) -> Vec3 {
        let mirrored = n * (2.0 * n.dot(self.view)) - self.view;
        let below = mirrored.dot(self.face_normal);
        let along = n.dot(self.face_normal);
        if below >= 0.0 || along <= 0.0 {
            return n;
        }
        let grazing = mirrored - n * (below / along.max(1e-3));
        (self.view + grazing.normalize_or_zero()).try_normalize().unwrap_or(n)
    }

    fn frame(&self, n: Vec3, tangent: Vec3, sense: f32, bend: Vec3) -> Option<Vec3> {
        let t = self.to_world(tangent);
        let t = (t - n * n.dot(t)).try_normalize()?;
        (t * bend.x + n.cross(t) * (sense * bend.y) + n * bend.z).try_normalize()
    }
}

/// Surface parameters that vary over a surface.
pub trait MaterialMaps: Send + Sync + std::fmt::Debug {
    /// The parameters at a point of a surface whose material has the parameters `base`.
    fn evaluate(&self, base: BsdfParameters, place: &MaterialEvalContext<'_>) -> BsdfParameters;

    /// Names the attribute that the mesh lacks for these maps; `None` when it has all.
    fn missing_attribute(&self, _mesh: &TriMesh) -> Option<&'static str> {
        None
    }
}

/// A point whose surface parameters differ from its material's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceParameters {
    pub(crate) model: SurfaceModel,
    pub(crate) emission: Vec3,
    pub(crate) ambient: f32,
    pub(crate) direct: f32,
}

impl BsdfParameters {
    /// The parameters of a model, with a material's emission and a normal.
    pub(crate) fn of(model: &SurfaceModel, emission: Vec3, normal: Vec3) -> BsdfParameters {
        let (metallic, roughness, specular) = match *model {
            SurfaceModel::Pbr { metallic, roughness, specular, .. } => {
                (metallic, roughness, specular)
            }
            SurfaceModel::Metal { roughness } => (1.0, roughness, 0.0),
            _ => (0.0, 1.0, 0.0),
        };
        BsdfParameters {
            normal,
            metallic,
            roughness,
            specular,
            emission,
            ambient: 1.0,
            direct: 1.0,
        }
    }

    /// `model` with these parameters. NaN and values outside their range become the nearest valid
    /// value, so that data cannot put NaN into an image.
    pub(crate) fn apply(&self, mut model: SurfaceModel) -> SurfaceParameters {
        let unit = |v: f32| if v > 0.0 { v.min(1.0) } else { 0.0 };
        match &mut model {
            SurfaceModel::Pbr { metallic, roughness, specular, .. } => {
                (*metallic, *roughness, *specular) =
                    (unit(self.metallic), unit(self.roughness), unit(self.specular));
            }
            SurfaceModel::Metal { roughness } => *roughness = unit(self.roughness),
            _ => {}
        }
        let light = |v: f32| if v > 0.0 && v.is_finite() { v } else { 0.0 };
        let [r, g, b] = self.emission.to_array().map(light);
        SurfaceParameters {
            model,
            emission: Vec3::new(r, g, b),
            ambient: unit(self.ambient),
            direct: unit(self.direct),
        }
    }
}
