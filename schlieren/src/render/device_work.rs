//! What a GPU did for an image.

/// The work of a GPU for an image, over all wavelengths. Its map is not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[non_exhaustive]
pub struct DeviceWork {
    /// Photons, or triangles of beams, that started and ended on the device. 0 where the CPU
    /// prepares rays and exposes the film.
    pub photons: u64,
    /// Steps of photons, and of rays that the CPU prepared. Those of beams are not counted.
    pub ray_steps: u64,
    /// Rays that the CPU prepared.
    pub rays: u64,
    /// Number of times that work was given to the device.
    pub submissions: u64,
    /// Bytes written to the device. This includes the flow unless it was there.
    pub bytes_to_device: u64,
    /// Bytes read back.
    pub bytes_from_device: u64,
}

#[cfg(feature = "gpu")]
impl DeviceWork {
    /// Adds the work of one wavelength.
    pub(super) fn add(&mut self, counters: &crate::gpu::GpuCounters) {
        self.photons += counters.photons;
        self.ray_steps += counters.ray_steps;
        self.rays += counters.rays;
        self.submissions += counters.submissions;
        self.bytes_to_device += counters.bytes_to_device;
        self.bytes_from_device += counters.bytes_from_device;
    }
}
