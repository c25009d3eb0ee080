//! Ambient and environment light, attenuated by near surfaces: cosine-weighted rays over the
//! hemisphere, limited in length.

use super::frame_context::FrameContext;
use super::hemisphere::{Hemisphere, HemisphereSamples, OcclusionPoint, directions};
use super::lobes::ambient_albedo;
use super::point::{Maps, WithMaps, WithoutMaps};
use super::point_block::{PointBlock, by_material};
use super::response_block::{self, supports};
use super::shadow::{trace_blocks, trace_light_rays};
use super::sky_rays::SkyRays;
use super::wavefront::{LightRays, OcclusionSource, RayState};
use super::{Point, SampleDimension, TileArea};
use crate::bvh::Coherence;
use crate::effects::Effects;
use crate::environment::IrradianceCoefficients;
use crate::material_maps::SurfaceParameters;
use crate::ray::LANES;
use crate::ray_stats::RayStats;
use crate::simd::vectors::{Rows3, Vec3x16};
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch, f32x16, mask32x16, u32x16};
use glam::Vec3;

/// Rays per batch: enough for the tracer to sort them by direction, few enough to stay in the
/// second-level cache.
const BATCH_RAYS: usize = 4096;

/// Adds ambient and environment light to `points`.
pub(crate) fn add_ambient_light(
    context: &FrameContext<'_>,
    area: &TileArea,
    points: &mut [Point],
    parameters: &[SurfaceParameters],
    states: &[RayState],
    rays: &mut LightRays,
    OcclusionBuffers { open, hemisphere_samples, sky_rays }: &mut OcclusionBuffers,
    stats: &mut RayStats,
    mut cost: Option<&mut [f32]>,
) {
    let Some(mean) = &context.irradiance else { return };
    let ambient =
        if parameters.is_empty() { ambient_at::<WithoutMaps> } else { ambient_at::<WithMaps> };
    let ambient = |p: &Point| ambient(context, mean, parameters, p);
    let in_blocks = parameters.is_empty();
    let occlusion = context
        .scene
        .ambient_occlusion
        .filter(|_| context.effects.contains(Effects::AMBIENT_OCCLUSION));
    let Some(occlusion) = occlusion else {
        for p in points.iter_mut().filter(|p| p.lit) {
            p.radiance += ambient(p);
        }
        return;
    };

    let count = occlusion.rays;
    let per_batch = (BATCH_RAYS / count as usize).max(1);
    // Where an occluded ray is all there is to know, rays need no list of what they contribute.
    let listed = context.light_passes_surfaces() || !matches!(rays.source, OcclusionSource::World);
    let mut start = 0;
    while start < points.len() {
        let end = (start + per_batch).min(points.len());
        // ---- Points that ambient light reaches.
        open.clear();
        let mut light = Rows3::ZERO;
        for (i, p) in points[start..end].iter().enumerate() {
            if in_blocks && i % LANES == 0 {
                let block = &points[start + i..end.min(start + i + LANES)];
                let at = PointBlock::gather(block, context.viewer);
                dispatch!(
                    context.level,
                    simd => ambient_block(simd, context, mean, &at, &mut light)
                );
            }
            if !p.lit {
                continue;
            }
            let light = if in_blocks { light.get(i % LANES) } else { ambient(p) };
            if light == Vec3::ZERO {
                continue;
            }
            let state = &states[p.lane as usize];
            let sampler = area.sampler(context, state.slot);
            let dimension = state.stream.wrapping_add(SampleDimension::AMBIENT_OCCLUSION);
            open.push(OcclusionPoint { index: i as u32, light, sampler, dimension });
        }
        // ---- Directions over +z, sixteen at a time across points.
        dispatch!(
            context.level,
            simd => directions(simd, context, open, count, hemisphere_samples)
        );
        // ---- Rays.
        rays.clear();
        rays.first_point = start as u32;
        let batch = &mut points[start..end];
        let sent_by = |o: &OcclusionPoint| Hemisphere::new(&batch[o.index as usize].surface);
        dispatch!(
            context.level,
            simd => sky_rays.fill(simd, open, sent_by, hemisphere_samples, count)
        );
        sky_rays.store_blocks(occlusion.distance as f32, &mut rays.blocks);
        if let Some(cost) = cost.as_deref_mut() {
            for (o, sent) in open.iter().zip(&sky_rays.sent) {
                let p = &batch[o.index as usize];
                cost[states[p.lane as usize].slot as usize] += *sent as f32;
            }
        }
        // ---- Light of those that arrive.
        let counts = if listed {
            for (o, (sent, numbers)) in open.iter().zip(sky_rays.numbers(count)) {
                let radiance = o.light / sent as f32;
                numbers.for_each(|k| rays.aim(o.index, radiance, context.sky_number + k));
            }
            trace_light_rays(context, rays, Coherence::Incoherent, |i, light| {
                batch[i as usize].radiance += light
            })
        } else {
            let mut counts = trace_blocks(context, rays, Coherence::Incoherent);
            let mut first = 0;
            for (open, sent) in open.chunks(LANES).zip(sky_rays.sent.chunks(LANES)) {
                let mut arrived = [0; LANES];
                for (lane, &sent) in sent.iter().enumerate() {
                    let blocked = rays.count_blocked(first, sent as usize);
                    arrived[lane] = sent - blocked;
                    counts.blocked += blocked as u64;
                    first += sent as usize;
                }
                dispatch!(
                    context.level,
                    simd => add_arrived(simd, open, sent, &arrived, batch)
                );
            }
            counts.rays = first as u64;
            counts
        };
        stats.ambient_occlusion += counts.rays;
        stats.ambient_occlusion_blocked += counts.blocked;
        counts.add_to(stats);
        start = end;
    }
}

/// Ambient light that a point reflects to the eye.
fn ambient_at<M: Maps>(
    context: &FrameContext<'_>,
    mean: &IrradianceCoefficients,
    parameters: &[SurfaceParameters],
    p: &Point,
) -> Vec3 {
    let albedo =
        ambient_albedo(p.model::<M>(context, parameters), p.surface.color, context.effects);
    let light = albedo * mean.for_normal(p.surface.normal);
    p.parameters::<M>(parameters).map_or(light, |v| light * v.ambient)
}

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct OcclusionBuffers {
    open: Vec<OcclusionPoint>,
    hemisphere_samples: HemisphereSamples,
    sky_rays: SkyRays,
}

/// [`ambient_at`] for points without parameters of their own.
#[inline(never)]
pub(super) fn ambient_block<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    mean: &IrradianceCoefficients,
    at: &PointBlock,
    out: &mut Rows3,
) {
    simd.vectorize(
        #[inline(always)]
        || {
            let color = Vec3x16::load(simd, &at.color);
            let normal = Vec3x16::load(simd, &at.normal);
            by_material(
                context,
                &at.instance,
                at.lit,
                #[inline(always)]
                |material, lanes| {
                    if supports(&material.model) {
                        let light = response_block::ambient(
                            simd,
                            context.effects,
                            &material.model,
                            mean,
                            color,
                            normal,
                        );
                        let old = Vec3x16::load(simd, out);
                        light.or_else(mask32x16::from_bitmask(simd, lanes as u64), old).store(out);
                        return;
                    }
                    for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                        let albedo =
                            ambient_albedo(&material.model, at.color.get(lane), context.effects);
                        out.set(lane, albedo * mean.for_normal(at.normal.get(lane)));
                    }
                },
            );
        },
    );
}

/// Adds the light of the rays that arrived at one to sixteen points, each of which has `sent` rays.
/// One sum a ray, as where rays have a list: the same bits.
#[inline(never)]
fn add_arrived<S: Simd>(
    simd: S,
    open: &[OcclusionPoint],
    sent: &[u32],
    arrived: &[u32; LANES],
    points: &mut [Point],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            let (mut light, mut radiance) = (Rows3::ZERO, Rows3::ZERO);
            let mut rays = [1.0; LANES];
            for (lane, (o, &sent)) in open.iter().zip(sent).enumerate() {
                light.set(lane, o.light);
                radiance.set(lane, points[o.index as usize].radiance);
                rays[lane] = sent as f32;
            }
            let each = Vec3x16::load(simd, &light).div(f32x16::from_slice(simd, &rays));
            let mut sum = Vec3x16::load(simd, &radiance);
            let arrived = u32x16::from_slice(simd, arrived);
            for k in 0..sent.iter().copied().max().unwrap_or(0) {
                let more = arrived.simd_gt(u32x16::splat(simd, k));
                sum = sum.add(each).or_else(more, sum);
            }
            sum.store(&mut radiance);
            for (lane, o) in open.iter().enumerate() {
                points[o.index as usize].radiance = radiance.get(lane);
            }
        },
    );
}
