//! A field that is projected along the light on the device: the maps that straight rays sample.

use super::kernel::{FIRST_SLAB, FieldLayout, PROJECTION};
use super::{Gpu, GpuError};
use crate::march::{LineOfSight, ProjectedMap};
use bytemuck::{Pod, Zeroable};
use wgpu::{BindingResource, BufferUsages};

/// A projection on a device.
pub(super) struct DeviceProjection {
    numbers: wgpu::Buffer,
    /// Coefficients of the path, then for oblique views of the deflection along right and up.
    coefficients: Vec<wgpu::Buffer>,
}

/// `Projection` of line_of_sight.wgsl.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ProjectionParams {
    centre: [f32; 2],
    centre_low: [f32; 2],
    per_m: [f32; 2],
    per_m_low: [f32; 2],
    last: [f32; 2],
    row: u32,
    exit_depth_m: f32,
}

impl ProjectionParams {
    fn new(map: &ProjectedMap, exit_depth_m: Option<f64>) -> ProjectionParams {
        let high = |v: [f64; 2]| v.map(|v| v as f32);
        let low = |v: [f64; 2]| v.map(|v| (v - f64::from(v as f32)) as f32);
        ProjectionParams {
            centre: high(map.centre),
            centre_low: low(map.centre),
            per_m: high(map.per_m),
            per_m_low: low(map.per_m),
            last: map.dims.map(|n| (n - 1) as f32),
            row: map.row as u32,
            exit_depth_m: exit_depth_m.unwrap_or(0.0) as f32,
        }
    }
}

impl DeviceProjection {
    /// Uploads the maps of a projection.
    ///
    /// # Errors
    /// If they do not fit a binding of the device, or it fails.
    pub(super) fn new(gpu: &Gpu, sight: &LineOfSight) -> Result<DeviceProjection, GpuError> {
        let (map, exit_depth_m) = sight.projection();
        let (need, available) = (size_of_val(&map.coefficients[..]) as u64, gpu.binding_bytes());
        if need > available {
            let [width, height] = map.dims;
            let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
            return Err(GpuError::TooLarge {
                what: "a projection",
                dims: [width, height, 1],
                need: mib(need),
                available: format!("a binding of {}", mib(available)),
                adapter: gpu.name(),
            });
        }
        let numbers = ProjectionParams::new(map, exit_depth_m);
        let numbers = gpu.checked(|| {
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            let buffer = gpu.buffer(size_of::<ProjectionParams>(), usage);
            gpu.queue.write_buffer(&buffer, 0, bytemuck::bytes_of(&numbers));
            buffer
        })?;
        let maps = std::iter::once(&map.coefficients).chain(map.slopes.iter().flatten());
        let coefficients = maps
            .map(|m| gpu.upload(bytemuck::cast_slice(m)))
            .collect::<Result<Vec<_>, GpuError>>()?;
        Ok(DeviceProjection { numbers, coefficients })
    }

    /// Memory in bytes.
    pub(super) fn bytes(&self) -> u64 {
        let all = std::iter::once(&self.numbers).chain(&self.coefficients);
        all.map(wgpu::Buffer::size).sum()
    }

    pub(super) fn layout(&self) -> FieldLayout {
        if self.coefficients.len() == 1 {
            FieldLayout::ProjectedAlongAxis
        } else {
            FieldLayout::ProjectedObliquely
        }
    }

    /// What a kernel binds.
    pub(super) fn bindings(&self) -> Vec<(u32, BindingResource<'_>)> {
        let maps = (FIRST_SLAB..).zip(&self.coefficients);
        let all = std::iter::once((PROJECTION, &self.numbers)).chain(maps);
        all.map(|(i, b)| (i, b.as_entire_binding())).collect()
    }
}
