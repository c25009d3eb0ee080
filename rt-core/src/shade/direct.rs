//! Direct light from the scene's lights, with or without shadow rays.

use super::direct_block::{self, LightBlock, ShadowErrors};
use super::frame_context::FrameContext;
pub(super) use super::light_sampling::LightSampling;
use super::lobes::response;
use super::point::{Maps, WithMaps, WithoutMaps};
use super::point_block::PointBlock;
use super::shadow::trace_light_rays;
use super::wavefront::{LightRays, RayState};
use super::{Point, SampleDimension, TileArea};
use crate::bvh::Coherence;
use crate::light::{ResolvedLight, ResolvedLightKind, cone_share};
use crate::material_maps::SurfaceParameters;
use crate::math::{length, max_abs, orthonormal_basis};
use crate::ray::{LANES, Ray};
use crate::ray_stats::RayStats;
use crate::sampler::{Sampler, unit_disk};
use crate::surface::SurfacePoint;
use fearless_simd::dispatch;
use glam::Vec3;

/// Light that arrives at a point from one direction.
pub(super) struct Incident {
    /// Unit, towards the light.
    pub(super) dir: Vec3,
    /// Position of the light; `None` for directional light.
    from: Option<Vec3>,
    /// Offset from the light's position to the end of shadow rays: off the plane of a flat light by
    /// the error of its position, towards the point, so that geometry in that plane does not hide
    /// the light even at grazing angles.
    lift: Vec3,
    /// Share of the light's colour that arrives here.
    pub(super) strength: f32,
}

/// Point of the unit square for ray `k` of `count` to light `number`; round lights map it to their
/// disk.
#[inline]
pub(super) fn light_point(
    sampler: &Sampler,
    stream: u32,
    number: usize,
    k: u32,
    count: u32,
) -> [f32; 2] {
    sampler.square_of(stream.wrapping_add(SampleDimension::LIGHTS + number as u32), k, count)
}

/// Adds the direct light of every light source to `points`.
pub(crate) fn add_direct_light(
    context: &FrameContext<'_>,
    area: &TileArea,
    points: &mut [Point],
    parameters: &[SurfaceParameters],
    states: &[RayState],
    rays: &mut LightRays,
    stats: &mut RayStats,
    cost: Option<&mut [f32]>,
) {
    if parameters.is_empty() {
        direct_lighting::<WithoutMaps>(
            context, area, points, parameters, states, rays, stats, cost,
        );
    } else {
        direct_lighting::<WithMaps>(context, area, points, parameters, states, rays, stats, cost);
    }
}

/// As [`add_direct_light`].
pub(super) fn direct_lighting<M: Maps>(
    context: &FrameContext<'_>,
    area: &TileArea,
    points: &mut [Point],
    parameters: &[SurfaceParameters],
    states: &[RayState],
    rays: &mut LightRays,
    stats: &mut RayStats,
    mut cost: Option<&mut [f32]>,
) {
    for (number, light) in context.lights.iter().enumerate() {
        rays.clear();
        let sampling = context.light_sampling[number];
        let LightSampling { traced, spread, count, first_number } = sampling;
        let in_blocks = !M::USED && !spread && direct_block::knows(light);
        if in_blocks {
            let mut block = LightBlock::new();
            for (b, points) in points.chunks_mut(LANES).enumerate() {
                light_block(context, light, sampling, b, points, states, &mut block, rays);
            }
        }
        for (i, p) in points.iter_mut().enumerate().filter(|_| !in_blocks) {
            if !p.lit {
                continue;
            }
            let state = &states[p.lane as usize];
            // An occluder between this point and the light would have hidden the point from the
            // eye.
            let traced = traced && !(light.follows_camera_rays && state.first);
            let model = p.model::<M>(context, parameters);
            let arriving = p.parameters::<M>(parameters).map_or(1.0, |v| v.direct);
            for k in 0..count {
                let at = spread.then(|| {
                    light_point(&area.sampler(context, state.slot), state.stream, number, k, count)
                });
                let incident = incident_from(light, p.surface.point, at);
                if incident.strength <= 0.0 {
                    continue;
                }
                let (normal, color) = (p.surface.normal, p.surface.color);
                let answer = response(
                    model,
                    normal,
                    color,
                    p.towards_viewer(context.viewer),
                    incident.dir,
                    light.color,
                    light.highlight,
                );
                let strength =
                    if M::USED { arriving * incident.strength } else { incident.strength };
                let radiance = answer * (strength / count as f32);
                if radiance == Vec3::ZERO {
                    continue;
                }
                if traced {
                    let common = !spread && !context.light_passes_surfaces();
                    let ray = shadow_ray(&p.surface, &incident, common);
                    rays.push(&ray, i as u32, radiance, first_number + k);
                } else {
                    p.radiance += radiance;
                }
            }
        }
        if !traced {
            continue;
        }
        if let Some(cost) = cost.as_deref_mut() {
            for &(i, _) in &rays.targets {
                cost[states[points[i as usize].lane as usize].slot as usize] += 1.0;
            }
        }
        let counts = trace_light_rays(context, rays, Coherence::Coherent, |i, light| {
            points[i as usize].radiance += light
        });
        stats.shadow += counts.rays;
        stats.shadow_blocked += counts.blocked;
        counts.add_to(stats);
    }
}

/// The light of `light` at one to sixteen points, the `b`-th block of them.
fn light_block(
    context: &FrameContext<'_>,
    light: &ResolvedLight,
    LightSampling { traced, first_number, .. }: LightSampling,
    b: usize,
    points: &mut [Point],
    states: &[RayState],
    block: &mut LightBlock,
    rays: &mut LightRays,
) {
    let from_light = traced.then(|| !context.light_passes_surfaces());
    let at = PointBlock::gather(points, context.viewer);
    dispatch!(
        context.level,
        simd => block.fill(simd, context, light, &at, from_light, SHADOW_ERRORS)
    );
    let mut untested = if traced { 0 } else { block.lanes };
    if traced && light.follows_camera_rays {
        for (lane, p) in points.iter().enumerate() {
            untested |= (states[p.lane as usize].first as u16) << lane;
        }
        untested &= block.lanes;
    }
    for lane in (0..points.len()).filter(|l| untested >> l & 1 != 0) {
        points[lane].radiance += block.radiance.get(lane);
    }
    let first = (b * LANES) as u32;
    rays.push_lanes(block.lanes & !untested, &block.rays, first, &block.radiance, first_number);
}

/// Direction and strength of `light` at `p`; `at` is a point of the unit square for lights with a
/// size.
///
/// Parallel light without size, which nearly every scene has, is handled in the caller; the rest is
/// a call. As one function it is too long to be inlined, and untextured frames with shadows took
/// 1.8 % more instructions.
#[inline(always)]
pub(super) fn incident_from(light: &ResolvedLight, p: Vec3, at: Option<[f32; 2]>) -> Incident {
    match (light.kind, at) {
        (ResolvedLightKind::Directional { to_light }, None) => {
            Incident { dir: to_light, from: None, lift: Vec3::ZERO, strength: 1.0 }
        }
        _ => incident_from_place(light, p, at),
    }
}

#[inline(never)]
fn incident_from_place(light: &ResolvedLight, p: Vec3, at: Option<[f32; 2]>) -> Incident {
    let (center, normal) = match light.kind {
        ResolvedLightKind::Directional { to_light } => {
            let dir = if let Some(at) = at {
                let [x, y] = unit_disk(at);
                // Uniform over the disk that the light subtends.
                let (s, t) = orthonormal_basis(to_light);
                (to_light + (s * x + t * y) * light.size.tan()).normalize()
            } else {
                to_light
            };
            return Incident { dir, from: None, lift: Vec3::ZERO, strength: 1.0 };
        }
        ResolvedLightKind::Point { position } => {
            (position, (p - position).as_dvec3().normalize_or_zero().as_vec3())
        }
        ResolvedLightKind::Spot { position, direction, .. }
        | ResolvedLightKind::Cone { position, direction, .. }
        | ResolvedLightKind::Ring { position, direction, .. }
        | ResolvedLightKind::Quad { position, direction, .. }
        | ResolvedLightKind::Disk { position, direction } => (position, direction),
    };
    let from = match (at, light.kind) {
        (Some([x, y]), ResolvedLightKind::Quad { edges: [a, b], .. }) => {
            center + a * (2.0 * x - 1.0) + b * (2.0 * y - 1.0)
        }
        (Some(at), kind) if normal != Vec3::ZERO => {
            let [x, y] = in_ring(unit_disk(at), kind);
            let (s, t) = orthonormal_basis(normal);
            center + (s * x + t * y) * light.size
        }
        _ => center,
    };
    let to_light = from - p;
    let distance = length(to_light);
    if distance == 0.0 || !distance.is_finite() {
        return Incident { dir: Vec3::ZERO, from: Some(from), lift: Vec3::ZERO, strength: 0.0 };
    }
    let dir = to_light / distance;
    let mut strength = match light.attenuation {
        Some([c, l, q]) => 1.0 / (c + distance * (l + distance * q)),
        None => 1.0,
    };
    match light.kind {
        ResolvedLightKind::Spot { direction, cos_cutoff, exponent, .. } => {
            let cos = -dir.dot(direction);
            strength *= if cos < cos_cutoff {
                0.0
            } else if exponent == 0.0 {
                1.0
            } else {
                cos.max(0.0).powf(exponent)
            };
        }
        ResolvedLightKind::Cone { direction, cos_inner, cos_outer, .. } => {
            strength *= cone_share(-dir.dot(direction), cos_inner, cos_outer);
        }
        ResolvedLightKind::Disk { direction, .. } => strength *= (-dir.dot(direction)).max(0.0),
        ResolvedLightKind::Ring { direction, cos_inner, cos_outer, .. } => {
            let cos = -dir.dot(direction);
            strength *= cone_share(cos, cos_inner, cos_outer) * cos.max(0.0);
        }
        ResolvedLightKind::Quad { direction, both_sides, .. } => {
            let cos = -dir.dot(direction);
            strength *= if both_sides { cos.abs() } else { cos.max(0.0) };
        }
        ResolvedLightKind::Directional { .. } | ResolvedLightKind::Point { .. } => {}
    }
    let lift = match light.kind {
        ResolvedLightKind::Disk { direction, .. } | ResolvedLightKind::Ring { direction, .. } => {
            off_plane(direction, dir, max_abs(center) + light.size)
        }
        ResolvedLightKind::Quad { direction, edges: [a, b], .. } => {
            off_plane(direction, dir, max_abs(center) + max_abs(a) + max_abs(b))
        }
        _ => Vec3::ZERO,
    };
    Incident { dir, from: Some(from), lift, strength }
}

/// See [`Incident::lift`]: for a light in the plane with this normal, with coordinates up to
/// `reach`.
#[inline]
fn off_plane(normal: Vec3, to_light: Vec3, reach: f32) -> Vec3 {
    let towards_point = if to_light.dot(normal) > 0.0 { -normal } else { normal };
    towards_point * (PLACE_ULPS * f32::EPSILON * reach)
}

/// Maps a point of the unit disk to the ring around a light's hole, with uniform density.
#[inline]
fn in_ring(at: [f32; 2], kind: ResolvedLightKind) -> [f32; 2] {
    let ResolvedLightKind::Ring { hole, .. } = kind else { return at };
    let squared = at[0] * at[0] + at[1] * at[1];
    if hole <= 0.0 || squared == 0.0 {
        return at;
    }
    let factor = ((hole * hole + squared * (1.0 - hole * hole)) / squared).sqrt();
    at.map(|v| v * factor)
}

/// Error of a light's position, in ulps of its coordinates: as for surfaces (see
/// [`crate::surface`]).
const PLACE_ULPS: f32 = 4.0;

/// A ray may start at the light if it ends at most this many error bounds of the surface before the
/// surface.
const MOST_ERRORS: f32 = 32.0;

/// For blocks.
pub(super) const SHADOW_ERRORS: ShadowErrors =
    ShadowErrors { place_ulps: PLACE_ULPS, most_errors: MOST_ERRORS };

/// The ray between a point and a light. `from_light` requests the light as its origin: all rays of
/// a light then share the origin and are traced as one packet.
///
/// A ray is exact at its origin; at its end, the arithmetic has an error of some ulp of its length.
/// So rays start at the surface, and the error is at the light, where it is no larger than the
/// resolution of f32 coordinates: an object that touches the surface casts its shadow at any
/// distance of the light. Rays may start at the light only if it is so near that the error is of
/// the order of the surface's own.
#[inline]
pub(super) fn shadow_ray(p: &SurfacePoint, incident: &Incident, from_light: bool) -> Ray {
    let origin = p.ray_origin(incident.dir);
    let Some(light) = incident.from else {
        return Ray::new(origin, incident.dir);
    };
    let light = light + incident.lift;
    let to_light = light - origin;
    if from_light {
        // The end at the surface is off it by its error bound. The arithmetic of a ray from this
        // distance adds some ulp of the coordinates, which is taken off the range, and as much at
        // the light, which may lie on a surface. At most a hundredth, for a light next to a wall.
        let slack = 8.0 * f32::EPSILON * (max_abs(light) + max_abs(origin));
        let share = slack / max_abs(to_light);
        if slack <= MOST_ERRORS * p.point_error && share < 0.01 {
            return Ray { t_min: share, ..Ray::new(light, -to_light).with_t_max(1.0 - share) };
        }
    }
    // Unit length: in units of the distance to a far light, geometry near the surface would
    // underflow in f32.
    let distance = length(to_light);
    let error = PLACE_ULPS * f32::EPSILON * (max_abs(light) + distance);
    Ray::new(origin, to_light / distance).with_t_max(distance - error.min(0.5 * distance))
}
