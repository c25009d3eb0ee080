//! Light that sixteen surfaces reflect: the arithmetic of [`super::lobes`] and of
//! [`super::direct::incident_from`], with the same bits in each lane.

use super::lobes::{least_cosine, power};
use crate::effects::Effects;
use crate::environment::IrradianceCoefficients;
use crate::light::{ResolvedLight, ResolvedLightKind, cone_share};
use crate::material::{PhongForm, SurfaceModel};
use crate::ray::LANES;
use crate::simd::vectors::{Row, Rows3, Vec3x16};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdNarrow, SimdWiden, f32x16};
use glam::Vec3;

/// Models with vector code: ideal diffuse, or ideal diffuse with a highlight.
#[derive(Clone, Copy)]
pub(super) enum Lobe {
    Matte,
    Phong { diffuse: f32, specular: Vec3, tinted: bool, shininess: f32, highlight: PhongForm },
}

impl Lobe {
    /// The lobe of a model that is [supported](supports).
    #[inline(always)]
    pub(super) fn of(model: &SurfaceModel) -> Lobe {
        match *model {
            SurfaceModel::Phong { diffuse, specular, tinted, shininess, highlight, .. } => {
                let specular = Vec3::from(specular);
                Lobe::Phong { diffuse, specular, tinted, shininess, highlight }
            }
            _ => Lobe::Matte,
        }
    }
}

/// Microfacets are left to the scalar code: vector code for their many special cases would pay only
/// in scenes made of them.
pub(super) fn supports(model: &SurfaceModel) -> bool {
    !matches!(model, SurfaceModel::Metal { .. } | SurfaceModel::Pbr { .. })
}

/// As [`super::lobes::response`].
#[inline(always)]
pub(super) fn respond<S: Simd>(
    simd: S,
    lobe: Lobe,
    color: Vec3x16<S>,
    normal: Vec3x16<S>,
    view: Vec3x16<S>,
    l: Vec3x16<S>,
    light: &ResolvedLight,
) -> Vec3x16<S> {
    let v = |x: f32| f32x16::splat(simd, x);
    let cos = normal.dot(l);
    let away = cos.simd_le(v(0.0));
    let lit = color.mul(Vec3x16::splat(simd, light.color));
    let answer = match lobe {
        Lobe::Matte => lit.scale(cos),
        Lobe::Phong { diffuse, specular, tinted, shininess, highlight } => {
            let matte = lit.scale(v(diffuse) * cos);
            if specular == Vec3::ZERO {
                matte
            } else {
                let base = match highlight {
                    PhongForm::HalfVector => {
                        let (h, ok) = l.add(view).try_normalize(simd);
                        normal.dot(h.or_else(ok, Vec3x16::splat(simd, Vec3::ZERO)))
                    }
                    PhongForm::Mirrored | PhongForm::MirroredAboveZero => {
                        normal.scale(v(2.0) * cos).sub(l).dot(view)
                    }
                    PhongForm::TowardsLight => cos,
                };
                let direct_lighting =
                    power_block(simd, base.max(v(least_cosine(highlight))), shininess);
                let highlight = if tinted {
                    Vec3x16::splat(simd, specular)
                        .mul(color)
                        .mul(Vec3x16::splat(simd, light.highlight))
                } else {
                    Vec3x16::splat(simd, specular * light.highlight)
                };
                matte.add(highlight.scale(direct_lighting))
            }
        }
    };
    Vec3x16::splat(simd, Vec3::ZERO).or_else(away, answer)
}

/// As [`power`].
#[inline(always)]
fn power_block<S: Simd>(simd: S, x: f32x16<S>, n: f32) -> f32x16<S> {
    if n.fract() != 0.0 || n > 1024.0 {
        let mut row: Row = [0.0; LANES];
        for lane in 0..LANES {
            row[lane] = power(x[lane], n);
        }
        return f32x16::from_slice(simd, &row);
    }
    let (mut k, mut square, mut result) = (n as u32, x, f32x16::splat(simd, 1.0));
    while k != 0 {
        if k & 1 != 0 {
            result *= square;
        }
        square *= square;
        k >>= 1;
    }
    result
}

/// Direction to a light without size and the share of it that arrives, as
/// [`super::direct::incident_from`].
#[inline(always)]
pub(super) fn incident<S: Simd>(
    simd: S,
    light: &ResolvedLight,
    points: &Rows3,
) -> (Vec3x16<S>, f32x16<S>) {
    let v = |x: f32| f32x16::splat(simd, x);
    let (one, zero) = (v(1.0), v(0.0));
    let from = match light.kind {
        ResolvedLightKind::Directional { to_light } => {
            return (Vec3x16::splat(simd, to_light), one);
        }
        ResolvedLightKind::Point { position }
        | ResolvedLightKind::Spot { position, .. }
        | ResolvedLightKind::Cone { position, .. }
        | ResolvedLightKind::Ring { position, .. }
        | ResolvedLightKind::Quad { position, .. }
        | ResolvedLightKind::Disk { position, .. } => position,
    };
    let to_light = Vec3x16::splat(simd, from).sub(Vec3x16::load(simd, points));
    let distance = length(to_light);
    let nowhere = distance.simd_eq(zero) | !distance.simd_lt(v(f32::INFINITY));
    let dir = Vec3x16::splat(simd, Vec3::ZERO).or_else(nowhere, to_light.div(distance));
    let mut strength = match light.attenuation {
        Some([c, l, q]) => one / (v(c) + distance * (v(l) + distance * v(q))),
        None => one,
    };
    match light.kind {
        ResolvedLightKind::Spot { direction, cos_cutoff, exponent, .. } => {
            let cos = -dir.dot(Vec3x16::splat(simd, direction));
            let falloff = if exponent == 0.0 {
                one
            } else {
                let mut row: Row = [0.0; LANES];
                for lane in 0..LANES {
                    row[lane] = cos[lane].max(0.0).powf(exponent);
                }
                f32x16::from_slice(simd, &row)
            };
            strength *= cos.simd_lt(v(cos_cutoff)).select(zero, falloff);
        }
        ResolvedLightKind::Cone { direction, cos_inner, cos_outer, .. } => {
            let cos = -dir.dot(Vec3x16::splat(simd, direction));
            let mut row: Row = [0.0; LANES];
            for lane in 0..LANES {
                row[lane] = cone_share(cos[lane], cos_inner, cos_outer);
            }
            strength *= f32x16::from_slice(simd, &row);
        }
        ResolvedLightKind::Disk { direction, .. } => {
            strength *= (-dir.dot(Vec3x16::splat(simd, direction))).max(zero);
        }
        ResolvedLightKind::Ring { direction, cos_inner, cos_outer, .. } => {
            let cos = -dir.dot(Vec3x16::splat(simd, direction));
            let mut row: Row = [0.0; LANES];
            for lane in 0..LANES {
                row[lane] = cone_share(cos[lane], cos_inner, cos_outer) * cos[lane].max(0.0);
            }
            strength *= f32x16::from_slice(simd, &row);
        }
        ResolvedLightKind::Quad { direction, both_sides, .. } => {
            let cos = -dir.dot(Vec3x16::splat(simd, direction));
            strength *= if both_sides { cos.abs() } else { cos.max(zero) };
        }
        ResolvedLightKind::Directional { .. } | ResolvedLightKind::Point { .. } => {}
    }
    (dir, nowhere.select(zero, strength))
}

/// Lengths of vectors of any size, as [`crate::math::length`].
#[inline(always)]
pub(super) fn length<S: Simd>(d: Vec3x16<S>) -> f32x16<S> {
    let ((x, x2), (y, y2), (z, z2)) = (d.x.widen(), d.y.widen(), d.z.widen());
    let low = (x * x + y * y + z * z).sqrt();
    let high = (x2 * x2 + y2 * y2 + z2 * z2).sqrt();
    low.narrow(high)
}

/// Ambient light that surfaces of a supported model reflect: [`super::lobes::ambient_albedo`] times
/// the mean radiance around the normal.
#[inline(always)]
pub(super) fn ambient<S: Simd>(
    simd: S,
    effects: Effects,
    model: &SurfaceModel,
    mean: &IrradianceCoefficients,
    color: Vec3x16<S>,
    normal: Vec3x16<S>,
) -> Vec3x16<S> {
    let albedo = match *model {
        SurfaceModel::Phong { ambient, .. } => color.scale(f32x16::splat(simd, ambient)),
        SurfaceModel::Dielectric { .. } if effects.contains(Effects::REFRACTION) => {
            Vec3x16::splat(simd, Vec3::ZERO)
        }
        SurfaceModel::Unlit => Vec3x16::splat(simd, Vec3::ZERO),
        _ => color,
    };
    albedo.mul(irradiance(simd, mean, normal))
}

/// As [`IrradianceCoefficients::for_normal`].
#[inline(always)]
fn irradiance<S: Simd>(simd: S, mean: &IrradianceCoefficients, n: Vec3x16<S>) -> Vec3x16<S> {
    let v = |x: f32| f32x16::splat(simd, x);
    let c = |k: usize| Vec3x16::splat(simd, mean.coefficients[k]);
    let linear = c(0).add(c(1).scale(n.y)).add(c(2).scale(n.z)).add(c(3).scale(n.x));
    let quadratic = c(4).scale(n.x * n.y).add(c(5).scale(n.y * n.z));
    let quadratic = quadratic.add(c(6).scale(v(3.0) * n.z * n.z - v(1.0)));
    let quadratic = quadratic.add(c(7).scale(n.x * n.z)).add(c(8).scale(n.x * n.x - n.y * n.y));
    let sum = linear.add(quadratic);
    Vec3x16 { x: sum.x.max(v(0.0)), y: sum.y.max(v(0.0)), z: sum.z.max(v(0.0)) }
}
