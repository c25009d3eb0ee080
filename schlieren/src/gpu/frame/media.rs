//! The medium's absorption and rotation on the device.

use super::params::parts;
use crate::gpu::{Gpu, GpuError};
use crate::march::Frame;
use crate::media::Volume;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use std::sync::{Mutex, PoisonError};

/// Binding of the numbers of the media, and of the first property.
const NUMBERS: u32 = 7;
const FIRST_PROPERTY: u32 = NUMBERS + 1;

/// Properties that dim a photon's light, and how they are integrated along its ray
/// ([`crate::media::MediaIntegrator`]).
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrameMedia<'a> {
    pub(crate) absorption: Option<&'a Volume>,
    pub(crate) rotation: Option<&'a Volume>,
    pub(crate) analyser_rad: Option<f64>,
    /// Whether rays are bent, by the interpolant of the march.
    pub(crate) bent: bool,
    /// Longest step, in lattice steps.
    pub(crate) step_voxels: f64,
    /// First node of the field.
    pub(crate) origin_m: DVec3,
    /// Where the properties' values on the device are kept.
    pub(crate) cache: Option<&'a MediaCache>,
}

/// Keeps properties of the medium on the device for the next image. The owner must pass the same
/// medium to every call.
#[derive(Debug, Default)]
pub struct MediaCache {
    kept: Mutex<Option<Kept>>,
}

/// Values on a device, which is known by its handle.
#[derive(Debug, Clone)]
struct Kept {
    device: wgpu::Device,
    properties: [Option<wgpu::Buffer>; 2],
}

/// `Media` of media.wgsl.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct MediaParams {
    step_voxels: [f32; 2],
    analyser: [f32; 2],
    scale: [[f32; 4]; 2],
    offset: [[f32; 4]; 2],
    dims: [[u32; 4]; 2],
}

/// Media on a device: their numbers, and the properties' values.
pub(super) struct DeviceMedia {
    numbers: wgpu::Buffer,
    properties: [Option<wgpu::Buffer>; 2],
}

impl<'a> FrameMedia<'a> {
    fn properties(&self) -> [Option<&Volume>; 2] {
        [self.absorption, self.rotation]
    }

    /// Number of storage buffers.
    pub(super) fn buffers(&self) -> u32 {
        self.properties().iter().flatten().count() as u32
    }

    /// Bytes of the largest buffer.
    pub(super) fn largest_buffer(&self) -> u64 {
        let bytes = |v: &Volume| 4 * v.dims().iter().map(|n| *n as u64).product::<u64>();
        self.properties().into_iter().flatten().map(bytes).max().unwrap_or(0)
    }

    fn numbers(&self, march: &Frame) -> MediaParams {
        let mut p = MediaParams::zeroed();
        p.step_voxels = parts(self.step_voxels);
        let (sine, cosine) = self.analyser_rad.unwrap_or(0.0).sin_cos();
        p.analyser = [cosine as f32, sine as f32];
        for (i, volume) in self.properties().into_iter().enumerate() {
            let Some(volume) = volume else { continue };
            let scale = march.spacing_m / volume.spacing_m();
            let offset = (self.origin_m - volume.origin_m()) / volume.spacing_m();
            p.scale[i] = scale.as_vec3().extend(0.0).to_array();
            p.offset[i] = offset.as_vec3().extend(0.0).to_array();
            let [x, y, z] = volume.dims().map(|n| n as u32);
            p.dims[i] = [x, y, z, 0];
        }
        p
    }

    /// The media on a device, and the number of bytes that were copied there.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn upload(&self, gpu: &Gpu, march: &Frame) -> Result<(DeviceMedia, u64), GpuError> {
        let numbers = self.numbers(march);
        let numbers = gpu.checked(|| {
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let buffer = gpu.buffer(size_of::<MediaParams>(), usage);
            gpu.queue.write_buffer(&buffer, 0, bytemuck::bytes_of(&numbers));
            buffer
        })?;
        let lock = |c: &'a MediaCache| c.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = self.properties();
        let is_this = |k: &&Kept| {
            let has = |i: usize| k.properties[i].is_some() == wanted[i].is_some();
            k.device == gpu.device && has(0) && has(1)
        };
        let kept = self.cache.and_then(|c| lock(c).as_ref().filter(is_this).cloned());
        if let Some(Kept { properties, .. }) = kept {
            let bytes = numbers.size();
            return Ok((DeviceMedia { numbers, properties }, bytes));
        }
        let [absorption, rotation] =
            wanted.map(|v| v.map(|v| gpu.upload(bytemuck::cast_slice(&v.nodes()))).transpose());
        let properties = [absorption?, rotation?];
        let bytes = properties.iter().flatten().map(wgpu::Buffer::size).sum::<u64>();
        if let Some(cache) = self.cache {
            let device = gpu.device.clone();
            *lock(cache) = Some(Kept { device, properties: properties.clone() });
        }
        let bytes = numbers.size() + bytes;
        Ok((DeviceMedia { numbers, properties }, bytes))
    }

    /// The source text, which follows that of the march and of start.wgsl.
    pub(super) fn wgsl(&self) -> String {
        let mut text = format!(
            "const MEDIA = true;\nconst ABSORPTION = {};\nconst ROTATION = {};\nconst ANALYSER = \
             {};\nconst BENT = {};\n",
            self.absorption.is_some(),
            self.rotation.is_some(),
            self.analyser_rad.is_some(),
            self.bent,
        );
        for (i, volume) in self.properties().into_iter().enumerate() {
            let binding = (FIRST_PROPERTY + i as u32).to_string();
            text += &match volume {
                Some(_) => include_str!("property.wgsl")
                    .replace("BINDING", &binding)
                    .replace("PROPERTY", &i.to_string()),
                None => format!("fn property_{i}(place: vec3f) -> f32 {{\n    return 0.0;\n}}\n"),
            };
        }
        text + include_str!("media.wgsl")
    }
}

impl DeviceMedia {
    pub(super) fn bindings(&self) -> impl Iterator<Item = (u32, wgpu::BindingResource<'_>)> {
        let properties = (FIRST_PROPERTY..).zip(&self.properties);
        let properties = properties.filter_map(|(i, b)| b.as_ref().map(|b| (i, b)));
        let all = std::iter::once((NUMBERS, &self.numbers)).chain(properties);
        all.map(|(i, b)| (i, b.as_entire_binding()))
    }
}
