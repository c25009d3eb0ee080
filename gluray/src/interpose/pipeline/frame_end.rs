//! The end of a frame: a swap of buffers, a read of the framebuffer, or a clear of what was traced.

use crate::calls::{at, class};
use crate::capture::ImmediateModeTarget;
use crate::driver::gl;
use crate::enums::*;
use crate::host::config::{self, Quality};
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::trace::thread_pool;
use crate::watched_calls;
use std::sync::Arc;

impl Context {
    /// Ends a frame: its image is now visible on the screen.
    pub(crate) fn frame_done(&mut self) {
        self.route_next_frame();
        self.counters.report.frames += 1;
        self.presentation.frame.frame_done();
        (self.counters.report.cache_hits, self.counters.report.cache_misses) =
            (self.capture.geometry_cache.hits, self.capture.geometry_cache.misses);
        self.counters.report.textures_read = self.capture.textures.read;
        self.presentation.path_tracer.frame_done();
        self.classifier.programs.frame_done();
        self.capture.attribute_cache.frame_done();
        self.capture.recorder.frame_done();
        let fast = self.config.settings.quality == Quality::Fast;
        self.capture.geometry_cache.frame_done(|g| {
            if !fast {
                thread_pool::in_background(move || g.improve());
            }
            !fast
        });
        let [_, _, w, h] = self.state.snapshot.viewport.map(|v| v.max(0).cast_unsigned());
        let telemetry = &mut self.presentation.frame.telemetry;
        self.counters.report.objects = telemetry.frame_done(&self.counters.report, [w, h]);
        if let Some(problem) = telemetry.take_problem() {
            self.counters.warn(problem);
        }
        self.apply_new_settings();
        self.counters.publish(false);
    }

    /// Applies new settings. They hold from the next frame on.
    pub(super) fn apply_new_settings(&mut self) {
        let config = config::current();
        if !Arc::ptr_eq(&config, &self.config) {
            if self.bypassed && config.settings.enabled {
                self.end_bypass();
            }
            self.config = config;
            self.route_by_settings();
            // Classifications depend on settings.
            self.state.dirty = class::ALL;
            watched_calls::arm();
        }
    }

    /// The program reads the framebuffer. This also ends a frame when something was traced for it.
    pub(super) fn read_back(&mut self) {
        self.presentation.frame.pipelined.read();
        if self.presentation.frame.is_traced() || self.routing.has_passed() {
            self.frame_done();
        }
    }

    /// What was traced is cleared: a frame is over that nobody swapped or read, as in programs that
    /// draw into framebuffer objects alone.
    fn end_unswapped_frame(&mut self) {
        // Only then is the state asked for. Windows have their frames when they are swapped, and a
        // query of materials changes what Mesa holds of them (osgbillboard, osgtessellate).
        if self.presentation.frame.has_pending() || !self.presentation.frame.was_traced_off_screen()
        {
            return;
        }
        self.refresh();
        let s = &self.state.snapshot;
        let rect = s.scissor.unwrap_or(s.viewport);
        if s.framebuffer != 0 && self.presentation.frame.was_traced_in(s.framebuffer, rect) {
            self.frame_done();
        }
    }

    /// `glClear`. A clear of everything makes the pending draws invisible. A clear of a part comes
    /// after them.
    pub(crate) fn clear(&mut self, mask: u32) -> bool {
        const COLOR_AND_DEPTH: u32 = COLOR_BUFFER_BIT | DEPTH_BUFFER_BIT;
        if self.capture.recording.is_some() {
            self.capture.list_driver_call(true, true);
            return false;
        }
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glClear between Begin and End");
            return false;
        }
        if self.routing.is_drivers {
            let outside = self.capture.immediate_target == ImmediateModeTarget::Outside;
            if mask & COLOR_AND_DEPTH == COLOR_AND_DEPTH && outside {
                self.route_rest_of_frame();
            }
            if self.routing.is_drivers {
                return false;
            }
        }
        self.end_batch();
        self.classifier.programs.peeling.cleared(self.counters.report.passed_draws);
        if self.classifier.programs.weighted.has_draws() {
            self.flush(FlushReason::Call(at::glClear));
        }
        let both = mask & COLOR_AND_DEPTH == COLOR_AND_DEPTH;
        if self.presentation.frame.is_traced() && both {
            self.end_unswapped_frame();
        }
        if self.presentation.frame.has_pending() || self.classifier.probes.has_draws() {
            self.refresh();
            let s = &self.state.snapshot;
            let whole = both
                && s.scissor.is_none()
                && s.color_mask
                && s.depth_mask
                && self.presentation.frame.is_pending_only_in(s.framebuffer);
            if whole {
                self.presentation.frame.drop_pending();
                self.classifier.probes.drop_draws();
            } else {
                self.flush(FlushReason::PartialClear);
            }
        }
        self.attributes.sync();
        if mask & DEPTH_BUFFER_BIT != 0
            && self.presentation.frame.has_drivers_depths()
            && !gl::is_enabled(SCISSOR_TEST)
        {
            let bound = match self.capabilities.version {
                30.. => gl::word(FRAMEBUFFER_BINDING),
                _ => 0,
            };
            self.presentation.frame.depth_cleared(bound);
        }
        false
    }
}
