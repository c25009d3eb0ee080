//! Finds a GPU, opens it, and reopens it after a failure.

use super::GpuError;
use super::kernel::{FIRST_SLAB, MOST_SLABS};
use super::part_size::PartSize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::Duration;
use wgpu::{DeviceType, ErrorFilter};

/// How often in a row a GPU is reopened after a failure. A batch that finishes between two failures
/// restarts the count. It shows that the device works, and the cause (such as a driver reset or a
/// suspended laptop) may be temporary.
pub(super) const MAX_REOPENINGS: u32 = 3;

/// Bytes per upload. A larger upload would be copied to staging memory as a whole before its
/// transfer begins.
pub(super) const UPLOAD_BYTES: usize = 64 << 20;

/// An open GPU. A program needs only one; see [`Gpu::shared`].
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    binding_bytes: u64,
    storage_buffers: u32,
    /// The first error outside an error scope.
    failure: Arc<OnceLock<String>>,
    pipelines: Mutex<BTreeMap<(String, &'static str), wgpu::ComputePipeline>>,
    /// How many photons it gets at a time.
    pub(super) part_size: PartSize,
    /// Whether this device has finished a batch.
    has_finished_batch: AtomicBool,
    /// How often in a row the GPU was reopened before this device.
    reopened: u32,
    replacement: Mutex<Replacement>,
}

/// The device that replaces a failed one.
#[derive(Default)]
struct Replacement {
    attempts: u32,
    successor: Option<Arc<Gpu>>,
}

impl Gpu {
    /// Opens the fastest kind of adapter: a discrete GPU is preferred to an integrated one, then a
    /// virtual one, then a driver that runs on the CPU.
    ///
    /// # Errors
    /// If there is no adapter, or it cannot be opened.
    pub fn open() -> Result<Gpu, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        // No validation layers and no debug labels, because error scopes catch errors where they
        // occur.
        descriptor.flags = wgpu::InstanceFlags::empty();
        let instance = wgpu::Instance::new(descriptor);
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        let rank = |a: &wgpu::Adapter| match a.get_info().device_type {
            DeviceType::DiscreteGpu => 0,
            DeviceType::IntegratedGpu => 1,
            DeviceType::VirtualGpu => 2,
            DeviceType::Other => 3,
            DeviceType::Cpu => 4,
        };
        let Some(adapter) = adapters.into_iter().min_by_key(rank) else {
            return Err(GpuError::NoAdapter("Vulkan finds no device".into()));
        };
        let info = adapter.get_info();
        let limits = adapter.limits();
        let opened = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: None,
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        }));
        let (device, queue) = opened
            .map_err(|e| GpuError::Open { adapter: info.name.clone(), reason: e.to_string() })?;
        // Without a handler, wgpu panics.
        let failure = Arc::new(OnceLock::new());
        let seen = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            let _ = seen.set(e.to_string());
        }));
        let seen = Arc::clone(&failure);
        device.set_device_lost_callback(move |_, why| {
            let _ = seen.set(format!("the device is lost: {why}"));
        });
        Ok(Gpu {
            device,
            queue,
            info,
            binding_bytes: largest_binding(&limits),
            storage_buffers: limits.max_storage_buffers_per_shader_stage,
            failure,
            pipelines: Mutex::default(),
            part_size: PartSize::default(),
            has_finished_batch: AtomicBool::new(false),
            reopened: 0,
            replacement: Mutex::default(),
        })
    }

    /// The program's shared GPU. The first call opens it; later calls reopen it after a failure.
    ///
    /// # Errors
    /// As [`Gpu::open`], and [`GpuError::GivenUp`] after several failures in a row. The absence of
    /// a GPU is determined only once.
    pub fn shared() -> Result<Arc<Gpu>, GpuError> {
        static SHARED: Mutex<Option<Result<Arc<Gpu>, GpuError>>> = Mutex::new(None);
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let gpu = match &*shared {
            Some(Ok(gpu)) => gpu.current(),
            Some(Err(none)) => Err(none.clone()),
            None => Gpu::open().map(Arc::new),
        };
        match &gpu {
            Ok(_) | Err(GpuError::NoAdapter(_)) => *shared = Some(gpu.clone()),
            // The next call retries.
            Err(_) => {}
        }
        gpu
    }

    /// This GPU, or its replacement if it failed. Reopens the GPU if there is no replacement yet.
    ///
    /// # Errors
    /// If the GPU cannot be reopened, or has failed too often.
    pub(super) fn current(self: &Arc<Gpu>) -> Result<Arc<Gpu>, GpuError> {
        let mut gpu = Arc::clone(self);
        while let Some(reason) = gpu.failure() {
            let mut s = gpu.replacement.lock().unwrap_or_else(PoisonError::into_inner);
            let successor = match &s.successor {
                Some(successor) => Arc::clone(successor),
                None => {
                    let before = if gpu.has_finished_batch.load(Ordering::Relaxed) {
                        0
                    } else {
                        gpu.reopened
                    };
                    let times = before + s.attempts;
                    if times >= MAX_REOPENINGS {
                        return Err(gpu.give_up_error(times, reason));
                    }
                    s.attempts += 1;
                    let opened = Gpu { reopened: before + s.attempts, ..Gpu::open()? };
                    let opened = Arc::new(opened.with_binding_limit(gpu.binding_bytes));
                    s.successor = Some(Arc::clone(&opened));
                    opened
                }
            };
            drop(s);
            gpu = successor;
        }
        Ok(gpu)
    }

    /// Limits the size of bindings, to test large fields.
    #[must_use]
    pub fn with_binding_limit(mut self, bytes: u64) -> Gpu {
        self.binding_bytes = self.binding_bytes.min(bytes) & !15;
        self
    }

    /// Destroys the device, as a driver reset does, to test recovery.
    pub fn destroy(&self) {
        self.device.destroy();
    }

    /// Marks the device as failed: it gets no more batches.
    pub(super) fn mark_failed(&self, reason: impl Into<String>) {
        // The first reason is the cause.
        let _ = self.failure.set(reason.into());
    }

    /// Records that a batch was finished.
    pub(super) fn mark_batch_finished(&self) {
        self.has_finished_batch.store(true, Ordering::Relaxed);
    }

    /// Name of the device and its driver.
    pub fn name(&self) -> String {
        match self.info.driver_info.as_str() {
            "" => self.info.name.clone(),
            driver => format!("{}, {} {driver}", self.info.name, self.info.driver),
        }
    }

    /// Whether the driver runs on the CPU. Its results are correct, but it is slower than this
    /// library's CPU kernels.
    pub fn is_software(&self) -> bool {
        self.device_type() == DeviceType::Cpu
    }

    /// What kind of adapter it is.
    pub(super) fn device_type(&self) -> DeviceType {
        self.info.device_type
    }

    /// Whether bindings are smaller than the device allows ([`Gpu::with_binding_limit`]).
    pub(super) fn has_binding_limit(&self) -> bool {
        self.binding_bytes < largest_binding(&self.device.limits())
    }

    /// Size of the largest binding in bytes.
    pub fn binding_bytes(&self) -> u64 {
        self.binding_bytes
    }

    /// Number of storage buffers that a kernel can have.
    pub(super) fn storage_buffers(&self) -> u32 {
        self.storage_buffers
    }

    /// Number of bindings that a kernel has for the field.
    pub(super) fn slabs(&self) -> u32 {
        // The parameters are not a storage buffer.
        self.storage_buffers.saturating_sub(FIRST_SLAB - 1).min(MOST_SLABS)
    }

    /// The failure of the device, if any.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    pub(super) fn give_up_error(&self, times: u32, reason: &str) -> GpuError {
        GpuError::GivenUp { adapter: self.info.name.clone(), times, reason: reason.into() }
    }

    pub(super) fn failed(&self, reason: impl Into<String>) -> GpuError {
        GpuError::Failed { adapter: self.info.name.clone(), reason: reason.into() }
    }

    /// Runs work that may fail on the device, and returns the error if it did.
    pub(super) fn checked<T>(&self, work: impl FnOnce() -> T) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(ErrorFilter::Validation);
        let internal = self.device.push_error_scope(ErrorFilter::Internal);
        let done = work();
        let errors = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
        if errors.iter().any(Option::is_some) {
            // A lost device reports the loss when it is polled. The caught error may only be a
            // consequence of it.
            let _ = self.device.poll(wgpu::PollType::Poll);
        }
        match errors.into_iter().flatten().next() {
            Some(e) => Err(self.failed(e.to_string())),
            None => self.failure().map_or(Ok(done), |e| Err(self.failed(e))),
        }
    }

    /// A buffer, which is zero.
    pub(super) fn buffer(&self, bytes: usize, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes as u64,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Copies a part of a field to a buffer of its own.
    pub(super) fn upload(&self, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
        self.checked(|| {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            let buffer = self.buffer(bytes.len(), usage);
            for (i, part) in bytes.chunks(UPLOAD_BYTES).enumerate() {
                self.queue.write_buffer(&buffer, (i * UPLOAD_BYTES) as u64, part);
                self.queue.submit([]);
            }
            buffer
        })
    }

    /// Binds buffers to the two groups of a kernel.
    pub(super) fn bind(
        &self,
        pipeline: &wgpu::ComputePipeline,
        groups: [&[(u32, wgpu::BindingResource<'_>)]; 2],
    ) -> Result<[wgpu::BindGroup; 2], GpuError> {
        self.checked(|| {
            [0, 1].map(|group| {
                let entries: Vec<_> = groups[group]
                    .iter()
                    .map(|(binding, resource)| wgpu::BindGroupEntry {
                        binding: *binding,
                        resource: resource.clone(),
                    })
                    .collect();
                self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: None,
                    layout: &pipeline.get_bind_group_layout(group as u32),
                    entries: &entries,
                })
            })
        })
    }

    /// Waits for a submission.
    pub(super) fn wait(&self, index: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        let wait = wgpu::PollType::Wait { submission_index: Some(index), timeout: None };
        if let Err(e) = self.device.poll(wait) {
            self.mark_failed(e.to_string());
        }
        self.failure().map_or(Ok(()), |e| Err(self.failed(e)))
    }

    /// Waits until the callback of a buffer has run. Another thread's poll may have seen the work
    /// complete and may not have run its callback yet, and a lost device may never run it.
    pub(super) fn wait_for_map(
        &self,
        mapped: &mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
    ) -> Result<(), GpuError> {
        const LOOK: Duration = Duration::from_millis(100);
        let result = loop {
            match mapped.recv_timeout(LOOK) {
                Err(mpsc::RecvTimeoutError::Timeout) if self.failure().is_none() => {}
                result => break result,
            }
        };
        let failure = match result {
            Ok(Ok(())) => None,
            Ok(Err(e)) => Some(e.to_string()),
            Err(e) => Some(e.to_string()),
        };
        if let Some(e) = failure {
            self.mark_failed(e);
        }
        self.failure().map_or(Ok(()), |e| Err(self.failed(e)))
    }

    /// The words of a buffer that can be mapped, after all that was submitted.
    pub(super) fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u32>, GpuError> {
        let (sender, mapped) = mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |r| {
            // The receiver is gone if the frame was abandoned.
            let _ = sender.send(r);
        });
        self.wait_for_all()?;
        self.wait_for_map(&mapped)?;
        let words = {
            let range = buffer.get_mapped_range(..).map_err(|e| {
                self.mark_failed(e.to_string());
                self.failed(e.to_string())
            })?;
            bytemuck::cast_slice(&range).to_vec()
        };
        buffer.unmap();
        Ok(words)
    }

    fn wait_for_all(&self) -> Result<(), GpuError> {
        if let Err(e) = self.device.poll(wgpu::PollType::wait_indefinitely()) {
            self.mark_failed(e.to_string());
        }
        self.failure().map_or(Ok(()), |e| Err(self.failed(e)))
    }

    /// The compiled kernel with this source text. The first use compiles it.
    pub(super) fn pipeline(
        &self,
        wgsl: String,
        entry_point: &'static str,
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        let mut made = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (wgsl, entry_point);
        if let Some(p) = made.get(&key) {
            return Ok(p.clone());
        }
        let pipeline = self.checked(|| {
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry_point),
                source: wgpu::ShaderSource::Wgsl(key.0.as_str().into()),
            });
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: None,
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            })
        })?;
        made.insert(key, pipeline.clone());
        Ok(pipeline)
    }
}

/// Size of the largest binding in bytes. It is rounded to whole vectors of four numbers, and
/// limited so that offsets fit 32 bits.
fn largest_binding(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(1 << 33) & !15
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu")
            .field("name", &self.name())
            .field("binding_bytes", &self.binding_bytes)
            .finish()
    }
}
