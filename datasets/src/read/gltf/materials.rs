//! Materials of glTF files, with their images and samplers.

use super::super::scene::{AlphaMode, SurfaceMaterial, Texture, decode_texture};
use super::{Reader, resource};
use gltf::texture::{MagFilter, WrappingMode};
use rt_core::texture::{Filter, Wrap};
use std::path::Path;

/// Requested textures of the file: their index in the scene, or `None` if they cannot be read.
type TextureSlots = Vec<Option<Option<usize>>>;

impl Reader {
    pub(super) fn materials(&mut self, path: &Path, gltf: &gltf::Gltf) {
        let mut slots: TextureSlots = vec![None; gltf.textures().len()];
        for m in gltf.materials() {
            let pbr = m.pbr_metallic_roughness();
            let strength = m.emissive_strength().unwrap_or(1.0);
            let name = m.name().unwrap_or("").to_string();
            let mut find = |texture: gltf::Texture<'_>, set: u32, what: &str| {
                if set != 0 {
                    self.warnings.push(format!(
                        "material `{name}` uses a second set of texture coordinates: {what} \
                         texture skipped"
                    ));
                    return None;
                }
                *slots[texture.index()].get_or_insert_with(|| self.texture(path, gltf, &texture))
            };
            let color = pbr
                .base_color_texture()
                .and_then(|t| find(t.texture(), t.tex_coord(), "base colour"));
            let metallic_roughness = pbr
                .metallic_roughness_texture()
                .and_then(|t| find(t.texture(), t.tex_coord(), "metallic-roughness"));
            let normal =
                m.normal_texture().and_then(|t| find(t.texture(), t.tex_coord(), "normal"));
            let occlusion =
                m.occlusion_texture().and_then(|t| find(t.texture(), t.tex_coord(), "occlusion"));
            let emissive =
                m.emissive_texture().and_then(|t| find(t.texture(), t.tex_coord(), "emissive"));
            let mut base_color = pbr.base_color_factor();
            if m.alpha_mode() == gltf::material::AlphaMode::Opaque {
                base_color[3] = 1.0;
            }
            self.scene.materials.push(SurfaceMaterial {
                base_color,
                base_color_texture: color,
                alpha: match m.alpha_mode() {
                    gltf::material::AlphaMode::Opaque => AlphaMode::Opaque,
                    gltf::material::AlphaMode::Mask => {
                        AlphaMode::Mask(m.alpha_cutoff().unwrap_or(0.5))
                    }
                    gltf::material::AlphaMode::Blend => AlphaMode::Blend,
                },
                metallic: pbr.metallic_factor(),
                roughness: pbr.roughness_factor(),
                metallic_roughness_texture: metallic_roughness,
                normal_texture: normal,
                normal_scale: m.normal_texture().map_or(1.0, |t| t.scale()),
                occlusion_texture: occlusion,
                occlusion_strength: m.occlusion_texture().map_or(1.0, |t| t.strength()),
                emissive: m.emissive_factor().map(|e| e * strength),
                emissive_texture: emissive,
                ior: m.ior().unwrap_or(1.5),
                double_sided: m.double_sided(),
                name,
            });
        }
    }

    /// Reads a texture into the scene; `None`, with a warning, if its image cannot be read.
    fn texture(
        &mut self,
        path: &Path,
        gltf: &gltf::Gltf,
        texture: &gltf::Texture<'_>,
    ) -> Option<usize> {
        let image = texture.source();
        let json = &gltf.as_json().images[image.index()];
        // The crate assumes that every image has a source.
        let has_source =
            json.uri.is_some() || json.buffer_view.is_some() && json.mime_type.is_some();
        let decoded =
            if has_source { self.decode(path, &image) } else { Err("it names no data".into()) };
        match decoded {
            Ok(decoded) => {
                let sampler = texture.sampler();
                let nearest = sampler.mag_filter() == Some(MagFilter::Nearest);
                self.scene.textures.push(Texture {
                    wrap: [sampler.wrap_s(), sampler.wrap_t()].map(wrap),
                    filter: if nearest { Filter::Nearest } else { Filter::Bilinear },
                    ..decoded
                });
                Some(self.scene.textures.len() - 1)
            }
            Err(e) => {
                self.warnings.push(format!("texture {} skipped: {e}", image.index()));
                None
            }
        }
    }

    fn decode(&self, path: &Path, image: &gltf::Image<'_>) -> Result<Texture, String> {
        let name = image.name().unwrap_or("").to_string();
        match image.source() {
            gltf::image::Source::Uri { uri, .. } => {
                let bytes =
                    resource(path, uri).map_err(|e| match std::error::Error::source(&e) {
                        Some(reason) => format!("{e}: {reason}"),
                        None => e.to_string(),
                    })?;
                decode_texture(&name, &bytes, false)
            }
            gltf::image::Source::View { view, .. } => {
                let buffer = &self.buffers[view.buffer().index()];
                let end = view.offset().checked_add(view.length());
                let bytes = end
                    .and_then(|end| buffer.get(view.offset()..end))
                    .ok_or("it lies outside its buffer")?;
                decode_texture(&name, bytes, false)
            }
        }
    }
}

fn wrap(mode: WrappingMode) -> Wrap {
    match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    }
}
