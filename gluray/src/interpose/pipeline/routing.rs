//! Who draws the next frame, the driver or rays: see [`crate::classify::routing`].

use crate::calls::class;
use crate::capture::ImmediateModeTarget;
use crate::classify::routing::CHEAPER;
use crate::driver::gl;
use crate::enums::*;
use crate::host::panel_client::FrameTelemetry;
use crate::interpose::context::Context;
use crate::watched_calls;

impl Context {
    /// True when the driver draws so many vertices because the frame is its own. Outside of Begin
    /// and End. A draw that is worth its rays even once makes the rest of the frame rays'.
    pub(crate) fn passes_draw(&mut self, mode: u32, vertices: u32) -> bool {
        if !self.routing.is_drivers {
            return false;
        }
        let frame = self.counters.report.frames + 1;
        if self.routing.is_worth_rays_at_once(mode, vertices, frame, || gl::ints(VIEWPORT)) {
            self.begin_rays();
            return false;
        }
        self.attributes.sync();
        self.routing.pass(mode, vertices);
        true
    }

    /// A frame is over: decides who draws the next one.
    pub(super) fn route_next_frame(&mut self) {
        if self.capture.immediate_target != ImmediateModeTarget::Outside || self.bypassed {
            // The driver answers no questions between Begin and End.
            return;
        }
        self.route_by_settings();
        let next = self.counters.report.frames + 2;
        if self.routing.is_drivers {
            self.route_from(next);
        } else if self.routing.end_of_rays(next, || gl::ints(VIEWPORT)) {
            self.give_to_driver();
        }
        let changes = self.routing.take_changes();
        self.counters.report.routes.extend(changes);
    }

    /// What the driver has drawn so far is cleared: the same for the rest of the frame.
    pub(super) fn route_rest_of_frame(&mut self) {
        self.route_from(self.counters.report.frames + 1);
    }

    /// Decides whether `frame` is rays', after something of the driver's.
    fn route_from(&mut self, frame: u64) {
        let draws = self.routing.take_passed_draws();
        if draws > 0 {
            self.counters.count_driver_draws(CHEAPER, draws);
        }
        if self.routing.end_of_drivers(frame, || gl::ints(VIEWPORT)) {
            self.begin_rays();
        }
    }

    /// The settings have changed, or whoever looks at what rays find.
    pub(super) fn route_by_settings(&mut self) {
        let watched = FrameTelemetry::is_watched();
        if self.routing.set_settings(&self.config.settings, watched) {
            self.begin_rays();
        }
    }

    /// From the next draw on, rays draw.
    fn begin_rays(&mut self) {
        self.attributes.sync();
        self.routing.change(false);
        // Nothing was asked since the driver began to draw, and nothing is known of its depths.
        self.state.dirty = class::ALL;
        self.presentation.frame.driver_drew_frames();
        watched_calls::arm();
    }

    /// From the next draw on, the driver draws.
    fn give_to_driver(&mut self) {
        self.end_batch();
        let programs = &self.classifier.programs;
        let held_back = self.presentation.frame.has_pending()
            || self.classifier.probes.has_draws()
            || programs.peeling.has_draws()
            || programs.weighted.has_draws();
        if held_back || self.capture.immediate_target != ImmediateModeTarget::Outside {
            return;
        }
        self.attributes.sync();
        self.state.dirty = class::ALL;
        self.routing.change(true);
    }
}
