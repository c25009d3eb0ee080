//! Renders a tile: traces a wavefront of rays, lights its hits and spawns the next wavefronts,
//! until no rays are left.
//!
//! Each effect is a pass over the whole wavefront. A pass is entered once per wavefront and only if
//! the frame's [`Effects`] include it: [`direct`] light with its shadow rays,
//! [`ambient_occlusion`], then [`specular`] (mirror, gloss, glass) or [`path`] and transparency,
//! which spawn rays for the next wavefronts. Rays behind transparent surfaces stay coherent and
//! form a separate wavefront. Frames without any of these effects, or with hard shadows alone, use
//! loops of their own, [`local`].

mod ambient_occlusion;
#[cfg(test)]
mod block_tests;
mod camera_rays;
mod camera_wavefront;
pub mod deferred;
mod direct;
mod direct_block;
mod frame_context;
mod hemisphere;
mod layers;
mod light_sampling;
mod lobes;
mod local;
mod microfacet;
mod path;
mod point;
mod point_block;
mod response_block;
mod shadow;
mod sky_rays;
mod spawn;
mod specular;
mod surfaces;
mod tile;
mod volumes;
pub mod vtk_pbr;
mod wavefront;

pub(crate) use frame_context::FrameContext;
pub(crate) use point::Point;
pub(crate) use tile::{TILE, TileArea, TileLayers};

use crate::bvh::{Coherence, InstanceFilter};
use crate::effects::Effects;
use crate::environment::Background;
use crate::frame::Layers;
use crate::material::SurfaceModel;
use crate::material_maps::SurfaceParameters;
use crate::ray::{HitBlock, LANES, NO_HIT, Ray};
use crate::ray_stats::RayStats;
use crate::surface::{ResolvedInstance, SurfacePoint};
use camera_wavefront::{generate_camera_rays, generate_camera_wavefront};
use fearless_simd::dispatch;
use glam::Vec3;
use point::{Maps, NO_PARAMETERS, WithMaps, WithoutMaps};
use spawn::spawn_rays;
use surfaces::BlockSurfaces;
use tile::PIXELS;
use wavefront::{LightRays, RayKind, RayState, Wavefront};

/// Smallest opacity of an opaque surface: interpolation between corners of alpha 1 gives values
/// some roundings below 1.
const OPAQUE: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Sampler dimensions, counted from the start of a ray's stream.
pub(crate) struct SampleDimension;

impl SampleDimension {
    const PIXEL: u32 = 0;
    const LENS: u32 = 1;
    const CHOICE: u32 = 2;
    const SCATTER: u32 = 3;
    const AMBIENT_OCCLUSION: u32 = 4;
    /// One per light from this number on.
    const LIGHTS: u32 = 8;
}

/// Buffers of one thread, kept from tile to tile.
#[derive(Default)]
pub(crate) struct Workspace {
    current: Wavefront,
    behind: Wavefront,
    scattered: Wavefront,
    hits: Vec<HitBlock>,
    /// For each ray, the surface at its hit, in deferred frames; empty where this scene's world
    /// is traced.
    surfaces: Vec<SurfacePoint>,
    points: Vec<Point>,
    /// Parameters of points whose material has maps.
    parameters: Vec<SurfaceParameters>,
    light_rays: LightRays,
    occlusion: ambient_occlusion::OcclusionBuffers,
    shadows: local::ShadowBuffers,
    /// For each ray, what it collects in the volume up to its hit, where other processes hold the
    /// volume's bricks; empty where the whole volume is here.
    volume_samples: Vec<crate::volume::VolumeSample>,
    /// The same where the frame's only volume takes samples, which it does for sixteen rays at a
    /// time.
    sampled: volumes::SampledRays,
    /// One ray in the object spaces of all volumes.
    object_rays: Vec<Ray>,
    /// Premultiplied RGBA of this sample.
    pixels: Vec<[f32; 4]>,
}

/// Adds sample number `sample` to every pixel of the tile.
pub(crate) fn render_tile(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    sample: u32,
) -> RayStats {
    let mut stats = RayStats::default();
    let layers = context.options.layers;
    let centered =
        context.options.samples <= 1 && !context.effects.contains(Effects::DEPTH_OF_FIELD);
    let wants_geometry = layers.intersects(Layers::GEOMETRY) && sample == 0;

    // Depth, normals and ids belong to the pixel centre. They need separate rays unless the
    // colour's rays go through the centre.
    if wants_geometry && !(centered && layers.contains(Layers::COLOR)) {
        trace_geometry_layers(context, area, out, work, &mut stats);
    }
    if !layers.contains(Layers::COLOR) {
        return stats;
    }
    let record = wants_geometry && centered;
    if local::is_sufficient(context) {
        let jittered = (!centered).then_some(sample);
        local::render_tile(context, area, out, work, jittered, record, &mut stats);
    } else {
        render_wavefronts(context, area, out, work, sample, centered, record, &mut stats);
    }
    stats
}

/// As [`render_tile`], with any effects. With `centered`, camera rays go through pixels' centres;
/// with `record`, they fill the geometry layers.
fn render_wavefronts(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    sample: u32,
    centered: bool,
    record: bool,
    stats: &mut RayStats,
) {
    generate_camera_wavefront(
        context,
        area,
        &mut work.current,
        (!centered).then_some(sample),
        stats,
        out.cost_mut(),
    );
    if sample == 0 {
        work.pixels = std::mem::take(&mut out.color);
    }
    work.pixels.clear();
    work.pixels.resize(PIXELS, [0.0; 4]);
    work.behind.clear();
    work.scattered.clear();

    let mut coherent = true;
    let mut area_sample = *area;
    area_sample.sample = sample;
    let mut record_all = record && !context.effects.contains(Effects::TRANSPARENCY);
    loop {
        trace(context, work, coherent);
        if std::mem::take(&mut record_all) {
            record_camera_hits(context, &area_sample, out, work);
        }
        process_hits(context, &area_sample, out, work, record, stats);
        shade_points(context, &area_sample, out, work, stats);
        spawn_rays(context, &area_sample, out, work, stats);
        coherent = !work.behind.is_empty();
        let next = if coherent { &mut work.behind } else { &mut work.scattered };
        if next.is_empty() {
            break;
        }
        std::mem::swap(&mut work.current, next);
        next.clear();
    }
    if sample == 0 {
        out.start_samples(std::mem::take(&mut work.pixels));
    } else {
        out.add_sample(&work.pixels);
    }
}

fn trace(context: &FrameContext<'_>, work: &mut Workspace, coherent: bool) {
    // The old contents do not matter: tracing starts with misses everywhere.
    work.hits.resize(work.current.blocks.len(), HitBlock::MISS);
    let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
    let world = &context.scene.world;
    world.closest_stream(&work.current.blocks, &mut work.hits, coherence, InstanceFilter::All);
    prefetch_surfaces(context, &work.hits);
}

/// Prefetches everything that looking up the hits will read, first the triangles and then the
/// vertices they name. Without it, these waits were half of the time of shading (measured on a
/// million triangles).
fn prefetch_surfaces(context: &FrameContext<'_>, hits: &[HitBlock]) {
    fn each(context: &FrameContext<'_>, hits: &[HitBlock], f: impl Fn(&ResolvedInstance<'_>, u32)) {
        for h in hits {
            for lane in (0..LANES).filter(|l| h.prim[*l] != NO_HIT) {
                f(&context.instances[h.instance[lane] as usize], h.prim[lane]);
            }
        }
    }
    each(context, hits, |resolved, prim| resolved.prefetch_triangle(prim));
    each(context, hits, |resolved, prim| resolved.prefetch_vertices(prim));
}

/// Depth, distance, normal and ids of the first surface of at least `depth_min_opacity`.
fn trace_geometry_layers(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    stats: &mut RayStats,
) {
    generate_camera_wavefront(context, area, &mut work.current, None, stats, out.cost_mut());
    if !context.effects.contains(Effects::TRANSPARENCY) {
        trace(context, work, true);
        record_camera_hits(context, area, out, work);
        return;
    }
    loop {
        trace(context, work, true);
        work.behind.clear();
        for i in 0..work.current.states.len() {
            let Some(hit) = work.hits[i / LANES].get(i % LANES) else { continue };
            let (ray, state) = (work.current.ray(i), work.current.states[i]);
            let s = context.surface(&ray, &hit);
            if s.opacity > 0.0 && s.opacity >= context.options.depth_min_opacity {
                out.record(context, area, state.slot, &ray, &hit, || s.normal);
            } else {
                let ray = Ray { t_min: s.t_behind(&ray, hit.t), ..ray };
                if ray.is_valid() {
                    work.behind.push(&ray, state);
                    stats.transparency += 1;
                }
            }
        }
        if work.behind.is_empty() {
            return;
        }
        std::mem::swap(&mut work.current, &mut work.behind);
    }
}

/// Geometry layers of the first surfaces of all pixels, opaque or not.
fn record_camera_hits(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &Workspace,
) {
    for (b, (rays, hits)) in work.current.blocks.iter().zip(&work.hits).enumerate() {
        dispatch!(
            context.level,
            simd => layers::record_block(simd, context, area, b, rays, hits, out)
        );
        if context.options.layers.contains(Layers::NORMAL) {
            let hit = (0..LANES).fold(0u16, |m, l| m | ((hits.prim[l] != NO_HIT) as u16) << l);
            let normal =
                |l| hits.get(l).map_or(Vec3::ZERO, |h| context.surface(&rays.get(l), &h).normal);
            out.record_normals(b, hit, normal);
        }
    }
}

/// Hits become points to shade; misses add the background or the environment.
fn process_hits(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    record: bool,
    stats: &mut RayStats,
) {
    // In deferred frames, the hits do not carry the parameters of mapped surfaces.
    if context.has_maps && work.surfaces.is_empty() {
        process_hits_with::<WithMaps>(context, area, out, work, record, stats);
    } else {
        process_hits_with::<WithoutMaps>(context, area, out, work, record, stats);
    }
}

/// As [`process_hits`].
fn process_hits_with<M: Maps>(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    record: bool,
    stats: &mut RayStats,
) {
    let transparent = context.effects.contains(Effects::TRANSPARENCY);
    let refraction = context.effects.intersects(Effects::REFRACTION | Effects::PATH_TRACING);
    work.points.clear();
    work.parameters.clear();
    let mut count = 0;
    // Camera rays that miss everything find nothing.
    let misses_count = work.current.has_scattered
        || context.scene.background != Background::Transparent
        || !context.volumes.is_empty();
    let mut surfaces = BlockSurfaces::new();
    let mut nothing = false;
    work.sampled.take(context, &work.current, &work.hits, !work.volume_samples.is_empty());
    for i in 0..work.current.states.len() {
        let (block, hits, lane) =
            (&work.current.blocks[i / LANES], &work.hits[i / LANES], i % LANES);
        if lane == 0 {
            nothing = !surfaces.look_up(context, block, hits, work.surfaces.is_empty());
            if !nothing {
                work.points.resize(count + LANES, Point::BLANK);
            }
        }
        if nothing && !misses_count {
            continue;
        }
        let hit = hits.get(lane);
        if hit.is_none() && !misses_count || block.t_max[lane] < block.t_min[lane] {
            continue;
        }
        let ray = block.get(lane);
        if !context.volumes.is_empty() {
            let t_end = hit.map_or(ray.t_max, |h| h.t);
            let collected = work.volume_samples.get(i).or_else(|| work.sampled.get(i));
            let sample = match collected {
                Some(collected) => *collected,
                None => volumes::integrate_volumes(context, &ray, t_end, &mut work.object_rays),
            };
            volumes::composite_volume(
                &sample,
                &mut work.current.states[i],
                &mut work.pixels,
                stats,
            );
        }
        let Some(hit) = hit else {
            add_miss(context, area, &work.current.states[i], ray.dir, &mut work.pixels);
            continue;
        };
        let resolved = context.instance_at(&hit);
        let mut surface = match work.surfaces.get(i) {
            Some(seen_elsewhere) => *seen_elsewhere,
            None => surfaces.get(lane),
        };
        let parameters =
            if M::USED { resolved.parameters(&ray, &hit, &mut surface.normal) } else { None };
        if !transparent {
            stats.opacity_ignored += (surface.opacity < OPAQUE) as u64;
            surface.opacity = 1.0;
        }
        let length = surfaces.lengths[lane];
        let state = &mut work.current.states[i];
        if state.absorption != Vec3::ZERO {
            // `t_min` is the parameter where the ray entered the medium or was last continued.
            state.throughput *= (-state.absorption * ((hit.t - ray.t_min) * length)).exp();
        }
        if record && transparent && state.kind == RayKind::Camera {
            let shown =
                surface.opacity > 0.0 && surface.opacity >= context.options.depth_min_opacity;
            if shown && !out.is_recorded(state.slot) {
                out.record(context, area, state.slot, &ray, &hit, || surface.normal);
            }
        }
        let (lit, radiance) = match resolved.material.model {
            SurfaceModel::Unlit => (false, surface.color),
            SurfaceModel::Dielectric { .. } if refraction => (false, Vec3::ZERO),
            _ => (surface.opacity > 0.0, Vec3::ZERO),
        };
        // Field by field into place: a copy of the whole would wait for the stores of its parts.
        let p = &mut work.points[count];
        count += 1;
        p.surface = surface;
        p.view = ray.dir * surfaces.to_view[lane];
        p.radiance =
            radiance + parameters.map_or(resolved.material.emission.into(), |v| v.emission);
        p.t = hit.t;
        p.lane = i as u32;
        p.instance = hit.instance;
        p.lit = lit;
        p.before_camera = state.kind == RayKind::Camera;
        p.parameters = parameters.map_or(NO_PARAMETERS, |v| {
            work.parameters.push(v);
            work.parameters.len() as u32 - 1
        });
    }
    work.points.truncate(count);
}

fn add_miss(
    context: &FrameContext<'_>,
    area: &TileArea,
    state: &RayState,
    dir: Vec3,
    pixels: &mut [[f32; 4]],
) {
    let pixel = &mut pixels[state.slot as usize];
    let radiance = match state.kind {
        RayKind::Camera => {
            let [_, y] = area.pixel(state.slot).unwrap_or_default();
            let [r, g, b, a] = context.background(y, dir);
            pixel[3] += state.coverage * a;
            Vec3::new(r, g, b) * a
        }
        RayKind::Reflected | RayKind::Refracted => context.surroundings(dir),
        RayKind::Diffuse => {
            let environment = context.scene.environment.as_ref();
            context.ambient
                + environment.map_or(Vec3::ZERO, |e| e.radiance(dir.normalize_or_zero()))
        }
    };
    let added = state.throughput * radiance;
    for c in 0..3 {
        pixel[c] += added[c];
    }
}

fn shade_points(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    stats: &mut RayStats,
) {
    add_light(context, area, work, stats, out.cost_mut());
    accumulate_radiance(context, area, work);
}

/// Light that arrives at the wavefront's points.
fn add_light(
    context: &FrameContext<'_>,
    area: &TileArea,
    work: &mut Workspace,
    stats: &mut RayStats,
    mut cost: Option<&mut [f32]>,
) {
    let Workspace { current, points, parameters, light_rays, occlusion, .. } = work;
    if !context.lights.is_empty() {
        let cost = cost.as_deref_mut();
        direct::add_direct_light(
            context,
            area,
            points,
            parameters,
            &current.states,
            light_rays,
            stats,
            cost,
        );
    }
    if context.irradiance.is_some() && !context.effects.contains(Effects::PATH_TRACING) {
        ambient_occlusion::add_ambient_light(
            context,
            area,
            points,
            parameters,
            &current.states,
            light_rays,
            occlusion,
            stats,
            cost,
        );
    }
}

/// Adds the radiance of the wavefront's points to the pixels.
fn accumulate_radiance(context: &FrameContext<'_>, area: &TileArea, work: &mut Workspace) {
    let Workspace { current, points, pixels, .. } = work;
    // The path tracer chooses at random between the surface and what is behind it, with the same
    // mean.
    let split = !context.effects.contains(Effects::PATH_TRACING);
    for p in points.iter() {
        let state = &current.states[p.lane as usize];
        let opacity = p.surface.opacity;
        let pixel = &mut pixels[state.slot as usize];
        if split {
            let added = state.throughput * p.radiance * opacity;
            for c in 0..3 {
                pixel[c] += added[c];
            }
            pixel[3] += state.coverage * opacity;
        } else if path::scatters(context, area, state, p) {
            let added = state.throughput * p.radiance;
            for c in 0..3 {
                pixel[c] += added[c];
            }
            pixel[3] += state.coverage;
        }
    }
}
