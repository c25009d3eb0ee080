//! Pictures of files and of the generated data sets.
//!
//! A [`subject::Subject`] is what is drawn, without lights: out of any file that [`datasets::read`] knows, or out of the
//! catalogue. [`look`] adds materials and lights for the wished effects, [`framing`] finds a camera, [`draw`] does the
//! work and keeps the account, [`save`] writes PNG and OpenEXR. [`gallery`] holds the pictures of the report.

pub mod framing;
pub mod gallery;
pub mod look;
pub mod save;
pub mod subject;

use framing::Framing;
use look::Look;
use rt_core::accel::BuildOptions;
use rt_core::frame::{Frame, Layers};
use rt_core::render::{Progressive, RenderOptions, RenderReport};
use std::time::Instant;
use subject::Subject;

/// How a subject is drawn.
#[derive(Debug, Clone)]
pub struct Wish {
    /// Pixels per row and rows.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Materials, lights and effects.
    pub look: Look,
    /// Where it is seen from.
    pub framing: Framing,
    /// How the acceleration structure is built.
    pub build: BuildOptions,
    /// Layers besides colour.
    pub layers: Layers,
}

/// A picture and how it came about.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// The picture.
    pub frame: Frame,
    /// Rays by kind, effects, warnings.
    pub report: RenderReport,
    /// The wished effects that the scene had no use for.
    pub warnings: Vec<String>,
    /// Wall time of the acceleration structure.
    pub build_secs: f64,
    /// Wall time of the picture.
    pub render_secs: f64,
}

/// Draws a subject. `go_on` is asked between samples and may end the work with an error.
pub fn draw(
    subject: Subject,
    wish: &Wish,
    go_on: &mut dyn FnMut() -> anyhow::Result<()>,
) -> anyhow::Result<Drawn> {
    let up = subject.up;
    let start = Instant::now();
    let mut scene = wish.look.scene(subject, &wish.build)?;
    let build_secs = start.elapsed().as_secs_f64();
    let mut warnings = vec![];
    let skipped = scene.world.report().skipped;
    if skipped > 0 {
        warnings
            .push(format!("{skipped} primitives left out: their coordinates are not finite or out of range"));
    }

    let (lo, hi) = framing::bounds(&scene.world)?;
    let placed = wish.framing.camera(lo, hi, up, wish.size)?;
    wish.look.adapt(&mut scene, (hi - lo).length() * 0.5);
    let camera = wish.look.lens(placed.camera, placed.focus_distance)?;

    // Glass needs more bounces before what is cut off stops to matter.
    let glass = wish.look.effects.contains(rt_core::effects::Effects::REFRACTION);
    let options = RenderOptions {
        max_bounces: if glass { 16 } else { 8 },
        samples: wish.samples,
        layers: Layers::COLOR | wish.layers,
        path_tracing: wish.look.effects.contains(rt_core::effects::Effects::PATH_TRACING),
        ..RenderOptions::new(wish.size[0], wish.size[1])
    };
    let start = Instant::now();
    let mut progressive = Progressive::new(&scene, &camera, &options)?;
    while progressive.step()? {
        go_on()?;
    }
    let (frame, report) = (progressive.frame(), progressive.report());
    let render_secs = start.elapsed().as_secs_f64();
    warnings.extend(report.warnings.iter().cloned());
    Ok(Drawn { frame, report, warnings, build_secs, render_secs })
}
