//! Renders many frames in the same memory.

use super::progressive::Buffers;
use super::{ProgressiveRenderer, RenderError, RenderOptions, RenderOutput};
use crate::camera::Camera;
use crate::frame::Frame;
use crate::scene::Scene;
use std::sync::atomic::AtomicBool;

/// Renders frames as [`super::render`] does and keeps the buffers for the next one. At interactive
/// rates, getting fresh pages from the operating system for every frame costs about as much as a
/// sixth of the rays.
#[derive(Default)]
pub struct Renderer {
    buffers: Buffers,
}

impl Renderer {
    /// A renderer without buffers yet.
    pub fn new() -> Renderer {
        Renderer::default()
    }

    /// See [`super::render`].
    pub fn render(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<RenderOutput, RenderError> {
        self.render_unless(scene, camera, options, None)
    }

    /// Takes back an image that is no longer needed. The next one of the same size and layers is
    /// written into its memory.
    pub fn recycle(&mut self, frame: Frame) {
        self.buffers.frame = frame;
    }

    /// As [`Renderer::render`] with a second cancel flag.
    pub(super) fn render_unless(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
        cancel: Option<&AtomicBool>,
    ) -> Result<RenderOutput, RenderError> {
        let buffers = std::mem::take(&mut self.buffers);
        let mut progressive = ProgressiveRenderer::with_buffers(scene, camera, options, buffers)?;
        progressive.also_cancel = cancel;
        while progressive.step()? {}
        let (output, buffers) = progressive.finish();
        self.buffers = buffers;
        Ok(output)
    }
}
