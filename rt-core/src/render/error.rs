//! Why a picture could not be drawn.

use crate::camera::CameraError;
use crate::scene::SceneError;

/// Why a picture could not be drawn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// Something is wrong with the scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Something is wrong with the camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// An option is out of range.
    #[error("render option `{field}` is {value}; it must be {rule}")]
    Option {
        /// Which option.
        field: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// Effects that do not work together.
    #[error("{what} is not supported {with}; {cure}")]
    Unsupported {
        /// What was asked for.
        what: &'static str,
        /// Together with what.
        with: &'static str,
        /// What to do.
        cure: &'static str,
    },
    /// A bug: the renderer panicked. Nothing else of the process is affected.
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
    /// The thread of an asynchronous renderer is gone.
    #[error(
        "the rendering thread could not be started or has ended: {reason}; make a new AsyncRenderer"
    )]
    NoWorker {
        /// What happened.
        reason: String,
    },
}
