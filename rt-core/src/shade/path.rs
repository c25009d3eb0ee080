//! Path tracing (Kajiya 1986): one continued ray per point, chosen with the probabilities of the
//! material's lobes. Lights are sampled by shadow rays at every point; environment and emission
//! contribute when rays hit them. No light is counted twice: lights have no surface that a ray
//! could hit.

use super::frame_context::FrameContext;
use super::lobes::pbr_transmitted;
use super::microfacet::schlick;
use super::point::WithMaps;
use super::specular::{facing, interface, mirrored, push_scattered, sample_lobe};
use super::wavefront::{RayKind, RayState};
use super::{Point, SampleDimension, TileArea, Workspace};
use crate::effects::MIRROR_ROUGHNESS;
use crate::material::SurfaceModel;
use crate::math::orthonormal_basis;
use crate::ray::Ray;
use crate::ray_stats::RayStats;
use crate::sampler::cosine_hemisphere;
use glam::Vec3;

/// First bounce at which paths may be ended at random (Russian roulette; Arvo and Kirk 1990).
const ROULETTE_FROM: u16 = 4;

/// Largest probability with which a path continues. It is below 1, so that paths end where nothing
/// absorbs. With survival probability q at albedo ρ the variance is finite only for ρ² < q: pbrt's
/// 0.95 fails above ρ = 0.975, this value holds up to 0.9995.
const MOST_SURVIVAL: f32 = 1.0 - 1.0 / 1024.0;

/// Whether the path scatters at `p` rather than passing through it: at random, with the surface's
/// opacity as probability.
#[inline]
pub(super) fn scatters(
    context: &FrameContext<'_>,
    area: &TileArea,
    state: &RayState,
    p: &Point,
) -> bool {
    p.surface.opacity >= 1.0 || choice(context, area, state)[0] < p.surface.opacity
}

#[inline]
fn choice(context: &FrameContext<'_>, area: &TileArea, state: &RayState) -> [f32; 2] {
    area.sampler(context, state.slot).square(state.stream.wrapping_add(SampleDimension::CHOICE))
}

pub(super) fn continue_paths(
    context: &FrameContext<'_>,
    area: &TileArea,
    work: &mut Workspace,
    stats: &mut RayStats,
) {
    for p in &work.points {
        let state = work.current.states[p.lane as usize];
        if !scatters(context, area, &state, p) {
            let ray = work.current.ray(p.lane as usize);
            let ray = Ray { t_min: p.surface.t_behind(&ray, p.t), ..ray };
            if ray.is_valid() {
                let stream = crate::sampler::hash(state.stream.wrapping_add(0x51ed_270b));
                work.behind.push(&ray, RayState { stream, first: false, ..state });
                stats.transparency += 1;
            }
            continue;
        }
        let model = p.model::<WithMaps>(context, &work.parameters);
        let Some((dir, weight, mut next)) = scatter(context, area, p, model, &state) else {
            continue;
        };
        let mut throughput = state.throughput * weight;
        if state.bounce >= ROULETTE_FROM {
            let survive = throughput.max_element().min(MOST_SURVIVAL);
            let [_, u] =
                choice(context, area, &RayState { stream: state.stream ^ 0x2545_f491, ..state });
            if u >= survive {
                continue;
            }
            throughput /= survive;
        }
        next.throughput = throughput;
        // Only roulette ends paths, unless the options limit them: dropping faint paths would make
        // the image too dark.
        if let Some(most) = context.options.max_bounces
            && u32::from(state.bounce) >= most
        {
            stats.cut_at_max_bounces += 1;
            continue;
        }
        push_scattered(p, dir, throughput, next, 3, &mut work.scattered);
        stats.path += 1;
    }
}

/// Direction and weight (BRDF · cosine / density) of the continued path.
fn scatter(
    context: &FrameContext<'_>,
    area: &TileArea,
    p: &Point,
    model: &SurfaceModel,
    state: &RayState,
) -> Option<(Vec3, Vec3, RayState)> {
    let sampler = area.sampler(context, state.slot);
    let u = sampler.square(state.stream.wrapping_add(SampleDimension::SCATTER));
    // The first number of this pair decided about opacity; rescale its remainder to a fresh one.
    let [_, lobe] = choice(context, area, state);
    let material = context.instances[p.instance as usize].material;
    let color = p.surface.color;
    let n = facing(p);
    let kind = |kind| RayState { kind, ..*state };
    let diffuse = |weight: Vec3| {
        let n = if matches!(material.sides, crate::material::Sides::LitOutside) {
            p.surface.normal
        } else {
            n
        };
        let (s, t) = orthonormal_basis(n);
        let d = cosine_hemisphere(u);
        let dir = s * d.x + t * d.y + n * d.z;
        // Directions below the face point into the body: black.
        (dir.dot(p.surface.face_normal) > 0.0).then(|| (dir, weight, kind(RayKind::Diffuse)))
    };
    let gloss = |f0: Vec3, roughness: f32, probability: f32| {
        if roughness <= MIRROR_ROUGHNESS {
            let share = schlick(f0, n.dot(p.view)) / probability;
            return Some((mirrored(p, n), share, kind(RayKind::Reflected)));
        }
        let (dir, share) = sample_lobe(p, n, f0, roughness, u)?;
        Some((dir, share / probability, kind(RayKind::Reflected)))
    };
    match *model {
        SurfaceModel::Unlit => None,
        SurfaceModel::Matte => diffuse(color),
        SurfaceModel::Phong { diffuse: kd, mirror, .. } => {
            // The highlight applies to lights only: it is not a physical lobe, and has no share of
            // indirect light.
            let matte = color * kd;
            let total = mirror + matte.max_element();
            if total <= 0.0 {
                return None;
            }
            let probability = mirror / total;
            if lobe < probability {
                Some((mirrored(p, n), Vec3::splat(mirror / probability), kind(RayKind::Reflected)))
            } else {
                diffuse(matte / (1.0 - probability))
            }
        }
        SurfaceModel::Metal { roughness } => gloss(color, roughness, 1.0),
        SurfaceModel::Pbr { metallic, roughness, specular, .. } => {
            let f0 = Vec3::splat(specular).lerp(color, metallic);
            let at_view =
                schlick(f0, n.dot(p.view)).max_element() * (f0 != Vec3::ZERO) as u32 as f32;
            let matte = color * (1.0 - metallic);
            let transmitted = pbr_transmitted(specular, n.dot(p.view));
            let total = at_view + (matte * transmitted).max_element();
            if total <= 0.0 {
                return None;
            }
            let probability = at_view / total;
            if lobe < probability {
                gloss(f0, roughness, probability)
            } else {
                diffuse(matte * transmitted / (1.0 - probability))
            }
        }
        SurfaceModel::Dielectric { ior, absorption } => {
            let (reflected, through) = interface(p, ior, absorption.into());
            match through {
                Some(t) if lobe >= reflected => {
                    let next = RayState { absorption: t.medium, ..kind(RayKind::Refracted) };
                    Some((t.dir, color, next))
                }
                _ => Some((mirrored(p, n), Vec3::ONE, kind(RayKind::Reflected))),
            }
        }
    }
}
