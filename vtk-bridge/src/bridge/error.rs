//! Errors of a frame that could not be rendered.

/// Reasons why nothing could be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BridgeError {
    /// rt-core failed with this error.
    #[error(transparent)]
    Render(#[from] rt_core::render::RenderError),
    /// The camera's matrix is invalid.
    #[error(transparent)]
    Camera(#[from] rt_core::camera::CameraError),
    /// The acceleration structure could not be built.
    #[error(transparent)]
    Build(#[from] rt_core::bvh::BuildError),
    /// The thread pool could not be created.
    #[error("RTV_THREADS={threads}: the threads could not be started: {reason}; ask for fewer")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// The system's error.
        reason: String,
    },
}
