//! The draws of a frame that wait until they must be in the framebuffer.

use crate::capture::draw::{Draw, TexturedDraw};
use crate::enums::*;
use crate::host::panel_client::FrameTelemetry;
use crate::present::frame_reuse::FrameReuse;
use crate::present::pipelined::PipelinedPresent;
use crate::state::snapshot::Snapshot;
use crate::trace::texturing::Image;
use std::sync::Arc;

/// Draws that are deferred to the end of the frame.
#[derive(Default)]
pub(crate) struct Frame {
    pending: Vec<TexturedDraw>,
    /// Images that may be reused.
    pub(crate) reuse: FrameReuse,
    /// The image that is shown one frame later.
    pub(crate) pipelined: PipelinedPresent,
    /// Telemetry of the frame for the control panel and reports.
    pub(crate) telemetry: FrameTelemetry,
    /// The driver drew something that commutes since the first of them.
    others: bool,
    /// True when something was traced since the last frame ended.
    traced: bool,
    /// The framebuffers and viewports of the traced draws.
    places: Vec<(u32, [i32; 4])>,
    /// The framebuffers with depths that the driver has drawn since they were cleared.
    drivers_depths: Vec<u32>,
    /// The driver may have drawn depths anywhere, except into framebuffers that were cleared since.
    depths_anywhere: bool,
    cleared: Vec<u32>,
    /// The highest row that window viewports reached in the previous frame and in this one.
    tops: [i32; 2],
}

impl Frame {
    // ---- Pending draws --------------------------------------------------------------------------
    /// Adds a draw and the image of its texture.
    pub(crate) fn push(&mut self, draw: Draw, image: Option<Arc<Image>>) {
        self.pending.push((draw, image));
    }

    pub(crate) fn has_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// True when pending draws have another number of samples a pixel than `draw`.
    pub(crate) fn has_other_samples(&self, draw: &Draw) -> bool {
        let samples = |d: &Draw| d.state.samples.max(1);
        self.pending.first().is_some_and(|(d, _)| samples(d) != samples(draw))
    }

    /// True when all pending draws go into this framebuffer.
    pub(crate) fn is_pending_only_in(&self, framebuffer: u32) -> bool {
        self.pending.iter().all(|(d, _)| d.state.framebuffer == framebuffer)
    }

    /// The pending draws, and the depth function for their image.
    pub(crate) fn take_pending(&mut self) -> (Vec<TexturedDraw>, u32) {
        let pending = std::mem::take(&mut self.pending);
        // What the driver drew after a traced surface wins ties with it, as LEQUAL says; what it
        // drew before loses them.
        let func = match (std::mem::take(&mut self.others), pending.first()) {
            (false, Some((first, _))) => first.state.depth_func,
            _ => LESS,
        };
        (pending, func)
    }

    /// The pending draws are cleared before anybody sees them.
    pub(crate) fn drop_pending(&mut self) {
        self.pending.clear();
        self.others = false;
    }

    /// The driver drew lines or points whose order does not matter but for ties.
    pub(crate) fn driver_drew(&mut self) {
        self.others |= !self.pending.is_empty();
    }

    // ---- Who drew the depths --------------------------------------------------------------------
    /// The driver draws depths into a framebuffer.
    pub(crate) fn driver_draws_depth(&mut self, framebuffer: u32) {
        self.cleared.retain(|f| *f != framebuffer);
        if !self.drivers_depths.contains(&framebuffer) {
            self.drivers_depths.push(framebuffer);
        }
    }

    /// The depths of a framebuffer are cleared.
    pub(crate) fn depth_cleared(&mut self, framebuffer: u32) {
        self.drivers_depths.retain(|f| *f != framebuffer);
        if self.depths_anywhere && !self.cleared.contains(&framebuffer) {
            self.cleared.push(framebuffer);
        }
    }

    /// The driver has drawn whole frames, into whatever framebuffers.
    pub(crate) fn driver_drew_frames(&mut self) {
        self.depths_anywhere = true;
        self.cleared.clear();
    }

    /// True when the driver has drawn depths anywhere.
    pub(crate) fn has_drivers_depths(&self) -> bool {
        self.depths_anywhere || !self.drivers_depths.is_empty()
    }

    /// True when the driver has drawn depths into this framebuffer.
    pub(crate) fn has_drivers_depths_in(&self, framebuffer: u32) -> bool {
        self.drivers_depths.contains(&framebuffer)
            || self.depths_anywhere && !self.cleared.contains(&framebuffer)
    }

    // ---- What was traced ------------------------------------------------------------------------
    pub(crate) fn mark_traced(&mut self) {
        self.traced = true;
    }

    /// True when something was traced since the last frame ended.
    pub(crate) fn is_traced(&self) -> bool {
        self.traced
    }

    /// Pending draws are traced for this frame.
    pub(crate) fn record_traced(&mut self, frame: u64, draws: &[TexturedDraw]) {
        self.traced = true;
        for (d, _) in draws {
            let place = (d.state.framebuffer, d.state.viewport);
            if !self.places.contains(&place) {
                self.places.push(place);
            }
        }
        self.telemetry.traced(frame, draws.iter().map(|(d, _)| d));
    }

    /// Peeled surfaces are traced for this frame.
    pub(crate) fn record_peeled(&mut self, frame: u64, draws: &[TexturedDraw]) {
        self.traced = true;
        self.telemetry.traced(frame, draws.iter().map(|(d, _)| d));
    }

    /// A draw whose order matters is traced for this frame.
    pub(crate) fn record_ordered(&mut self, frame: u64, draw: &Draw) {
        self.traced = true;
        self.telemetry.traced(frame, std::iter::once(draw));
    }

    /// True when something was traced into a framebuffer object.
    pub(crate) fn was_traced_off_screen(&self) -> bool {
        self.places.iter().any(|(framebuffer, _)| *framebuffer != 0)
    }

    /// True when something was traced into a part of this rectangle of a framebuffer.
    pub(crate) fn was_traced_in(&self, framebuffer: u32, [x, y, w, h]: [i32; 4]) -> bool {
        self.places.iter().any(|&(f, [a, b, c, d])| {
            f == framebuffer && a < x + w && x < a + c && b < y + h && y < b + d
        })
    }

    // ---- Windows and frames ---------------------------------------------------------------------
    /// The scissors of a new context.
    pub(crate) fn set_initial_height(&mut self, [_, y, _, h]: [i32; 4]) {
        self.tops[0] = y.saturating_add(h);
    }

    /// The height of the window in rows. No call returns it, but some viewport reaches the top.
    pub(crate) fn window_height(&mut self, s: &Snapshot) -> i32 {
        let top = s.viewport[1].saturating_add(s.viewport[3]);
        if s.framebuffer != 0 {
            return top;
        }
        self.tops[1] = self.tops[1].max(top);
        self.tops[0].max(self.tops[1])
    }

    /// A frame is over.
    pub(crate) fn frame_done(&mut self) {
        self.traced = false;
        self.places.clear();
        if self.tops[1] > 0 {
            self.tops = [self.tops[1], 0];
        }
        self.pipelined.frame_done();
        self.reuse.frame_done();
    }
}
