//! A frame's buffers and kernels on a device, and the submissions of its parts.

use super::bound_kernel::{BoundKernel, run};
use super::cone::ConeOnDevice;
use super::film::FilmLayout;
use super::params::FrameParams;
use super::shader::FrameShader;
use super::{FrameFilter, Job, Light};
use crate::film::beams::corner_of_cells;
use crate::gpu::part_size::{FEWEST_GROUPS, MOST_GROUPS};
use crate::gpu::paths::DeviceState;
use crate::gpu::{Gpu, GpuError, GpuPaths};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use wgpu::BufferUsages;

/// Number of corners in a submission, and of photons that bodies may stop: enough to fill any
/// device, and few enough that no driver assumes that the device hangs.
const PER_SUBMISSION: usize = TILE * FEWEST_GROUPS;
/// Pixels of a tile, which is a work group.
pub(super) const TILE: usize = 64;
/// Columns and rows of a tile.
pub(super) const TILE_SIDES: [u32; 2] = [16, 4];
/// Submissions in flight: one is prepared while the device works on the other.
const IN_FLIGHT: usize = 2;

/// A frame's buffers and kernels on a device.
pub(super) struct FrameOnDevice<'a> {
    gpu: Arc<Gpu>,
    params: FrameParams,
    layout: FilmLayout,
    frame: wgpu::Buffer,
    film: wgpu::Buffer,
    /// Bits of the rays of a submission that bodies stop.
    bodies: Option<wgpu::Buffer>,
    /// Kernels with what is bound to them, in the order in which they run.
    kernels: Vec<BoundKernel>,
    /// Kernels that make the picture of the film, and the picture; the same for its noise.
    pictures: Vec<(Vec<BoundKernel>, wgpu::Buffer)>,
    /// The filter that keeps photons, whose picture comes before the others.
    cone: Option<ConeOnDevice>,
    in_flight: VecDeque<InFlight>,
    progress: &'a (dyn Fn(u64) + Sync),
}

/// A submission that the device works on.
struct InFlight {
    index: wgpu::SubmissionIndex,
    rays: u64,
    /// Work groups of a part whose size can be chosen, and when it was submitted.
    groups: Option<(usize, Instant)>,
}

impl<'a> FrameOnDevice<'a> {
    pub(super) fn new(
        paths: &GpuPaths<'_>,
        on_device: &DeviceState,
        job: &Job<'a>,
    ) -> Result<FrameOnDevice<'a>, GpuError> {
        let Job { exposure, technique, layout, media, .. } = job;
        let from_film = exposure.technique.samples_from_film();
        let optics = exposure.technique.optics();
        let mut params = FrameParams::new(
            &paths.frame,
            &job.framing,
            optics,
            paths.field.n0(),
            paths.options.step_voxels,
            exposure.margin_px,
            from_film,
        );
        params.seed = [exposure.seed as u32, (exposure.seed >> 32) as u32];
        (params.counts, params.outcomes) = (layout.counts() as u32, layout.outcomes() as u32);
        (params.technique, params.dots_seed) = (technique.numbers, technique.dots_seed);
        let needs_source = exposure.tilted_beams || exposure.technique.needs_source_points();
        let shader = FrameShader {
            march: on_device.kernel,
            technique,
            media: *media,
            channels: layout.channels(),
            tilted_beams: exposure.tilted_beams,
            from_film,
            counts: layout.has_counts(),
            keeps: job.keeps().is_some(),
            bodies: exposure.solids.is_some(),
            sampling: exposure.sampling,
            source: needs_source.then(|| optics.source_image()),
        };

        let of_march = paths.params(&on_device.volume, 0);
        let of_march = bytemuck::bytes_of(&of_march);
        let gpu = Arc::clone(&on_device.gpu);
        let (storage, to_device) = (BufferUsages::STORAGE, BufferUsages::COPY_DST);
        let made = gpu.checked(|| {
            let frame = gpu.buffer(size_of::<FrameParams>(), BufferUsages::UNIFORM | to_device);
            // New buffers are zero.
            let film = gpu.buffer(4 * layout.words(), storage | BufferUsages::COPY_SRC);
            let march = gpu.buffer(of_march.len(), BufferUsages::UNIFORM | to_device);
            gpu.queue.write_buffer(&march, 0, of_march);
            let image = technique.image.map(|i| {
                let buffer = gpu.buffer(size_of_val(i.pixels()), storage | to_device);
                gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(i.pixels()));
                paths.work.add_to_device(buffer.size());
                buffer
            });
            (frame, film, march, image)
        })?;
        let (frame, film, march, image) = made;
        let rays = match job.light {
            Light::Photons { .. } => PER_SUBMISSION,
            Light::Beams { per_side } => corners_at_once(job, per_side),
        };
        let bodies = exposure
            .solids
            .map(|_| gpu.checked(|| gpu.buffer(4 * rays.div_ceil(32), storage | to_device)))
            .transpose()?;
        paths.work.add_to_device(march.size());
        let media = media.map(|m| m.upload(&gpu, &paths.frame)).transpose()?;
        if let Some((_, bytes)) = &media {
            paths.work.add_to_device(*bytes);
        }
        let of_media = || media.iter().flat_map(|(m, _)| m.bindings());
        let mut of_march = vec![(0, march.as_entire_binding())];
        of_march.extend(on_device.field_bindings());
        let cone = job
            .keeps()
            .map(|(photons, _)| {
                ConeOnDevice::new(&gpu, &shader, layout, &job.framing, &frame, photons)
            })
            .transpose()?;
        let mut kernels = Vec::new();
        match job.light {
            Light::Photons { .. } => {
                let pipeline = gpu.pipeline(shader.photons(), "photons")?;
                let mut own = vec![(0, frame.as_entire_binding()), (1, film.as_entire_binding())];
                own.extend(image.as_ref().map(|i| (3, i.as_entire_binding())));
                own.extend(bodies.as_ref().map(|b| (4, b.as_entire_binding())));
                own.extend(cone.iter().flat_map(ConeOnDevice::bindings));
                own.extend(of_media());
                let groups = gpu.bind(&pipeline, [&of_march, &own])?;
                kernels.push((pipeline, groups));
            }
            Light::Beams { per_side } => {
                params.per_row = job.columns(per_side) as u32;
                params.parts = per_side;
                let corners = gpu.checked(|| gpu.buffer(corner_bytes(job), storage))?;
                let pipeline = gpu.pipeline(shader.corners(), "trace_corners")?;
                let mut own =
                    vec![(0, frame.as_entire_binding()), (2, corners.as_entire_binding())];
                own.extend(image.as_ref().map(|i| (3, i.as_entire_binding())));
                own.extend(bodies.as_ref().map(|b| (4, b.as_entire_binding())));
                own.extend(of_media());
                let groups = gpu.bind(&pipeline, [&of_march, &own])?;
                kernels.push((pipeline, groups));
                let pipeline = gpu.pipeline(shader.triangles(), "distribute_cells")?;
                let own = [(0, &frame), (1, &film), (2, &corners)]
                    .map(|(i, b)| (i, b.as_entire_binding()));
                let groups = gpu.bind(&pipeline, [&[], &own])?;
                kernels.push((pipeline, groups));
            }
        }
        let mut pictures = Vec::new();
        if let Some(filter_of_job) = job.filter {
            params.per_photon = match &job.light {
                Light::Photons { passes } => 1.0 / passes.len() as f32,
                Light::Beams { .. } => 1.0,
            };
            if let Light::Photons { passes } = &job.light {
                // Passes expose the films in turn, from the first.
                let odd = (passes.start % 2) as usize;
                let halves = [(passes.len() + 1 - odd) / 2, (passes.len() + odd) / 2];
                params.per_photon_of_film = halves.map(|n| 1.0 / n.max(1) as f32);
            }
            // The noise of a picture by the cone filter is that of the film, unfiltered.
            let (weights, wanted): (_, &[bool]) = match filter_of_job {
                FrameFilter::Weights(weights) => (weights, &[false, true]),
                FrameFilter::Cone { nearest } => {
                    params.nearest = nearest;
                    (&[1.0][..], &[true])
                }
            };
            let has_noise = layout.films() > 1 && !layout.has_counts();
            for noise in wanted.iter().filter(|noise| !**noise || has_noise) {
                let buffers = [&frame, &film];
                pictures.push(filter(paths, &gpu, &shader, layout, (weights, *noise), buffers)?);
            }
        }
        let (layout, progress) = (*layout, job.progress);
        let in_flight = VecDeque::new();
        Ok(FrameOnDevice {
            gpu,
            params,
            layout,
            frame,
            film,
            bodies,
            kernels,
            pictures,
            cone,
            in_flight,
            progress,
        })
    }

    /// Returns false when it was cancelled.
    pub(super) fn send_photons(
        &mut self,
        paths: &GpuPaths<'_>,
        job: &Job<'_>,
        passes: Range<u32>,
    ) -> Result<bool, GpuError> {
        let [width, height] = job.area();
        let [of_tile, rows_of_tile] = TILE_SIDES.map(u64::from);
        let (per_row, rows) = (width.div_ceil(of_tile), height.div_ceil(rows_of_tile));
        let per_pass = per_row * rows;
        (self.params.per_row, self.params.per_pass) = (per_row as u32, per_pass as u32);
        self.params.parts = self.layout.films() as u32;
        let tiles = per_pass * passes.len() as u64;
        let photons = width * height * passes.len() as u64;
        let photons_of = |tiles_done: u64| {
            (u128::from(photons) * u128::from(tiles_done) / u128::from(tiles)) as u64
        };
        let mut first = 0;
        while first < tiles {
            // The CPU tests the rays of a part against bodies, into a buffer of fixed size.
            let is_fixed = self.bodies.is_some();
            let at_once = if is_fixed { FEWEST_GROUPS } else { self.gpu.part_size.groups() };
            let count = (tiles - first).min(at_once as u64);
            self.params.first = (first % per_pass) as u32;
            self.params.first_pass = passes.start + (first / per_pass) as u32;
            self.params.first_photon = (first * TILE as u64) as u32;
            let sent = photons_of(first + count) - photons_of(first);
            if let Some(bodies) = &self.bodies {
                let place = |tile: u64, lane: u32| {
                    let (in_pass, margin) = (tile % per_pass, i64::from(job.exposure.margin_px));
                    let x = in_pass % per_row * of_tile + u64::from(lane % TILE_SIDES[0]);
                    let y = in_pass / per_row * rows_of_tile + u64::from(lane / TILE_SIDES[0]);
                    let pass = passes.start + (tile / per_pass) as u32;
                    job.exposure
                        .send(&job.framing, [x as i64 - margin, y as i64 - margin], pass)
                        .start
                };
                let bits = bits(count as usize * TILE, |ray| {
                    let tile = first + (ray / TILE) as u64;
                    job.exposure.is_behind_body(&place(tile, (ray % TILE) as u32))
                });
                self.write(paths, bodies, &bits);
            }
            if !self.submit(paths, &[[count as u32, 1]], sent, job.cancel)? {
                return Ok(false);
            }
            if let Some(last) = self.in_flight.back_mut().filter(|_| !is_fixed) {
                last.groups = Some((count as usize, Instant::now()));
            }
            first += count;
        }
        Ok(true)
    }

    /// Returns false when it was cancelled.
    pub(super) fn send_beams(
        &mut self,
        paths: &GpuPaths<'_>,
        job: &Job<'_>,
        per_side: u32,
    ) -> Result<bool, GpuError> {
        let columns = self.params.per_row as usize;
        let rows = job.area()[1] as usize * per_side as usize;
        let at_once = rows_at_once(columns);
        for first in (0..rows).step_by(at_once) {
            let count = at_once.min(rows - first);
            (self.params.first, self.params.per_pass) = (first as u32, count as u32);
            if let Some(bodies) = &self.bodies {
                let bits = bits((count + 1) * columns, |ray| {
                    let at = [ray % columns, first + ray / columns];
                    job.exposure.is_behind_body(&corner_of_cells(
                        job.exposure,
                        &job.framing,
                        at,
                        per_side,
                    ))
                });
                self.write(paths, bodies, &bits);
            }
            let across = columns.div_ceil(TILE) as u32;
            let groups = [[across, count as u32 + 1], [across, count as u32]];
            if !self.submit(paths, &groups, (count * columns) as u64, job.cancel)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Runs the kernels with these numbers of work groups. Returns false when it was cancelled.
    fn submit(
        &mut self,
        paths: &GpuPaths<'_>,
        groups: &[[u32; 2]],
        rays: u64,
        cancel: &AtomicBool,
    ) -> Result<bool, GpuError> {
        while self.in_flight.len() >= IN_FLIGHT {
            self.wait_for_first()?;
        }
        if cancel.load(Ordering::Relaxed) {
            return Ok(false);
        }
        let gpu = &self.gpu;
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&self.params));
        paths.work.add_to_device(self.frame.size());
        let mut commands = gpu.device.create_command_encoder(&Default::default());
        run(&mut commands, &self.kernels, groups);
        let index = gpu.queue.submit([commands.finish()]);
        paths.work.add_submission(groups.len() as u64);
        self.in_flight.push_back(InFlight { index, rays, groups: None });
        Ok(true)
    }

    /// Writes to a buffer before the next submission.
    fn write(&self, paths: &GpuPaths<'_>, buffer: &wgpu::Buffer, words: &[u32]) {
        self.gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(words));
        paths.work.add_to_device(size_of_val(words) as u64);
    }

    fn wait_for_first(&mut self) -> Result<(), GpuError> {
        if let Some(InFlight { index, rays, groups }) = self.in_flight.pop_front() {
            self.gpu.wait(index)?;
            self.gpu.mark_batch_finished();
            if let Some((groups, since)) = groups {
                self.gpu.part_size.learn(groups, since.elapsed());
            }
            (self.progress)(rays);
        }
        Ok(())
    }

    /// Sorts the photons that were kept, and filters them: a part of the rows at a time, because a
    /// pixel without light searches far.
    fn filter_photons(&mut self, paths: &GpuPaths<'_>) -> Result<(), GpuError> {
        let Some(cone) = &self.cone else { return Ok(()) };
        let gpu = Arc::clone(&self.gpu);
        let across = self.params.width.div_ceil(TILE as u32);
        let rows = (FEWEST_GROUPS as u32 / across).clamp(1, self.params.height.max(1));
        for first in (0..self.params.height).step_by(rows as usize) {
            self.params.first = first;
            gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&self.params));
            paths.work.add_to_device(self.frame.size());
            let mut commands = gpu.device.create_command_encoder(&Default::default());
            let sort: &[_] = if first == 0 { &cone.sort } else { &[] };
            for (kernel, groups) in sort {
                run(&mut commands, std::slice::from_ref(kernel), &[*groups]);
            }
            run(&mut commands, std::slice::from_ref(&cone.filter), &[[across, rows]]);
            gpu.queue.submit([commands.finish()]);
            paths.work.add_submission(1 + sort.len() as u64);
        }
        Ok(())
    }

    /// Waits for the film and reads its words: its sums unless only pictures are wanted, then the
    /// pictures, then the outcomes.
    pub(super) fn read(mut self, paths: &GpuPaths<'_>) -> Result<Vec<u32>, GpuError> {
        self.filter_photons(paths)?;
        let [first_outcome, outcomes] = self.layout.outcome_bytes();
        let of_picture = self.layout.picture_bytes();
        let made = self.pictures.iter().map(|(_, picture)| picture);
        let pictures: Vec<_> = self.cone.iter().map(|c| &c.picture).chain(made).collect();
        let of_film =
            if pictures.is_empty() || self.layout.has_counts() { first_outcome } else { 0 };
        let before = of_film + pictures.len() as u64 * of_picture;
        let bytes = before + outcomes;
        let gpu = Arc::clone(&self.gpu);
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let readback = gpu.checked(|| gpu.buffer(bytes as usize, usage))?;
        let mut commands = gpu.device.create_command_encoder(&Default::default());
        for (kernels, _) in &self.pictures {
            let groups = [self.params.width.div_ceil(TILE as u32), self.params.height];
            run(&mut commands, kernels, &[groups; 2]);
        }
        if !self.pictures.is_empty() {
            paths.work.add_submission(2 * self.pictures.len() as u64);
        }
        if of_film > 0 {
            commands.copy_buffer_to_buffer(&self.film, 0, &readback, 0, of_film);
        }
        for (n, picture) in pictures.iter().enumerate() {
            let to = of_film + n as u64 * of_picture;
            commands.copy_buffer_to_buffer(picture, 0, &readback, to, of_picture);
        }
        commands.copy_buffer_to_buffer(&self.film, first_outcome, &readback, before, outcomes);
        gpu.queue.submit([commands.finish()]);
        while !self.in_flight.is_empty() {
            self.wait_for_first()?;
        }
        let words = gpu.read(&readback)?;
        paths.work.add_from_device(bytes);
        Ok(words)
    }
}

/// The kernels that filter a film along rows and columns, and the picture or its noise.
fn filter(
    paths: &GpuPaths<'_>,
    gpu: &Gpu,
    shader: &FrameShader<'_>,
    layout: &FilmLayout,
    (weights, noise): (&[f64], bool),
    [frame, film]: [&wgpu::Buffer; 2],
) -> Result<(Vec<BoundKernel>, wgpu::Buffer), GpuError> {
    let weights: Vec<f32> = weights.iter().map(|w| *w as f32).collect();
    let (bytes, storage) = (layout.picture_bytes() as usize, BufferUsages::STORAGE);
    let [rows, pixels, of_weights] = gpu.checked(|| {
        let of_weights = gpu.buffer(size_of_val(&weights[..]), storage | BufferUsages::COPY_DST);
        gpu.queue.write_buffer(&of_weights, 0, bytemuck::cast_slice(&weights));
        let pixels = gpu.buffer(bytes, storage | BufferUsages::COPY_SRC);
        [gpu.buffer(bytes, storage), pixels, of_weights]
    })?;
    paths.work.add_to_device(of_weights.size());
    let bind = |of_rows: bool| {
        let pipeline =
            gpu.pipeline(shader.filter(of_rows, layout.films(), noise), "filter_noise")?;
        let (from, to) = if of_rows { ((1, film), (2, &rows)) } else { ((2, &rows), (5, &pixels)) };
        let own = [(0, frame), from, to, (6, &of_weights)].map(|(i, b)| (i, b.as_entire_binding()));
        let groups = gpu.bind(&pipeline, [&[], &own])?;
        Ok::<_, GpuError>((pipeline, groups))
    };
    Ok((vec![bind(true)?, bind(false)?], pixels))
}

/// One bit for each of so many rays, from the lowest of the first word.
fn bits(rays: usize, is_set: impl Fn(usize) -> bool + Sync) -> Vec<u32> {
    let word = |w: usize| {
        (32 * w..rays.min(32 * w + 32)).fold(0, |a, ray| a | u32::from(is_set(ray)) << (ray % 32))
    };
    (0..rays.div_ceil(32)).into_par_iter().map(word).collect()
}

/// Corners of beams in a submission: there is one row more than rows of cells.
fn corners_at_once(job: &Job<'_>, per_side: u32) -> usize {
    let columns = job.columns(per_side);
    columns * (rows_at_once(columns) + 1)
}

/// Bytes of these corners: a shift, and energies. 0 for photons.
pub(super) fn corner_bytes(job: &Job<'_>) -> usize {
    match job.light {
        Light::Photons { .. } => 0,
        Light::Beams { per_side } => {
            4 * corners_at_once(job, per_side) * (2 + job.layout.channels())
        }
    }
}

/// Rows of cells in a submission, for rows of this many corners.
fn rows_at_once(columns: usize) -> usize {
    (PER_SUBMISSION / columns).clamp(1, MOST_GROUPS - 1)
}
