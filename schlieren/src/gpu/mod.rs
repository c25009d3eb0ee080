//! Traces light paths on a GPU: the deviational Verlet march of [`crate::march::Deviational`] as a
//! Vulkan compute shader.
//!
//! The results equal those of the CPU within a few roundings. The same code prepares the rays and
//! converts the results in `f64`. The rays take the same steps, and the kernel does the same
//! operations in `f32` in the same order. The field is stored in buffers and interpolated with
//! explicit weights, because texture units round weights to 8 bits. A field larger than one binding
//! of the device is divided into slabs, one per binding.
//!
//! | file | contents |
//! |---|---|
//! | device.rs | [`Gpu`]: finds an adapter, opens it, knows its limits |
//! | method.rs | how rays are stepped |
//! | kernel.rs, *.wgsl | the shader, assembled from what a scene needs |
//! | bricks.rs | bricks that rays skip, and counts of what they skipped |
//! | volume.rs, rows.rs | the field on the device: in slabs, or in rows of four coefficients |
//! | projection.rs | its projection along the light, for straight rays |
//! | part_size.rs | how many photons a device gets at a time |
//! | paths.rs | [`GpuPaths`]: traces starts to exits in batches |
//! | frame/ | a whole frame on the device: starts, march, cut-off, film |
//! | cpu_fallback.rs | recovery of batches that the device does not finish, on a reopened device or on the CPU |
//!
//! Single rays of line of sight are not sent: each would be more bytes than the numbers that it
//! reads of the projection, so the CPU samples them. Frames sample the projection on the device.

mod bricks;
mod cpu_fallback;
mod device;
mod frame;
mod kernel;
mod method;
mod part_size;
mod paths;
mod projection;
mod rows;
mod volume;
mod work;

pub use device::Gpu;
pub use frame::MediaCache;
pub(crate) use frame::{FrameFilter, FrameMedia, NotExposed};
pub use method::{GpuOptions, Method};
pub use paths::GpuPaths;
pub use volume::VolumeCache;
pub use work::GpuCounters;

/// Why the GPU cannot trace.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No GPU was found.
    #[error(
        "no GPU: {0}; install its Vulkan driver (on Debian mesa-vulkan-drivers, which also has one \
         that runs on the CPU), or compute on the CPU (--device cpu)"
    )]
    NoAdapter(String),
    /// The GPU cannot be opened.
    #[error("the GPU `{adapter}` cannot be opened: {reason}")]
    Open {
        /// Name of the GPU.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// There is no kernel for the request.
    #[error("the GPU has no kernel for {what}. {cure}")]
    Unsupported {
        /// What was requested.
        what: String,
        /// An alternative.
        cure: &'static str,
    },
    /// The field does not fit.
    #[error(
        "{what} of {dims:?} nodes needs {need}, and `{adapter}` has {available}; compute on the \
         CPU (--device cpu), or resample the flow to fewer nodes"
    )]
    TooLarge {
        /// The part of the field that does not fit.
        what: &'static str,
        /// Dimensions of the field in nodes.
        dims: [usize; 3],
        /// Memory that it needs.
        need: String,
        /// Memory that is available.
        available: String,
        /// The device.
        adapter: String,
    },
    /// The driver reported an error, or the device was lost.
    #[error("`{adapter}` failed: {reason}; compute on the CPU (--device cpu)")]
    Failed {
        /// The device.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// The GPU failed too often.
    #[error(
        "`{adapter}` failed ({reason}) after {times} attempts to reopen it, and is not used; check \
         the driver's log, or compute on the CPU (--device cpu)"
    )]
    GivenUp {
        /// The device.
        adapter: String,
        /// How often it was reopened.
        times: u32,
        /// The driver's last message.
        reason: String,
    },
}

/// The warning for an image that the CPU finished after the GPU failed.
pub(crate) fn fallback_message(failure: &GpuError) -> String {
    match failure {
        GpuError::Failed { .. } => {
            format!("{}; the rest was computed on the CPU", failure_message(failure))
        }
        other => format!("computed on the CPU: {other}"),
    }
}

/// Describes a failure without advice.
pub(crate) fn failure_message(failure: &GpuError) -> String {
    match failure {
        GpuError::Failed { adapter, reason } => format!("the GPU `{adapter}` failed ({reason})"),
        other => other.to_string(),
    }
}
