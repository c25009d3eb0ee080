//! Traces the rays of a frame in its scene, or in a part of it: hits with their surfaces.

use super::super::direct::{LightSampling, incident_from, light_point, shadow_ray};
use super::super::hemisphere::{Hemisphere, HemisphereSamples, OcclusionPoint, directions};
use super::super::tile::{PIXELS, TileArea};
use super::super::wavefront::{LightRays, OcclusionSource};
use super::super::{SampleDimension, Workspace, generate_camera_rays, local, prefetch_surfaces};
use super::{DeferredFrame, LightHit, LightPoint, Pass, ShadingHit};
use crate::bvh::{Coherence, InstanceFilter};
use crate::frame::Layers;
use crate::ray::{Hit, HitBlock, LANES, NO_HIT, Ray, RayBlock};
use crate::ray_stats::RayStats;
use crate::shade::TileLayers;
use fearless_simd::dispatch;
use glam::Vec3;

/// Camera rays of one tile and their hits in this world.
#[derive(Default)]
pub struct CameraHits {
    work: Workspace,
    area: Option<TileArea>,
    rays: u64,
}

impl CameraHits {
    /// Rays traced.
    pub fn rays(&self) -> u64 {
        self.rays
    }

    /// The hit of the pixel in slot `slot` (0..1024, see [`TileState`](super::TileState)).
    pub fn get(&self, slot: usize) -> Option<Hit> {
        self.work.hits.get(slot / LANES)?.get(slot % LANES)
    }

    /// Sixteen bits for every sixteen slots: set where there is a hit.
    pub fn mask(&self) -> impl Iterator<Item = u16> + '_ {
        let bits =
            |h: &HitBlock| (0..LANES).fold(0u16, |m, l| m | ((h.prim[l] != NO_HIT) as u16) << l);
        self.work.hits.iter().map(bits)
    }

    /// Colours of all slots with a hit, in frames where
    /// [`DeferredFrame::needs_only_local_light`].
    pub fn colors(&mut self, frame: &DeferredFrame<'_>) -> &[[f32; 4]] {
        let Some(area) = self.area else { return &[] };
        let mut pixels = std::mem::take(&mut self.work.pixels);
        pixels.clear();
        pixels.resize(PIXELS, [0.0; 4]);
        let mut layers = TileLayers::new(Layers::COLOR, 0.0, false);
        let mut stats = RayStats::default();
        local::light(
            &frame.context,
            &area,
            &mut layers,
            &self.work,
            &mut pixels,
            false,
            &mut stats,
        );
        self.work.pixels = pixels;
        &self.work.pixels
    }

    /// The complete hit in slot `slot`.
    pub fn shading_hit(&self, frame: &DeferredFrame<'_>, slot: usize) -> Option<ShadingHit> {
        let (area, hit) = (self.area?, self.get(slot)?);
        let ray = self.work.current.blocks[slot / LANES].get(slot % LANES);
        let mut shading_hit = frame.shading_hit(&ray, &hit);
        let layers = frame.context.options.layers;
        if layers.intersects(Layers::DEPTH | Layers::DISTANCE) {
            (shading_hit.depth, shading_hit.distance) =
                frame.depth_and_distance(&area, slot as u16, &ray, &hit);
        }
        Some(shading_hit)
    }
}

/// Scratch memory of [`DeferredFrame::occlusion_bits`].
#[derive(Default)]
pub struct OcclusionScratch {
    rays: LightRays,
    open: Vec<OcclusionPoint>,
    hemisphere_samples: HemisphereSamples,
    /// Rays traced so far.
    pub traced: u64,
}

/// Light rays that are traced together.
const BATCH_RAYS: usize = 4096;

impl DeferredFrame<'_> {
    /// Hits of the camera rays of tile `tile` in this world.
    pub fn camera_hits(&self, tile: usize, pass: Pass, out: &mut CameraHits) {
        let mut area = self.tiles[tile];
        area.sample = if let Pass::Color(sample) = pass { sample } else { 0 };
        let (sample, mut stats) = (self.sample_of(pass), RayStats::default());
        let work = &mut out.work;
        generate_camera_rays(
            &self.context,
            &area,
            &mut work.current.blocks,
            sample,
            &mut stats,
            None,
        );
        work.hits.resize(PIXELS / LANES, HitBlock::MISS);
        let world = &self.context.scene.world;
        world.closest_stream(
            &work.current.blocks,
            &mut work.hits,
            Coherence::Coherent,
            InstanceFilter::All,
        );
        prefetch_surfaces(&self.context, &work.hits);
        (out.area, out.rays) = (Some(area), stats.primary);
    }

    fn shading_hit(&self, ray: &Ray, hit: &Hit) -> ShadingHit {
        let surface = self.context.surface(ray, hit);
        let (instance, primitive) = (hit.instance, hit.prim);
        ShadingHit { t: hit.t, instance, primitive, depth: 0.0, distance: 0.0, surface }
    }

    fn depth_and_distance(&self, area: &TileArea, slot: u16, ray: &Ray, hit: &Hit) -> (f32, f32) {
        let [x, y] = area.pixel(slot).unwrap_or_default();
        self.context.depth_and_distance(self.context.ndc(x, y, [0.5; 2]), ray, hit)
    }

    /// Hits of rays of any kind in this world, one answer each. Neighbouring rays should be
    /// similar. With `pixels` (tile and slot of each, for camera rays of a pass that fills geometry
    /// layers) the answers have depth and distance.
    pub fn closest(
        &self,
        rays: &[Ray],
        pixels: Option<&[(u32, u16)]>,
        out: &mut Vec<Option<ShadingHit>>,
    ) {
        let blocks = RayBlock::from_rays(rays);
        let mut hits = vec![HitBlock::MISS; blocks.len()];
        let world = &self.context.scene.world;
        world.closest_stream(&blocks, &mut hits, Coherence::Incoherent, InstanceFilter::All);
        out.clear();
        for (i, ray) in rays.iter().enumerate() {
            let answer = hits[i / LANES].get(i % LANES).map(|hit| {
                let mut shading_hit = self.shading_hit(ray, &hit);
                let place =
                    pixels.and_then(|p| p.get(i)).map(|&(t, s)| (self.tiles.get(t as usize), s));
                if let Some((Some(area), slot)) = place {
                    (shading_hit.depth, shading_hit.distance) =
                        self.depth_and_distance(area, slot, ray, &hit);
                }
                shading_hit
            });
            out.push(answer);
        }
    }

    /// What light rays hit in this world, one answer each. Only the closest hit counts among those
    /// of several parts, and [`LightHit::Blocked`] before all others.
    pub fn light_hits(&self, rays: &[Ray], out: &mut Vec<Option<LightHit>>) {
        let mut blocks = RayBlock::from_rays(rays);
        let (world, marks) = (&self.context.scene.world, self.context.transmissive.as_slice());
        let mut ended = vec![0u16; blocks.len()];
        if marks.contains(&false) {
            let filter = InstanceFilter::Unmarked(marks);
            world.occluded_stream(&blocks, &mut ended, Coherence::Incoherent, filter);
        }
        for (block, &ended) in blocks.iter_mut().zip(&ended) {
            for lane in (0..LANES).filter(|l| ended >> l & 1 != 0) {
                block.t_max[lane] = -1.0;
            }
        }
        let mut hits = vec![HitBlock::MISS; blocks.len()];
        world.closest_stream(
            &blocks,
            &mut hits,
            Coherence::Incoherent,
            InstanceFilter::Marked(marks),
        );
        let answer = |(i, ray): (usize, &Ray)| {
            let (block, lane) = (i / LANES, i % LANES);
            if ended[block] >> lane & 1 != 0 {
                return Some(LightHit::Blocked);
            }
            let hit = hits[block].get(lane)?;
            Some(LightHit::Surface(self.shading_hit(ray, &hit)))
        };
        out.clear();
        out.extend(rays.iter().enumerate().map(answer));
    }

    /// For every light ray of every point, whether this world blocks it:
    /// [`DeferredFrame::light_rays_per_point`] bits per point, in whole 64-bit words, the lowest
    /// bit first. Rays that no material could need may be left out; their bits are 0.
    pub fn occlusion_bits(
        &self,
        points: &[LightPoint],
        pass: Pass,
        work: &mut OcclusionScratch,
        out: &mut Vec<u64>,
    ) {
        let words = (self.light_rays_per_point() as usize).div_ceil(64);
        out.clear();
        out.resize(words * points.len(), 0);
        let sample = if let Pass::Color(sample) = pass { sample } else { 0 };
        // Ray numbers are kept for all sources but the world itself.
        work.rays.source = OcclusionSource::Recording(Vec::new());
        let most = self.light_rays_per_point().max(1) as usize;
        let per_batch = (BATCH_RAYS / most).max(1);
        for (batch, out) in points.chunks(per_batch).zip(out.chunks_mut(per_batch * words)) {
            for (number, light_sampling) in
                self.context.light_sampling.iter().enumerate().filter(|(_, s)| s.traced)
            {
                self.push_light_rays(batch, sample, number, light_sampling, &mut work.rays);
                self.trace_into_bits(true, work, words, out);
            }
            if self.sky_rays() > 0 {
                self.push_ambient_rays(batch, sample, work);
                self.trace_into_bits(false, work, words, out);
            }
        }
    }

    fn push_light_rays(
        &self,
        points: &[LightPoint],
        sample: u32,
        number: usize,
        s: &LightSampling,
        rays: &mut LightRays,
    ) {
        let light = &self.context.lights[number];
        rays.clear();
        for (i, p) in points.iter().enumerate().filter(|(_, p)| p.lamps) {
            let sampler = self.context.sampler(p.pixel[0], p.pixel[1], sample);
            let surface = p.surface();
            for k in 0..s.count {
                let at = s.spread.then(|| light_point(&sampler, p.stream, number, k, s.count));
                let incident = incident_from(light, p.point, at);
                // No material reflects light that comes from behind its shading normal.
                if incident.strength <= 0.0 || p.normal.dot(incident.dir) <= 0.0 {
                    continue;
                }
                let ray = shadow_ray(&surface, &incident, !s.spread);
                rays.push(&ray, i as u32, Vec3::ZERO, s.first_number + k);
            }
        }
    }

    fn push_ambient_rays(&self, points: &[LightPoint], sample: u32, work: &mut OcclusionScratch) {
        let Some(ao) = self.context.scene.ambient_occlusion else { return };
        let OcclusionScratch { rays, open, hemisphere_samples, .. } = work;
        rays.clear();
        open.clear();
        open.extend(points.iter().enumerate().filter(|(_, p)| p.sky).map(|(i, p)| {
            OcclusionPoint {
                index: i as u32,
                light: Vec3::ZERO,
                sampler: self.context.sampler(p.pixel[0], p.pixel[1], sample),
                dimension: p.stream.wrapping_add(SampleDimension::AMBIENT_OCCLUSION),
            }
        }));
        dispatch!(
            self.context.level,
            simd => directions(simd, &self.context, open, ao.rays, hemisphere_samples)
        );
        let mut direction = 0;
        for o in open.iter() {
            let over = Hemisphere::new(&points[o.index as usize].surface());
            for k in 0..ao.rays {
                if let Some(ray) = over.ray(hemisphere_samples, direction, ao.distance) {
                    rays.push(&ray, o.index, Vec3::ZERO, self.context.sky_number + k);
                }
                direction += 1;
            }
        }
    }

    fn trace_into_bits(
        &self,
        coherent: bool,
        work: &mut OcclusionScratch,
        words: usize,
        out: &mut [u64],
    ) {
        let rays = &mut work.rays;
        work.traced += rays.targets.len() as u64;
        rays.blocked.clear();
        rays.blocked.resize(rays.blocks.len(), 0);
        let world = &self.context.scene.world;
        let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
        world.occluded_stream(&rays.blocks, &mut rays.blocked, coherence, InstanceFilter::All);
        for (i, (point, number)) in rays.numbered().enumerate() {
            let bit = rays.is_blocked(i) as u64;
            out[point as usize * words + number as usize / 64] |= bit << (number % 64);
        }
    }
}
