//! Why the bridge renders nothing.

/// Why nothing could be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BridgeError {
    /// rt-core failed for this reason.
    #[error(transparent)]
    Render(#[from] rt_core::render::RenderError),
    /// The camera's matrix is not usable.
    #[error(transparent)]
    Camera(#[from] rt_core::camera::CameraError),
    /// The acceleration structure could not be built.
    #[error(transparent)]
    Build(#[from] rt_core::bvh::BuildError),
    /// The thread pool could not be made.
    #[error("RTV_THREADS={threads}: the threads could not be started: {reason}; ask for fewer")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// The system's reason.
        reason: String,
    },
}
