//! The calls between the steps of a frame, in one place.
//!
//! A [`Context`] has a struct for each step: [`StateCache`], [`AttributeState`], [`Capture`],
//! [`Classifier`] and [`Presentation`], and the [`SharedObjects`] of its group. These structs do
//! not refer to each other. What one step needs of another goes through here:
//!
//! 1. Before a watched call runs, pending draws are presented if the call needs them, and the
//!    classes of state that it may change are marked ([`Context::watched_call`]).
//! 2. At a draw the driver is asked for the marked classes, and the state says what becomes of the
//!    draw ([`Context::classify_draw`]).
//! 3. What is recorded becomes a draw ([`Context::end_batch`]), which waits for the others of its
//!    frame ([`Context::add`]).
//! 4. The pending draws are traced and presented (`presenting`).
//! 5. A frame ends (`frame_end`), and it is decided who draws the next one (`routing`).
//!
//! The methods that take a draw from the program's calls stand in the room of their step, in
//! `capture` and `classify`.
//!
//! [`StateCache`]: crate::state::StateCache
//! [`AttributeState`]: crate::state::current_attributes::AttributeState
//! [`Capture`]: crate::capture::Capture
//! [`Classifier`]: crate::classify::Classifier
//! [`Presentation`]: crate::present::Presentation
//! [`SharedObjects`]: crate::interpose::share_group::SharedObjects

mod frame_end;
mod presenting;
mod routing;

use crate::calls::{self, class};
use crate::capture::ImmediateModeTarget;
use crate::capture::draw::{Draw, Values};
use crate::classify::routing::CHEAPER;
use crate::classify::rules::{self, Classification, TraceFilter};
use crate::driver::gl;
use crate::enums::*;
use crate::faults::attempt;
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::interpose::kept_errors::KeptErrors;
use crate::present::framebuffer_pass::REFUSED;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::material_properties::MaterialProperties;
use crate::state::snapshot::DriverCapabilities;
use crate::trace;
use crate::watched_calls;
use std::sync::Arc;
use std::time::Instant;

/// Why the driver draws what is tested for equality with depths of its own: those of rays agree
/// with them to some steps of the buffer only.
const EQUAL_DEPTHS: &str = "a test for equal depth after draws of the driver";

/// After so many watched calls without a draw, the next ones are not reported.
const ENOUGH_WATCHED_CALLS: u32 = 12;

impl Context {
    /// The context is current again. The driver may have been told anything meanwhile.
    pub(crate) fn on_made_current(&mut self) {
        self.state.dirty = class::ALL;
        self.shared.on_made_current();
        self.attributes.on_made_current();
        if !self.counters.knows_driver() {
            // As large as the window until the program says otherwise.
            self.presentation.frame.set_initial_height(gl::ints(SCISSOR_BOX));
            let renderer = gl::string(RENDERER);
            self.routing.set_driver(&renderer);
            self.counters.set_driver(&renderer, &gl::string(VERSION));
        }
        if self.capabilities.version == 0 && !self.bypassed {
            self.capabilities = self.errors.hiding(DriverCapabilities::query);
            self.capture.textures.core = self.capabilities.core;
        }
    }

    /// The panel has switched the tracing on, which was off since the context was made. Nothing is
    /// known of what the program has done. Lists that it has compiled stay the driver's.
    pub(crate) fn end_bypass(&mut self) {
        self.bypassed = false;
        self.capture.immediate_target = ImmediateModeTarget::Outside;
        self.on_made_current();
        self.mark(class::ALL);
    }

    /// A call that may change state, while nothing is done: the frames are counted, and others
    /// that share textures are told.
    fn call_while_bypassed(&mut self, index: usize, classes: u8) {
        self.shared.observe_call(index, classes);
        self.shared.mark(classes);
        if calls::swaps_buffers(index) {
            self.frame_done();
        } else if calls::reads_frame(index) {
            self.apply_new_settings();
        }
        if self.bypassed {
            watched_calls::disarm();
        }
    }

    /// An error kept for the program. The driver is asked when there is none.
    pub(crate) fn take_error(&mut self) -> Option<u32> {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glGetError between Begin and End");
        }
        self.errors.take()
    }

    /// Other contexts can see from now on what this one has written to textures. True when it has
    /// written anything.
    pub(crate) fn publish_textures(&mut self) -> bool {
        // Between Begin and End the driver answers no questions.
        if self.capture.immediate_target == ImmediateModeTarget::Pass {
            return false;
        }
        let has_framebuffers = self.capabilities.version >= 30;
        self.shared.publish_textures(|| has_framebuffers && gl::word(FRAMEBUFFER_BINDING) != 0)
    }

    // ---- Watched calls --------------------------------------------------------------------------
    /// A call is about to run that may change `classes` of state. `flushes`: pending draws must be
    /// in the framebuffer before it. `draws`: the driver draws in it.
    pub(crate) fn watched_call(&mut self, index: usize, classes: u8, flushes: bool, draws: bool) {
        if self.bypassed {
            self.call_while_bypassed(index, classes);
            return;
        }
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("another call between Begin and End");
        }
        self.classifier.programs.finish_redraw();
        self.shared.observe_call(index, classes);
        if let Some(r) = &mut self.capture.recording {
            r.note_driver_call(classes, flushes, draws);
        }
        let compiling = self.capture.recording.is_some();
        if flushes {
            let invisible = calls::shows_front_buffer(index)
                && self.capabilities.double_buffered
                && !self.state.draws_to_front();
            if !invisible && !compiling {
                self.flush(FlushReason::Call(index));
            }
            if draws && !compiling {
                self.counters.count_driver_draws("a draw call that is not followed", 1);
                self.presentation.frame.driver_draws_depth(self.state.snapshot.framebuffer);
            }
            if calls::swaps_buffers(index) {
                self.frame_done();
            } else if calls::reads_frame(index) {
                if self.capabilities.version >= 21 && gl::word(PIXEL_PACK_BUFFER_BINDING) != 0 {
                    self.shared.writes().any();
                }
                self.read_back();
            }
        }
        // A program that sets much state between draws pays for the first calls only.
        let watched_enough = self.watched_calls >= ENOUGH_WATCHED_CALLS;
        if classes & class::TEXTURE != 0 && self.state.snapshot.texture.is_some() {
            // What was drawn with a texture is drawn with what it is now.
            self.end_batch();
        }
        self.attributes.sync();
        self.mark(classes);
        self.watched_calls += 1;
        if watched_enough && !compiling && watched_calls::is_alone() {
            // Writes to buffers and textures are reported all the same.
            self.mark(class::ALL & !(class::BUFFER | class::TEXTURE));
            watched_calls::disarm();
        }
    }

    fn mark(&mut self, classes: u8) {
        self.state.dirty |= classes;
        self.shared.mark(classes);
    }

    // ---- State ----------------------------------------------------------------------------------
    /// Asks the driver for the marked classes of state. Ends the batch of immediate mode when the
    /// state has changed.
    pub(crate) fn refresh(&mut self) {
        self.watched_calls = 0;
        watched_calls::arm();
        self.classifier.programs.finish_redraw();
        let version = self.shared.texture_version();
        if self.state.snapshot.texture.as_ref().is_some_and(|t| t.version != version) {
            // Another context of the share group may have written it.
            self.state.dirty |= class::TEXTURE;
        }
        if self.state.dirty & class::DRAWS == 0 {
            return;
        }
        if self.state.dirty & class::RASTER != 0 {
            self.capture.evaluators.forget();
        }
        self.attributes.sync();
        self.errors.keep();
        let mut fresh = (*self.state.snapshot).clone();
        fresh.refresh(self.state.dirty, &self.capabilities);
        fresh.window_height = self.presentation.frame.window_height(&fresh);
        if let Some(t) = &mut fresh.texture {
            t.version = self.shared.texture_version();
        }
        if self.state.dirty & class::CURRENT != 0 && !self.capabilities.core {
            let now = CurrentAttributes::query();
            self.attributes.untracked_color =
                now.untracked_color(fresh.color_material.filter(|_| fresh.lighting));
            if now != self.attributes.current {
                self.end_batch();
                self.attributes.current = now;
            }
        }
        KeptErrors::drop_ours();
        self.state.dirty &= !class::DRAWS;
        if fresh != *self.state.snapshot {
            self.end_batch();
            self.state.snapshot = Arc::new(fresh);
        }
        self.classifier.classification = self.classification_of_state();
        if let Some(t) = &self.state.snapshot.texture
            && !matches!(self.classifier.classification, Classification::Pass(_))
        {
            // Now, as it is bound now: when a batch of immediate mode ends another may be.
            self.capture.textures.get(t.target, t.name, t.version);
        }
    }

    fn classification_of_state(&mut self) -> Classification {
        let filter = TraceFilter::of(&self.config.settings);
        let s = &self.state.snapshot;
        match rules::classify(s, filter) {
            Classification::Pass(why) => Classification::Pass(why),
            _ if rules::compares_depths_exactly(s)
                && self.presentation.frame.has_drivers_depths_in(s.framebuffer) =>
            {
                Classification::Pass(EQUAL_DEPTHS)
            }
            classification => match self.check_presenter() {
                Ok(()) => classification,
                Err(why) => Classification::Pass(why),
            },
        }
    }

    /// What becomes of filled primitives that are drawn now.
    pub(crate) fn classify_draw(&mut self) -> Classification {
        if self.routing.is_drivers {
            return Classification::Pass(CHEAPER);
        }
        self.refresh();
        self.attributes.set_since_draw = MaterialProperties::default();
        match self.classifier.classification {
            _ if trace::thread_pool::forked() => Classification::Pass("a forked process"),
            classification => classification,
        }
    }

    /// Whether the driver takes the pass that presents; the reason when not. Then nothing may be
    /// kept from it. The driver is asked the first time, before anything of the context is kept
    /// from it. Programs of which nothing is traced pay nothing. Not to be called between Begin and
    /// End.
    pub(crate) fn check_presenter(&mut self) -> Result<(), &'static str> {
        let presenter = &mut self.presentation.presenter;
        if presenter.is_unchecked() {
            let core = self.capabilities.core;
            if let Err(words) = self.errors.hiding(|| presenter.check_support(core)) {
                self.counters.warn(format!("{REFUSED}, so nothing is traced: {words}"));
            }
        }
        if self.presentation.presenter.is_refused() { Err(REFUSED) } else { Ok(()) }
    }

    // ---- Draws ----------------------------------------------------------------------------------
    /// The recorded immediate mode becomes a draw.
    pub(crate) fn end_batch(&mut self) {
        let start = Instant::now();
        let Some(draw) = self.capture.take_batch(&self.state.snapshot) else { return };
        let filter = TraceFilter::of(&self.config.settings);
        let in_order = rules::classify(&draw.state, filter) == Classification::TraceInOrder;
        self.counters.add_time("capture", start.elapsed());
        self.add(draw, in_order);
    }

    /// Adds a draw to the frame, or traces it at once when its order matters.
    pub(crate) fn add(&mut self, mut draw: Draw, in_order: bool) {
        let triangles = draw.geometry.mesh.num_triangles();
        self.counters.count_traced(draw.calls, triangles);
        self.routing.trace(draw.calls, triangles, 1.0);
        if draw.geometry.mesh.indices.is_empty() {
            return;
        }
        if let Some(color) = self.attributes.untracked_color
            && draw.state.color_material.is_some()
            && matches!(&draw.attributes.colors, Values::Constant(c) if *c == color)
        {
            Arc::make_mut(&mut draw.state).color_material = None;
        }
        trace::overrides::apply(&mut draw, &self.config.settings);
        if !trace::has_rays(&draw.clip_from_object) {
            // A model-view that flattens everything (a shadow on a floor): rays need the flattened
            // triangles themselves.
            self.capture.flatten(&mut draw);
        }
        if draw.state.blend && self.config.settings.sees_through() && draw.has_full_alpha() {
            // Programs leave blending on. What lets no light through is opaque all the same.
            Arc::make_mut(&mut draw.state).blend = false;
        }
        let image = draw.state.texture.and_then(|t| {
            self.errors.hiding(|| self.capture.textures.get(t.target, t.name, t.version))
        });
        if in_order {
            self.trace_ordered(&draw, image);
        } else {
            if self.presentation.frame.has_other_samples(&draw) {
                self.flush(FlushReason::OtherSamples);
            }
            self.presentation.frame.push(draw, image);
        }
    }

    /// The driver is about to draw something.
    pub(crate) fn before_driver_draw(&mut self, why: &'static str, filled: bool) {
        self.end_batch();
        if rules::commutes(&self.state.snapshot) && !filled {
            self.presentation.frame.driver_drew();
        } else {
            self.flush(FlushReason::DriverDraw);
        }
        self.attributes.sync();
        self.counters.count_driver_draws(why, 1);
        let s = &self.state.snapshot;
        if s.depth_test && s.depth_mask {
            self.presentation.frame.driver_draws_depth(s.framebuffer);
        }
    }

    /// The driver is about to execute lists of its own, which may draw or change textures.
    pub(crate) fn before_driver_list(&mut self, draws: bool, textures: bool) {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("a list between Begin and End");
        }
        self.end_batch();
        if draws
            && self.capture.immediate_target == ImmediateModeTarget::Outside
            && !self.routing.is_drivers
        {
            self.refresh();
            if rules::commutes(&self.state.snapshot) {
                self.presentation.frame.driver_drew();
            } else {
                self.flush(FlushReason::DriverList);
            }
            // Whether the list switches depths off is not known.
            self.presentation.frame.driver_draws_depth(self.state.snapshot.framebuffer);
        }
        self.attributes.sync();
        self.state.dirty = class::ALL;
        if textures {
            self.shared.invalidate_textures();
        }
    }

    /// The driver draws the primitive that is being recorded after all.
    pub(crate) fn replay_to_driver(&mut self, why: &'static str) {
        self.capture.immediate_target = ImmediateModeTarget::Pass;
        let (mode, vertices) = self.capture.recorder.take_open_primitive();
        self.before_driver_draw(why, true);
        self.attributes.replay(mode, vertices);
    }

    // ---- Faults ---------------------------------------------------------------------------------
    /// A fault of ours has ended the tracing. What was kept from the driver is drawn, by rays if
    /// they still can be sent, and the driver is told what it does not know. Between Begin and End
    /// of a primitive that the driver draws none of this is possible, so it waits.
    pub(crate) fn stop_tracing(&mut self) {
        if self.bypassed {
            self.tracing_stopped = true;
        }
        if self.tracing_stopped || self.capture.immediate_target == ImmediateModeTarget::Pass {
            return;
        }
        self.tracing_stopped = true;
        self.capture.depth_of_lists = 0;
        let open = self.capture.immediate_target == ImmediateModeTarget::Trace;
        self.capture.immediate_target = ImmediateModeTarget::Outside;
        if let Some(r) = &mut self.capture.recording {
            r.stop_tracing();
            // What was kept before the list cannot be drawn while the driver compiles it: the first
            // call after its end does.
            self.tracing_stopped = false;
        } else {
            let recorder = &mut self.capture.recorder;
            let mode = recorder.mode();
            let primitive = open
                .then(|| attempt(|| recorder.take_open_primitive()).unwrap_or((mode, Vec::new())));
            attempt(|| self.flush_now(FlushReason::Fault));
            attempt(|| self.attributes.sync());
            if let Some((mode, vertices)) = primitive {
                self.attributes.replay(mode, vertices);
            }
        }
        attempt(|| self.attributes.sync());
        attempt(|| self.counters.publish(true));
    }
}
