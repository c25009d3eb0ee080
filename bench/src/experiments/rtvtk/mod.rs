//! Frames of VTK's wheel as it is against the same with rtvtk: large isosurfaces, many small
//! actors, a translucent surface, and volumes. Each measurement is a process of its own, and the
//! processes take turns.

use super::Context;
use super::python_process;
use crate::record::{Record, Row};
use crate::runner::{Ratio, VERDICT_ROUNDS};
use crate::stats::Summary;
use serde::Deserialize;
use serde_json::json;
use std::path::Path;

const SCRIPT: &str = include_str!("frames.py");
/// In the order of their turns. `rtvtk` leaves frames to OpenGL where that costs less, as it does
/// for users; `always` traces all of them.
const TRACERS: [&str; 3] = ["stock", "rtvtk", "rtvtk, always"];
/// Frames after the first, in which OpenGL may still draw and caches fill.
const WARM: usize = 5;

/// A scene, and the width of its square image.
#[derive(Clone, Copy)]
struct Subject {
    scene: &'static str,
    pixels: u32,
}

/// What a process prints.
#[derive(Deserialize)]
struct Frames {
    triangles: u64,
    window: String,
    vtk: String,
    /// CPU and wall seconds of each.
    frames: Vec<[f64; 2]>,
    peak_bytes: u64,
}

impl Frames {
    fn first(&self) -> f64 {
        self.frames[0][0]
    }

    /// The median of the steady frames' CPU or wall seconds.
    fn steady(&self, clock: usize) -> f64 {
        let steady: Vec<f64> = self.frames[1 + WARM..].iter().map(|f| f[clock]).collect();
        Summary::of(&steady).map_or(f64::NAN, |s| s.median)
    }

    /// The most that a frame took.
    fn slowest(&self) -> f64 {
        self.frames.iter().map(|f| f[0]).fold(0.0, f64::max)
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    columns(record);
    let python = crate::opengl::find("RTSV_RTVTK_PYTHON", "target/wheels/rtvtk/bin/python");
    let Some(python) = python else {
        record.missing.push(
            "a Python with rtvtk: run `cargo xtask wheels`, or name one in RTSV_RTVTK_PYTHON"
                .to_owned(),
        );
        return Ok(());
    };
    let subject = |scene, pixels| Subject { scene, pixels };
    let (subjects, rounds) = if context.quick {
        let small = ["isosurfaces small", "500 spheres", "translucent", "volume 33"];
        (small.map(|scene| subject(scene, 300)).to_vec(), 1)
    } else {
        let large = ["isosurfaces 1 M", "isosurfaces 4 M", "translucent"];
        let volumes = ["volume 65", "volume 65 shaded", "volume 257", "volume 257 shaded"];
        let all = large.map(|scene| subject(scene, 1024)).into_iter();
        let all = all.chain([subject("500 spheres", 300)]);
        (all.chain(volumes.map(|scene| subject(scene, 512))).collect(), VERDICT_ROUNDS)
    };
    record.notes.push(format!(
        "One sample a pixel, no effects. The camera turns by 15 degrees a frame; the first frame \
         has everything in it that is done once, and the {WARM} after it are not counted as \
         steady. CPU seconds are those of all threads of the process."
    ));
    for subject in subjects {
        measure(context, record, &python, &subject, rounds)?;
    }
    Ok(())
}

fn columns(record: &mut Record) {
    record.column(
        "scene",
        "",
        "isosurfaces in one actor; 500 actors of 96 triangles; a translucent ellipsoid; volumes, \
         by their points along an axis",
    );
    record.column("triangles", "", "triangles of the scene");
    record.column("pixels", "", "width and height of the image");
    record.column("tracer", "", "VTK’s wheel alone; with rtvtk; with rtvtk, all frames traced");
    record.column("first", "s", "first frame, median over the rounds, CPU time");
    record.column("frame", "s", "a steady frame, median of the rounds’ medians, CPU time");
    record.column("frame_low", "s", "smallest of the rounds’ medians");
    record.column("frame_high", "s", "largest of the rounds’ medians");
    record.column("wall", "s", "a steady frame, wall time");
    record.column("slowest", "s", "the slowest frame, the one that builds, median over the rounds");
    record.column("memory", "MB", "most of any round, the whole process");
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    python: &Path,
    subject: &Subject,
    rounds: usize,
) -> anyhow::Result<()> {
    let Subject { scene, pixels } = *subject;
    let mut found: [Vec<Frames>; 3] = Default::default();
    for round in 0..rounds {
        for turn in 0..TRACERS.len() {
            let i = (round + turn) % TRACERS.len();
            context.report_step(format!("{scene}: {}, round {}", TRACERS[i], round + 1))?;
            let order = json!({
                "scene": scene, "tracer": TRACERS[i], "size": pixels, "warm": WARM, "frames": 6,
            });
            let frames: Frames = python_process::run(python, SCRIPT, &order)?;
            anyhow::ensure!(frames.frames.len() > 1 + WARM, "{scene}: too few frames");
            found[i].push(frames);
        }
    }
    if let Some(one) = found[0].first() {
        let note = format!("VTK {}, {}.", one.vtk, one.window);
        if !record.notes.contains(&note) {
            record.notes.push(note);
        }
    }
    for (tracer, frames) in TRACERS.iter().zip(&found) {
        record.rows.extend(row(subject, tracer, frames));
        if *tracer != "stock" {
            let pairs = || found[0].iter().zip(frames);
            let first: Vec<f64> = pairs().map(|(s, o)| s.first() / o.first()).collect();
            let steady: Vec<f64> = pairs().map(|(s, o)| s.steady(0) / o.steady(0)).collect();
            let named = |what: &str| format!("{tracer}: {scene}, {what}");
            record.ratios.extend(Ratio::of_rounds(named("first frame"), "stock", &first));
            record.ratios.extend(Ratio::of_rounds(named("steady frame"), "stock", &steady));
        }
    }
    Ok(())
}

fn row(subject: &Subject, tracer: &str, frames: &[Frames]) -> Option<Row> {
    let summary =
        |of: &dyn Fn(&Frames) -> f64| Summary::of(&frames.iter().map(of).collect::<Vec<f64>>());
    let steady = summary(&|f| f.steady(0))?;
    let peak = frames.iter().map(|f| f.peak_bytes).max()?;
    Some(
        Row::new()
            .with("scene", subject.scene)
            .with("triangles", frames.first()?.triangles)
            .with("pixels", subject.pixels)
            .with("tracer", tracer)
            .with("first", summary(&Frames::first)?.median)
            .with("frame", steady.median)
            .with("frame_low", steady.low)
            .with("frame_high", steady.high)
            .with("wall", summary(&|f| f.steady(1))?.median)
            .with("slowest", summary(&Frames::slowest)?.median)
            .with("memory", peak as f64 / 1e6),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steady_frames_are_those_after_the_first_and_the_warm_ones() {
        let mut frames = vec![[9.0, 5.0]; 1 + WARM];
        frames.extend([[1.0, 0.5], [3.0, 0.7], [2.0, 0.6]]);
        frames[2] = [40.0, 20.0];
        let of = Frames {
            triangles: 1,
            window: "w".into(),
            vtk: "9".into(),
            frames,
            peak_bytes: 3_000_000,
        };
        assert_eq!((of.first(), of.steady(0), of.steady(1), of.slowest()), (9.0, 2.0, 0.6, 40.0));
        let subject = Subject { scene: "s", pixels: 8 };
        let row = row(&subject, "rtvtk", &[of]).unwrap();
        assert_eq!((row.number("memory"), row.number("frame")), (Some(3.0), Some(2.0)));
    }
}
