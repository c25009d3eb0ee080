//! Traces rays on the GPU in batches: [`GpuPaths`].

use super::bricks::{self, DeviceBricks};
use super::cpu_fallback::{BatchTracer, CpuFallback, Failure};
use super::device::MAX_REOPENINGS;
use super::kernel::{BRICKS, Kernel, SKIPPING};
use super::method::{GpuOptions, Method};
use super::volume::{DeviceVolume, NodeValues, VolumeCache};
use super::work::{GpuCounters, Work};
use super::{Gpu, GpuError};
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant};
use crate::march::{
    BlankCells, FieldCache, Frame, KernelOutput, KernelRay, LineOfSight, Projection,
};
use crate::path::{Exit, LightPaths, PathQuantities, SkipReport, Start};
use crate::view::View;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use wgpu::{BufferDescriptor, BufferUsages};

/// Number of rays per dispatch. This is enough to fill any device. It is small enough that two
/// batches take little memory and no driver assumes that the device hangs.
const BATCH: usize = 1 << 18;
/// Bits of `KernelOutput::worst_node` of march.wgsl.
const WORST_NODE: u32 = 3;
const TURNED: u32 = 4;
/// Workgroup size of march.wgsl.
const WORKGROUP: usize = 64;

/// Traces light on a GPU. Every call costs a round trip to the
/// device, so [`LightPaths::trace_parallel`] with many starts is fastest.
///
/// If the device fails during a call, it is reopened, at most a few times, and the lost rays are
/// traced again ([`GpuCounters::rays_repeated`]). The CPU traces the rest
/// ([`GpuCounters::rays_on_cpu`]). [`LightPaths::device_warning`] names the cause and the remedy.
///
/// If a ray is stopped, its `status` is the cause, and deflection and displacement are those at the
/// point where it stopped.
pub struct GpuPaths<'a> {
    pub(super) field: &'a Field,
    pub(super) frame: Frame,
    interpolant: Interpolant,
    pub(super) options: GpuOptions,
    /// The projection that straight rays sample, with [`Method::LineOfSight`].
    projection: Option<Arc<LineOfSight>>,
    /// Number of rays per dispatch.
    batch: usize,
    current: Mutex<CurrentDevice>,
    /// Traces on the CPU when the device fails.
    pub(super) cpu_fallback_paths: CpuFallback<'a>,
    pub(super) work: Work,
}

/// The field and the kernel on one device.
pub(super) struct DeviceState {
    pub(super) gpu: Arc<Gpu>,
    /// Number of devices that preceded this one.
    pub(super) number: u32,
    pub(super) kernel: Kernel,
    /// The kernel of single rays; there is none for straight rays.
    pipeline: Option<wgpu::ComputePipeline>,
    pub(super) volume: Arc<DeviceVolume>,
    /// Counts of the steps that rays skip.
    skipping: Option<wgpu::Buffer>,
    /// Buffers that no batch is using.
    idle: Mutex<Vec<Scratch>>,
}

/// The device in use.
struct CurrentDevice {
    on_device: Arc<DeviceState>,
    /// How often a replacement was requested.
    attempts: u32,
}

impl DeviceState {
    fn new(
        gpu: Arc<Gpu>,
        number: u32,
        volume: Arc<DeviceVolume>,
        interpolant: Interpolant,
        options: GpuOptions,
    ) -> Result<DeviceState, GpuError> {
        let kernel = Kernel {
            method: options.method,
            interpolant,
            opd: options.quantities.opd,
            skip: volume.bricks.is_some(),
            nodes: volume.kinds.is_some(),
            layout: volume.values.layout(),
        };
        let is_marched = options.method != Method::LineOfSight;
        let pipeline = is_marched.then(|| gpu.pipeline(kernel.of_rays(), "march")).transpose()?;
        let skipping = volume.bricks.is_some().then(|| bricks::counts(&gpu)).transpose()?;
        let idle = Mutex::default();
        Ok(DeviceState { gpu, number, kernel, pipeline, volume, skipping, idle })
    }

    /// What a march reads of the field, and where it counts what it skips.
    pub(super) fn field_bindings(&self) -> Vec<(u32, wgpu::BindingResource<'_>)> {
        let volume = &self.volume;
        let buffers = [
            (3, volume.kinds.as_ref()),
            (BRICKS, volume.bricks.as_ref().map(|b| &b.buffer)),
            (SKIPPING, self.skipping.as_ref()),
        ];
        let mut bound = volume.values.bindings();
        bound
            .extend(buffers.into_iter().filter_map(|(i, b)| b.map(|b| (i, b.as_entire_binding()))));
        bound
    }

    /// Number of storage buffers of [`DeviceState::field_bindings`].
    pub(super) fn field_buffers(&self) -> u32 {
        let skipping = if self.volume.bricks.is_some() { 2 } else { 0 };
        u32::from(self.volume.kinds.is_some()) + self.volume.values.layout().buffers() + skipping
    }

    fn failure(&self, error: GpuError) -> Failure {
        Failure { device: self.number, error }
    }

    /// Reuses or creates buffers for this number of rays.
    fn scratch(&self, pipeline: &wgpu::ComputePipeline, rays: usize) -> Result<Scratch, GpuError> {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(i) = idle.iter().position(|s| s.capacity >= rays) {
            return Ok(idle.swap_remove(i));
        }
        drop(idle);
        let capacity = rays.next_power_of_two().clamp(1024, BATCH);
        self.gpu.checked(|| {
            let buffer = |size: usize, usage| {
                self.gpu.device.create_buffer(&BufferDescriptor {
                    label: None,
                    size: size as u64,
                    usage,
                    mapped_at_creation: false,
                })
            };
            let params =
                buffer(size_of::<Params>(), BufferUsages::UNIFORM | BufferUsages::COPY_DST);
            let rays =
                buffer(capacity * size_of::<Ray>(), BufferUsages::STORAGE | BufferUsages::COPY_DST);
            let output_bytes = capacity * size_of::<RawKernelOutput>();
            let outputs = buffer(output_bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
            let readback = buffer(output_bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
            let mut bound: Vec<_> = [(0, &params), (1, &rays), (2, &outputs)]
                .map(|(binding, b)| (binding, b.as_entire_binding()))
                .into();
            bound.extend(self.field_bindings());
            let entries: Vec<_> = bound
                .into_iter()
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            let bindings = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            Scratch { capacity, params, rays, outputs, readback, bindings }
        })
    }
}

/// [`Ray`] of march.wgsl.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Ray {
    middle: [f32; 3],
    dt: f32,
    stride: [f32; 3],
    steps: u32,
    along: [f32; 3],
    unused_0: u32,
    xi: [f32; 3],
    unused_1: u32,
}

/// `KernelOutput` of march.wgsl.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawKernelOutput {
    v: [f32; 3],
    opd: f32,
    xi: [f32; 3],
    worst_node: u32,
}

/// `Params` of march.wgsl.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Params {
    h2: [f32; 3],
    rays: u32,
    rcp_h2: [f32; 3],
    survives: u32,
    last: [f32; 3],
    row: u32,
    last_cell: [f32; 3],
    layer: u32,
    dims: [u32; 3],
    slab: u32,
    zero: u32,
    skip_rad: f32,
    skip_opd: f32,
    unused: u32,
}

/// Buffers for one batch.
struct Scratch {
    capacity: usize,
    params: wgpu::Buffer,
    rays: wgpu::Buffer,
    outputs: wgpu::Buffer,
    readback: wgpu::Buffer,
    bindings: wgpu::BindGroup,
}

/// A submitted batch.
pub(super) struct Pending {
    on_device: Arc<DeviceState>,
    scratch: Scratch,
    prepared: Vec<KernelRay>,
    index: wgpu::SubmissionIndex,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
}

impl<'a> GpuPaths<'a> {
    /// Compiles the kernel and copies the field (or its spline) to the device.
    ///
    /// # Errors
    /// If the field does not fit, the device fails, or a method other than Verlet shall skip.
    pub fn new(
        gpu: Arc<Gpu>,
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: GpuOptions,
    ) -> Result<GpuPaths<'a>, GpuError> {
        let caches = (&FieldCache::default(), &VolumeCache::default());
        GpuPaths::with_caches(gpu, field, view, interpolant, options, caches)
    }

    /// As [`GpuPaths::new`]. The spline, and what is copied to the device, are kept in `caches` for
    /// other paths through the same field.
    ///
    /// # Errors
    /// As [`GpuPaths::new`].
    pub fn with_caches(
        gpu: Arc<Gpu>,
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: GpuOptions,
        caches: (&FieldCache, &VolumeCache),
    ) -> Result<GpuPaths<'a>, GpuError> {
        let skip = options.skip_rad > 0.0;
        if skip && options.method != Method::Verlet {
            return Err(GpuError::Unsupported {
                what: format!("skipping with {:?}", options.method),
                cure: "Set GpuOptions::skip_rad to 0, or march by Method::Verlet.",
            });
        }
        let projection = (options.method == Method::LineOfSight).then(|| {
            let GpuOptions { quantities, blank, .. } = options;
            caches.0.line_of_sight(field, Projection { view, interpolant, quantities, blank })
        });
        let (volume, bytes) = match &projection {
            Some(sight) => caches.1.projection(&gpu, sight)?,
            None => caches.1.volume(&gpu, field, (interpolant, skip), caches.0)?,
        };
        let work = Work::default();
        work.add_to_device(bytes);
        let on_device = DeviceState::new(gpu, 0, volume, interpolant, options)?;
        Ok(GpuPaths {
            field,
            frame: Frame::new(field, view),
            interpolant,
            options,
            projection,
            batch: BATCH / options.method.samples(),
            current: Mutex::new(CurrentDevice { on_device: Arc::new(on_device), attempts: 0 }),
            cpu_fallback_paths: CpuFallback::of_march(field, view, interpolant, options),
            work,
        })
    }

    /// Counts of the work so far.
    pub fn counters(&self) -> GpuCounters {
        GpuCounters {
            rays_repeated: self.cpu_fallback_paths.repeated(),
            rays_on_cpu: self.cpu_fallback_paths.rays(),
            ..self.work.counters()
        }
    }

    /// Limits the number of rays per batch, to test several batches.
    #[must_use]
    pub fn with_batch(self, rays: usize) -> GpuPaths<'a> {
        GpuPaths { batch: rays.clamp(1, BATCH), ..self }
    }

    /// The device in use.
    pub fn gpu(&self) -> Arc<Gpu> {
        Arc::clone(&self.on_device().gpu)
    }

    pub(super) fn on_device(&self) -> Arc<DeviceState> {
        Arc::clone(&self.current.lock().unwrap_or_else(PoisonError::into_inner).on_device)
    }

    /// Memory of the field on the device in bytes, without batches.
    pub fn device_bytes(&self) -> u64 {
        self.on_device().volume.bytes
    }

    /// Number of buffers over which the field is divided; 0 if a driver on the CPU has it as a
    /// texture.
    pub fn slabs(&self) -> usize {
        self.on_device().volume.values.layout().buffers() as usize
    }

    pub(super) fn params(&self, volume: &DeviceVolume, rays: usize) -> Params {
        let h = (self.frame.spacing_m / self.frame.unit_m).to_array();
        let dims = self.field.dims();
        Params {
            h2: h.map(|h| (h * h) as f32),
            rays: rays as u32,
            rcp_h2: h.map(|h| (1.0 / (h * h)) as f32),
            survives: match self.options.blank {
                BlankCells::Opaque => 0,
                BlankCells::Continued => 1,
            },
            last: dims.map(|n| (n - 1) as f32),
            row: volume.stride[0] as u32,
            last_cell: dims.map(|n| (n - 2) as f32),
            layer: volume.stride[1] as u32,
            dims: dims.map(|n| n as u32),
            slab: volume.layers as u32,
            zero: 0,
            skip_rad: self.options.skip_rad as f32,
            skip_opd: (self.options.skip_opd_m / self.frame.unit_m) as f32,
            unused: 0,
        }
    }

    /// Converts starts to the kernel's rays. Rays that miss the field stay zero.
    fn prepare(&self, starts: &[Start], prepared: &mut [KernelRay], rays: &mut [Ray]) {
        let mut known = None;
        for ((start, p), ray) in starts.iter().zip(prepared).zip(rays) {
            *p = KernelRay::new(&self.frame, start, &mut known);
            let steps = p.steps(self.options.step_voxels);
            if steps > 0 {
                let e = p.entry(&self.frame, steps);
                *ray = Ray {
                    middle: e.middle,
                    dt: e.dt,
                    stride: e.stride,
                    steps,
                    along: e.along,
                    unused_0: 0,
                    xi: e.xi,
                    unused_1: 0,
                };
            }
        }
    }
}

impl BatchTracer for GpuPaths<'_> {
    type Pending = Pending;

    fn submit(&self, starts: &[Start], parallel: bool) -> Result<Pending, Failure> {
        let on_device = self.on_device();
        let gpu = &on_device.gpu;
        if let Some(e) = gpu.failure() {
            return Err(on_device.failure(gpu.failed(e)));
        }
        let mut prepared = vec![KernelRay::default(); starts.len()];
        let mut rays = vec![Ray::zeroed(); starts.len()];
        if parallel {
            const CHUNK: usize = 1024;
            starts
                .par_chunks(CHUNK)
                .zip(prepared.par_chunks_mut(CHUNK))
                .zip(rays.par_chunks_mut(CHUNK))
                .for_each(|((s, p), r)| self.prepare(s, p, r));
        } else {
            self.prepare(starts, &mut prepared, &mut rays);
        }
        // Straight rays are not sent.
        let Some(pipeline) = &on_device.pipeline else {
            let error = gpu.failed("single rays of a projection have no kernel");
            return Err(on_device.failure(error));
        };
        let scratch =
            on_device.scratch(pipeline, starts.len()).map_err(|e| on_device.failure(e))?;
        let queue = &gpu.queue;
        queue.write_buffer(
            &scratch.params,
            0,
            bytemuck::bytes_of(&self.params(&on_device.volume, starts.len())),
        );
        queue.write_buffer(&scratch.rays, 0, bytemuck::cast_slice(&rays));
        let mut commands = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = commands.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &scratch.bindings, &[]);
            pass.dispatch_workgroups(starts.len().div_ceil(WORKGROUP) as u32, 1, 1);
        }
        let bytes = (starts.len() * size_of::<RawKernelOutput>()) as u64;
        commands.copy_buffer_to_buffer(&scratch.outputs, 0, &scratch.readback, 0, bytes);
        let index = queue.submit([commands.finish()]);
        let (sender, mapped) = mpsc::channel();
        scratch.readback.map_async(wgpu::MapMode::Read, ..bytes, move |r| {
            // The receiver is gone if the batch was abandoned.
            let _ = sender.send(r);
        });
        let steps: u64 = rays.iter().map(|r| u64::from(r.steps)).sum();
        self.work.add_steps(steps);
        self.work.add_submission(1);
        self.work.add_to_device((size_of::<Params>() + size_of_val(&rays[..])) as u64);
        self.work.add_from_device(bytes);
        Ok(Pending { on_device, scratch, prepared, index, mapped })
    }

    fn finish(&self, pending: Pending, exits: &mut [Exit], parallel: bool) -> Result<(), Failure> {
        let on_device = &pending.on_device;
        let gpu = &on_device.gpu;
        let failed = |e: &dyn std::fmt::Display| {
            gpu.mark_failed(e.to_string());
            on_device
                .failure(gpu.failed(gpu.failure().map_or_else(|| e.to_string(), str::to_string)))
        };
        gpu.wait(pending.index).map_err(|e| on_device.failure(e))?;
        gpu.wait_for_map(&pending.mapped).map_err(|e| on_device.failure(e))?;
        let bytes = (exits.len() * size_of::<RawKernelOutput>()) as u64;
        {
            let range =
                pending.scratch.readback.get_mapped_range(..bytes).map_err(|e| failed(&e))?;
            let outputs: &[RawKernelOutput] = bytemuck::cast_slice(&range);
            let read = |((exit, p), raw): ((&mut Exit, &KernelRay), &RawKernelOutput)| {
                let opd = self.options.quantities.opd.then_some(raw.opd);
                let output = KernelOutput {
                    v: raw.v,
                    xi: raw.xi,
                    opd,
                    worst_node: (raw.worst_node & WORST_NODE) as u8,
                    turned: raw.worst_node & TURNED != 0,
                };
                *exit = p.exit(&self.frame, self.field.n0(), self.options.blank, &output);
            };
            if parallel {
                const LEAST: usize = 1024;
                let all = exits.par_iter_mut().zip(&pending.prepared).zip(outputs);
                all.with_min_len(LEAST).for_each(read);
            } else {
                exits.iter_mut().zip(&pending.prepared).zip(outputs).for_each(read);
            }
        }
        pending.scratch.readback.unmap();
        gpu.mark_batch_finished();
        on_device.idle.lock().unwrap_or_else(PoisonError::into_inner).push(pending.scratch);
        Ok(())
    }

    fn replace(&self, failed: &Failure) -> Result<(), GpuError> {
        self.replace_device(failed)
    }
}

impl GpuPaths<'_> {
    /// Replaces the failed device: [`BatchTracer::replace`].
    pub(super) fn replace_device(&self, failed: &Failure) -> Result<(), GpuError> {
        // A thread that waits for this lock takes no other jobs. Nothing below may therefore wait
        // for a job, so what the interpolant reads is computed on this
        // thread alone.
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if current.on_device.number != failed.device {
            return Ok(());
        }
        let gpu = &current.on_device.gpu;
        let Some(reason) = gpu.failure() else {
            // The batch failed, but not the device.
            return Err(failed.error.clone());
        };
        if current.attempts >= MAX_REOPENINGS {
            return Err(gpu.give_up_error(current.attempts, reason));
        }
        let gpu = Arc::clone(gpu);
        current.attempts += 1;
        let gpu = gpu.current()?;
        let number = failed.device + 1;
        if let Some(sight) = &self.projection {
            let volume = Arc::new(DeviceVolume::projected(&gpu, sight)?);
            self.work.add_to_device(volume.bytes);
            let made = DeviceState::new(gpu, number, volume, self.interpolant, self.options)?;
            current.on_device = Arc::new(made);
            return Ok(());
        }
        let values = NodeValues::on_this_thread(self.field, self.interpolant);
        let bricks = match &values {
            _ if self.options.skip_rad <= 0.0 => None,
            NodeValues::BSpline(spline) => Some(DeviceBricks::new(&gpu, self.field, spline, true)?),
            _ => {
                let spline = BSpline::on_this_thread(self.field);
                Some(DeviceBricks::new(&gpu, self.field, &spline, true)?)
            }
        };
        let volume = Arc::new(DeviceVolume::new(&gpu, self.field, &values, bricks)?);
        self.work.add_to_device(volume.bytes);
        let made = DeviceState::new(gpu, number, volume, self.interpolant, self.options)?;
        current.on_device = Arc::new(made);
        Ok(())
    }
}

impl LightPaths for GpuPaths<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        if let Some(sight) = &self.projection {
            return sight.trace(starts, exits);
        }
        self.work.add_rays(starts.len() as u64);
        self.cpu_fallback_paths.trace(self, self.batch, starts, exits, false);
    }

    fn view(&self) -> &View {
        &self.frame.view
    }

    fn rays_at_once(&self) -> Option<usize> {
        self.projection.as_ref().and_then(|sight| sight.rays_at_once())
    }

    fn quantities(&self) -> PathQuantities {
        self.options.quantities
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * DVec3::min_element(self.frame.spacing_m)
    }

    fn skip_report(&self) -> Option<SkipReport> {
        let on_device = self.on_device();
        let bricks = on_device.volume.bricks.as_ref()?;
        let counts = on_device.skipping.as_ref()?;
        // What a lost device counted is lost, but every ray keeps the tolerance.
        let (steps, bound_rad) =
            bricks::read_counts(&on_device.gpu, counts).unwrap_or(([0; 2], self.options.skip_rad));
        let bound_rad = if on_device.number > 0 { self.options.skip_rad } else { bound_rad };
        Some(bricks.report(steps, bound_rad))
    }

    fn device_warning(&self) -> Option<String> {
        self.cpu_fallback_paths.device_warning()
    }

    fn trace_parallel(&self, starts: &[Start], exits: &mut [Exit]) {
        if let Some(sight) = &self.projection {
            return sight.trace_parallel(starts, exits);
        }
        self.work.add_rays(starts.len() as u64);
        self.cpu_fallback_paths.trace(self, self.batch, starts, exits, true);
    }
}
