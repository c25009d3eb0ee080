//! Errors of a demo.
use super::FrameError;
use datasets::catalogue::CatalogueError;
use datasets::model::ModelError;
use datasets::read::ReadError;
use rt_core::camera::CameraError;
use rt_core::scene::SceneError;
use rt_core::shapes::ShapeError;

/// Why a demo could not be prepared or rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DemoError {
    /// No such data set or size, or it cannot be made.
    #[error(transparent)]
    Data(#[from] CatalogueError),
    /// It has no such view.
    #[error("{data} has no view `{view}`; it has: {known}")]
    View {
        /// The data set.
        data: String,
        /// The view asked for.
        view: String,
        /// All its views.
        known: String,
    },
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] ReadError),
    /// A file whose data have no surface.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A file without a triangle.
    #[error("{file} has no surface to show: it holds no triangle")]
    NoSurface {
        /// The file.
        file: String,
    },
    /// A list of files without a file.
    #[error("{file} names no pieces")]
    NoPieces {
        /// The file.
        file: String,
    },
    /// A list of files shows the whole, in one way.
    #[error("{file} is a list of pieces, which has no {what}: leave it out")]
    OptionOfPieces {
        /// The file.
        file: String,
        /// "size", "view", ...
        what: &'static str,
    },
    /// A name that looks like a file, but there is no such file.
    #[error("there is no file {file}, and {unknown}")]
    NoFile {
        /// The name.
        file: String,
        /// The catalogue's error for the name.
        unknown: CatalogueError,
    },
    /// A file has one size.
    #[error("{file} is a file and has no size `{size}`: leave the size out")]
    SizeOfFile {
        /// The file.
        file: String,
        /// The size asked for.
        size: String,
    },
    /// Tubes.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
}
