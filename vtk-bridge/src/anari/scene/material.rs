//! Materials: from ANARI's to the renderer's model, and where colour and opacity come from.

use super::Notes;
use super::attribute::{NAMES, Source};
use super::paint::{AlphaMode, Input, Paint};
use super::sampler::Sampler;
use crate::anari::object::{Object, Value};
use rt_core::material::{Material, PbrForm, SurfaceModel};

/// A material without its colour: model and emission.
pub(crate) fn model_of(material: &Object, notes: &mut Notes) -> Material {
    let mut out = Material::matte([1.0; 3]);
    if material.subtype != "physicallyBased" {
        return out;
    }
    let mut unit = |name: &str, default: f32| {
        let v = material.f32(name, default);
        if (0.0..=1.0).contains(&v) {
            return v;
        }
        notes.warn(material, format!("`{name}` is {v}; it must be between 0 and 1"));
        if v > 1.0 { 1.0 } else { 0.0 }
    };
    let (metallic, roughness) = (unit("metallic", 1.0), unit("roughness", 1.0));
    let (strength, transmission) = (unit("specular", 0.0), unit("transmission", 0.0));
    let ior = material.f32("ior", 1.5);
    let ior = if ior.is_finite() && ior >= 1.0 {
        ior
    } else {
        notes.warn(material, format!("`ior` is {ior}; it must be finite and at least 1: 1.5 is used"));
        1.5
    };
    if transmission > 0.0 && transmission < 1.0 {
        notes.warn(material, format!("`transmission` is {transmission}; there is nothing between 0 (opaque) and 1 (glass): the nearer is used"));
    }
    out.model = if transmission >= 0.5 {
        // Beer and Lambert: white light has the attenuation colour after the attenuation distance.
        let distance = material.f32("attenuationDistance", f32::INFINITY);
        let color = material.vector("attenuationColor", [1.0; 3]);
        let absorption =
            color.map(|c| (-(c.clamp(1e-6, 1.0) as f32).ln() / distance.max(f32::MIN_POSITIVE)).min(1e30));
        SurfaceModel::Dielectric { ior, absorption }
    } else {
        // KHR_materials_specular, which ANARI follows: reflectance at normal incidence, scaled.
        let normal = ((ior - 1.0) / (ior + 1.0)).powi(2) * strength;
        SurfaceModel::Pbr { metallic, roughness, specular: normal, form: PbrForm::Gltf }
    };
    let emission = material.vector("emissive", [0.0; 3]).map(|v| v as f32);
    if emission.iter().all(|v| v.is_finite() && *v >= 0.0) {
        out.emission = emission;
    } else {
        notes.warn(
            material,
            format!("`emissive` is {emission:?}; it must be finite and not negative: it gives off no light"),
        );
    }
    out
}

/// Where colour and opacity come from on `geometry` in `instance`.
pub(crate) fn paint_of(
    material: &Object,
    geometry: &Object,
    instance: Option<&Object>,
    notes: &mut Notes,
) -> Paint {
    let name = if material.subtype == "physicallyBased" { "baseColor" } else { "color" };
    let default = if material.subtype == "physicallyBased" { [1.0; 4] } else { [0.8, 0.8, 0.8, 1.0] };
    let mut input = |name: &str, default: [f32; 4]| {
        let found = match material.parameters().get(name) {
            None => return Input::Constant(default),
            Some(Value::Bytes(t, b)) => return Input::Constant(t.attribute(b)),
            Some(Value::Text(attribute)) => {
                let source = Source::of(attribute, geometry, instance);
                if source.is_none() {
                    notes.error(
                        material,
                        format!("`{name}` is \"{attribute}\", which is no attribute; use one of {NAMES:?}"),
                    );
                }
                source.map(Input::Attribute)
            }
            Some(Value::Object(sampler)) => {
                Sampler::of(sampler, geometry, instance, notes).map(Input::Sampler)
            }
            Some(Value::Pointer(..)) => None,
        };
        found.unwrap_or(Input::Constant(default))
    };
    let (color, opacity) = (input(name, default), input("opacity", [1.0; 4]));
    let mode = match material.text("alphaMode").as_deref() {
        Some("blend") => AlphaMode::Blend,
        Some("mask") => AlphaMode::Mask { cutoff: material.f32("alphaCutoff", 0.5) },
        _ => AlphaMode::Opaque,
    };
    Paint { color, opacity, mode }
}

/// Whether the look depends on where the instance is.
pub(crate) fn names_the_world(material: &Object) -> bool {
    material.parameters().values().any(|v| match v {
        Value::Text(t) => t.starts_with("world"),
        Value::Object(sampler) => sampler.text("inAttribute").is_some_and(|t| t.starts_with("world")),
        _ => false,
    })
}
