//! Renders a scene as seen by a camera and returns an image and a report.
//!
//! [`render`] draws one frame. A [`Renderer`] draws many frames and reuses its memory.
//! [`ProgressiveRenderer`] gives an image after every sample per pixel. [`AsyncRenderer`] draws
//! frame N while the program prepares frame N+1 (thesis section 4.1.2).

mod assemble;
mod asynchronous;
mod progressive;
mod renderer;

pub use asynchronous::AsyncRenderer;
pub use progressive::{ProgressiveRenderer, RenderReport, StopReason};
pub use renderer::Renderer;

pub use crate::render_error::RenderError;
pub use crate::render_options::{Crop, RenderOptions};

use crate::camera::Camera;
use crate::frame::Frame;
use crate::scene::Scene;

/// An image with a report on its rendering.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RenderOutput {
    /// The image.
    pub frame: Frame,
    /// Rays by kind, effects that ran, warnings, time.
    pub report: RenderReport,
}

/// Renders `scene` as seen by `camera`, on rayon's current thread pool, until the options' samples,
/// time or error are reached. The same arguments and seed give the same image bit for bit on any
/// number of threads (unless a time limit or cancellation ends it early).
pub fn render(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<RenderOutput, RenderError> {
    Renderer::new().render(scene, camera, options)
}
