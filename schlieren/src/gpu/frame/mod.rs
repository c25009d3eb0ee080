//! Exposes a film on the device: only its sums come back. Where bodies stop light, the CPU tests
//! each ray against their triangles, as it does for its own, and sends a bit.
//!
//! A photon's start, its way through the field, the cut-off and the film are one invocation of one
//! shader. Beams take two: one for the corners of cells and one for their areas. The shader does
//! what the CPU does, with the host's `f64` replaced by numbers of 48 bits where rays start, and by
//! `f32` behind the flow. Sums on the film are integers, so a frame has the same bits in every run.
//!
//! | file | contents |
//! |---|---|
//! | params.rs, frame.wgsl | the numbers of a frame |
//! | double.wgsl, sampler.wgsl | numbers of 48 bits; sample points |
//! | start.wgsl | a photon's ray |
//! | crossing_bent.wgsl, crossing_straight.wgsl | its way through the flow |
//! | exit.wgsl | what it brings to the film |
//! | media.rs, media.wgsl, property.wgsl | absorption and rotation on a photon's way |
//! | bodies.wgsl | the bits of rays that bodies stop |
//! | technique.rs, technique/*.wgsl | its energy, by technique and cut-off |
//! | photons.wgsl, corners.wgsl, triangles.wgsl | entry points |
//! | film.rs, film.wgsl | the sums |
//! | cone.rs, squares.wgsl, keep.wgsl, sort.wgsl, cone.wgsl | the cone filter, which keeps photons |
//! | filter*.wgsl | brightness and its filter, unless more than the picture is wanted |
//! | bound_kernel.rs | a kernel with its buffers |
//! | submissions.rs | buffers and kernels on a device, and the parts of a frame |
//! | shader.rs | the shaders, assembled from what a scene needs |

mod bound_kernel;
mod cone;
mod film;
mod media;
mod params;
mod shader;
mod submissions;
mod technique;

use super::cpu_fallback::Failure;
use super::paths::DeviceState;
use super::{GpuError, GpuPaths};
use crate::film::photons::Exposure;
use crate::film::{Film, Framing, Photograph, Tally};
use film::{FilmLayout, add_to_films, outcomes, pictures};
pub(crate) use media::FrameMedia;
pub use media::MediaCache;
use std::ops::Range;
use std::sync::atomic::AtomicBool;
use submissions::FrameOnDevice;
use technique::TechniqueShader;

/// Why the device did not expose a film.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum NotExposed {
    /// The caller cancelled.
    Cancelled,
    /// It cannot; films are as they were.
    Refused(String),
}

/// Counts of photons, and the picture of a cone filter if there is one: brightness of each pixel.
pub(crate) type CountedFilms<const C: usize> = (Tally, Option<Vec<[f32; C]>>);

/// How a film is exposed.
#[derive(Debug, Clone)]
enum Light {
    Photons { passes: Range<u32> },
    Beams { per_side: u32 },
}

/// A filter of a picture on the device.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FrameFilter<'a> {
    /// Weights by distance, along rows and columns.
    Weights(&'a [f64]),
    /// A cone over this many photons.
    Cone {
        /// Number of photons.
        nearest: u32,
    },
}

/// A film to expose.
struct Job<'a> {
    exposure: &'a Exposure<'a>,
    framing: Framing,
    layout: FilmLayout,
    technique: &'a TechniqueShader<'a>,
    /// What dims the light on its way.
    media: Option<&'a FrameMedia<'a>>,
    light: Light,
    /// The filter, if the picture is made on the device.
    filter: Option<FrameFilter<'a>>,
    cancel: &'a AtomicBool,
    /// Receives the number of photons or corners of each submission.
    progress: &'a (dyn Fn(u64) + Sync),
}

impl Job<'_> {
    /// Width and height of the area that sends light, in pixels.
    fn area(&self) -> [u64; 2] {
        [self.framing.width, self.framing.height]
            .map(|n| u64::from(n) + 2 * u64::from(self.exposure.margin_px))
    }

    /// How many photons are kept for a cone filter, with room for those of tiles beyond the area,
    /// and how many of them it takes.
    fn keeps(&self) -> Option<(usize, u32)> {
        let (Some(FrameFilter::Cone { nearest }), Light::Photons { passes }) =
            (self.filter, &self.light)
        else {
            return None;
        };
        let [width, height] = self.area();
        let [across, down] = submissions::TILE_SIDES.map(u64::from);
        let tiles = width.div_ceil(across) * height.div_ceil(down) * passes.len() as u64;
        Some((tiles as usize * submissions::TILE, nearest))
    }

    /// Corners of a row of beams.
    fn columns(&self, per_side: u32) -> usize {
        self.area()[0] as usize * per_side as usize + 1
    }
}

impl GpuPaths<'_> {
    /// As [`crate::film::photons::expose`], on the device. With `cone`, the number of photons of a
    /// cone filter, also the picture: brightness of each pixel. The films must have counts then.
    ///
    /// # Errors
    /// If it was cancelled, or the device cannot expose this film.
    pub(crate) fn expose_photons<const C: usize>(
        &self,
        exposure: &Exposure<'_>,
        media: Option<&FrameMedia<'_>>,
        films: &[Film<C>],
        passes: Range<u32>,
        cone: Option<u32>,
        cancel: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<CountedFilms<C>, NotExposed> {
        let layout = FilmLayout::of(films);
        let light = Light::Photons { passes };
        let framing = *films[0].framing();
        let filter = cone.map(|nearest| FrameFilter::Cone { nearest });
        let (words, tally) =
            self.expose(exposure, media, framing, layout, light, filter, cancel, progress)?;
        add_to_films(layout, &words, films);
        let picture = cone.map(|_| pictures(&words[layout.outcomes()..]));
        Ok((tally, picture))
    }

    /// A filtered picture by photons: brightness of each pixel. With `noise` also half the
    /// difference of the pictures that even and odd passes make.
    ///
    /// # Errors
    /// If it was cancelled, or the device cannot make this picture.
    pub(crate) fn photograph_photons<const C: usize>(
        &self,
        exposure: &Exposure<'_>,
        media: Option<&FrameMedia<'_>>,
        framing: Framing,
        passes: Range<u32>,
        (filter, noise): (FrameFilter<'_>, bool),
        cancel: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Photograph<C>, NotExposed> {
        let light = Light::Photons { passes };
        let layout = FilmLayout::of_picture::<C>(&framing, noise);
        let filter = Some(filter);
        let (words, tally) =
            self.expose(exposure, media, framing, layout, light, filter, cancel, progress)?;
        let mut pixels = pictures(&words);
        let noise = noise.then(|| pixels.split_off(framing.pixels()));
        Ok(Photograph { pixels, noise, tally })
    }

    /// A picture by beams ([`crate::film::beams::expose_beams`]): brightness of each pixel.
    ///
    /// # Errors
    /// If it was cancelled, or the device cannot make this picture.
    pub(crate) fn photograph_beams<const C: usize>(
        &self,
        exposure: &Exposure<'_>,
        media: Option<&FrameMedia<'_>>,
        framing: Framing,
        per_side: u32,
        cancel: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Photograph<C>, NotExposed> {
        let light = Light::Beams { per_side };
        let layout = FilmLayout::of_picture::<C>(&framing, false);
        let filter = Some(FrameFilter::Weights(&[1.0]));
        let (words, tally) =
            self.expose(exposure, media, framing, layout, light, filter, cancel, progress)?;
        Ok(Photograph { pixels: pictures(&words), noise: None, tally })
    }

    #[allow(clippy::too_many_arguments, reason = "the parts of a job, which it puts together")]
    fn expose(
        &self,
        exposure: &Exposure<'_>,
        media: Option<&FrameMedia<'_>>,
        framing: Framing,
        layout: FilmLayout,
        light: Light,
        filter: Option<FrameFilter<'_>>,
        cancel: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<(Vec<u32>, Tally), NotExposed> {
        let refused = NotExposed::Refused;
        let margin = f64::from(exposure.margin_px);
        let reach_m = [[0.0, 0.0], [1.0, 1.0]]
            .map(|[x, y]: [f64; 2]| {
                let of = |part: f64, n: u32| part * (f64::from(n) + 2.0 * margin) - margin;
                let at = framing.plane_from_pixel(of(x, framing.width), of(y, framing.height));
                at[0].abs().max(at[1].abs())
            })
            .into_iter()
            .fold(0.0, f64::max);
        let technique = TechniqueShader::new(exposure.technique, reach_m).map_err(refused)?;
        let technique = &technique;
        let job =
            Job { exposure, framing, layout, technique, media, light, filter, cancel, progress };
        let [width, height] = job.area();
        let per_side = match job.light {
            Light::Photons { .. } => 1,
            Light::Beams { per_side } => u64::from(per_side),
        };
        // Numbers of pixels and corners of a row are exact in f32, and a row is one row of work
        // groups.
        const LIMIT: u64 = 4_000_000;
        if width.max(height) * per_side > LIMIT {
            return Err(refused(format!("it has more than {LIMIT} cells along a side")));
        }
        let image = technique.image.map_or(0, |i| size_of_val(i.pixels()));
        let corners = submissions::corner_bytes(&job);
        let largest = (4 * layout.words()).max(image).max(corners) as u64;
        let kept = job.keeps().map_or(0, |(n, _)| cone::kept_bytes(n, layout.channels()));
        let largest = largest.max(kept as u64).max(media.map_or(0, FrameMedia::largest_buffer));
        let binding = self.gpu().binding_bytes();
        if largest > binding {
            return Err(refused(format!(
                "one of its buffers takes {largest} bytes, and a binding of the device has \
                 {binding}"
            )));
        }

        let on_device = self.on_device();
        let buffers = 1
            + u32::from(image > 0)
            + u32::from(exposure.solids.is_some())
            + if kept > 0 { 2 } else { 0 }
            + media.map_or(0, FrameMedia::buffers)
            + on_device.field_buffers();
        if buffers > on_device.gpu.storage_buffers() {
            return Err(refused(format!(
                "it takes {buffers} buffers, and a kernel of the device has {}",
                on_device.gpu.storage_buffers()
            )));
        }

        self.run_to_end(&job)
    }

    /// Exposes the film, on a reopened device if it must be: a device that fails loses its film, so
    /// the whole film is exposed again.
    fn run_to_end(&self, job: &Job<'_>) -> Result<(Vec<u32>, Tally), NotExposed> {
        let [width, height] = job.area();
        let mut failed = false;
        loop {
            let on_device = self.on_device();
            match self.run(&on_device, job) {
                Ok(None) => return Err(NotExposed::Cancelled),
                Ok(Some(words)) => {
                    let (mut tally, steps) = outcomes(&words);
                    tally.sent = match &job.light {
                        Light::Photons { passes } => width * height * passes.len() as u64,
                        Light::Beams { per_side } => {
                            2 * width * height * u64::from(*per_side).pow(2)
                        }
                    };
                    self.work.add_frame(tally.sent, steps);
                    if failed {
                        self.cpu_fallback_paths.add_repeated(tally.sent);
                    }
                    return Ok((words, tally));
                }
                Err(failure) => {
                    // If the device stays, or is given up, the rays that go out next tell it.
                    if let Err(why) = self.replace_device(&failure) {
                        return Err(NotExposed::Refused(super::failure_message(&why)));
                    }
                    self.cpu_fallback_paths.set_cause(&failure.error);
                    failed = true;
                }
            }
        }
    }

    /// Exposes the film on a device and returns its words; `None` when it was cancelled.
    fn run(&self, on_device: &DeviceState, job: &Job<'_>) -> Result<Option<Vec<u32>>, Failure> {
        let gpu = &on_device.gpu;
        let failure = |error: GpuError| Failure { device: on_device.number, error };
        if let Some(e) = gpu.failure() {
            return Err(failure(gpu.failed(e)));
        }
        let mut frame = FrameOnDevice::new(self, on_device, job).map_err(failure)?;
        match &job.light {
            Light::Photons { passes } => frame.send_photons(self, job, passes.clone()),
            Light::Beams { per_side } => frame.send_beams(self, job, *per_side),
        }
        .and_then(|go_on| if go_on { frame.read(self).map(Some) } else { Ok(None) })
        .map_err(failure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Field;
    use crate::gpu::{Gpu, GpuOptions};
    use crate::interpolate::Interpolant;
    use crate::optics::Optics;
    use crate::technique::Technique;
    use crate::view::{Axis, View};
    use glam::DVec3;
    use rt_core::sampler::Sampling;

    /// The march on the device goes on, so nothing may say that the CPU computes the rest.
    #[test]
    fn a_frame_that_fails_on_a_sound_device_says_nothing_of_its_rays() {
        let gpu = match Gpu::shared() {
            Ok(gpu) => gpu,
            Err(e) => {
                let required = std::env::var_os("RTSV_REQUIRE_PEERS").is_some_and(|v| v == "1");
                assert!(!required, "{e}");
                return;
            }
        };
        let field =
            Field::from_fn([5; 3], [0.25; 3], DVec3::splat(-0.5), 1.0, |p| 1e-5 * p.x).unwrap();
        let view = View::along(Axis::Z, DVec3::ZERO);
        let options = GpuOptions::default();
        let paths = GpuPaths::new(gpu, &field, view, Interpolant::BSpline, options).unwrap();
        let framing = Framing::fitted(8, 8, [1.0, 1.0]);
        let technique = Technique::Shadowgraph(Optics::DEFAULT);
        let exposure = Exposure {
            paths: &paths,
            technique: &technique,
            solids: None,
            sampling: Sampling::Sobol,
            seed: 0,
            margin_px: 0,
            tilted_beams: false,
        };
        let broken = TechniqueShader { text: "no shader".into(), ..TechniqueShader::default() };
        let job = Job {
            exposure: &exposure,
            framing,
            layout: FilmLayout::of_picture::<1>(&framing, false),
            technique: &broken,
            media: None,
            light: Light::Photons { passes: 0..1 },
            filter: Some(FrameFilter::Weights(&[1.0])),
            cancel: &AtomicBool::new(false),
            progress: &|_| (),
        };
        let refused = paths.run_to_end(&job);
        assert!(matches!(refused, Err(NotExposed::Refused(_))), "{refused:?}");
        assert!(paths.gpu().failure().is_none());
        assert_eq!(crate::path::LightPaths::device_warning(&paths), None);
    }
}
