//! Errors of rendering.

use crate::camera::CameraError;
use crate::scene::{Scene, SceneError};

/// Why an image could not be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The camera is invalid.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// An option is out of range.
    #[error("render option `{field}` is {value}; it must be {rule}")]
    Option {
        /// The option.
        field: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// Effects that cannot be combined.
    #[error("{what} is not supported {with}; {cure}")]
    Unsupported {
        /// What was requested.
        what: &'static str,
        /// What it cannot be combined with.
        with: &'static str,
        /// What to do.
        cure: &'static str,
    },
    /// A shape could not read its data, so the image is not right.
    #[error("geometry {geometry} (counted from 0) could not be read while rendering: {reason}")]
    Unreadable {
        /// Number of the geometry in the scene.
        geometry: usize,
        /// What the shape says.
        reason: String,
    },
    /// A stored volume could not be read, so the image is not right.
    #[error("volume {volume} (counted from 0) could not be read while rendering: {reason}")]
    UnreadableVolume {
        /// Number of the volume in the scene.
        volume: usize,
        /// What went wrong.
        reason: String,
    },
    /// A bug: the renderer panicked. The rest of the process is not affected.
    #[error(
        "internal error at pixel ({x}, {y}), sample {sample}: {message}; it repeats with crop: \
         Crop {{ x: {x}, y: {y}, width: 1, height: 1 }}, please report it"
    )]
    Panicked {
        /// Column.
        x: u32,
        /// Row from the top.
        y: u32,
        /// Sample number.
        sample: u32,
        /// The panic's message.
        message: String,
    },
    /// The thread of an asynchronous renderer has ended.
    #[error(
        "the rendering thread could not be started or has ended: {reason}; make a new AsyncRenderer"
    )]
    NoWorker {
        /// What happened.
        reason: String,
    },
}

impl RenderError {
    /// Whether a frame of the scene passed through data that could not be read: nobody knows what
    /// its rays would have met there.
    pub fn unreadable(scene: &Scene) -> Option<RenderError> {
        if let Some((geometry, reason)) = scene.world.failure() {
            return Some(RenderError::Unreadable { geometry, reason });
        }
        scene.volumes.iter().enumerate().find_map(|(volume, placed)| {
            let reason = placed.volume.failure()?.to_owned();
            Some(RenderError::UnreadableVolume { volume, reason })
        })
    }
}
