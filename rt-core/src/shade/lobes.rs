//! The reflection of light from one direction, and of ambient light, by a material.

use super::microfacet::{ggx, schlick};
use super::vtk_pbr::{Cosines, VtkPbr};
use crate::effects::{Effects, reflection_of};
use crate::material::{PbrForm, PhongForm, SurfaceModel};
use glam::Vec3;
use std::f32::consts::PI;

/// Smallest GGX α for shading with a light without size: a smaller highlight is a point that no
/// pixel would hit.
const MIN_HIGHLIGHT_ALPHA: f32 = 1e-3;

/// Light reflected to `view` per unit of light colour from direction `l` (unit): BRDF · π · cosine,
/// as the unit of lights requires. `highlight` is the light's own colour for Phong highlights.
/// Matte and Phong are handled in the caller; microfacets, which cost more than a call, are not, so
/// that loops over lights stay short.
#[inline(always)]
pub(crate) fn response(
    model: &SurfaceModel,
    normal: Vec3,
    surface_color: Vec3,
    view: Vec3,
    l: Vec3,
    color: Vec3,
    highlight: Vec3,
) -> Vec3 {
    let l = match *model {
        SurfaceModel::Pbr { form: PbrForm::Vtk { headlight: true, .. }, .. } => view,
        _ => l,
    };
    let cos = normal.dot(l);
    if cos <= 0.0 {
        return Vec3::ZERO;
    }
    match *model {
        SurfaceModel::Unlit => Vec3::ZERO,
        // A dielectric gets here only when refraction is disabled.
        SurfaceModel::Matte | SurfaceModel::Dielectric { .. } => surface_color * color * cos,
        SurfaceModel::Phong { diffuse, specular, tinted, shininess, highlight: form, .. } => {
            let matte = surface_color * color * (diffuse * cos);
            let specular = Vec3::from(specular) * if tinted { surface_color } else { Vec3::ONE };
            if specular == Vec3::ZERO {
                return matte;
            }
            let base = match form {
                PhongForm::HalfVector => normal.dot((l + view).normalize_or_zero()),
                PhongForm::Mirrored | PhongForm::MirroredAboveZero => {
                    (normal * (2.0 * cos) - l).dot(view)
                }
                PhongForm::TowardsLight => cos,
            };
            let least = least_cosine(form);
            // 0^0 is 1 in OpenGL: shininess 0 lights the whole side.
            matte + specular * highlight * power(base.max(least), shininess)
        }
        _ => microfacet_response(model, normal, surface_color, view, l, color) * cos,
    }
}

/// Least base of a highlight's power.
#[inline]
pub(crate) fn least_cosine(form: PhongForm) -> f32 {
    if form == PhongForm::MirroredAboveZero { 1e-5 } else { 0.0 }
}

/// [`response`] of the microfacet models, without the cosine.
#[inline(never)]
fn microfacet_response(
    model: &SurfaceModel,
    normal: Vec3,
    surface_color: Vec3,
    view: Vec3,
    l: Vec3,
    color: Vec3,
) -> Vec3 {
    match *model {
        SurfaceModel::Metal { roughness } => {
            microfacets(surface_color, roughness, normal, view, l) * color
        }
        SurfaceModel::Pbr {
            metallic,
            roughness,
            specular,
            form: PbrForm::Vtk { min_divisor, .. },
        } => {
            let model = VtkPbr {
                metallic,
                roughness,
                base_reflectance: specular,
                edge_tint: Vec3::ONE,
                min_divisor,
            };
            model.brdf(surface_color, Cosines::new(normal, view, l)) * PI * color
        }
        SurfaceModel::Pbr { metallic, roughness, specular, form: PbrForm::Gltf } => {
            let f0 = Vec3::splat(specular).lerp(surface_color, metallic);
            let matte =
                surface_color * pbr_transmitted(specular, normal.dot(view)) * (1.0 - metallic);
            let lobe = if f0 == Vec3::ZERO {
                Vec3::ZERO
            } else {
                microfacets(f0, roughness, normal, view, l)
            };
            (matte + lobe) * color
        }
        SurfaceModel::Unlit
        | SurfaceModel::Matte
        | SurfaceModel::Dielectric { .. }
        | SurfaceModel::Phong { .. } => Vec3::ZERO,
    }
}

/// Share of light that reaches the matte layer under a dielectric coat, by the viewing angle.
#[inline]
pub(crate) fn pbr_transmitted(specular: f32, cos_view: f32) -> f32 {
    if specular > 0.0 { 1.0 - schlick(Vec3::splat(specular), cos_view).x } else { 1.0 }
}

/// x^n for x in 0..=1. Integer exponents, which nearly all materials have, are computed by
/// squaring: a few multiplications, and the same bits on every platform.
#[inline]
pub(crate) fn power(x: f32, n: f32) -> f32 {
    if n.fract() != 0.0 || n > 1024.0 {
        return x.powf(n);
    }
    let (mut k, mut square, mut result) = (n as u32, x, 1.0);
    while k != 0 {
        if k & 1 != 0 {
            result *= square;
        }
        square *= square;
        k >>= 1;
    }
    result
}

fn microfacets(f0: Vec3, roughness: f32, n: Vec3, v: Vec3, l: Vec3) -> Vec3 {
    let alpha = (roughness * roughness).max(MIN_HIGHLIGHT_ALPHA);
    let h = (v + l).normalize_or_zero();
    schlick(f0, h.dot(v)) * (ggx(n, v, l, alpha) * PI)
}

/// Light reflected to the viewer per unit of ambient radiance. Where a reflector's own reflection
/// rays are left out, it uses its share of ambient light instead of turning black.
#[inline]
pub(crate) fn ambient_albedo(model: &SurfaceModel, color: Vec3, effects: Effects) -> Vec3 {
    let reflects = |roughness| effects.contains(reflection_of(roughness));
    match *model {
        SurfaceModel::Unlit => Vec3::ZERO,
        SurfaceModel::Matte => color,
        SurfaceModel::Phong { ambient, .. } => color * ambient,
        SurfaceModel::Metal { roughness } => {
            if reflects(roughness) {
                Vec3::ZERO
            } else {
                color
            }
        }
        // VTK's physically based shader has no ambient light; where ambient occlusion is requested,
        // there must be light to occlude.
        SurfaceModel::Pbr { form: PbrForm::Vtk { .. }, .. }
            if !effects.contains(Effects::AMBIENT_OCCLUSION) =>
        {
            Vec3::ZERO
        }
        SurfaceModel::Pbr { metallic, roughness, .. } => {
            if reflects(roughness) {
                color * (1.0 - metallic)
            } else {
                color
            }
        }
        SurfaceModel::Dielectric { .. } => {
            if effects.contains(Effects::REFRACTION) {
                Vec3::ZERO
            } else {
                color
            }
        }
    }
}
