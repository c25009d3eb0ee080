//! Renders frames that need nothing but camera rays, or these and hard shadows ([`shadows`]):
//! trace, look up, light. It keeps no wavefronts, ray states or points.
//!
//! The lights and lobes are those of the general loop, computed for sixteen pixels at a time. Half
//! of the time besides tracing was waiting for vertices (measured on a million triangles, one after
//! the other: 30 of 60 ns per pixel). So a tile first prefetches its triangles, then their
//! vertices, and only then reads them.

mod elsewhere;
mod light;
mod shadows;

pub(super) use shadows::ShadowBuffers;

use super::direct::incident_from;
use super::frame_context::FrameContext;
use super::layers::record_block;
use super::lobes::{ambient_albedo, response};
use super::response_block::supports;
use super::tile::{PIXELS, TileArea, TileLayers};
use super::{OPAQUE, Workspace, generate_camera_rays, prefetch_surfaces, record_camera_hits};
use crate::bvh::{Coherence, InstanceFilter};
use crate::effects::Effects;
use crate::environment::Background;
use crate::light::ResolvedLightKind;
use crate::material::{Material, SurfaceModel};
use crate::material_maps::SurfaceParameters;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use crate::ray_stats::RayStats;
use crate::simd::vectors::{Row, Rows3};
use crate::surface::{HitPoint, ShadingPoint, ShadingPointBlock, WithPoint, WithoutPoint};
use fearless_simd::{Simd, dispatch};
use glam::Vec3;

/// True when the frame has no effect other than the lens and hard shadows.
pub(super) fn is_sufficient(context: &FrameContext<'_>) -> bool {
    has_no_effect(context) || shadows::is_sufficient(context)
}

/// True when the frame has no effect other than the lens.
pub(super) fn has_no_effect(context: &FrameContext<'_>) -> bool {
    context.effects.without(Effects::DEPTH_OF_FIELD).is_empty()
}

pub(super) fn render_tile(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    sample: Option<u32>,
    record: bool,
    stats: &mut RayStats,
) {
    generate_camera_rays(context, area, &mut work.current.blocks, sample, stats, out.cost_mut());
    work.hits.resize(PIXELS / LANES, HitBlock::MISS);
    let world = &context.scene.world;
    world.closest_stream(
        &work.current.blocks,
        &mut work.hits,
        Coherence::Coherent,
        InstanceFilter::All,
    );
    let first = sample.is_none_or(|s| s == 0);
    let mut pixels = std::mem::take(if first { &mut out.color } else { &mut work.pixels });
    pixels.resize(PIXELS, [0.0; 4]);
    prefetch_surfaces(context, &work.hits);
    let mut record = record;
    if context.options.shading_points.is_some() {
        // Depth and ids are those of the rays.
        if std::mem::take(&mut record) {
            record_camera_hits(context, area, out, work);
        }
        elsewhere::move_hits(context, area, &mut work.current.blocks, &mut work.hits);
    }
    if has_no_effect(context) {
        light(context, area, out, work, &mut pixels, record, stats);
    } else {
        shadows::light(context, area, out, work, &mut pixels, record, stats);
    }
    if first {
        out.start_samples(pixels);
    } else {
        out.add_sample(&pixels);
        work.pixels = pixels;
    }
}

/// Colours of the tile whose camera rays and hits are in `work`.
pub(super) fn light(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &Workspace,
    pixels: &mut [[f32; 4]],
    record: bool,
    stats: &mut RayStats,
) {
    let has_place =
        |l: &crate::light::ResolvedLight| !matches!(l.kind, ResolvedLightKind::Directional { .. });
    let points = context.viewer.is_some() || context.lights.iter().any(has_place);
    dispatch!(context.level, simd => {
        if points {
            light_hits::<_, WithPoint>(simd, context, area, out, work, pixels, record, stats);
        } else {
            light_hits::<_, WithoutPoint>(simd, context, area, out, work, pixels, record, stats);
        }
    });
}

/// As [`light`].
fn light_hits<S: Simd, P: HitPoint>(
    simd: S,
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &Workspace,
    pixels: &mut [[f32; 4]],
    record: bool,
    stats: &mut RayStats,
) {
    let (mut shading_points, mut radiance) = (ShadingPointBlock::new(), Rows3::ZERO);
    for (b, pixels) in pixels.chunks_exact_mut(LANES).enumerate() {
        let (rays, hits) = (&work.current.blocks[b], &work.hits[b]);
        let mut rows: [Row; 4] = [[0.0; LANES]; 4];
        let hit = (0..LANES).fold(0u16, |m, l| m | ((hits.prim[l] != NO_HIT) as u16) << l);
        if hit != u16::MAX && context.scene.background != Background::Transparent {
            fill_background(context, area, b, rays, &mut rows);
        }
        // ---- One instance at a time; nearly always there is only one.
        let mut left = hit;
        while left != 0 {
            let instance = hits.instance[left.trailing_zeros() as usize];
            let same =
                (0..LANES).fold(0u16, |m, l| m | ((hits.instance[l] == instance) as u16) << l);
            let lanes = left & same;
            left &= !lanes;
            let resolved = &context.instances[instance as usize];
            resolved.shading_point_block::<S, P>(simd, lanes, rays, hits, &mut shading_points);
            for lane in 0..LANES {
                let pale = shading_points.opacity[lane] < OPAQUE;
                stats.opacity_ignored += (pale && lanes >> lane & 1 != 0) as u64;
            }
            let material = resolved.material;
            if material.maps.is_some() {
                for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                    let Some(hit) = hits.get(lane) else { continue };
                    let (ray, mut shading_point) = (rays.get(lane), shading_points.get(lane));
                    let parameters = resolved.parameters(&ray, &hit, &mut shading_point.normal);
                    shading_points.normal.set(lane, shading_point.normal);
                    radiance.set(
                        lane,
                        self::radiance(
                            context,
                            material,
                            parameters.as_ref(),
                            &shading_point,
                            ray.dir,
                        ),
                    );
                }
            } else if supports(&material.model) {
                light::radiance_block(
                    simd,
                    context,
                    material,
                    &shading_points,
                    rays,
                    &mut radiance,
                );
            } else {
                for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                    let (shading_point, dir) = (shading_points.get(lane), rays.get(lane).dir);
                    radiance
                        .set(lane, self::radiance(context, material, None, &shading_point, dir));
                }
            }
            light::merge(simd, lanes, &radiance, &mut rows);
            if record {
                out.record_normals(b, lanes, |lane| shading_points.normal.get(lane));
            }
        }
        if record {
            record_block(simd, context, area, b, rays, hits, out);
        }
        light::store_pixels(simd, &rows, pixels);
    }
}

/// Background under every pixel of block `b`; hits are drawn over it.
fn fill_background(
    context: &FrameContext<'_>,
    area: &TileArea,
    b: usize,
    rays: &RayBlock,
    rows: &mut [Row; 4],
) {
    for lane in 0..LANES {
        if let Some([_, y]) = area.pixel((b * LANES + lane) as u16) {
            let [r, g, b, a] = context.background(y, rays.get(lane).dir);
            (rows[0][lane], rows[1][lane], rows[2][lane], rows[3][lane]) = (r * a, g * a, b * a, a);
        }
    }
}

/// Radiance of one surface towards the viewer, or the origin of a ray with direction `dir`. The
/// scalar form of [`light::radiance_block`].
fn radiance(
    context: &FrameContext<'_>,
    material: &Material,
    parameters: Option<&SurfaceParameters>,
    shading_point: &ShadingPoint,
    dir: Vec3,
) -> Vec3 {
    let (model, arriving, ambient) =
        parameters.map_or((&material.model, 1.0, 1.0), |v| (&v.model, v.direct, v.ambient));
    let mut radiance = parameters.map_or(material.emission.into(), |v| v.emission);
    if *model == SurfaceModel::Unlit {
        return radiance + shading_point.color;
    }
    let ShadingPoint { point, normal, color, .. } = *shading_point;
    let view = context.viewer.map_or(-dir, |viewer| viewer - point).normalize_or_zero();
    for light in &context.lights {
        let incident = incident_from(light, point, None);
        let answer =
            response(model, normal, color, view, incident.dir, light.color, light.highlight);
        radiance += answer * (arriving * incident.strength);
    }
    if let Some(mean) = &context.irradiance {
        radiance +=
            ambient_albedo(model, color, context.effects) * mean.for_normal(normal) * ambient;
    }
    radiance
}

#[cfg(test)]
pub(super) mod tests;
