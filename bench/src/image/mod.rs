//! Renders images of files and of the generated data sets.
//!
//! A [`subject::Subject`] is the scene without lights, from any file that [`datasets::read`]
//! supports or from the catalogue. [`style`] adds materials and lights for the requested effects,
//! [`framing`] finds a camera, [`draw`] renders the image and records what it did, and [`save`]
//! writes PNG and OpenEXR. [`gallery`] contains the images of the report.

mod cell_contour;
pub mod framing;
pub mod gallery;
mod materials;
pub mod save;
pub mod style;
pub mod subject;

use datasets::cli::Interrupted;
use framing::Framing;
use rt_core::bvh::BuildOptions;
use rt_core::effects::Effects;
use rt_core::frame::{Frame, Layers};
use rt_core::render::{ProgressiveRenderer, RenderOptions, RenderReport, StopReason};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use style::RenderStyle;
use subject::Subject;

/// Settings for drawing a subject.
#[derive(Debug, Clone)]
pub struct RenderRequest {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Materials, lights and effects.
    pub style: RenderStyle,
    /// The viewpoint.
    pub framing: Framing,
    /// How the acceleration structure is built.
    pub build: BuildOptions,
    /// Layers in addition to colour.
    pub layers: Layers,
}

/// A rendered image and its statistics.
#[derive(Debug, Clone)]
pub struct RenderedImage {
    /// The image.
    pub frame: Frame,
    /// Statistics: rays by kind, effects, warnings.
    pub report: RenderReport,
    /// Requested effects that have no effect in the scene.
    pub warnings: Vec<String>,
    /// Wall time of building the acceleration structure.
    pub build_secs: f64,
    /// Wall time of rendering.
    pub render_secs: f64,
}

/// Cancellation and progress of drawing; the default has neither.
#[derive(Default)]
pub struct RenderControl<'a> {
    /// Set to true to stop as soon as the tiles in progress are finished.
    pub cancel: Option<Arc<AtomicBool>>,
    /// Called with the number of finished samples after every sample of all pixels.
    pub samples_done: Option<&'a mut dyn FnMut(u32)>,
}

impl RenderControl<'_> {
    /// Returns [`Interrupted`] once the flag is set.
    fn check(&self) -> Result<(), Interrupted> {
        let is_set = self.cancel.as_ref().is_some_and(|c| c.load(Ordering::Relaxed));
        if is_set { Err(Interrupted) } else { Ok(()) }
    }
}

impl RenderedImage {
    /// Whether the work was stopped before all samples were finished.
    pub fn is_interrupted(&self) -> bool {
        self.report.stopped == StopReason::Cancelled
    }
}

/// Draws a subject. If stopped after the first sample of every pixel, returns the image so far
/// ([`RenderedImage::is_interrupted`]); if stopped earlier, [`Interrupted`].
pub fn draw(
    subject: Subject,
    request: &RenderRequest,
    control: &mut RenderControl<'_>,
) -> anyhow::Result<RenderedImage> {
    let view = request.framing.fitted(&|point| subject.outline(point), subject.up, request.size);
    let start = Instant::now();
    let mut scene = request.style.scene(subject, &request.build)?;
    let build_secs = start.elapsed().as_secs_f64();
    let mut warnings = vec![];
    let skipped = scene.world.report().skipped;
    if skipped > 0 {
        warnings.push(format!(
            "{skipped} primitives left out: their coordinates are not finite or out of range"
        ));
    }

    control.check()?;
    let (lo, hi) = framing::bounds(&scene)?;
    let framed = request.framing.camera(view.as_ref(), lo, hi, request.size)?;
    request.style.scale_to_subject(&mut scene, (hi - lo).length() * 0.5);
    let camera = request.style.lens(framed.camera, framed.focus_distance)?;

    // Glass needs more bounces before the truncated light becomes negligible.
    let requested = request.style.effects;
    let glass = requested.contains(Effects::REFRACTION);
    let path = requested.contains(Effects::PATH_TRACING);
    // Pass the requested effects explicitly, so that the report says which of them change no pixel.
    let needed = Effects::required_by(&scene) | Effects::required_by_camera(&camera);
    let options = RenderOptions {
        effects: Some(needed | requested),
        // Paths end by Russian roulette.
        max_bounces: (!path).then_some(if glass { 16 } else { 8 }),
        samples: request.samples,
        layers: Layers::COLOR | request.layers,
        path_tracing: path,
        cancel: control.cancel.clone(),
        ..RenderOptions::new(request.size[0], request.size[1])
    };
    let start = Instant::now();
    let mut progressive = ProgressiveRenderer::new(&scene, &camera, &options)?;
    loop {
        let more = progressive.step()?;
        if let Some(report) = &mut control.samples_done {
            report(progressive.report().samples);
        }
        if !more {
            break;
        }
    }
    let report = progressive.report();
    if report.stopped == StopReason::Cancelled && report.samples == 0 {
        return Err(Interrupted.into());
    }
    let frame = progressive.frame();
    let render_secs = start.elapsed().as_secs_f64();
    warnings.extend(
        report.warnings.iter().filter(|w| !is_about_unrequested_effect(w, requested)).cloned(),
    );
    Ok(RenderedImage { frame, report, warnings, build_secs, render_secs })
}

/// Whether a warning says that an effect of the scene itself, which was not requested, changed
/// nothing.
fn is_about_unrequested_effect(warning: &str, requested: Effects) -> bool {
    let mut others = Effects::ALL.into_iter().filter(|(e, _)| !requested.contains(*e));
    others.any(|(_, name)| {
        warning
            .strip_prefix(name)
            .is_some_and(|rest| rest.starts_with(" changed no pixel of this picture"))
    })
}
