//! The cone filter on the device: photons are kept, sorted by pixels, and searched for the nearest
//! to each pixel.

use super::bound_kernel::BoundKernel;
use super::film::FilmLayout;
use super::shader::FrameShader;
use crate::film::Framing;
use crate::gpu::{Gpu, GpuError};
use wgpu::{BindingResource, BufferUsages};

/// `BORDER` of squares.wgsl.
const BORDER: usize = 8;
/// Work groups along x of a dispatch over all photons.
const GROUPS_OF_A_ROW: usize = 1 << 14;

/// Buffers and kernels of a cone filter on a device.
pub(super) struct ConeOnDevice {
    kept: wgpu::Buffer,
    counts: wgpu::Buffer,
    /// What sorts the photons, in the order in which it runs, with its work groups.
    pub(super) sort: Vec<(BoundKernel, [u32; 2])>,
    pub(super) filter: BoundKernel,
    pub(super) picture: wgpu::Buffer,
}

/// Bytes of the buffer of so many photons.
pub(super) fn kept_bytes(photons: usize, channels: usize) -> usize {
    4 * (3 + channels) * photons
}

impl ConeOnDevice {
    /// Makes room for so many photons.
    ///
    /// # Errors
    /// If there is none, or the device fails.
    pub(super) fn new(
        gpu: &Gpu,
        shader: &FrameShader<'_>,
        layout: &FilmLayout,
        framing: &Framing,
        frame: &wgpu::Buffer,
        photons: usize,
    ) -> Result<ConeOnDevice, GpuError> {
        let [columns, rows] = [framing.width, framing.height].map(|n| n as usize + 2 * BORDER);
        let storage = BufferUsages::STORAGE;
        // New buffers are zero: no square has a photon, and no photon has landed.
        let [kept, counts, begins, row_totals, order] = gpu.checked(|| {
            [
                kept_bytes(photons, layout.channels()),
                4 * columns * rows,
                4 * (columns * rows + 1),
                4 * rows,
                4 * photons,
            ]
            .map(|bytes| gpu.buffer(bytes, storage))
        })?;
        let picture = gpu.checked(|| {
            gpu.buffer(layout.picture_bytes() as usize, storage | BufferUsages::COPY_SRC)
        })?;
        let bound = |wgsl: String, name, buffers: &[(u32, &wgpu::Buffer)]| {
            let pipeline = gpu.pipeline(wgsl, name)?;
            let own: Vec<_> = buffers.iter().map(|(i, b)| (*i, b.as_entire_binding())).collect();
            let groups = gpu.bind(&pipeline, [&[], &own])?;
            Ok::<_, GpuError>((pipeline, groups))
        };
        let of_rows = [rows.div_ceil(64) as u32, 1];
        let groups = photons.div_ceil(64);
        let across = groups.min(GROUPS_OF_A_ROW);
        let of_photons = [across, groups.div_ceil(across.max(1))].map(|n| n as u32);
        let own = [(0, frame), (2, &row_totals), (3, &begins), (6, &counts)];
        let rows = bound(shader.sort(), "add_rows", &[own[0], own[1], own[3]])?;
        let squares = bound(shader.sort(), "begin_squares", &own)?;
        let own = [(4, &order), (5, &kept), (6, &counts)];
        let photons = bound(shader.sort(), "order_photons", &own)?;
        let own = [(0, frame), (2, &picture), (3, &begins), (4, &order), (5, &kept)];
        let filter = bound(shader.cone(), "cone", &own)?;
        let sort = vec![(rows, of_rows), (squares, of_rows), (photons, of_photons)];
        Ok(ConeOnDevice { kept, counts, sort, filter, picture })
    }

    /// What keeps the photons.
    pub(super) fn bindings(&self) -> [(u32, BindingResource<'_>); 2] {
        [(5, self.kept.as_entire_binding()), (6, self.counts.as_entire_binding())]
    }
}
