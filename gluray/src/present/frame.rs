//! Collects the draws of a frame and decides when they must be in the framebuffer.

use crate::capture::draw::{Draw, Shading};
use crate::capture::primitives::QuadSplit;
use crate::host::config::Mode;
use crate::interpose::context::Context;
use crate::present::frame_reuse::{self, FrameReuse};
use crate::present::framebuffer_pass::CompositeMode;
use crate::present::pipelined::{self, PipelinedPresent, TracedFrame};
use crate::state::enums::*;
use crate::trace::lighting::{product, transform};
use crate::trace::overrides::RayMaterial;
use crate::trace::texturing::Image;
use crate::trace::thread_pool;
use crate::trace::{self, Layer, Prepared};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

/// A draw and the image of its texture.
pub(crate) type Pending = (Draw, Option<Arc<Image>>);

/// Before what the driver draws of which nobody knows what it does to what is there.
pub(crate) const ORDER_MATTERS: &str = "a draw of the driver's whose order matters";

/// Draws that are deferred to the end of the frame.
#[derive(Default)]
pub(crate) struct Frame {
    pending: Vec<Pending>,
    /// Images that may be reused.
    reuse: FrameReuse,
    /// The image that is shown one frame later.
    pub(crate) pipelined: PipelinedPresent,
    /// The driver drew something that commutes since the first of them.
    others: bool,
    /// True when something was traced since the last frame ended.
    traced: bool,
    /// The framebuffers and viewports of the traced draws.
    places: Vec<(u32, [i32; 4])>,
    /// The highest row that window viewports reached in the previous frame and in this one.
    tops: [i32; 2],
    /// Telemetry of the frame for the control panel and reports.
    telemetry: crate::host::panel_client::FrameTelemetry,
}

impl Frame {
    /// The driver drew lines or points whose order does not matter but for ties.
    pub(crate) fn driver_drew(&mut self) {
        self.others |= !self.pending.is_empty();
    }
}

impl Frame {
    /// A new context's scissors.
    pub(crate) fn set_initial_height(&mut self, [_, y, _, h]: [i32; 4]) {
        self.tops[0] = y.saturating_add(h);
    }

    /// The height of the window in rows. No call returns it, but some viewport reaches the top.
    pub(crate) fn window_height(&mut self, s: &crate::state::snapshot::Snapshot) -> i32 {
        let top = s.viewport[1].saturating_add(s.viewport[3]);
        if s.framebuffer != 0 {
            return top;
        }
        self.tops[1] = self.tops[1].max(top);
        self.tops[0].max(self.tops[1])
    }

    /// Peeled surfaces are traced for this frame.
    pub(crate) fn record_peeled(&mut self, frame: u64, draws: &[Pending]) {
        self.traced = true;
        self.telemetry.traced(frame, draws.iter().map(|(d, _)| d));
    }
}

impl Context {
    /// Converts the recorded immediate mode to a draw.
    pub(crate) fn end_batch(&mut self) {
        let start = Instant::now();
        self.capture.recorder.flush_ring();
        if self.capture.recorder.runs.is_empty() {
            return;
        }
        let kind = &self.split_of_batch();
        let geometry = match self.capture.recorder.take_followed_geometry(kind) {
            Some(geometry) => {
                self.capture.geometry_cache.hits += 1;
                self.capture.geometry_cache.touch(&geometry);
                geometry
            }
            None => {
                self.capture.recorder.copy_followed_vertices();
                let geometry = self.capture.geometry_cache.of_runs(
                    &self.capture.recorder.positions,
                    &self.capture.recorder.runs,
                    kind,
                );
                self.capture.recorder.remember_batch(&geometry, kind);
                geometry
            }
        };
        let attributes = Arc::new(self.capture.recorder.take_attributes(&geometry));
        let clip_from_object =
            product(&self.state.snapshot.projection, &self.state.snapshot.model_view);
        let calls = self.capture.recorder.runs.iter().map(|r| u64::from(r.times)).sum();
        self.capture.recorder.positions.clear();
        self.capture.recorder.runs.clear();
        let state = self.state.snapshot.clone();
        let in_order = matches!(
            crate::classify::rules::classify(&state, self.config.trace()),
            crate::classify::rules::Classification::TraceInOrder
        );
        self.counters.add_time("capture", start.elapsed());
        self.add(
            Draw {
                geometry,
                attributes,
                state,
                shading: Shading::Fixed,
                clip_from_object,
                calls,
                ray_material: RayMaterial::default(),
            },
            in_order,
        );
    }

    /// How the driver would split the batch's quads into triangles.
    fn split_of_batch(&mut self) -> QuadSplit {
        let s = &self.state.snapshot;
        // Lists end batches with quads before and after them.
        let all_turned = s.flat || self.capture.depth_of_lists > 0;
        let mut split =
            QuadSplit { first_provokes: s.first_vertex_provokes, all_turned, turned: Vec::new() };
        if std::mem::take(&mut self.capture.recorder.quads) && !all_turned {
            let clipped = self.state.snapshot.clips();
            let outside = |from, to| self.capture.recorder.any_position(from, to, &clipped);
            // Begin and End after Begin and End of quads is one draw for the driver.
            let (mut at, mut first) = (0, 0);
            for (i, r) in self.capture.recorder.runs.iter().enumerate() {
                let next = self.capture.recorder.runs.get(i + 1).map(|r| r.mode);
                let end = at + r.count * r.times;
                if r.mode == QUADS && next != Some(QUADS) {
                    split.find_clipped_quads(first, end, outside);
                }
                at = end;
                first = if r.mode == QUADS && next == Some(QUADS) { first } else { at };
            }
        }
        split
    }

    /// Adds a draw to the frame, or traces it at once when its order matters.
    pub(crate) fn add(&mut self, mut draw: Draw, in_order: bool) {
        self.counters.report.traced_draws += draw.calls;
        self.counters.report.triangles += draw.geometry.mesh.num_triangles() as u64;
        if draw.geometry.mesh.indices.is_empty() {
            return;
        }
        if let Some(color) = self.attributes.untracked_color
            && draw.state.color_material.is_some()
            && matches!(&draw.attributes.colors, crate::capture::draw::Values::Constant(c) if *c == color)
        {
            Arc::make_mut(&mut draw.state).color_material = None;
        }
        crate::trace::overrides::apply(&mut draw, &self.config.settings);
        if !trace::has_rays(&draw.clip_from_object) {
            // A model-view that flattens everything (a shadow on a floor): rays need the flattened
            // triangles themselves.
            self.flatten(&mut draw);
        }
        if draw.state.blend && self.config.settings.sees_through() && draw.has_full_alpha() {
            // Programs leave blending on; what lets no light through is opaque all the same.
            Arc::make_mut(&mut draw.state).blend = false;
        }
        let image = draw.state.texture.and_then(|t| {
            self.keep_errors();
            let image = self.capture.images.get(t.target, t.name, t.version);
            self.drop_errors();
            image
        });
        if in_order {
            self.trace_ordered(&draw, image);
        } else {
            let samples = |d: &Draw| d.state.samples.max(1);
            if self
                .presentation
                .frame
                .pending
                .first()
                .is_some_and(|(d, _)| samples(d) != samples(&draw))
            {
                self.flush("a draw with more or fewer samples");
            }
            self.presentation.frame.pending.push((draw, image));
        }
    }

    fn flatten(&mut self, draw: &mut Draw) {
        let m = draw.state.model_view;
        let eye = |p: &rt_core::glam::Vec3| {
            let v = transform(&m, p.to_array());
            [v[0], v[1], v[2]]
        };
        let positions: Vec<[f32; 3]> = draw.geometry.mesh.positions.iter().map(eye).collect();
        let indices = draw.geometry.mesh.indices.clone();
        // Lit where the program lit it: normals cannot be found again from a singular matrix,
        // colours are lit beforehand.
        let setup = crate::trace::lighting::LightingSetup::new(&draw.state);
        let object = &draw.geometry.mesh.positions;
        let colors = (0..object.len())
            .map(|i| setup.vertex(&draw.attributes, i, object[i].to_array()).primary[0]);
        let colors = crate::capture::draw::Values::PerVertex(colors.collect());
        Arc::make_mut(&mut draw.attributes).colors = colors;
        let mut state = (*draw.state).clone();
        state.lighting = false;
        state.model_view = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
        draw.clip_from_object = state.projection;
        draw.state = Arc::new(state);
        draw.geometry = self.capture.geometry_cache.of_indices(&positions, &indices);
    }

    /// Draws the pending draws into the framebuffer.
    pub(crate) fn flush(&mut self, before: &str) {
        if !crate::interpose::panic_guard::happened() {
            self.flush_now(before);
        }
    }

    /// The same also after a fault: what was swallowed before it.
    pub(crate) fn flush_now(&mut self, before: &str) {
        crate::interpose::panic_guard::injected("flush");
        self.end_batch();
        if self.classifier.programs.peeling.has_draws()
            && matches!(before, "glBeginQuery" | ORDER_MATTERS)
        {
            self.composite_peeled();
        }
        if self.classifier.programs.weighted.has_draws() {
            self.sum_weighted();
        }
        let pending = std::mem::take(&mut self.presentation.frame.pending);
        let others = std::mem::take(&mut self.presentation.frame.others);
        if !self.classifier.probes.draws.is_empty() {
            self.counters.count_flush(before);
            self.presentation.frame.traced = true;
            self.darken();
        }
        if pending.is_empty() {
            return;
        }
        self.presentation.frame.traced = true;
        for (d, _) in &pending {
            let place = (d.state.framebuffer, d.state.viewport);
            if !self.presentation.frame.places.contains(&place) {
                self.presentation.frame.places.push(place);
            }
        }
        self.counters.count_flush(before);
        // Contexts that never end a frame need this count, too.
        self.counters.report.textures_read = self.capture.images.read;
        self.presentation
            .frame
            .telemetry
            .traced(self.counters.report.frames + 1, pending.iter().map(|(d, _)| d));
        // What the driver drew after a traced surface wins ties with it, as LEQUAL says; what it
        // drew before loses them.
        let func = if others { LESS } else { pending[0].0.state.depth_func };
        let mut pending = pending;
        if !matches!(self.config.settings.mode, Mode::Match | Mode::Phong) {
            crate::trace::view::assign_eye_spaces(&mut pending);
        }
        let samples = pending[0].0.state.samples.max(1).cast_unsigned();
        let places =
            match crate::present::effect_image::has_samples_for(&self.config.settings, samples) {
                true => None,
                false => self.sample_places(pending.iter().map(|(d, _)| d)),
            };
        if let Some(places) = places {
            return self.flush_samples(&pending, func, &places);
        }
        if crate::present::effect_image::is_needed(&self.config.settings) {
            let config = self.config.clone();
            let settings = crate::present::effect_image::with_samples(&config.settings, samples);
            return self.draw_effect_image(&pending, func, &settings, None);
        }
        self.warn_of_samples(pending.iter().map(|(d, _)| d));
        if self.may_be_pipelined(before) {
            return self.flush_pipelined(pending, func);
        }
        if let Some(layer) = self.presentation.frame.reuse.find(&pending, &self.config) {
            return self.present_reused(pending, layer, func);
        }
        let settings = &self.config.settings;
        let drawn = frame_reuse::DrawKey::of(&pending, settings);
        let traced = thread_pool::on_pool(|| pipelined::trace(pending, settings));
        let layer = self.present_traced(traced, CompositeMode::Surface(func), None);
        self.presentation.frame.reuse.keep(drawn, &self.config, layer);
    }

    /// Warns that one ray stands for all samples of a pixel.
    fn warn_of_samples<'a>(&mut self, draws: impl Iterator<Item = &'a Draw>) {
        if let Some(n) = draws.map(|d| d.state.samples).find(|n| *n > 1) {
            self.counters.warn(format!(
                "the program has {n} samples a pixel: one ray stands for all of them, so \
                 silhouettes are not smoothed as the driver's are"
            ));
        }
    }

    /// Presents a traced layer in the framebuffer, or in one sample of each of its pixels.
    pub(crate) fn present_traced(
        &mut self,
        traced: TracedFrame,
        composite_mode: CompositeMode,
        sample: Option<u32>,
    ) -> Layer {
        self.counters.add_time("trace", traced.took);
        self.counters.add_rays("primary", traced.primary);
        self.counters.add_rays("shadow", traced.extra[0]);
        self.counters.add_rays("ambient occlusion", traced.extra[1]);
        self.counters.count_builds(traced.structures);
        self.counters.report.pixels += traced.layer.covered as u64;
        let start = Instant::now();
        if traced.layer.covered > 0 {
            self.present_sample(std::slice::from_ref(&traced.layer), composite_mode, sample);
        }
        self.counters.add_time("present", start.elapsed());
        self.recycle(traced.draws);
        traced.layer
    }

    /// Presents the image that the same draws gave before.
    fn present_reused(&mut self, draws: Vec<Pending>, layer: Layer, func: u32) {
        self.counters.report.pictures_again += 1;
        self.counters.report.pixels += layer.covered as u64;
        let start = Instant::now();
        if layer.covered > 0 {
            self.present(std::slice::from_ref(&layer), CompositeMode::Surface(func));
        }
        self.counters.add_time("present", start.elapsed());
        self.presentation.frame.reuse.put_back(layer);
        self.recycle(draws);
    }

    fn recycle(&mut self, draws: Vec<Pending>) {
        for (draw, _) in draws {
            if let Some(attributes) = Arc::into_inner(draw.attributes) {
                self.capture.recorder.recycle(attributes, &draw.geometry);
            }
        }
    }

    fn trace_ordered(&mut self, draw: &Draw, image: Option<Arc<Image>>) {
        self.presentation.frame.traced = true;
        self.counters.count_flush("in order");
        self.presentation
            .frame
            .telemetry
            .traced(self.counters.report.frames + 1, std::iter::once(draw));
        let samples = match self.sample_places([draw]) {
            Some(places) => Context::each_sample(draw, &places),
            None => {
                self.warn_of_samples(std::iter::once(draw));
                vec![(draw.clone(), None)]
            }
        };
        for (draw, sample) in samples {
            let before =
                self.presentation.frame.reuse.find_ordered(&draw, image.as_ref(), &self.config);
            if let Some(layers) = before {
                self.counters.report.pictures_again += 1;
                self.present_ordered(&draw, image.as_ref(), layers, sample);
                continue;
            }
            let start = Instant::now();
            let mut structures = crate::capture::geometry_cache::BuildCounts::default();
            let texels = image.clone();
            let (layers, rays) =
                thread_pool::on_pool(|| match Prepared::new(&draw, texels, &mut structures) {
                    Some(p) => (trace::ordered_layers(&p), p.rays.load(Relaxed)),
                    None => (Vec::new(), 0),
                });
            self.counters.add_time("trace", start.elapsed());
            self.counters.add_rays("primary", rays);
            self.counters.count_builds(structures);
            self.present_ordered(&draw, image.as_ref(), layers, sample);
        }
    }

    /// Draws the layers of a draw whose order matters, and keeps them for the next equal draw.
    fn present_ordered(
        &mut self,
        draw: &Draw,
        image: Option<&Arc<Image>>,
        layers: Vec<Layer>,
        sample: Option<u32>,
    ) {
        let start = Instant::now();
        self.counters.report.pixels += layers.iter().map(|l| l.covered as u64).sum::<u64>();
        if !layers.is_empty() {
            self.present_sample(&layers, CompositeMode::AsDrawn, sample);
        }
        self.counters.add_time("present", start.elapsed());
        self.presentation.frame.reuse.keep_ordered(draw, image, &self.config, layers);
    }

    /// Ends a frame: its image is now visible on the screen.
    pub(crate) fn frame_done(&mut self) {
        self.counters.report.frames += 1;
        self.presentation.frame.traced = false;
        self.presentation.frame.places.clear();
        if self.presentation.frame.tops[1] > 0 {
            self.presentation.frame.tops = [self.presentation.frame.tops[1], 0];
        }
        self.presentation.frame.pipelined.frame_done();
        (self.counters.report.cache_hits, self.counters.report.cache_misses) =
            (self.capture.geometry_cache.hits, self.capture.geometry_cache.misses);
        self.counters.report.textures_read = self.capture.images.read;
        self.presentation.path_tracer.frame_done();
        let fast = self.config.settings.quality == crate::host::config::Quality::Fast;
        self.classifier.programs.frame_done();
        self.capture.attribute_cache.frame_done();
        self.capture.recorder.frame_done();
        self.presentation.frame.reuse.frame_done();
        self.capture.geometry_cache.frame_done(|g| {
            if !fast {
                thread_pool::in_background(move || g.improve());
            }
            !fast
        });
        let size = [2, 3].map(|i| self.state.snapshot.viewport[i].max(0).cast_unsigned());
        self.counters.report.objects =
            self.presentation.frame.telemetry.frame_done(&self.counters.report, size);
        if let Some(problem) = self.presentation.frame.telemetry.take_problem() {
            self.counters.warn(problem);
        }
        self.apply_new_settings();
        self.counters.publish(false);
    }

    /// Applies new settings. They hold from the next frame on.
    fn apply_new_settings(&mut self) {
        let config = crate::host::config::current();
        if !Arc::ptr_eq(&config, &self.config) {
            self.config = config;
            // Classifications depend on settings.
            self.state.dirty = crate::interpose::calls::class::ALL;
            crate::interpose::symbols::arm();
        }
    }

    /// The program reads the framebuffer. This also ends a frame when something was traced for it.
    pub(crate) fn read_back(&mut self) {
        self.presentation.frame.pipelined.read();
        if self.presentation.frame.traced {
            self.frame_done();
        }
    }

    /// What was traced is cleared: a frame is over that nobody swapped or read, as in programs that
    /// draw into framebuffer objects alone.
    fn end_unswapped_frame(&mut self) {
        // Only then is the state asked for: windows have their frames when they are swapped, and to
        // ask for materials heals what Mesa holds of them (osgbillboard, osgtessellate).
        if !self.presentation.frame.pending.is_empty()
            || self.presentation.frame.places.iter().all(|(framebuffer, _)| *framebuffer == 0)
        {
            return;
        }
        self.refresh();
        let [x, y, w, h] = self.state.snapshot.scissor.unwrap_or(self.state.snapshot.viewport);
        let target = self.state.snapshot.framebuffer;
        let meets = |&(f, [a, b, c, d]): &(u32, [i32; 4])| {
            f == target && a < x + w && x < a + c && b < y + h && y < b + d
        };
        if target != 0 && self.presentation.frame.places.iter().any(meets) {
            self.frame_done();
        }
    }

    /// `glClear`. A clear of everything makes what is pending invisible; a clear of a part comes
    /// after it.
    pub(crate) fn clear(&mut self, mask: u32) -> bool {
        if self.capture.recording.is_some() {
            if let Some(r) = &mut self.capture.recording {
                r.note_driver_call(0, true, true);
            }
            return false;
        }
        if self.capture.immediate_target == crate::capture::ImmediateModeTarget::Trace {
            self.replay_to_driver("glClear between Begin and End");
            return false;
        }
        self.end_batch();
        self.classifier.programs.peeling.cleared(self.counters.report.passed_draws);
        if self.classifier.programs.weighted.has_draws() {
            self.flush("glClear");
        }
        const COLOR_AND_DEPTH: u32 = COLOR_BUFFER_BIT | DEPTH_BUFFER_BIT;
        if self.presentation.frame.traced && mask & COLOR_AND_DEPTH == COLOR_AND_DEPTH {
            self.end_unswapped_frame();
        }
        if !self.presentation.frame.pending.is_empty() || !self.classifier.probes.draws.is_empty() {
            self.refresh();
            let whole = mask & COLOR_AND_DEPTH == COLOR_AND_DEPTH
                && self.state.snapshot.scissor.is_none()
                && self.state.snapshot.color_mask
                && self.state.snapshot.depth_mask
                && self
                    .presentation
                    .frame
                    .pending
                    .iter()
                    .all(|(d, _)| d.state.framebuffer == self.state.snapshot.framebuffer);
            if whole {
                self.presentation.frame.pending.clear();
                self.classifier.probes.draws.clear();
                self.presentation.frame.others = false;
            } else {
                self.flush("glClear of a part");
            }
        }
        self.sync();
        false
    }
}
