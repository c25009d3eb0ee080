//! Converts materials of scene files (glTF, OBJ) to rt-core's.

use datasets::read::{AlphaMode, SceneModel, SurfaceMaterial};
use rt_core::material::{Material, Sides, SurfaceModel};
use rt_core::material_maps::{MapConvention, MaterialMaps, TextureMaps};
use rt_core::texture::Texture;
use std::collections::HashMap;
use std::sync::Arc;

/// The interpretation of a texture: the same file may be a colour in one material and roughness in
/// another.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Role {
    /// sRGB with alpha.
    Color,
    /// sRGB; alpha is ignored.
    Opaque,
    /// sRGB, visible where alpha is at least this many 255ths.
    AlphaMask(u8),
    /// Linear data.
    Linear,
}

/// The materials of a scene, which share textures.
pub(super) struct SceneMaterials<'a> {
    model: &'a SceneModel,
    made: HashMap<(usize, Role), Arc<Texture>>,
}

impl<'a> SceneMaterials<'a> {
    pub(super) fn of(model: &'a SceneModel) -> SceneMaterials<'a> {
        SceneMaterials { model, made: HashMap::new() }
    }

    /// The texture in a role; `None` for a material without one.
    fn texture(
        &mut self,
        index: Option<usize>,
        role: Role,
    ) -> anyhow::Result<Option<Arc<Texture>>> {
        let Some((index, image)) = index.and_then(|i| Some((i, self.model.textures.get(i)?)))
        else {
            return Ok(None);
        };
        if let Some(made) = self.made.get(&(index, role)) {
            return Ok(Some(made.clone()));
        }
        let row = image.width.max(1) as usize;
        let rows = image.rgba8.chunks(row);
        // The reader keeps the texture coordinates of the file: v = 0 is the upper edge unless
        // `v_up`.
        let mut texels: Vec<[u8; 4]> =
            if image.v_up { rows.rev().flatten().copied().collect() } else { image.rgba8.clone() };
        for t in &mut texels {
            t[3] = match role {
                Role::Color | Role::Linear => t[3],
                Role::Opaque => 255,
                Role::AlphaMask(least) => 255 * u8::from(t[3] >= least),
            };
        }
        let (width, height) = (image.width as usize, image.height as usize);
        let mut made = if role == Role::Linear {
            let linear = texels.iter().map(|t| t.map(|v| f32::from(v) / 255.0)).collect();
            Texture::from_linear(width, height, linear)?
        } else {
            Texture::from_srgb8(width, height, texels.as_flattened())?
        };
        (made.wrap, made.filter) = (image.wrap, image.filter);
        let made = Arc::new(made);
        self.made.insert((index, role), made.clone());
        Ok(Some(made))
    }

    pub(super) fn material(&mut self, m: &SurfaceMaterial) -> anyhow::Result<Material> {
        let [r, g, b, factor] = m.base_color;
        // Reflectance of a smooth interface at normal incidence (Fresnel). Rough dielectrics are
        // drawn without mirror rays.
        let fresnel = ((m.ior - 1.0) / (m.ior + 1.0)).powi(2);
        let mut out =
            if m.metallic == 0.0 && m.roughness > 0.5 && m.metallic_roughness_texture.is_none() {
                Material::matte([r, g, b])
            } else {
                let mut out = Material::pbr([r, g, b], m.metallic, m.roughness);
                if let SurfaceModel::Pbr { specular, .. } = &mut out.model {
                    *specular = fresnel.clamp(0.0, 1.0);
                }
                out
            };
        let (opacity, role) = match m.alpha {
            AlphaMode::Opaque => (1.0, Role::Opaque),
            AlphaMode::Blend => (factor, Role::Color),
            // factor * texel >= cutoff
            AlphaMode::Mask(cutoff) if m.base_color_texture.is_some() => {
                let least = (255.0 * cutoff / factor).ceil();
                if least <= 255.0 {
                    (1.0, Role::AlphaMask(least.max(0.0) as u8))
                } else {
                    (0.0, Role::Opaque)
                }
            }
            AlphaMode::Mask(cutoff) => (f32::from(u8::from(factor >= cutoff)), Role::Opaque),
        };
        out = out.with_opacity(opacity.clamp(0.0, 1.0)).with_emission(m.emissive);
        if !m.double_sided {
            out = out.with_sides(Sides::FrontOnly);
        }
        if let Some(t) = self.texture(m.base_color_texture, role)? {
            out = out.textured(t);
        }
        let maps = TextureMaps {
            normal: self.texture(m.normal_texture, Role::Linear)?,
            normal_scale: m.normal_scale,
            metallic_roughness: self.texture(m.metallic_roughness_texture, Role::Linear)?,
            occlusion: self.texture(m.occlusion_texture, Role::Linear)?,
            occlusion_strength: m.occlusion_strength,
            emission: self.texture(m.emissive_texture, Role::Opaque)?,
            rows_from_top: [m.normal_texture]
                .into_iter()
                .flatten()
                .any(|i| !self.model.textures[i].v_up),
            ..TextureMaps::new(MapConvention::Gltf)
        };
        let any = [&maps.normal, &maps.metallic_roughness, &maps.occlusion, &maps.emission];
        if any.iter().any(|t| t.is_some()) {
            out = out.with_maps(Arc::new(maps) as Arc<dyn MaterialMaps>);
        }
        Ok(out)
    }
}
