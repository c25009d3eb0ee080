//! Presents traced fragments in the program's framebuffer: pending draws, the time at which they
//! must be visible, and the pass that writes colours and depths.

pub(crate) mod effect_image;
pub(crate) mod frame;
pub(crate) mod frame_reuse;
pub(crate) mod framebuffer_pass;
pub(crate) mod multisample;
pub(crate) mod pipelined;

use crate::trace::path_tracing::PathTracer;
use frame::Frame;
use framebuffer_pass::Presenter;

/// The frame of a context, and what brings it into the framebuffer.
#[derive(Default)]
pub(crate) struct Presentation {
    pub(crate) frame: Frame,
    pub(crate) presenter: Presenter,
    pub(crate) path_tracer: PathTracer,
}
