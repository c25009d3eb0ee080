//! Converts VTK's properties to rt-core's materials. Without any effect, the image equals VTK's.
//!
//! VTK 9's shader (measured difference: 0 to 0.1 levels of 255) adds three terms: ambient
//! coefficient times ambient colour, always; diffuse coefficient times colour times cosine; and a
//! highlight (R·V)^p, or (N·L)^p where one headlight is the only light. Numbers are neither decoded
//! nor encoded, except by the physically based shader, which ends with `pow(c, 1/2.2)` and divides
//! diffuse light by π. [`Encoding::Pbr`] marks this case for the image.

use crate::input::{Image, Maps, Property};
use crate::options::{MaterialChoice, Options};
use rt_core::material::{
    ColorSource, ColorTransfer, Material, PbrForm, PhongForm, Sides, SurfaceModel,
};
use rt_core::material_maps::{MapConvention, MaterialMaps, TextureMaps};
use rt_core::texture::Texture;
use rt_core::vtk_pbr::GAMMA;
use std::f32::consts::PI;
use std::sync::Arc;

/// How radiance becomes numbers in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Unchanged.
    Direct,
    /// Divided by π, then raised to the power 1/2.2.
    Pbr,
    /// Raised to the power 1/2.2: physically based surfaces without lighting since VTK 9.6.
    Gamma,
}

impl Encoding {
    /// The number in the image for radiance `v`.
    pub(crate) fn encoded(self, v: f32) -> f32 {
        match self {
            Encoding::Direct => v,
            Encoding::Pbr => (v / PI).max(0.0).powf(1.0 / GAMMA),
            Encoding::Gamma => v.max(0.0).powf(1.0 / GAMMA),
        }
    }
}

/// Settings that affect all materials of a frame.
#[derive(Debug, Clone, Copy)]
pub struct MaterialContext<'a> {
    /// The options.
    pub options: &'a Options,
    /// True when one headlight is the only light.
    pub only_headlight: bool,
    /// True when no light is on.
    pub dark: bool,
}

/// Ambient occlusion needs ambient light. This fraction of the diffuse coefficient reflects ambient
/// light instead of direct light.
fn ambient_share(options: &Options) -> f32 {
    if options.ao > 0 && !options.path_tracing { options.ao_strength } else { 0.0 }
}

/// Converts the property `p` to a material. `from_values` is true if colours of points, cells or a
/// map replace the property's.
pub fn material(
    p: &Property,
    from_values: bool,
    context: &MaterialContext<'_>,
) -> (Material, Encoding) {
    let options = context.options;
    let sides = match (p.cull_front, p.cull_back) {
        (false, false) | (true, true) => Sides::Both,
        (true, false) => Sides::BackOnly,
        (false, true) => Sides::FrontOnly,
    };
    let opacity = non_negative(p.opacity).min(1.0);
    let base = Material {
        model: SurfaceModel::Matte,
        color: p.diffuse_color.map(non_negative),
        color_source: ColorSource::Attribute,
        color_transfer: ColorTransfer::Linear,
        opacity,
        emission: [0.0; 3],
        sides,
        flat: p.flat,
        maps: None,
    };
    match options.material {
        MaterialChoice::Matte => {
            let share = ambient_share(options);
            let model = SurfaceModel::Phong {
                ambient: share,
                diffuse: 1.0 - share,
                specular: [0.0; 3],
                tinted: false,
                shininess: 1.0,
                highlight: PhongForm::Mirrored,
                mirror: options.mirror,
            };
            return (Material { model, ..base }, Encoding::Direct);
        }
        MaterialChoice::Metal => {
            return (
                Material { model: SurfaceModel::Metal { roughness: options.roughness }, ..base },
                Encoding::Direct,
            );
        }
        MaterialChoice::Glass => {
            let model = SurfaceModel::Dielectric { ior: options.ior, absorption: [0.0; 3] };
            // Halfway to white, because two walls of a saturated colour would absorb all light.
            let color = base.color.map(|c| 0.5 + 0.5 * c);
            return (Material { model, color, opacity: 1.0, ..base }, Encoding::Direct);
        }
        MaterialChoice::Scene | MaterialChoice::Transparent => {}
    }
    let opacity =
        if options.material == MaterialChoice::Transparent { 0.5 * opacity } else { opacity };
    let base = Material { opacity, ..base };
    if !p.lighting || context.dark {
        // Complexity 0 of VTK's shader: ambient and diffuse are used unchanged.
        let color = std::array::from_fn(|c| {
            non_negative(p.ambient * p.ambient_color[c] + p.diffuse * p.diffuse_color[c])
        });
        let color_transfer = transfer(&[p.ambient, p.diffuse], p.pbr, options);
        let encoding =
            if p.pbr && options.vtk >= (9, 6) { Encoding::Gamma } else { Encoding::Direct };
        let model = SurfaceModel::Unlit;
        return (Material { model, color, color_transfer, ..base }, encoding);
    }
    if p.pbr {
        return pbr(p, base, context);
    }
    let share = ambient_share(options);
    let same = from_values || p.ambient_color == p.diffuse_color;
    let specular = p.specular_color.map(|c| non_negative(c * p.specular));
    let model = SurfaceModel::Phong {
        ambient: if same { non_negative(p.ambient) } else { 0.0 } + non_negative(p.diffuse) * share,
        diffuse: non_negative(p.diffuse) * (1.0 - share),
        specular,
        tinted: false,
        shininess: non_negative(p.specular_power),
        highlight: if context.only_headlight {
            PhongForm::TowardsLight
        } else if options.vtk >= (9, 3) {
            PhongForm::MirroredAboveZero
        } else {
            PhongForm::Mirrored
        },
        mirror: options.mirror,
    };
    let emission =
        if same { [0.0; 3] } else { p.ambient_color.map(|c| non_negative(c * p.ambient)) };
    (Material { model, emission, ..base }, Encoding::Direct)
}

/// Colours of points, cells and maps, multiplied by each of `coefficients` and added. Since VTK
/// 9.7, the shader of physically based surfaces raises each product to the power 2.2.
fn transfer(coefficients: &[f32], pbr: bool, options: &Options) -> ColorTransfer {
    let exponent = if pbr && options.vtk >= (9, 7) { GAMMA } else { 1.0 };
    let sum: f32 = coefficients.iter().map(|c| non_negative(*c).powf(exponent)).sum();
    let factor = sum.powf(1.0 / exponent);
    if factor == 1.0 && exponent == 1.0 {
        ColorTransfer::Linear
    } else {
        ColorTransfer::Power { factor, exponent }
    }
}

/// The material under an actor's texture, which VTK multiplies with the lit colour: highlights have
/// its colour too.
pub(crate) fn under_texture(mut m: Material) -> Material {
    // The texture's colour times this is the surface's, so that no channel may be 0.
    const LEAST: f32 = 1e-6;
    if let SurfaceModel::Phong { specular, tinted, .. } = &mut m.model
        && *specular != [0.0; 3]
    {
        m.color = m.color.map(|c| c.max(LEAST));
        *specular = std::array::from_fn(|k| specular[k] / m.color[k]);
        *tinted = true;
    }
    m
}

/// Opacity of a glyph's colour: VTK's glyph mapper puts the property's into it, and its shader
/// multiplies both.
pub(crate) fn glyph_opacity(p: &Property, options: &Options) -> f32 {
    match options.material {
        MaterialChoice::Scene | MaterialChoice::Transparent => non_negative(p.opacity).min(1.0),
        MaterialChoice::Matte | MaterialChoice::Metal | MaterialChoice::Glass => 1.0,
    }
}

/// Factor on the colours of single glyphs, which VTK's shader never decodes.
pub(crate) fn glyph_factor(p: &Property, context: &MaterialContext<'_>) -> f32 {
    let of_scene = [MaterialChoice::Scene, MaterialChoice::Transparent];
    match (of_scene.contains(&context.options.material), !p.lighting || context.dark, p.pbr) {
        (true, true, _) => non_negative(p.ambient + p.diffuse),
        (true, false, true) => non_negative(p.diffuse),
        _ => 1.0,
    }
}

/// What a fragment becomes that the line along an edge covers, where that is not the line's own
/// colour: VTK's shader replaces the diffuse part by 0 and the ambient part by the line's colour,
/// and then lights them. Highlights therefore lie on lines, and lines on physically based surfaces,
/// which have no ambient part, are black.
pub(crate) fn under_line(m: &Material, line: [f32; 3], encoding: Encoding) -> Option<Material> {
    let base = Material { color_source: ColorSource::Constant, ..m.clone() };
    match m.model {
        SurfaceModel::Phong { specular, shininess, highlight, .. } if specular != [0.0; 3] => {
            let model = SurfaceModel::Phong {
                ambient: 0.0,
                diffuse: 0.0,
                specular,
                tinted: false,
                shininess,
                highlight,
                mirror: 0.0,
            };
            Some(Material { model, emission: line, ..base })
        }
        SurfaceModel::Pbr { form: PbrForm::Vtk { .. }, .. } => {
            Some(Material { color: [0.0; 3], ..base })
        }
        SurfaceModel::Unlit if encoding != Encoding::Direct => {
            Some(Material { color: line, ..base })
        }
        _ => None,
    }
}

fn pbr(p: &Property, base: Material, context: &MaterialContext<'_>) -> (Material, Encoding) {
    let options = context.options;
    let f0 = {
        let r = (p.base_ior - 1.0) / (p.base_ior + 1.0);
        non_negative(r * r).min(1.0)
    };
    let model = SurfaceModel::Pbr {
        metallic: non_negative(p.metallic).min(1.0),
        roughness: non_negative(p.roughness).min(1.0),
        specular: f0,
        form: PbrForm::Vtk {
            min_divisor: if options.vtk >= (9, 7) { 1e-8 } else { 0.0 },
            headlight: context.only_headlight,
        },
    };
    // VTK 9 treats the property's colour as linear here, although it encodes the result.
    let color = base.color.map(|c| c * non_negative(p.diffuse));
    let color_transfer = transfer(&[p.diffuse], true, options);
    (Material { model, color, color_transfer, ..base }, Encoding::Pbr)
}

/// Further textures of a physically based property.
#[derive(Debug, Clone)]
pub(crate) struct PbrTextures {
    detail: Arc<dyn MaterialMaps>,
    emission: [f32; 3],
}

/// Converts `maps`; `texture` converts each image.
pub(crate) fn pbr_textures(
    maps: &Maps<'_>,
    mut texture: impl FnMut(Option<&Image<'_>>) -> Option<Arc<Texture>>,
) -> PbrTextures {
    let packed = texture(maps.material.as_ref());
    let detail = TextureMaps {
        normal: texture(maps.normal.as_ref()),
        normal_scale: if maps.normal_scale.is_finite() { maps.normal_scale } else { 1.0 },
        metallic_roughness: packed.clone(),
        occlusion: packed,
        occlusion_strength: non_negative(maps.occlusion_strength).min(1.0),
        emission: texture(maps.emissive.as_ref()),
        ..TextureMaps::new(MapConvention::Vtk)
    };
    // The shader adds emission after it divides light by π and before it encodes the image.
    let factor = if detail.emission.is_some() { PI } else { 0.0 };
    let emission = maps.emissive_factor.map(|f| non_negative(f) * factor);
    PbrTextures { detail: Arc::new(detail), emission }
}

impl PbrTextures {
    /// Returns the material with these textures.
    pub(crate) fn apply_to(&self, base: Material) -> Material {
        let emission = std::array::from_fn(|c| base.emission[c] + self.emission[c]);
        Material { emission, ..base.with_maps(self.detail.clone()) }
    }
}

/// Converts the ambient part of a surface of one colour to emission. An ambient light in the scene
/// would affect every surface, even physically based ones, whose shader has no ambient coefficient.
/// Surfaces of varying colour and ambient occlusion still use an ambient light.
pub fn ambient_as_emission(mut m: Material) -> Material {
    if let (ColorSource::Constant, SurfaceModel::Phong { ambient, .. }) =
        (&m.color_source, &mut m.model)
    {
        m.emission = std::array::from_fn(|c| m.emission[c] + m.color[c] * *ambient);
        *ambient = 0.0;
    }
    m
}

/// Clamps to finite, non-negative values.
fn non_negative(v: f32) -> f32 {
    if v.is_finite() { v.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn context(options: &Options) -> MaterialContext<'_> {
        MaterialContext { options, only_headlight: false, dark: false }
    }

    #[test]
    fn ambient_occlusion_takes_its_light_from_the_lights() {
        let options = Options { ao: 8, ao_strength: 0.25, ..Options::default() };
        let (m, _) =
            material(&Property { diffuse: 0.8, ..Property::default() }, false, &context(&options));
        let SurfaceModel::Phong { ambient, diffuse, .. } = m.model else { panic!("{m:?}") };
        assert!((ambient - 0.2).abs() < 1e-6 && (diffuse - 0.6).abs() < 1e-6);
    }

    #[test]
    fn an_ambient_colour_of_its_own_is_given_off() {
        let p = Property { ambient: 0.5, ambient_color: [1.0, 0.0, 0.0], ..Property::default() };
        let (m, _) = material(&p, false, &context(&Options::default()));
        assert_eq!(m.emission, [0.5, 0.0, 0.0]);
        let (m, _) = material(&p, true, &context(&Options::default()));
        assert_eq!(m.emission, [0.0; 3], "colours of points replace both");
    }

    #[test]
    fn surfaces_of_one_colour_need_no_ambient_light() {
        let p = Property {
            ambient: 0.3,
            diffuse_color: [1.0, 0.5, 0.0],
            ambient_color: [1.0, 0.5, 0.0],
            ..Property::default()
        };
        let (m, _) = material(&p, false, &context(&Options::default()));
        let constant =
            ambient_as_emission(Material { color_source: ColorSource::Constant, ..m.clone() });
        assert!(matches!(constant.model, SurfaceModel::Phong { ambient: 0.0, .. }), "{constant:?}");
        assert_eq!(constant.emission, [0.3, 0.15, 0.0]);
        let varying = Material { color_source: ColorSource::Attribute, ..m };
        assert_eq!(ambient_as_emission(varying.clone()), varying);
    }

    #[test]
    fn nan_in_a_property_is_no_error_of_the_scene() {
        let p = Property {
            specular_power: f32::NAN,
            diffuse: -1.0,
            opacity: f32::NAN,
            ..Property::default()
        };
        let (m, _) = material(&p, false, &context(&Options::default()));
        assert!(
            matches!(m.model, SurfaceModel::Phong { shininess: 0.0, diffuse: 0.0, .. }),
            "{m:?}"
        );
    }
}
