//! Finding a GPU and opening it.

use super::GpuError;
use super::kernel::{FIRST_SLAB, Kernel};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use wgpu::{DeviceType, ErrorFilter};

/// How often in a row a GPU is opened again after it failed. A batch that is finished between two
/// failures begins a new row: then the device works, and what took it away (a driver that was
/// reset, a laptop that slept) may pass.
pub(super) const MAX_REOPENINGS: u32 = 3;

/// An open GPU. One is enough for a program; see [`Gpu::shared`].
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    binding_bytes: u64,
    storage_buffers: u32,
    /// The first error that nobody was there to catch.
    failure: Arc<OnceLock<String>>,
    pipelines: Mutex<BTreeMap<String, wgpu::ComputePipeline>>,
    /// Whether a batch was finished here.
    proven: AtomicBool,
    /// How often the GPU was opened again before this, in a row.
    reopened: u32,
    replacement: Mutex<Replacement>,
}

/// What took the place of a device that failed.
#[derive(Default)]
struct Replacement {
    attempts: u32,
    successor: Option<Arc<Gpu>>,
}

impl Gpu {
    /// Opens the fastest kind of adapter there is: a discrete GPU before an integrated one before a
    /// virtual one before a driver that runs on the CPU.
    ///
    /// # Errors
    /// If there is none, or it cannot be opened.
    pub fn open() -> Result<Gpu, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        // Neither validation layers nor debug labels: errors are caught where they are made.
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
        // Without a handler of ours wgpu panics.
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
            // Whole vectors of four numbers, and offsets that fit 32 bits.
            binding_bytes: limits
                .max_storage_buffer_binding_size
                .min(limits.max_buffer_size)
                .min(1 << 33)
                & !15,
            storage_buffers: limits.max_storage_buffers_per_shader_stage,
            failure,
            pipelines: Mutex::default(),
            proven: AtomicBool::new(false),
            reopened: 0,
            replacement: Mutex::default(),
        })
    }

    /// The program's GPU, opened at the first call, and again after it failed.
    ///
    /// # Errors
    /// As [`Gpu::open`]; [`GpuError::GivenUp`] once it failed several times in a row. That a
    /// machine has none is found once.
    pub fn shared() -> Result<Arc<Gpu>, GpuError> {
        static SHARED: Mutex<Option<Result<Arc<Gpu>, GpuError>>> = Mutex::new(None);
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let gpu = match &*shared {
            Some(Ok(gpu)) => gpu.working(),
            Some(Err(none)) => Err(none.clone()),
            None => Gpu::open().map(Arc::new),
        };
        match &gpu {
            Ok(_) | Err(GpuError::NoAdapter(_)) => *shared = Some(gpu.clone()),
            // The next call tries again.
            Err(_) => {}
        }
        gpu
    }

    /// This GPU, or what took its place after it failed; it is opened again if nothing did.
    ///
    /// # Errors
    /// If it cannot be opened again, or has failed too often.
    pub(super) fn working(self: &Arc<Gpu>) -> Result<Arc<Gpu>, GpuError> {
        let mut gpu = Arc::clone(self);
        while let Some(reason) = gpu.failure() {
            let mut s = gpu.replacement.lock().unwrap_or_else(PoisonError::into_inner);
            let successor = match &s.successor {
                Some(successor) => Arc::clone(successor),
                None => {
                    let before = if gpu.proven.load(Ordering::Relaxed) { 0 } else { gpu.reopened };
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

    /// The same with smaller bindings, for tests of what large fields meet.
    #[must_use]
    pub fn with_binding_limit(mut self, bytes: u64) -> Gpu {
        self.binding_bytes = self.binding_bytes.min(bytes) & !15;
        self
    }

    /// Takes the device away as a driver's reset does, for tests of what follows.
    pub fn lose(&self) {
        self.device.destroy();
    }

    /// No more batches for this device.
    pub(super) fn mark_failed(&self, reason: impl Into<String>) {
        // The first is the cause.
        let _ = self.failure.set(reason.into());
    }

    /// A batch was finished.
    pub(super) fn mark_working(&self) {
        self.proven.store(true, Ordering::Relaxed);
    }

    /// Name of the device, and of its driver.
    pub fn name(&self) -> String {
        match self.info.driver_info.as_str() {
            "" => self.info.name.clone(),
            driver => format!("{}, {} {driver}", self.info.name, self.info.driver),
        }
    }

    /// Whether it is a driver that runs on the CPU: right, and slower than this program's own
    /// kernels there.
    pub fn is_software(&self) -> bool {
        self.info.device_type == DeviceType::Cpu
    }

    /// The largest binding.
    pub fn binding_bytes(&self) -> u64 {
        self.binding_bytes
    }

    /// Bindings that a kernel has for the field.
    pub(super) fn slabs(&self) -> u32 {
        // Parameters are no storage buffer.
        self.storage_buffers.saturating_sub(FIRST_SLAB - 1)
    }

    /// What failed so far, if anything did.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    pub(super) fn give_up_error(&self, times: u32, reason: &str) -> GpuError {
        GpuError::GivenUp { adapter: self.info.name.clone(), times, reason: reason.into() }
    }

    pub(super) fn failed(&self, reason: impl Into<String>) -> GpuError {
        GpuError::Failed { adapter: self.info.name.clone(), reason: reason.into() }
    }

    /// Does what may fail on the device, and says if it did.
    pub(super) fn checked<T>(&self, work: impl FnOnce() -> T) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(ErrorFilter::Validation);
        let internal = self.device.push_error_scope(ErrorFilter::Internal);
        let done = work();
        let errors = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
        if errors.iter().any(Option::is_some) {
            // A device that is lost says so when it is asked; what was caught may be no more than a
            // consequence.
            let _ = self.device.poll(wgpu::PollType::Poll);
        }
        match errors.into_iter().flatten().next() {
            Some(e) => Err(self.failed(e.to_string())),
            None => self.failure().map_or(Ok(done), |e| Err(self.failed(e))),
        }
    }

    /// The compiled kernel, made at its first use.
    pub(super) fn pipeline(&self, kernel: &Kernel) -> Result<wgpu::ComputePipeline, GpuError> {
        let wgsl = kernel.wgsl();
        let mut made = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(p) = made.get(&wgsl) {
            return Ok(p.clone());
        }
        let pipeline = self.checked(|| {
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("march"),
                source: wgpu::ShaderSource::Wgsl(wgsl.as_str().into()),
            });
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("march"),
                layout: None,
                module: &module,
                entry_point: Some("march"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            })
        })?;
        made.insert(wgsl, pipeline.clone());
        Ok(pipeline)
    }
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu")
            .field("name", &self.name())
            .field("binding_bytes", &self.binding_bytes)
            .finish()
    }
}
