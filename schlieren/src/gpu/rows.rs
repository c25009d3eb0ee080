//! Copies the coefficients of a spline to the device in rows of four, so that the 64 of a sample
//! are 16 reads: a texture for drivers on the CPU, a buffer for discrete GPUs. This takes four
//! times the memory of slabs.

use super::device::UPLOAD_BYTES;
use super::{Gpu, GpuError};
use rayon::prelude::*;
use wgpu::{BufferUsages, DeviceType};

/// Memory of rows at most. A larger field is copied in slabs.
const MOST_BYTES: u64 = 1 << 30;

/// Rows on a device.
pub(super) enum Rows {
    /// A row of four in each texel.
    Texture(wgpu::TextureView),
    /// One after the other.
    Buffer(wgpu::Buffer),
}

/// The rows, the strides of neighbours along y and z, and the bytes that they take. `None` if the
/// device gets slabs: none of its kind was measured, the rows do not fit, or the size of bindings
/// is limited.
///
/// # Errors
/// If the device fails.
pub(super) fn upload(
    gpu: &Gpu,
    coefficients: &[f32],
    dims: [usize; 3],
) -> Result<Option<(Rows, [usize; 2], u64)>, GpuError> {
    let [columns, height, layers] = dims;
    let width = columns - 3;
    let stride = [width, width * height];
    let bytes = 16 * (stride[1] * layers) as u64;
    if gpu.has_binding_limit() || bytes > MOST_BYTES {
        return Ok(None);
    }
    let limits = gpu.device.limits();
    let made = match gpu.device_type() {
        DeviceType::Cpu => {
            let size = [width, height, layers].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
            if size[0].max(size[1]) > limits.max_texture_dimension_2d
                || size[2] > limits.max_texture_array_layers
            {
                return Ok(None);
            }
            texture(gpu, coefficients, size).map(Rows::Texture)
        }
        DeviceType::DiscreteGpu if bytes <= gpu.binding_bytes() => {
            buffer(gpu, coefficients, columns, bytes).map(Rows::Buffer)
        }
        _ => return Ok(None),
    };
    match made {
        Ok(rows) => Ok(Some((rows, stride, bytes))),
        // Slabs may still fit the memory of a device that works.
        Err(_) if gpu.failure().is_none() => Ok(None),
        Err(e) => Err(e),
    }
}

/// Each coefficient of a row of the lattice with the three that follow.
fn fours(row: &[f32]) -> impl Iterator<Item = [f32; 4]> {
    row.windows(4).map(|w| [w[0], w[1], w[2], w[3]])
}

fn texture(
    gpu: &Gpu,
    coefficients: &[f32],
    [width, height, layers]: [u32; 3],
) -> Result<wgpu::TextureView, GpuError> {
    let (columns, rows) = (width as usize + 3, height as usize);
    gpu.checked(|| {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("field"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let mut texels = Vec::with_capacity(width as usize * rows);
        for (z, layer) in (0..layers).zip(coefficients.chunks(columns * rows)) {
            texels.clear();
            texels.extend(layer.chunks(columns).flat_map(fours));
            let origin = wgpu::Origin3d { x: 0, y: 0, z };
            gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
                bytemuck::cast_slice(&texels),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(16 * width),
                    rows_per_image: None,
                },
                wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            );
        }
        gpu.queue.submit([]);
        texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        })
    })
}

fn buffer(
    gpu: &Gpu,
    coefficients: &[f32],
    columns: usize,
    bytes: u64,
) -> Result<wgpu::Buffer, GpuError> {
    let rows_at_once = (UPLOAD_BYTES / (16 * (columns - 3))).max(1);
    gpu.checked(|| {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let buffer = gpu.buffer(bytes as usize, usage);
        let mut at = 0;
        for part in coefficients.chunks(rows_at_once * columns) {
            let of_rows = part.par_chunks(columns).flat_map_iter(fours).collect::<Vec<_>>();
            let part: &[u8] = bytemuck::cast_slice(&of_rows);
            gpu.queue.write_buffer(&buffer, at, part);
            gpu.queue.submit([]);
            at += part.len() as u64;
        }
        buffer
    })
}
