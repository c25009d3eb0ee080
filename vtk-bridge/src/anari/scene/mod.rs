//! Converts committed objects to a scene of rt-core. Each file converts one kind of object.

pub mod attribute;
mod camera;
mod geometry;
mod light;
mod material;
mod material_inputs;
mod renderer;
mod sampler;
mod surface;
mod surface_color;
mod volume;
pub mod world;

pub(crate) use camera::camera_of;
pub(crate) use renderer::{FrameBackground, RendererSettings, renderer_settings};

use super::object::Object;
use super::status::{Code, Message, Severity};

/// Diagnostics for the program, collected while objects are converted.
#[derive(Default)]
pub(crate) struct Diagnostics(pub(crate) Vec<Message>);

impl Diagnostics {
    pub(crate) fn add(&mut self, about: &Object, severity: Severity, text: impl std::fmt::Display) {
        let code = if severity <= Severity::Warning { Code::InvalidArgument } else { Code::Ok };
        let text = format!("{}: {text}", about.title());
        self.0.push(Message {
            source: about.handle,
            source_type: about.kind,
            severity,
            code,
            text,
        });
    }

    pub(crate) fn warn(&mut self, about: &Object, text: impl std::fmt::Display) {
        self.add(about, Severity::Warning, text);
    }

    pub(crate) fn error(&mut self, about: &Object, text: impl std::fmt::Display) {
        self.add(about, Severity::Error, text);
    }
}
