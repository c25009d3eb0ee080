//! A tile in progress: generates rays, takes what they hit, and shades it.

use super::super::shadow::LightRayState;
use super::super::tile::{PIXELS, TileArea, TileLayers};
use super::super::wavefront::{LightRayResult, OcclusionSource, RayKind, RecordedRay};
use super::super::{
    Workspace, accumulate_radiance, add_light, generate_camera_wavefront, local, process_hits,
    spawn_rays,
};
use super::{DeferredFrame, LightHit, LightPoint, Pass, ShadingHit};
use crate::effects::Effects;
use crate::frame::Frame;
use crate::ray::{Hit, HitBlock, LANES, Ray};
use crate::ray_stats::RayStats;
use crate::surface::SurfacePoint;
use crate::volume::VolumeSample;
use glam::Vec3;

/// A tile in progress. Its pixels have slots (0..1024) along a Morton curve.
pub struct TileState {
    tile: usize,
    area: TileArea,
    layers: TileLayers,
    work: Workspace,
    stats: RayStats,
    pass: Pass,
    /// Light rays of the current wavefront.
    waiting: Vec<RecordedRay>,
    points: Vec<LightPoint>,
    /// For each point of the wavefront, its index in `points`; `u32::MAX` for none.
    place: Vec<u32>,
    light_ray_states: Vec<LightRayState>,
    /// Whether the wavefront's points have received their light.
    lit: bool,
}

/// An answer that no part of this scene can have given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("an answer of tile {tile} does not fit its question: {what} {found}, expected {expected}")]
pub struct AnswerError {
    /// The tile.
    pub tile: usize,
    /// What is wrong.
    pub what: &'static str,
    /// The number found.
    pub found: u64,
    /// The number expected, or the bound that it must be below.
    pub expected: u64,
}

impl DeferredFrame<'_> {
    /// An empty tile with the number `tile`.
    pub fn tile(&self, tile: usize) -> TileState {
        let background_depth = self.context.camera.background_depth() as f32;
        TileState {
            tile,
            area: self.tiles[tile],
            layers: TileLayers::new(self.context.options.layers, background_depth, false),
            work: Workspace::default(),
            stats: RayStats::default(),
            pass: Pass::Geometry,
            waiting: Vec::new(),
            points: Vec::new(),
            place: Vec::new(),
            light_ray_states: Vec::new(),
            lit: false,
        }
    }
}

impl TileState {
    /// Number of the tile.
    pub fn number(&self) -> usize {
        self.tile
    }

    /// Rays of this tile so far, by kind.
    pub fn stats(&self) -> RayStats {
        self.stats
    }

    /// Generates camera rays.
    pub fn begin(&mut self, frame: &DeferredFrame<'_>, pass: Pass) {
        self.pass = pass;
        let first = matches!(pass, Pass::Color(0));
        self.area.sample = if let Pass::Color(sample) = pass { sample } else { 0 };
        let (work, sample) = (&mut self.work, frame.sample_of(pass));
        generate_camera_wavefront(
            &frame.context,
            &self.area,
            &mut work.current,
            sample,
            &mut self.stats,
            self.layers.cost_mut(),
        );
        if first {
            work.pixels = std::mem::take(&mut self.layers.color);
        }
        work.pixels.clear();
        work.pixels.resize(PIXELS, [0.0; 4]);
        work.behind.clear();
        work.scattered.clear();
    }

    /// Number of answers that [`TileState::process_hits`] expects: one per ray of the wavefront,
    /// whether it waits for an answer or not.
    pub fn num_rays(&self) -> usize {
        self.work.current.states.len()
    }

    /// Rays that wait for an answer, with the index of that answer and the slot of their pixel. The
    /// first wavefront of a pass has the rays of [`DeferredFrame::camera_hits`], ray k in slot
    /// k.
    pub fn rays(&self) -> impl Iterator<Item = (usize, u16, Ray)> + '_ {
        let wave = &self.work.current;
        wave.states.iter().enumerate().filter_map(|(i, state)| {
            let ray = wave.ray(i);
            (ray.t_max >= ray.t_min).then_some((i, state.slot, ray))
        })
    }

    /// In frames where [`DeferredFrame::needs_only_local_light`], takes the colours of the
    /// nearest hits, slot by slot; `None` for the background. Ends the pass.
    ///
    /// # Errors
    /// When the number of colours is not the number of slots.
    pub fn select_colors(
        &mut self,
        frame: &DeferredFrame<'_>,
        colors: &[Option<[f32; 4]>],
    ) -> Result<(), AnswerError> {
        self.expect("number of colours", colors.len(), PIXELS)?;
        let work = &mut self.work;
        work.hits.clear();
        work.hits.resize(PIXELS / LANES, HitBlock::MISS);
        let mut pixels = std::mem::take(&mut work.pixels);
        let mut no_stats = RayStats::default();
        local::light(
            &frame.context,
            &self.area,
            &mut self.layers,
            work,
            &mut pixels,
            false,
            &mut no_stats,
        );
        for (pixel, color) in pixels.iter_mut().zip(colors) {
            *pixel = color.unwrap_or(*pixel);
        }
        work.pixels = pixels;
        self.end_pass();
        Ok(())
    }

    /// Fills the geometry layers from the hits of the pixels' camera rays, slot by slot, in frames
    /// that use [`TileState::select_colors`].
    pub fn record_geometry(&mut self, hits: &[Option<ShadingHit>]) {
        for (slot, hits) in hits.iter().enumerate().take(PIXELS) {
            if let Some(m) = hits {
                self.layers.record_given(
                    slot as u16,
                    [m.depth, m.distance],
                    m.surface.normal,
                    [m.instance, m.primitive],
                );
            }
        }
    }

    /// Sets what each ray of the wavefront collects in the volumes up to its hit, before
    /// [`TileState::process_hits`]. Without this call, the frame's own volumes are integrated.
    ///
    /// # Errors
    /// When the number of answers is not the number of rays.
    pub fn set_volume_samples(&mut self, collected: Vec<VolumeSample>) -> Result<(), AnswerError> {
        self.expect("number of crossings", collected.len(), self.num_rays())?;
        self.work.volume_samples = collected;
        Ok(())
    }

    /// Takes the first hit of each ray of the wavefront.
    ///
    /// # Errors
    /// When the answers do not fit the wavefront.
    pub fn process_hits(
        &mut self,
        frame: &DeferredFrame<'_>,
        hits: &[Option<ShadingHit>],
    ) -> Result<(), AnswerError> {
        self.expect("number of answers", hits.len(), self.num_rays())?;
        let instances = frame.context.instances.len();
        self.work.hits.clear();
        self.work.hits.resize(hits.len().div_ceil(LANES), HitBlock::MISS);
        self.work.surfaces.clear();
        for (i, m) in hits.iter().enumerate() {
            let Some(m) = m else {
                self.work.surfaces.push(NO_SURFACE);
                continue;
            };
            if m.instance as usize >= instances {
                return Err(self.wrong("an instance", m.instance as u64, instances as u64));
            }
            let hit = Hit { t: m.t, u: 0.0, v: 0.0, prim: m.primitive, instance: m.instance };
            self.work.hits[i / LANES].set(i % LANES, Some(hit));
            self.work.surfaces.push(m.surface);
        }
        if frame.records_geometry(self.pass) {
            self.record_wave(frame, hits);
        }
        if self.pass == Pass::Geometry {
            return Ok(());
        }
        let stats = &mut self.stats;
        process_hits(&frame.context, &self.area, &mut self.layers, &mut self.work, false, stats);
        self.work.volume_samples.clear();
        self.find_light_rays(frame);
        Ok(())
    }

    /// Records the geometry layers of first surfaces. In a separate geometry pass, rays continue
    /// behind surfaces that are too transparent.
    fn record_wave(&mut self, frame: &DeferredFrame<'_>, hits: &[Option<ShadingHit>]) {
        let transparent = frame.context.effects.contains(Effects::TRANSPARENCY);
        for (i, m) in hits.iter().enumerate() {
            let state = self.work.current.states[i];
            let Some(m) = m.as_ref().filter(|_| state.kind == RayKind::Camera) else { continue };
            let s = &m.surface;
            let shown = s.opacity > 0.0 && s.opacity >= frame.context.options.depth_min_opacity;
            if !transparent || shown {
                if !self.layers.is_recorded(state.slot) {
                    self.layers.record_given(
                        state.slot,
                        [m.depth, m.distance],
                        s.normal,
                        [m.instance, m.primitive],
                    );
                }
            } else if self.pass == Pass::Geometry {
                let ray = self.work.current.ray(i);
                let ray = Ray { t_min: s.t_behind(&ray, m.t), ..ray };
                if ray.is_valid() {
                    self.work.behind.push(&ray, state);
                    self.stats.transparency += 1;
                }
            }
        }
    }

    // ---- Light ----------------------------------------------------------------------------------
    /// Runs the lights once to find the rays that they would send.
    fn find_light_rays(&mut self, frame: &DeferredFrame<'_>) {
        let before: Vec<Vec3> = self.work.points.iter().map(|p| p.radiance).collect();
        self.work.light_rays.source = OcclusionSource::Recording(std::mem::take(&mut self.waiting));
        let mut no_stats = RayStats::default();
        add_light(&frame.context, &self.area, &mut self.work, &mut no_stats, None);
        for (p, radiance) in self.work.points.iter_mut().zip(before) {
            p.radiance = radiance;
        }
        if let OcclusionSource::Recording(list) = std::mem::take(&mut self.work.light_rays.source) {
            self.waiting = list;
        }
        self.points.clear();
        self.light_ray_states.clear();
        self.lit = false;
        if frame.light_passes_surfaces() {
            let start = |r: &RecordedRay| LightRayState::new(&frame.context, r.radiance);
            self.light_ray_states.extend(self.waiting.iter().map(start));
            return;
        }
        self.place.clear();
        self.place.resize(self.work.points.len(), u32::MAX);
        for r in &self.waiting {
            let place = &mut self.place[r.point as usize];
            if *place == u32::MAX {
                *place = self.points.len() as u32;
                let p = &self.work.points[r.point as usize];
                let state = &self.work.current.states[p.lane as usize];
                let s = &p.surface;
                self.points.push(LightPoint {
                    pixel: self.area.pixel(state.slot).unwrap_or_default(),
                    lamps: false,
                    sky: false,
                    stream: state.stream,
                    point: s.point,
                    point_error: s.point_error,
                    face_normal: s.face_normal,
                    normal: s.normal,
                });
            }
            let p = &mut self.points[*place as usize];
            let sky = r.number >= frame.context.sky_number;
            (p.lamps, p.sky) = (p.lamps | !sky, p.sky | sky);
        }
    }

    /// Points whose light is requested, where light does not pass through surfaces.
    pub fn light_points(&self) -> &[LightPoint] {
        &self.points
    }

    /// For each of [`TileState::light_points`], the slot of its pixel.
    pub fn slots_of_points(&self) -> impl Iterator<Item = u16> + '_ {
        let slot = |p: &LightPoint| {
            TileArea::slot(p.pixel[0] - self.area.x, p.pixel[1] - self.area.y) as u16
        };
        self.points.iter().map(slot)
    }

    /// For each light ray that matters, its point among [`TileState::light_points`] and the ray.
    /// Use them to decide which parts to ask.
    pub fn light_rays_of_points(&self) -> impl Iterator<Item = (usize, Ray)> + '_ {
        self.waiting.iter().map(|r| (self.place[r.point as usize] as usize, r.ray))
    }

    /// Takes the bits of [`DeferredFrame::occlusion_bits`] for all [`TileState::light_points`].
    /// Combine the bits of several parts by *or*.
    ///
    /// # Errors
    /// When the number of words is wrong.
    pub fn apply_occlusion(
        &mut self,
        frame: &DeferredFrame<'_>,
        bits: &[u64],
    ) -> Result<(), AnswerError> {
        let words = (frame.light_rays_per_point() as usize).div_ceil(64);
        self.expect("words of light bits", bits.len(), words * self.points.len())?;
        let passage = |r: &RecordedRay| {
            let first = self.place[r.point as usize] as usize * words;
            let hit = bits[first + r.number as usize / 64] >> (r.number % 64) & 1 != 0;
            LightRayResult {
                transmittance: if hit { Vec3::ZERO } else { Vec3::ONE },
                hit,
                continued: 0,
            }
        };
        let given: Vec<LightRayResult> = self.waiting.iter().map(passage).collect();
        self.add_light(frame, given);
        Ok(())
    }

    /// Light rays that wait for the next surface along them, where light passes through surfaces.
    pub fn light_rays(&self) -> impl Iterator<Item = Ray> + '_ {
        self.waiting.iter().map(|r| r.ray).filter(|r| r.t_max >= r.t_min)
    }

    /// Takes the answer of [`DeferredFrame::light_hits`] to each of [`TileState::light_rays`]; of
    /// several parts, [`LightHit::Blocked`] before all others, else the closest hit.
    ///
    /// # Errors
    /// When the answers do not fit the rays.
    pub fn process_light_hits(
        &mut self,
        frame: &DeferredFrame<'_>,
        hits: &[Option<LightHit>],
    ) -> Result<(), AnswerError> {
        self.expect("number of answers", hits.len(), self.light_rays().count())?;
        let instances = &frame.context.instances;
        for hit in hits {
            if let Some(LightHit::Surface(m)) = hit
                && m.instance as usize >= instances.len()
            {
                return Err(self.wrong("an instance", m.instance as u64, instances.len() as u64));
            }
        }
        let mut answers = hits.iter();
        for (r, f) in self.waiting.iter_mut().zip(&mut self.light_ray_states) {
            if r.ray.t_max < r.ray.t_min {
                continue;
            }
            let behind = match answers.next() {
                Some(Some(LightHit::Blocked)) => {
                    *f = LightRayState::BLOCKED;
                    None
                }
                Some(Some(LightHit::Surface(m))) => {
                    self.stats.light_closest += 1;
                    self.stats.light_lookups += 1;
                    let material = instances[m.instance as usize].material;
                    f.pass(&frame.context, material, &m.surface, &r.ray, m.t)
                }
                _ => {
                    self.stats.light_closest += 1;
                    None
                }
            };
            match behind {
                Some(t_min) => r.ray.t_min = t_min,
                None => (r.ray.t_min, r.ray.t_max) = (0.0, -1.0),
            }
        }
        Ok(())
    }

    fn add_light(&mut self, frame: &DeferredFrame<'_>, given: Vec<LightRayResult>) {
        self.waiting.clear();
        self.work.light_rays.source = OcclusionSource::Given(given.into_iter());
        let cost = self.layers.cost_mut();
        add_light(&frame.context, &self.area, &mut self.work, &mut self.stats, cost);
        self.work.light_rays.source = OcclusionSource::World;
        self.points.clear();
        self.light_ray_states.clear();
        self.lit = true;
    }

    /// Shades the wavefront. Returns true when there is another one; otherwise the pass is
    /// finished.
    pub fn advance(&mut self, frame: &DeferredFrame<'_>) -> bool {
        if self.pass == Pass::Geometry {
            self.work.surfaces.clear();
            std::mem::swap(&mut self.work.current, &mut self.work.behind);
            self.work.behind.clear();
            return !self.work.current.is_empty();
        }
        if !self.lit {
            let given = self.light_ray_states.iter().map(LightRayState::result).collect();
            self.add_light(frame, given);
        }
        let (context, work, stats) = (&frame.context, &mut self.work, &mut self.stats);
        accumulate_radiance(context, &self.area, work);
        spawn_rays(context, &self.area, &mut self.layers, work, stats);
        work.surfaces.clear();
        let next = if work.behind.is_empty() { &mut work.scattered } else { &mut work.behind };
        if next.is_empty() {
            self.end_pass();
            return false;
        }
        std::mem::swap(&mut work.current, next);
        next.clear();
        true
    }

    fn end_pass(&mut self) {
        self.work.current.clear();
        if self.pass == Pass::Color(0) {
            self.layers.start_samples(std::mem::take(&mut self.work.pixels));
        } else {
            self.layers.add_sample(&self.work.pixels);
        }
    }

    // ---- The result -----------------------------------------------------------------------------
    /// The finished tile as an image: the requested layers of the pixels in
    /// [`DeferredFrame::tile_area`].
    pub fn image(&self, frame: &DeferredFrame<'_>) -> Frame {
        let TileArea { width, height, .. } = self.area;
        let scale = 1.0 / frame.context.options.samples as f32;
        let slots: Vec<usize> =
            (0..height).flat_map(|y| (0..width).map(move |x| TileArea::slot(x, y))).collect();
        // Layers that were not requested are empty.
        fn plane<T: Copy>(layer: &[T], slots: &[usize]) -> Vec<T> {
            slots.iter().filter_map(|slot| layer.get(*slot).copied()).collect()
        }
        let l = &self.layers;
        let mut color = plane(&l.color, &slots);
        color.as_flattened_mut().iter_mut().for_each(|v| *v *= scale);
        Frame {
            width,
            height,
            color,
            depth: plane(&l.depth, &slots),
            distance: plane(&l.distance, &slots),
            normal: plane(&l.normal, &slots),
            instance: plane(&l.instance, &slots),
            primitive: plane(&l.primitive, &slots),
            cost: plane(&l.cost, &slots),
        }
    }

    fn wrong(&self, what: &'static str, found: u64, expected: u64) -> AnswerError {
        AnswerError { tile: self.tile, what, found, expected }
    }

    fn expect(&self, what: &'static str, found: usize, expected: usize) -> Result<(), AnswerError> {
        if found == expected {
            Ok(())
        } else {
            Err(self.wrong(what, found as u64, expected as u64))
        }
    }
}

/// Stands for the surface of a ray that hit nothing.
const NO_SURFACE: SurfacePoint = SurfacePoint {
    point: Vec3::ZERO,
    point_error: 0.0,
    face_normal: Vec3::Z,
    normal: Vec3::Z,
    outside: true,
    color: Vec3::ZERO,
    opacity: 0.0,
};
