//! Counts the work of a device.

use std::sync::atomic::{AtomicU64, Ordering};

/// Counts of the work so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct GpuCounters {
    /// Number of rays that the host prepared.
    pub rays: u64,
    /// Number of photons, or of triangles of beams, that started and ended on the device.
    pub photons: u64,
    /// Number of steps of both. Steps of the corners of beams are not counted.
    pub ray_steps: u64,
    /// Number of kernels started.
    pub dispatches: u64,
    /// Number of times that work was given to the device.
    pub submissions: u64,
    /// Bytes written to the device: the field, if it was not there, and what frames need.
    pub bytes_to_device: u64,
    /// Bytes read back.
    pub bytes_from_device: u64,
    /// Number of rays, or photons, that were traced again on a reopened device.
    pub rays_repeated: u64,
    /// Number of rays that the CPU traced because the device failed.
    pub rays_on_cpu: u64,
}

/// [`GpuCounters`] that several threads count.
#[derive(Debug, Default)]
pub(super) struct Work {
    rays: AtomicU64,
    photons: AtomicU64,
    ray_steps: AtomicU64,
    dispatches: AtomicU64,
    submissions: AtomicU64,
    bytes_to_device: AtomicU64,
    bytes_from_device: AtomicU64,
}

impl Work {
    pub(super) fn add_rays(&self, rays: u64) {
        self.rays.fetch_add(rays, Ordering::Relaxed);
    }

    pub(super) fn add_frame(&self, photons: u64, steps: u64) {
        self.photons.fetch_add(photons, Ordering::Relaxed);
        self.add_steps(steps);
    }

    pub(super) fn add_steps(&self, steps: u64) {
        self.ray_steps.fetch_add(steps, Ordering::Relaxed);
    }

    pub(super) fn add_submission(&self, dispatches: u64) {
        self.submissions.fetch_add(1, Ordering::Relaxed);
        self.dispatches.fetch_add(dispatches, Ordering::Relaxed);
    }

    pub(super) fn add_to_device(&self, bytes: u64) {
        self.bytes_to_device.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn add_from_device(&self, bytes: u64) {
        self.bytes_from_device.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn counters(&self) -> GpuCounters {
        let read = |c: &AtomicU64| c.load(Ordering::Relaxed);
        GpuCounters {
            rays: read(&self.rays),
            photons: read(&self.photons),
            ray_steps: read(&self.ray_steps),
            dispatches: read(&self.dispatches),
            submissions: read(&self.submissions),
            bytes_to_device: read(&self.bytes_to_device),
            bytes_from_device: read(&self.bytes_from_device),
            ..GpuCounters::default()
        }
    }
}
