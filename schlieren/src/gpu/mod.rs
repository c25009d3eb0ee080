//! Light paths on a GPU: the deviational Verlet march of [`crate::march::Deviational`] as a Vulkan
//! compute shader.
//!
//! The same numbers as on the CPU, within a few roundings: rays are prepared and read out in `f64`
//! by the same code, take the same steps, and the kernel does the same operations in `f32` in the
//! same order. The field lies in storage buffers and is interpolated with explicit weights, because
//! texture units round theirs to 8 bits. A field larger than one binding of the device is cut into
//! slabs, one a binding.
//!
//! | file | holds |
//! |---|---|
//! | device.rs | finding an adapter, opening it, what it can hold |
//! | kernel.rs, *.wgsl | the shader, put together from what a scene calls for |
//! | volume.rs | the field on the device |
//! | paths.rs | [`GpuPaths`]: starts in, exits out, in batches |
//! | fall_back.rs | what happens to batches that the device does not finish: the device is opened
//! again, and then the CPU stands in |
//!
//! What has no kernel here is refused by name ([`GpuError::Unsupported`]): line of sight and full
//! marches, and gradients that are interpolated themselves.

mod cpu_fallback;
mod device;
mod kernel;
mod paths;
mod volume;

pub use device::Gpu;
pub use paths::{GpuCounters, GpuOptions, GpuPaths};

/// Why the GPU does not do it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// There is none.
    #[error(
        "no GPU: {0}; install its Vulkan driver (on Debian mesa-vulkan-drivers, which also has one \
         that runs on the CPU), or compute on the CPU (--device cpu)"
    )]
    NoAdapter(String),
    /// It cannot be opened.
    #[error("the GPU `{adapter}` cannot be opened: {reason}")]
    Open {
        /// Its name.
        adapter: String,
        /// What its driver says.
        reason: String,
    },
    /// There is no kernel for it.
    #[error("the GPU has no kernel for {what}; it has verlet with b-spline or trilinear. {cure}")]
    Unsupported {
        /// What was asked for.
        what: String,
        /// What to do instead.
        cure: &'static str,
    },
    /// The field does not fit.
    #[error(
        "{what} of {dims:?} nodes takes {need} and `{adapter}` has room for {room}; compute on the \
         CPU (--device cpu), or resample the flow coarser"
    )]
    TooLarge {
        /// Part of the field.
        what: &'static str,
        /// Of the field.
        dims: [usize; 3],
        /// What it would take.
        need: String,
        /// What there is.
        room: String,
        /// The device.
        adapter: String,
    },
    /// Its driver refused or failed.
    #[error("`{adapter}` failed: {reason}; compute on the CPU (--device cpu)")]
    Failed {
        /// The device.
        adapter: String,
        /// What its driver says.
        reason: String,
    },
    /// It failed again and again.
    #[error(
        "`{adapter}` failed ({reason}) after it was opened again {times} times, and is left alone; \
         look into its driver's log, or compute on the CPU (--device cpu)"
    )]
    GivenUp {
        /// The device.
        adapter: String,
        /// How often it was opened again.
        times: u32,
        /// What its driver said last.
        reason: String,
    },
}

/// A failure, told with the picture that was drawn all the same.
pub(crate) fn fallback_message(failure: &GpuError) -> String {
    match failure {
        GpuError::Failed { .. } => {
            format!("{}; what it left was computed on the CPU", failure_message(failure))
        }
        other => format!("computed on the CPU: {other}"),
    }
}

/// A failure, without what can be done about it.
pub(crate) fn failure_message(failure: &GpuError) -> String {
    match failure {
        GpuError::Failed { adapter, reason } => format!("the GPU `{adapter}` failed ({reason})"),
        other => other.to_string(),
    }
}
