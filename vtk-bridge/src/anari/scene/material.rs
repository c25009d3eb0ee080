//! Materials: converts ANARI's model to the renderer's, and finds the sources of colour and
//! opacity.

use super::Diagnostics;
use super::attribute::Source;
use super::material_inputs::MaterialInputs;
use super::sampler::Sampler;
use super::surface_color::{AlphaMode, Input, SurfaceColor};
use crate::anari::object::{Object, Value};
use crate::anari::schema::ATTRIBUTES;
use rt_core::material::{Material, PbrForm, SurfaceModel};

/// A material without its colour: model and emission.
pub(crate) fn model_of(material: &Object, diagnostics: &mut Diagnostics) -> Material {
    let mut out = Material::matte([1.0; 3]);
    if material.subtype != "physicallyBased" {
        return out;
    }
    let mut unit = |name: &str, default: f32| {
        // Varying inputs are evaluated at the hits; here the material only has to be able to
        // reflect.
        let varies =
            matches!(material.parameters().get(name), Some(Value::Text(_) | Value::Object(_)));
        let v = if varies { 1.0 } else { material.f32(name, default) };
        if (0.0..=1.0).contains(&v) {
            return v;
        }
        diagnostics.warn(material, format!("`{name}` is {v}; it must be between 0 and 1"));
        if v > 1.0 { 1.0 } else { 0.0 }
    };
    let (metallic, roughness) = (unit("metallic", 1.0), unit("roughness", 1.0));
    let (strength, transmission) = (unit("specular", 0.0), unit("transmission", 0.0));
    let ior = ior_of(material).unwrap_or_else(|ior| {
        diagnostics.warn(
            material,
            format!("`ior` is {ior}; it must be finite and at least 1: 1.5 is used"),
        );
        1.5
    });
    if transmission > 0.0 && transmission < 1.0 {
        diagnostics.warn(
            material,
            format!(
                "`transmission` is {transmission}; there is nothing \
                                            between 0 (opaque) and 1 (glass): the nearer is used"
            ),
        );
    }
    out.model = if transmission >= 0.5 {
        // Beer and Lambert: white light takes on the attenuation colour after the attenuation
        // distance.
        let distance = material.f32("attenuationDistance", f32::INFINITY);
        let color = material.vector("attenuationColor", [1.0; 3]);
        let absorption = color.map(|c| {
            (-(c.clamp(1e-6, 1.0) as f32).ln() / distance.max(f32::MIN_POSITIVE)).min(1e30)
        });
        SurfaceModel::Dielectric { ior, absorption }
    } else {
        // KHR_materials_specular, which ANARI follows: reflectance at normal incidence, scaled.
        SurfaceModel::Pbr {
            metallic,
            roughness,
            specular: normal_reflectance(ior) * strength,
            form: PbrForm::Gltf,
        }
    };
    let emission = material.vector("emissive", [0.0; 3]).map(|v| v as f32);
    if emission.iter().all(|v| v.is_finite() && *v >= 0.0) {
        out.emission = emission;
    } else {
        diagnostics.warn(
            material,
            format!(
                "`emissive` is {emission:?}; it must be finite and not negative: it gives off \
                     no light"
            ),
        );
    }
    out
}

fn ior_of(material: &Object) -> Result<f32, f32> {
    let ior = material.f32("ior", 1.5);
    if ior.is_finite() && ior >= 1.0 { Ok(ior) } else { Err(ior) }
}

/// Reflectance of glass at normal incidence.
fn normal_reflectance(ior: f32) -> f32 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}

/// Finds the attribute or sampler that a parameter names; `None` if it is a number, not set, or
/// unusable.
fn varying(
    material: &Object,
    name: &str,
    geometry: &Object,
    instance: Option<&Object>,
    diagnostics: &mut Diagnostics,
) -> Option<Input> {
    match material.parameters().get(name)? {
        Value::Text(attribute) => {
            let source = Source::of(attribute, geometry, instance);
            if source.is_none() {
                diagnostics.error(
                    material,
                    format!(
                        "`{name}` is \"{attribute}\", which is no attribute; use one of {ATTRIBUTES:?}"
                    ),
                );
            }
            source.map(Input::Attribute)
        }
        Value::Object(sampler) => {
            Sampler::of(sampler, geometry, instance, diagnostics).map(Input::Sampler)
        }
        Value::Bytes(..) | Value::Pointer(..) => None,
    }
}

/// Inputs that vary on `geometry` in `instance`, other than colour and opacity; `None` if there are
/// none.
pub(crate) fn material_inputs_of(
    material: &Object,
    geometry: &Object,
    instance: Option<&Object>,
    diagnostics: &mut Diagnostics,
) -> Option<MaterialInputs> {
    if material.subtype != "physicallyBased" {
        return None;
    }
    let mut input = |name: &str| varying(material, name, geometry, instance, diagnostics);
    let material_inputs = MaterialInputs {
        metallic: input("metallic"),
        roughness: input("roughness"),
        specular: input("specular"),
        emissive: input("emissive"),
        occlusion: input("occlusion"),
        normal: match input("normal") {
            Some(Input::Sampler(sampler)) => Some(sampler),
            _ => None,
        },
        normal_reflectance: normal_reflectance(ior_of(material).unwrap_or(1.5)),
    };
    material_inputs.varies().then_some(material_inputs)
}

/// Finds the sources of colour and opacity on `geometry` in `instance`.
pub(crate) fn surface_color_of(
    material: &Object,
    geometry: &Object,
    instance: Option<&Object>,
    diagnostics: &mut Diagnostics,
) -> SurfaceColor {
    let name = if material.subtype == "physicallyBased" { "baseColor" } else { "color" };
    let default =
        if material.subtype == "physicallyBased" { [1.0; 4] } else { [0.8, 0.8, 0.8, 1.0] };
    let mut input = |name: &str, default: [f32; 4]| {
        if let Some(Value::Bytes(t, b)) = material.parameters().get(name) {
            return Input::Constant(t.attribute(b));
        }
        varying(material, name, geometry, instance, diagnostics).unwrap_or(Input::Constant(default))
    };
    let (color, opacity) = (input(name, default), input("opacity", [1.0; 4]));
    let mode = match material.text("alphaMode").as_deref() {
        Some("blend") => AlphaMode::Blend,
        Some("mask") => AlphaMode::Mask { cutoff: material.f32("alphaCutoff", 0.5) },
        _ => AlphaMode::Opaque,
    };
    SurfaceColor { color, opacity, mode }
}

/// Whether the appearance depends on the instance's transform.
pub(crate) fn uses_world_space(material: &Object) -> bool {
    material.parameters().values().any(|v| match v {
        Value::Text(t) => t.starts_with("world"),
        Value::Object(sampler) => {
            sampler.text("inAttribute").is_some_and(|t| t.starts_with("world"))
        }
        _ => false,
    })
}
