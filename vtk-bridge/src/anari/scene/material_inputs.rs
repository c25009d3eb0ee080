//! Material inputs that vary over a surface, other than colour and opacity: numbers, emission and
//! perturbed normals. They are looked up at the hits.

use super::attribute::{HitPoint, Topology};
use super::sampler::Sampler;
use super::surface_color::{Input, Weights};
use rt_core::glam::{DAffine3, Vec2, Vec3};
use rt_core::material_maps::{BsdfParameters, MaterialEvalContext, MaterialMaps};
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Inputs of a physically based material that are not constants.
#[derive(Clone)]
pub(crate) struct MaterialInputs {
    pub(crate) metallic: Option<Input>,
    pub(crate) roughness: Option<Input>,
    pub(crate) specular: Option<Input>,
    pub(crate) emissive: Option<Input>,
    pub(crate) occlusion: Option<Input>,
    pub(crate) normal: Option<Sampler>,
    /// The reflectance that `specular` scales.
    pub(crate) normal_reflectance: f32,
}

impl MaterialInputs {
    pub(crate) fn varies(&self) -> bool {
        let inputs =
            [&self.metallic, &self.roughness, &self.specular, &self.emissive, &self.occlusion];
        inputs.into_iter().any(Option::is_some) || self.normal.is_some()
    }
}

/// The material maps of a geometry.
pub(crate) struct BoundMaterialInputs {
    pub(crate) material_inputs: MaterialInputs,
    pub(crate) topology: Arc<Topology>,
    pub(crate) weights: Weights,
    /// The triangles, even if they are rendered as a shape.
    pub(crate) mesh: Option<Arc<TriMesh>>,
    pub(crate) world_from_object: DAffine3,
}

impl std::fmt::Debug for BoundMaterialInputs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BoundMaterialInputs")
            .field("weights", &self.weights)
            .finish_non_exhaustive()
    }
}

impl MaterialMaps for BoundMaterialInputs {
    fn evaluate(&self, base: BsdfParameters, place: &MaterialEvalContext<'_>) -> BsdfParameters {
        let here = HitPoint {
            topology: &self.topology,
            primitive: place.primitive,
            weights: self.weights.of(place.uv),
            point: place.point,
            normal: place.object_normal.as_dvec3(),
            world_from_object: &self.world_from_object,
        };
        let g = &self.material_inputs;
        let first =
            |input: &Option<Input>, other: f32| input.as_ref().map_or(other, |i| i.at(&here)[0]);
        let mut out = BsdfParameters {
            metallic: first(&g.metallic, base.metallic),
            roughness: first(&g.roughness, base.roughness),
            specular: g
                .specular
                .as_ref()
                .map_or(base.specular, |i| i.at(&here)[0] * g.normal_reflectance),
            ambient: first(&g.occlusion, base.ambient),
            ..base
        };
        if let Some(emissive) = &g.emissive {
            let [r, g, b, _] = emissive.at(&here);
            out.emission = Vec3::new(r, g, b);
        }
        if let Some(normal) = g.normal.as_ref().and_then(|s| self.mapped_normal(s, &here, place)) {
            out.normal = normal;
        }
        out
    }
}

impl BoundMaterialInputs {
    /// The tangent frame is that of the mesh's tangents. Without them, it follows the direction in
    /// which the sampler's attribute increases along the triangle.
    fn mapped_normal(
        &self,
        sampler: &Sampler,
        here: &HitPoint<'_>,
        place: &MaterialEvalContext<'_>,
    ) -> Option<Vec3> {
        let mesh = self.mesh.as_ref()?;
        let place = place.with_mesh(mesh);
        let frame = if mesh.tangents.is_some() {
            place.tangent()?
        } else {
            let corner = |k: usize| {
                let mut weights = [0.0; 3];
                weights[k] = 1.0;
                let [u, v, ..] = sampler.attribute(&HitPoint { weights, ..*here });
                Vec2::new(u, v)
            };
            place.tangent_of([corner(0), corner(1), corner(2)])?
        };
        let [r, g, b, _] = sampler.at(here);
        place.perturbed_normal(frame, (Vec3::new(r, g, b) * 2.0 - 1.0).try_normalize()?)
    }
}
