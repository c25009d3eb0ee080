//! Mirror, gloss and glass: the rays of Whitted (1980), with microfacet directions for gloss (Cook,
//! Porter and Carpenter 1984).

use super::frame_context::FrameContext;
use super::microfacet::{
    fresnel_dielectric, masking_ratio, refract, sample_visible_normal, schlick,
};
use super::point::WithMaps;
use super::wavefront::{RayKind, RayState, Wavefront};
use super::{Point, SampleDimension, TileArea, Workspace};
use crate::effects::{Effects, MIRROR_ROUGHNESS, reflection_of};
use crate::material::SurfaceModel;
use crate::math::orthonormal_basis;
use crate::ray::Ray;
use crate::ray_stats::RayStats;
use crate::sampler::hash;
use glam::Vec3;

/// Default limit on consecutive reflections and refractions.
const MIRROR_BOUNCES: u32 = 8;

/// Sampler stream of a ray that leaves a point in branch `branch`.
#[inline]
pub(super) fn child_stream(state: &RayState, branch: u32) -> u32 {
    hash(state.stream.wrapping_mul(4).wrapping_add(branch).wrapping_add(0x9e37_79b9))
}

pub(super) fn spawn_specular_rays(
    context: &FrameContext<'_>,
    area: &TileArea,
    work: &mut Workspace,
    stats: &mut RayStats,
) {
    let e = context.effects;
    let mirror = e.contains(Effects::REFLECTION);
    let sent = |roughness| e.contains(reflection_of(roughness));
    for p in &work.points {
        let state = work.current.states[p.lane as usize];
        let mut weight = state.throughput * p.surface.opacity;
        if let Some(v) = p.parameters::<WithMaps>(&work.parameters) {
            weight *= v.ambient;
        }
        match *p.model::<WithMaps>(context, &work.parameters) {
            SurfaceModel::Phong { mirror: share, .. } if share > 0.0 && mirror => {
                reflect_at(
                    context,
                    p,
                    facing(p),
                    weight * share,
                    &state,
                    &mut work.scattered,
                    stats,
                );
            }
            SurfaceModel::Metal { roughness } => {
                let f0 = p.surface.color;
                if sent(roughness) {
                    reflect_lobe(
                        context,
                        area,
                        p,
                        f0,
                        roughness,
                        weight,
                        &state,
                        &mut work.scattered,
                        stats,
                    );
                }
            }
            SurfaceModel::Pbr { metallic, roughness, specular, .. }
                if metallic > 0.0 || specular > 0.0 =>
            {
                let f0 = Vec3::splat(specular).lerp(p.surface.color, metallic);
                if sent(roughness) {
                    reflect_lobe(
                        context,
                        area,
                        p,
                        f0,
                        roughness,
                        weight,
                        &state,
                        &mut work.scattered,
                        stats,
                    );
                }
            }
            SurfaceModel::Dielectric { ior, absorption } if e.contains(Effects::REFRACTION) => {
                let (reflected, through) = interface(p, ior, absorption.into());
                if let Some(t) = through {
                    let next = RayState { absorption: t.medium, kind: RayKind::Refracted, ..state };
                    let throughput = weight * p.surface.color * t.share;
                    stats.refraction += spawn_ray(
                        context,
                        p,
                        t.dir,
                        throughput,
                        next,
                        2,
                        &mut work.scattered,
                        stats,
                    );
                }
                // Total internal reflection belongs to refraction: without it, glass would leak
                // light.
                if mirror || reflected == 1.0 {
                    let n = facing(p);
                    reflect_at(
                        context,
                        p,
                        n,
                        weight * reflected,
                        &state,
                        &mut work.scattered,
                        stats,
                    );
                }
            }
            _ => {}
        }
    }
}

/// The shading normal on the side of the viewer.
#[inline]
pub(super) fn facing(p: &Point) -> Vec3 {
    if p.surface.normal.dot(p.view) < 0.0 { -p.surface.normal } else { p.surface.normal }
}

/// The refracted ray at an interface.
pub(super) struct RefractedRay {
    pub(super) dir: Vec3,
    /// Absorption of the medium it enters.
    pub(super) medium: Vec3,
    /// Transmitted share.
    pub(super) share: f32,
}

/// Reflected share and refracted ray; no ray at total internal reflection.
#[inline]
pub(super) fn interface(p: &Point, ior: f32, absorption: Vec3) -> (f32, Option<RefractedRay>) {
    let n = facing(p);
    let eta = if p.surface.outside { 1.0 / ior } else { ior };
    let reflected = fresnel_dielectric(n.dot(p.view), eta);
    let medium = if p.surface.outside { absorption } else { Vec3::ZERO };
    let through = refract(-p.view, n, eta).filter(|_| reflected < 1.0).map(|dir| RefractedRay {
        dir,
        medium,
        share: 1.0 - reflected,
    });
    (reflected, through)
}

/// Mirror direction about `n`, kept above the face.
#[inline]
pub(super) fn mirrored(p: &Point, n: Vec3) -> Vec3 {
    let r = n * (2.0 * n.dot(p.view)) - p.view;
    let below = r.dot(p.surface.face_normal);
    if below < 0.0 { r - p.surface.face_normal * (2.0 * below) } else { r }
}

fn reflect_at(
    context: &FrameContext<'_>,
    p: &Point,
    n: Vec3,
    weight: Vec3,
    state: &RayState,
    wave: &mut Wavefront,
    stats: &mut RayStats,
) {
    let next = RayState { kind: RayKind::Reflected, ..*state };
    stats.reflection += spawn_ray(context, p, mirrored(p, n), weight, next, 1, wave, stats);
}

fn reflect_lobe(
    context: &FrameContext<'_>,
    area: &TileArea,
    p: &Point,
    f0: Vec3,
    roughness: f32,
    weight: Vec3,
    state: &RayState,
    wave: &mut Wavefront,
    stats: &mut RayStats,
) {
    let n = facing(p);
    if roughness <= MIRROR_ROUGHNESS {
        return reflect_at(context, p, n, weight * schlick(f0, n.dot(p.view)), state, wave, stats);
    }
    let u = area
        .sampler(context, state.slot)
        .square(state.stream.wrapping_add(SampleDimension::SCATTER));
    if let Some((dir, share)) = sample_lobe(p, n, f0, roughness, u) {
        let next = RayState { kind: RayKind::Reflected, ..*state };
        stats.reflection += spawn_ray(context, p, dir, weight * share, next, 1, wave, stats);
    }
}

/// A direction of the GGX lobe and its weight.
#[inline]
pub(super) fn sample_lobe(
    p: &Point,
    n: Vec3,
    f0: Vec3,
    roughness: f32,
    u: [f32; 2],
) -> Option<(Vec3, Vec3)> {
    let alpha = roughness * roughness;
    let (s, t) = orthonormal_basis(n);
    let v = Vec3::new(s.dot(p.view), t.dot(p.view), n.dot(p.view));
    let h = sample_visible_normal(v, alpha, u);
    let l = h * (2.0 * h.dot(v)) - v;
    let share = schlick(f0, h.dot(v)) * masking_ratio(v.z, l.z, alpha);
    let dir = s * l.x + t * l.y + n * l.z;
    (share != Vec3::ZERO && dir.dot(p.surface.face_normal) > 0.0).then_some((dir, share))
}

/// Sends a ray of Whitted's tree unless its contribution is too small or it has bounced too often:
/// two deterministic approximations, bounded by the options and counted. Returns how many were
/// sent.
pub(super) fn spawn_ray(
    context: &FrameContext<'_>,
    p: &Point,
    dir: Vec3,
    throughput: Vec3,
    state: RayState,
    branch: u32,
    wave: &mut Wavefront,
    stats: &mut RayStats,
) -> u64 {
    if throughput.max_element() < context.options.min_contribution {
        stats.cut_at_min_contribution += (throughput != Vec3::ZERO) as u64;
        return 0;
    }
    if u32::from(state.bounce) >= context.options.max_bounces.unwrap_or(MIRROR_BOUNCES) {
        stats.cut_at_max_bounces += 1;
        return 0;
    }
    push_scattered(p, dir, throughput, state, branch, wave);
    1
}

/// Appends the ray that leaves `p` in branch `branch` of the ray with `state`.
pub(super) fn push_scattered(
    p: &Point,
    dir: Vec3,
    throughput: Vec3,
    state: RayState,
    branch: u32,
    wave: &mut Wavefront,
) {
    let ray = Ray::new(p.surface.ray_origin(dir), dir);
    // Unlimited paths may be longer than the counter's range; it is only compared with smaller
    // limits.
    let (stream, bounce) = (child_stream(&state, branch), state.bounce.saturating_add(1));
    wave.push(&ray, RayState { throughput, coverage: 0.0, stream, bounce, first: false, ..state });
}
