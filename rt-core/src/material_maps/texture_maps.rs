//! Material maps from textures at the mesh's texture coordinates: those of glTF 2.0, which are also
//! `vtkProperty`'s.

use super::{BsdfParameters, MaterialEvalContext, MaterialMaps};
use crate::mesh::TriMesh;
use crate::texture::Texture;
use glam::Vec3;
use std::sync::Arc;

/// Which convention interprets the textures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum MapConvention {
    /// glTF 2.0: occlusion attenuates ambient light only; the tangent frame belongs to the outside;
    /// tangents come from the texture coordinates where the mesh has none.
    #[default]
    Gltf,
    /// VTK 9's shader: occlusion attenuates lights too, but not emission; the frame is built on the
    /// normal that is turned towards the viewer; without tangents in the mesh the normal map is
    /// ignored.
    Vtk,
}

/// Textures; the material's own value applies where one is `None`.
#[derive(Debug, Clone, Default)]
pub struct TextureMaps {
    /// Normals: 2 rgb - 1 in the frame of tangent, bitangent and shading normal.
    pub normal: Option<Arc<Texture>>,
    /// Factor on the first two components of the normal.
    pub normal_scale: f32,
    /// Green times the material's roughness, blue times its metalness.
    pub metallic_roughness: Option<Arc<Texture>>,
    /// Red: share of light that arrives.
    pub occlusion: Option<Arc<Texture>>,
    /// Strength of the occlusion: 0 for none, 1 for full.
    pub occlusion_strength: f32,
    /// Times the material's emission.
    pub emission: Option<Arc<Texture>>,
    /// How the textures are interpreted.
    pub convention: MapConvention,
    /// The second texture coordinate grows from the image's upper edge downwards, as in glTF's
    /// files. Green points up in the image, so a bitangent that is computed from such coordinates
    /// points against them. Tangents of the mesh already include the sign.
    pub rows_from_top: bool,
}

impl TextureMaps {
    /// No textures, full scale and strength.
    pub fn new(convention: MapConvention) -> TextureMaps {
        TextureMaps {
            normal_scale: 1.0,
            occlusion_strength: 1.0,
            convention,
            ..TextureMaps::default()
        }
    }

    fn perturbed_normal(
        &self,
        place: &MaterialEvalContext<'_>,
        [r, g, b, _]: [f32; 4],
    ) -> Option<Vec3> {
        let scale = Vec3::new(self.normal_scale, self.normal_scale, 1.0);
        let bend = ((Vec3::new(r, g, b) * 2.0 - 1.0) * scale).try_normalize()?;
        match self.convention {
            MapConvention::Gltf => {
                let (tangent, sense) = place.tangent()?;
                let made = place.mesh?.tangents.is_none();
                place.perturbed_normal(
                    (tangent, if made && self.rows_from_top { -sense } else { sense }),
                    bend,
                )
            }
            MapConvention::Vtk => {
                place.mesh?.tangents.as_ref()?;
                place.perturbed_normal_after_flip(place.tangent()?.0, bend)
            }
        }
    }
}

impl MaterialMaps for TextureMaps {
    fn evaluate(&self, base: BsdfParameters, place: &MaterialEvalContext<'_>) -> BsdfParameters {
        let Some(at) = place.texcoord() else { return base };
        let mut out = base;
        if let Some(texture) = &self.metallic_roughness {
            let [_, roughness, metallic, _] = texture.sample(at);
            out.roughness *= roughness;
            out.metallic *= metallic;
        }
        if let Some(texture) = &self.occlusion {
            let dimmed = 1.0 + self.occlusion_strength * (texture.sample(at)[0] - 1.0);
            out.ambient *= dimmed;
            if self.convention == MapConvention::Vtk {
                out.direct *= dimmed;
            }
        }
        if let Some(texture) = &self.emission {
            let [r, g, b, _] = texture.sample(at);
            out.emission *= Vec3::new(r, g, b);
        }
        if let Some(texture) = &self.normal
            && let Some(normal) = self.perturbed_normal(place, texture.sample(at))
        {
            out.normal = normal;
        }
        out
    }

    fn missing_attribute(&self, mesh: &TriMesh) -> Option<&'static str> {
        if mesh.texcoords.is_none() {
            return Some("texture coordinates");
        }
        let vtk = self.convention == MapConvention::Vtk;
        (vtk && self.normal.is_some() && mesh.tangents.is_none())
            .then_some("tangents, without which VTK leaves normal maps out")
    }
}
