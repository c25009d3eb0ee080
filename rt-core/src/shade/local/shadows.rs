//! Renders frames whose only effect is shadows with hard edges: trace, look up, light, and trace
//! once more towards each light.
//!
//! Points stay in the blocks of sixteen pixels in which their rays were traced. In the general
//! loop, every point is written to a list, gathered for each light and its ray written to another
//! list: close to a surface, where rays are cheap, that took longer than both kinds of rays.

use super::super::Workspace;
use super::super::ambient_occlusion::ambient_block;
use super::super::direct::SHADOW_ERRORS;
use super::super::direct_block::{LightBlock, knows};
use super::super::frame_context::FrameContext;
use super::super::layers::record_block;
use super::super::point_block::{PointBlock, by_material};
use super::super::shadow::trace_light_rays;
use super::super::surfaces::BlockSurfaces;
use super::super::tile::{PIXELS, TileArea, TileLayers};
use super::super::wavefront::LightRays;
use super::light::{merge, store_pixels};
use super::{OPAQUE, fill_background};
use crate::bvh::{Coherence, InstanceFilter};
use crate::effects::Effects;
use crate::environment::Background;
use crate::light::ResolvedLight;
use crate::material::SurfaceModel;
use crate::ray::{LANES, NO_HIT, RayBlock};
use crate::ray_stats::RayStats;
use crate::simd::vectors::{Row, Rows3, Vec3x16};
use fearless_simd::{Simd, SimdMask, dispatch, mask32x16};
use glam::Vec3;

/// Shadow rays of a block with at least this many are traced as they are. Fewer share blocks with
/// those of other pixels.
const FULL: u32 = 12;

/// Buffers of one thread.
#[derive(Default)]
pub(in crate::shade) struct ShadowBuffers {
    /// Points of each block of pixels, and the radiance collected there.
    points: Vec<PointBlock>,
    radiance: Vec<Rows3>,
    hit: Vec<u16>,
    /// Rays of blocks with [many](FULL) of them, and where they go.
    rays: Vec<RayBlock>,
    targets: Vec<Target>,
    blocked: Vec<u16>,
}

/// What the rays of a block contribute if nothing is in between.
struct Target {
    block: usize,
    lanes: u16,
    radiance: Rows3,
}

/// True when the frame has no other effects than shadows of lights that [`LightBlock`] knows, and
/// the lens.
pub(in crate::shade) fn is_sufficient(context: &FrameContext<'_>) -> bool {
    context.effects.without(Effects::DEPTH_OF_FIELD) == Effects::SHADOWS
        && !context.has_maps
        && context.options.shading_points.is_none()
        && context.lights.iter().all(knows)
}

/// Colours of the tile whose camera rays and hits are in `work`.
pub(super) fn light(
    context: &FrameContext<'_>,
    area: &TileArea,
    out: &mut TileLayers,
    work: &mut Workspace,
    pixels: &mut [[f32; 4]],
    record: bool,
    stats: &mut RayStats,
) {
    let mut buffers = std::mem::take(&mut work.shadows);
    buffers.look_up(context, work, stats);
    for number in 0..context.lights.len() {
        buffers.add_light(context, number, &mut work.light_rays, out.cost_mut(), stats);
    }
    dispatch!(
        context.level,
        simd => buffers.finish(simd, context, area, work, out, pixels, record)
    );
    work.shadows = buffers;
}

impl ShadowBuffers {
    /// Points and what they emit.
    fn look_up(&mut self, context: &FrameContext<'_>, work: &Workspace, stats: &mut RayStats) {
        const BLOCKS: usize = PIXELS / LANES;
        self.points.resize(BLOCKS, PointBlock::NONE);
        self.radiance.clear();
        self.radiance.resize(BLOCKS, Rows3::ZERO);
        self.hit.clear();
        self.hit.resize(BLOCKS, 0);
        let mut surfaces = BlockSurfaces::new();
        for (b, (rays, hits)) in work.current.blocks.iter().zip(&work.hits).enumerate() {
            if !surfaces.look_up(context, rays, hits, true) {
                continue;
            }
            let hit = (0..LANES).fold(0u16, |m, l| m | ((hits.prim[l] != NO_HIT) as u16) << l);
            let (shading, _) = surfaces.rows();
            for lane in 0..LANES {
                let pale = shading.opacity[lane] < OPAQUE;
                stats.opacity_ignored += (pale && hit >> lane & 1 != 0) as u64;
            }
            self.points[b] = PointBlock::of_surfaces(&surfaces, rays, hits, hit, context.viewer);
            let (at, radiance) = (&mut self.points[b], &mut self.radiance[b]);
            let instances = at.instance;
            by_material(context, &instances, hit, |material, lanes| {
                let unlit = material.model == SurfaceModel::Unlit;
                if unlit {
                    at.lit &= !lanes;
                }
                let emission = Vec3::from(material.emission);
                if unlit || emission != Vec3::ZERO {
                    for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                        let own = if unlit { at.color.get(lane) } else { Vec3::ZERO };
                        radiance.set(lane, own + emission);
                    }
                }
            });
            self.hit[b] = hit;
        }
    }

    /// Adds the light that arrives from light `number`.
    fn add_light(
        &mut self,
        context: &FrameContext<'_>,
        number: usize,
        few: &mut LightRays,
        mut cost: Option<&mut [f32]>,
        stats: &mut RayStats,
    ) {
        let (light, sampling) = (&context.lights[number], context.light_sampling[number]);
        // Whatever is between the eye and such a light hides the point from the eye.
        let traced = sampling.traced && !light.follows_camera_rays;
        self.rays.clear();
        self.targets.clear();
        few.clear();
        let mut arriving = LightBlock::new();
        for b in 0..self.points.len() {
            if self.hit[b] == 0 {
                continue;
            }
            dispatch!(
                context.level,
                simd => self.light_block(simd, context, light, traced, b, &mut arriving)
            );
            let lanes = arriving.lanes;
            if !traced || lanes == 0 {
                continue;
            }
            if let Some(cost) = cost.as_deref_mut() {
                for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                    cost[b * LANES + lane] += 1.0;
                }
            }
            if lanes.count_ones() < FULL {
                let first = (b * LANES) as u32;
                let radiance = &arriving.radiance;
                few.push_lanes(lanes, &arriving.rays, first, radiance, sampling.first_number);
                continue;
            }
            for lane in 0..LANES {
                if lanes >> lane & 1 == 0 {
                    arriving.rays.t_max[lane] = -1.0;
                }
            }
            self.rays.push(arriving.rays);
            self.targets.push(Target { block: b, lanes, radiance: arriving.radiance });
        }
        if !traced {
            return;
        }
        let radiance = &mut self.radiance;
        let counts = trace_light_rays(context, few, Coherence::Coherent, |i, light| {
            let (rows, lane) = (&mut radiance[i as usize / LANES], i as usize % LANES);
            rows.set(lane, rows.get(lane) + light);
        });
        stats.shadow += counts.rays;
        stats.shadow_blocked += counts.blocked;
        counts.add_to(stats);

        self.blocked.clear();
        self.blocked.resize(self.rays.len(), 0);
        let world = &context.scene.world;
        let all = InstanceFilter::All;
        world.occluded_stream(&self.rays, &mut self.blocked, Coherence::Coherent, all);
        dispatch!(context.level, simd => self.add_arrived(simd));
        for (target, blocked) in self.targets.iter().zip(&self.blocked) {
            stats.shadow += u64::from(target.lanes.count_ones());
            stats.shadow_blocked += u64::from((target.lanes & blocked).count_ones());
        }
    }

    /// Light at block `b`; adds it where no rays are traced.
    fn light_block<S: Simd>(
        &mut self,
        simd: S,
        context: &FrameContext<'_>,
        light: &ResolvedLight,
        traced: bool,
        b: usize,
        arriving: &mut LightBlock,
    ) {
        // Light that no surface lets through may start at its source.
        let from_light = traced.then_some(true);
        arriving.fill(simd, context, light, &self.points[b], from_light, SHADOW_ERRORS);
        if !traced {
            add(simd, arriving.lanes, &arriving.radiance, &mut self.radiance[b]);
        }
    }

    /// Adds the light of rays that nothing blocks.
    #[inline(never)]
    fn add_arrived<S: Simd>(&mut self, simd: S) {
        for (target, blocked) in self.targets.iter().zip(&self.blocked) {
            let sum = &mut self.radiance[target.block];
            add(simd, target.lanes & !blocked, &target.radiance, sum);
        }
    }

    /// Adds ambient light and writes the pixels and the layers.
    fn finish<S: Simd>(
        &mut self,
        simd: S,
        context: &FrameContext<'_>,
        area: &TileArea,
        work: &Workspace,
        out: &mut TileLayers,
        pixels: &mut [[f32; 4]],
        record: bool,
    ) {
        for (b, pixels) in pixels.chunks_exact_mut(LANES).enumerate() {
            let (rays, hits, hit) = (&work.current.blocks[b], &work.hits[b], self.hit[b]);
            let (at, sum) = (&self.points[b], &mut self.radiance[b]);
            let mut rows: [Row; 4] = [[0.0; LANES]; 4];
            if hit != u16::MAX && context.scene.background != Background::Transparent {
                fill_background(context, area, b, rays, &mut rows);
            }
            if let Some(mean) = context.irradiance.as_ref().filter(|_| hit != 0) {
                let mut ambient = Rows3::ZERO;
                ambient_block(simd, context, mean, at, &mut ambient);
                add(simd, at.lit, &ambient, sum);
            }
            merge(simd, hit, sum, &mut rows);
            if record {
                record_block(simd, context, area, b, rays, hits, out);
                out.record_normals(b, hit, |lane| at.normal.get(lane));
            }
            store_pixels(simd, &rows, pixels);
        }
    }
}

/// Adds `light` to the lanes `lanes` of `sum`.
#[inline(never)]
fn add<S: Simd>(simd: S, lanes: u16, light: &Rows3, sum: &mut Rows3) {
    simd.vectorize(
        #[inline(always)]
        || {
            let on = mask32x16::from_bitmask(simd, lanes as u64);
            let old = Vec3x16::load(simd, sum);
            old.add(Vec3x16::load(simd, light)).or_else(on, old).store(sum);
        },
    );
}
