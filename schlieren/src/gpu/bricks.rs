//! Bricks of a field on the device, and counts of the steps that rays skip in them.

use super::{Gpu, GpuError};
use crate::field::Field;
use crate::interpolate::BSpline;
use crate::march::Frame;
use crate::path::SkipReport;
use crate::skip::Bricks;
use wgpu::BufferUsages;

/// The bricks of a field on a device.
pub(super) struct DeviceBricks {
    pub(super) buffer: wgpu::Buffer,
    build_secs: f64,
}

impl DeviceBricks {
    /// Bounds for the spline through a field hold for the other interpolants, too. With
    /// `on_this_thread`, the calling thread alone computes them, and waits for no other thread.
    pub(super) fn new(
        gpu: &Gpu,
        field: &Field,
        spline: &BSpline,
        on_this_thread: bool,
    ) -> Result<DeviceBricks, GpuError> {
        let bricks = if on_this_thread {
            Bricks::on_this_thread(field, spline)
        } else {
            Bricks::new(field, spline)
        };
        let unit_m = Frame::unit_of(field.spacing_m().into()) as f32;
        let numbers = |b: &crate::skip::Brick| {
            let has_nodes = f32::from(u8::from(b.has_nodes));
            [b.max_gradient_per_m * unit_m, b.mean_eps, b.half_range_eps, has_nodes]
        };
        let numbers: Vec<[f32; 4]> = bricks.all().iter().map(numbers).collect();
        if size_of_val(&numbers[..]) as u64 > gpu.binding_bytes() {
            return Err(GpuError::Unsupported {
                what: format!("skipping in {} bricks", numbers.len()),
                cure: "Omit --skip, or compute on the CPU (--device cpu).",
            });
        }
        let buffer = gpu.upload(bytemuck::cast_slice(&numbers))?;
        Ok(DeviceBricks { buffer, build_secs: bricks.build_time().as_secs_f64() })
    }

    /// What rays skipped.
    pub(super) fn report(&self, [steps, skipped]: [u64; 2], bound_rad: f64) -> SkipReport {
        SkipReport {
            steps_part: skipped as f64 / steps.max(1) as f64,
            bound_rad,
            bricks_bytes: self.buffer.size() as usize,
            bricks_secs: self.build_secs,
        }
    }
}

/// Words of the counts of bricks.wgsl.
const WORDS: usize = 5;

/// A buffer for the counts. New buffers are zero.
pub(super) fn counts(gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
    gpu.checked(|| gpu.buffer(4 * WORDS, BufferUsages::STORAGE | BufferUsages::COPY_SRC))
}

/// Reads the numbers of steps and of skipped steps, and the largest bound on a lost deflection.
pub(super) fn read_counts(gpu: &Gpu, counts: &wgpu::Buffer) -> Result<([u64; 2], f64), GpuError> {
    let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
    let readback = gpu.checked(|| gpu.buffer(4 * WORDS, usage))?;
    let mut commands = gpu.device.create_command_encoder(&Default::default());
    commands.copy_buffer_to_buffer(counts, 0, &readback, 0, counts.size());
    gpu.queue.submit([commands.finish()]);
    let words = gpu.read(&readback)?;
    let sum = |at: usize| u64::from(words[at]) | u64::from(words[at + 1]) << 32;
    Ok(([sum(0), sum(2)], f64::from(f32::from_bits(words[4]))))
}
