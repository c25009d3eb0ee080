//! Pending draws are traced and presented: what each kind of draw needs, and in which order.

use crate::capture::draw::{Draw, TexturedDraw};
use crate::capture::geometry_cache::BuildCounts;
use crate::classify::affine_probe::factor_settings;
use crate::driver::gl;
use crate::enums::*;
use crate::host::config::{Mode, Settings};
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::interpose::kept_errors::KeptErrors;
use crate::present::effect_image;
use crate::present::frame_reuse::DrawKey;
use crate::present::framebuffer_pass::{self, CompositeMode};
use crate::present::multisample;
use crate::present::pipelined::{self, TracedFrame};
use crate::trace::texturing::Image;
use crate::trace::view::assign_eye_spaces;
use crate::trace::{self, Layer, Prepared, WeightedSums, thread_pool};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

/// The reason in the report when the driver has refused a shader after draws were kept from it.
const LOST: &str = "the driver refuses our shader: what was traced is lost";

impl Context {
    /// Draws the pending draws into the framebuffer.
    pub(crate) fn flush(&mut self, reason: FlushReason) {
        if !crate::faults::happened() {
            self.flush_now(reason);
        }
    }

    /// The same also after a fault: what was kept from the driver before it.
    pub(crate) fn flush_now(&mut self, reason: FlushReason) {
        crate::faults::injected("flush");
        self.end_batch();
        if self.classifier.programs.peeling.has_draws() && reason.may_gather_layers() {
            self.composite_peeled();
        }
        if self.classifier.programs.weighted.has_draws() {
            self.sum_weighted();
        }
        let (pending, func) = self.presentation.frame.take_pending();
        if self.classifier.probes.has_draws() {
            self.counters.count_flush(reason.text());
            self.presentation.frame.mark_traced();
            self.darken();
        }
        if pending.is_empty() {
            return;
        }
        self.counters.count_flush(reason.text());
        // Contexts that never end a frame need this count, too.
        self.counters.report.textures_read = self.capture.textures.read;
        self.presentation.frame.record_traced(self.counters.report.frames + 1, &pending);
        self.trace_pending(pending, func, reason);
    }

    /// Traces pending draws in the way of the mode, and presents them with the depth function
    /// `func`.
    fn trace_pending(&mut self, mut pending: Vec<TexturedDraw>, func: u32, reason: FlushReason) {
        let config = self.config.clone();
        let settings = &config.settings;
        if !matches!(settings.mode, Mode::Match | Mode::Phong) {
            assign_eye_spaces(&mut pending);
        }
        let samples = pending[0].0.state.samples.max(1).cast_unsigned();
        let places = match effect_image::has_samples_for(settings, samples) {
            true => None,
            false => self.sample_places(pending.iter().map(|(d, _)| d)),
        };
        if let Some(places) = places {
            return self.present_samples(&pending, func, &places);
        }
        if effect_image::is_needed(settings) {
            let settings = effect_image::with_samples(settings, samples);
            return self.present_effect_image(&pending, func, &settings, None);
        }
        self.warn_of_samples(pending.iter().map(|(d, _)| d));
        if self.may_be_pipelined(reason) {
            return self.present_pipelined(pending, func);
        }
        if let Some(layer) = self.presentation.frame.reuse.find(&pending, &config) {
            return self.present_reused(pending, layer, func);
        }
        let drawn = DrawKey::of(&pending, settings);
        let traced = thread_pool::on_pool(|| pipelined::trace(pending, settings));
        let layer = self.present_traced(traced, CompositeMode::Surface(func), None);
        self.presentation.frame.reuse.keep(drawn, &config, layer);
    }

    // ---- The nearest surfaces -------------------------------------------------------------------
    /// Presents a traced layer in the framebuffer, or in one sample of each of its pixels.
    fn present_traced(
        &mut self,
        traced: TracedFrame,
        composite_mode: CompositeMode,
        sample: Option<u32>,
    ) -> Layer {
        self.counters.add_time("trace", traced.took);
        let [shadow, occlusion] = traced.extra;
        self.counters.add_rays_of_modes([traced.primary, shadow, occlusion]);
        self.counters.count_builds(traced.structures);
        self.counters.report.pixels += traced.layer.covered as u64;
        let (covered, presented) = (traced.layer.covered, traced.layer.depth.len());
        let built = traced.structures.triangles;
        self.routing.traced_set(traced.searched, covered, presented, built);
        let start = Instant::now();
        if traced.layer.covered > 0 {
            self.present(std::slice::from_ref(&traced.layer), composite_mode, sample);
        }
        self.counters.add_time("present", start.elapsed());
        self.capture.recycle(traced.draws);
        traced.layer
    }

    /// Presents the image that the same draws gave before.
    fn present_reused(&mut self, draws: Vec<TexturedDraw>, layer: Layer, func: u32) {
        self.counters.report.pictures_again += 1;
        self.counters.report.pixels += layer.covered as u64;
        self.routing.traced_set(0, layer.covered, layer.depth.len(), 0);
        let start = Instant::now();
        if layer.covered > 0 {
            self.present(std::slice::from_ref(&layer), CompositeMode::Surface(func), None);
        }
        self.counters.add_time("present", start.elapsed());
        self.presentation.frame.reuse.put_back(layer);
        self.capture.recycle(draws);
    }

    /// True when the pending draws may be shown in the next frame.
    fn may_be_pipelined(&self, reason: FlushReason) -> bool {
        self.config.settings.asynchronous
            && self.presentation.frame.pipelined.is_allowed()
            && self.state.snapshot.framebuffer == 0
            && !reason.reads_pixels()
            && !thread_pool::forked()
    }

    /// Starts tracing `draws` and presents the result of the last frame.
    fn present_pipelined(&mut self, draws: Vec<TexturedDraw>, func: u32) {
        let settings = self.config.settings.clone();
        let start = Instant::now();
        let shown = self.presentation.frame.pipelined.exchange(draws, settings);
        self.counters.add_time("wait", start.elapsed());
        if let Some(traced) = shown {
            drop(self.present_traced(traced, CompositeMode::Surface(func), None));
        }
    }

    // ---- Samples --------------------------------------------------------------------------------
    /// The sample positions of the framebuffer of `draws`, relative to the pixel centre. `None` for
    /// a single sample, and where samples cannot be written separately.
    fn sample_places<'a>(
        &mut self,
        draws: impl IntoIterator<Item = &'a Draw>,
    ) -> Option<Vec<[f32; 2]>> {
        let samples = multisample::separate_samples(draws, &self.capabilities)?;
        Some(self.errors.hiding(|| multisample::places(samples)))
    }

    /// Traces the pending draws for each sample separately.
    fn present_samples(&mut self, pending: &[TexturedDraw], func: u32, places: &[[f32; 2]]) {
        // The samples already provide the requested number of rays.
        let settings = &Settings { samples: 1, ..self.config.settings.clone() };
        for (i, place) in places.iter().enumerate() {
            let sample = Some(i as u32);
            let moved = |(d, image): &TexturedDraw| (multisample::moved(d, *place), image.clone());
            let draws: Vec<TexturedDraw> = pending.iter().map(moved).collect();
            if effect_image::is_needed(settings) {
                self.present_effect_image(&draws, func, settings, sample);
                continue;
            }
            let traced = thread_pool::on_pool(|| pipelined::trace(draws, settings));
            self.present_traced(traced, CompositeMode::Surface(func), sample);
        }
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

    // ---- Images of more than the nearest surfaces -----------------------------------------------
    /// Draws the pending draws as an image, or into one sample of each pixel.
    fn present_effect_image(
        &mut self,
        pending: &[TexturedDraw],
        func: u32,
        settings: &Settings,
        sample: Option<u32>,
    ) {
        let start = Instant::now();
        let [r, g, b, _] = self.errors.hiding(|| gl::floats::<4>(COLOR_CLEAR_VALUE));
        let path_tracer = &mut self.presentation.path_tracer;
        let traced = effect_image::trace(pending, settings, [r, g, b], path_tracer);
        self.counters.add_time("trace", start.elapsed());
        self.counters.add_rays("primary", traced.primary);
        self.counters.count_builds(traced.structures);
        traced.warnings.into_iter().for_each(|w| self.counters.warn(w));
        for image in traced.images {
            let start = Instant::now();
            image.rays().iter().for_each(|(kind, n)| self.counters.add_rays(kind, *n));
            for (layer, composite_mode) in image.layers(func) {
                self.counters.report.pixels += layer.covered as u64;
                if layer.covered > 0 {
                    self.present(&[layer], composite_mode, sample);
                }
            }
            self.counters.add_time("present", start.elapsed());
        }
    }

    /// Makes what the driver drew darker where rays find corners and shadows.
    fn darken(&mut self) {
        let draws = self.classifier.probes.take_draws();
        if draws.is_empty() {
            return;
        }
        let start = Instant::now();
        let settings = factor_settings(&self.config.settings);
        let darkening = effect_image::trace_darkening(&draws, &settings);
        self.counters.add_time("trace", start.elapsed());
        self.counters.count_builds(darkening.structures);
        self.counters.add_rays_of_modes(darkening.rays);
        let start = Instant::now();
        for layer in darkening.layers.into_iter().filter(|l| l.covered > 0) {
            self.counters.report.pixels += layer.covered as u64;
            self.present(&[layer], CompositeMode::Multiply, None);
        }
        self.counters.add_time("present", start.elapsed());
    }

    // ---- Draws whose order matters --------------------------------------------------------------
    pub(super) fn trace_ordered(&mut self, draw: &Draw, image: Option<Arc<Image>>) {
        let frame = self.counters.report.frames + 1;
        self.counters.count_flush("in order");
        self.presentation.frame.record_ordered(frame, draw);
        let samples = match self.sample_places([draw]) {
            Some(places) => multisample::each_sample(draw, &places),
            None => {
                self.warn_of_samples(std::iter::once(draw));
                vec![(draw.clone(), None)]
            }
        };
        for (draw, sample) in samples {
            let reuse = &mut self.presentation.frame.reuse;
            if let Some(layers) = reuse.find_ordered(&draw, image.as_ref(), &self.config) {
                self.counters.report.pictures_again += 1;
                self.present_ordered(&draw, image.as_ref(), layers, sample);
                continue;
            }
            let start = Instant::now();
            let mut structures = BuildCounts::default();
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
            self.present(&layers, CompositeMode::AsDrawn, sample);
        }
        self.counters.add_time("present", start.elapsed());
        self.presentation.frame.reuse.keep_ordered(draw, image, &self.config, layers);
    }

    // ---- VTK's translucent surfaces -------------------------------------------------------------
    /// VTK is about to gather what its pass has peeled.
    fn composite_peeled(&mut self) {
        let (mut taken, limit) = self.classifier.programs.peeling.take_draws();
        self.refresh();
        let Some(limit) = limit else { return };
        self.presentation.frame.record_peeled(self.counters.report.frames + 1, &taken);
        self.counters.count_flush("depth peeling");
        let buffers = self.classifier.programs.peeling.gather_buffers(&self.state.snapshot);
        let Some((target, before)) = buffers else {
            self.counters.warn(
                "depth peeling did not go as VTK's does: translucent surfaces are lost".into(),
            );
            return;
        };
        let start = Instant::now();
        let settings = &self.config.settings;
        if settings.mode != Mode::Match {
            assign_eye_spaces(&mut taken);
        }
        let (layer, rays, structures) =
            trace_translucent(&taken, |ready| trace::depth_sorted(ready, &limit, settings));
        self.counters.add_time("trace", start.elapsed());
        self.counters.add_rays_of_modes(rays);
        self.counters.count_builds(structures);
        self.counters.report.pixels += layer.covered as u64;
        let (hits, built) = (layer.covered, structures.triangles);
        self.routing.traced_set(layer.depth.len() as u64, hits, layer.depth.len(), built);
        let start = Instant::now();
        if layer.covered > 0 {
            gl::draw_buffers(&target);
            self.present(&[layer], CompositeMode::OverIgnoringDepth, None);
            gl::draw_buffers(&before);
        }
        self.counters.add_time("present", start.elapsed());
    }

    /// Adds the draws that VTK would sum up to the sums in the framebuffer.
    fn sum_weighted(&mut self) {
        let mut taken = self.classifier.programs.weighted.take_draws();
        self.presentation.frame.record_peeled(self.counters.report.frames + 1, &taken);
        self.counters.count_flush("translucent sums");
        let settings = &self.config.settings;
        if settings.mode != Mode::Match {
            assign_eye_spaces(&mut taken);
        }
        // As far as the viewport reaches, opaque surfaces hide what is behind them.
        let [x, y, w, h] = taken.first().map_or([0; 4], |(d, _)| d.state.viewport);
        let (width, height) = ((x + w).max(0) as usize, (y + h).max(0) as usize);
        if width * height == 0 || width * height > 1 << 26 {
            return;
        }
        let core = self.capabilities.core;
        let depth = self.errors.hiding(|| gl::depths(core, width as i32, height as i32));
        let limit = trace::DepthLimits { width, height, depth, exact: true };
        let start = Instant::now();
        let (sums, rays, structures) =
            trace_translucent(&taken, |ready| trace::weighted_sums(ready, &limit, settings));
        self.counters.add_time("trace", start.elapsed());
        self.counters.add_rays_of_modes(rays);
        self.counters.count_builds(structures);
        self.counters.report.pixels += sums.covered as u64;
        // The depths of the window are read for it.
        let pixels = width * height;
        self.routing.traced_set(pixels as u64, sums.covered, pixels, structures.triangles);
        let start = Instant::now();
        if sums.covered > 0 {
            self.with_saved_state(|c| c.add_sums(&sums));
        }
        self.counters.add_time("present", start.elapsed());
    }

    fn add_sums(&mut self, sums: &WeightedSums) {
        let vertex_array = self.presentation.presenter.vertex_array();
        if !self.classifier.programs.weighted.add_sums(sums, vertex_array) {
            self.counters.count_driver_draws(LOST, 1);
        }
    }

    // ---- Into the framebuffer -------------------------------------------------------------------
    /// Draws the layers over one another, into all samples of each pixel or into one.
    fn present(&mut self, layers: &[Layer], composite_mode: CompositeMode, sample: Option<u32>) {
        self.with_saved_state(|c| {
            let mask = sample.map(gl::only_sample);
            if !c.presentation.presenter.present(layers, composite_mode, &c.capabilities) {
                c.counters.count_driver_draws(LOST, 1);
            }
            if let Some(mask) = mask {
                gl::all_samples(mask);
            }
        });
    }

    /// Runs `f` with plain unpacking of pixels, and leaves no trace of what it does to the driver's
    /// state and errors.
    fn with_saved_state(&mut self, f: impl FnOnce(&mut Context)) {
        self.errors.keep();
        let capabilities = self.capabilities;
        framebuffer_pass::with_saved_state(&capabilities, || f(self));
        let materials = self.attributes.set_since_draw;
        if !capabilities.core && !materials.is_empty() {
            materials.set_again();
        }
        KeptErrors::drop_ours();
    }
}

/// Traces translucent draws. Gives the image that `trace` makes of them, with the numbers of
/// primary rays, shadow rays and rays of ambient occlusion.
fn trace_translucent<T: Send>(
    draws: &[TexturedDraw],
    trace: impl FnOnce(&[Prepared<'_>]) -> (T, [u64; 2]) + Send,
) -> (T, [u64; 3], BuildCounts) {
    thread_pool::on_pool(|| {
        let mut structures = BuildCounts::default();
        let ready: Vec<Prepared<'_>> =
            draws.iter().filter_map(|(d, _)| Prepared::new(d, None, &mut structures)).collect();
        let (image, [shadow, occlusion]) = trace(&ready);
        let primary = ready.iter().map(|p| p.rays.load(Relaxed)).sum::<u64>();
        (image, [primary, shadow, occlusion], structures)
    })
}
