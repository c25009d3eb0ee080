//! Figure 4.9: frame time against the number of triangles for the same view, with primary rays and
//! a headlight, and with frames of Mesa's rasteriser.

use super::Context;
use super::fig4_7::fits_in_memory;
use crate::clock::{Clock, Sample};
use crate::image::framing::Framing;
use crate::opengl::{Mesa, MesaFrames};
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use datasets::catalogue;
use datasets::generate::nested_wavelet::Size;
use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::Camera;
use rt_core::render::{RenderOptions, render};
use rt_core::scene::Scene;
use std::cell::RefCell;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("triangles", "", "triangles of the wavelet surfaces");
    record.column(
        "view",
        "",
        "view of the data set; `llvmpipe`: the whole of it, turning, drawn by an unmodified \
         program",
    );
    record.column("pixels", "", "pixels of the frame, one primary ray each");
    record.column("covered", "", "pixels that show a surface");
    record.column(
        "threads",
        "",
        "threads that render; empty for llvmpipe, which takes what there is",
    );
    record.column(
        "time",
        "ms",
        "median over the rounds, wall time of a frame with headlight shading",
    );
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("cpu", "ms", "median CPU time of all threads");
    record.column("rate", "Mray/s", "primary rays by median time");
    record.column("build", "s", "wall time of the acceleration structure");
    record.column("bytes_per_triangle", "B", "memory of the structure, without the mesh");
    record.notes.push(
        "A frame through the renderer: one primary ray a pixel, headlight, matte material, no \
         secondary rays, from the \
         same camera for all sizes. Views and llvmpipe take turns, a frame each. Where a ray \
         tracer’s time and a rasteriser’s \
         cross is the point of the dissertation’s figure."
            .into(),
    );
    let mesa = Mesa::find().map_err(|missing| record.missing.extend(missing)).ok();
    let sizes = if context.quick { &[Size::M1, Size::M2, Size::M4][..] } else { &Size::ALL[..] };
    let pixels = if context.quick { 512 } else { 1024 };
    for &size in sizes {
        if fits_in_memory(size, record) {
            measure(context, record, mesa.as_ref(), size, pixels)?;
        }
    }
    record.notes.extend(describe_growth(record));
    record.plots.push(plot(record));
    Ok(())
}

/// Describes how the time of each view grew from the smallest to the largest number of triangles.
fn describe_growth(record: &Record) -> Option<String> {
    let mut words = vec![];
    for series in &plot(record).series {
        let (first, last) = (series.points.first()?, series.points.last()?);
        if first.x < last.x {
            words.push(format!("{} {:.2} times", series.name, last.y / first.y));
        }
    }
    let ends = plot(record)
        .series
        .first()
        .and_then(|s| Some((s.points.first()?.x, s.points.last()?.x)))?;
    let more = ends.1 / ends.0;
    (!words.is_empty()).then(|| {
        format!(
            "From {} to {} triangles, {more:.1} times as many, the time of a frame grew: {}.",
            ends.0,
            ends.1,
            words.join(", ")
        )
    })
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    mesa: Option<&Mesa>,
    size: Size,
    pixels: u32,
) -> anyhow::Result<()> {
    let mesh = context.wavelet(size)?;
    context.report_step(format!("{} triangles: building", mesh.num_triangles()))?;
    let scene = Scene::new(World::from_mesh(mesh.clone(), &BuildOptions::default())?);
    let report = scene.world.report();
    let (build_secs, bytes) = (report.total.as_secs_f64(), report.bytes);
    let options = RenderOptions::new(pixels, pixels);
    let n = mesh.num_triangles();
    let mut drawn: Option<MesaFrames> = None;
    if let Some(mesa) = mesa {
        context.report_step(format!("{n} triangles: a program for llvmpipe"))?;
        drawn = mesa
            .draw(&mesh, pixels)
            .map_err(|e| record.missing.push(format!("{n} triangles: {e:#}")))
            .ok();
    }
    let mut cameras: Vec<(String, Camera)> = vec![];
    for view in catalogue::find("wavelet")?.views() {
        cameras.push((view.name.clone(), Framing::At(view).of(&scene.world, [pixels, pixels])?));
    }
    context.report_step(format!("{n} triangles: frames in turns"))?;
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let mut variants: Vec<Variant<'_>> = cameras
        .iter()
        .map(|(name, camera)| {
            let (scene, options, failed) = (&scene, &options, &failed);
            Variant::new(name.as_str(), move || match render(scene, camera, options) {
                Ok(o) => o.frame.color.iter().filter(|c| c[3] > 0.0).count() as u64,
                Err(e) => {
                    failed.borrow_mut().get_or_insert(e.into());
                    0
                }
            })
        })
        .collect();
    if let Some(frames) = &mut drawn {
        let (name, failed) = (frames.name(), &failed);
        variants.push(Variant::timed(name, move || {
            frames.frame().unwrap_or_else(|e| {
                failed.borrow_mut().get_or_insert(e);
                Sample::default()
            })
        }));
    }
    let timings = interleave(&context.schedule(Schedule::all_threads(), 8.0), &mut variants)?;
    drop(variants);
    if let Some(e) = failed.into_inner() {
        return Err(e);
    }
    let rays = f64::from(pixels) * f64::from(pixels);
    for timed in &timings.variants {
        let (wall, cpu) = (timed.summary(Clock::Wall), timed.summary(Clock::ProcessCpu));
        let row =
            Row::new().with("triangles", n).with("view", timed.name.as_str()).with("pixels", rays);
        let row = row.with("time", wall.median * 1e3).with("time_low", wall.low * 1e3);
        let row = row.with("time_high", wall.high * 1e3).with("cpu", cpu.median * 1e3);
        let is_ours = cameras.iter().any(|(name, _)| *name == timed.name);
        record.rows.push(if is_ours {
            row.with("covered", timed.check)
                .with("threads", rayon::current_num_threads())
                .with("rate", rays / wall.median / 1e6)
                .with("build", build_secs)
                .with("bytes_per_triangle", bytes as f64 / n as f64)
        } else {
            row
        });
    }
    if let Some(frames) = drawn {
        frames.close()?;
    }
    Ok(())
}

fn plot(record: &Record) -> Plot {
    let mut plot =
        Plot::lines("Time of a frame", Axis::log("triangles", ""), Axis::log("time", "ms"));
    for row in &record.rows {
        let (Some(view), Some(x), Some(y)) =
            (row.text("view"), row.number("triangles"), row.number("time"))
        else {
            continue;
        };
        let point = Point { x, y, range: row.number("time_low").zip(row.number("time_high")) };
        match plot.series.iter_mut().find(|s| s.name == view) {
            Some(s) => s.points.push(point),
            None => plot.series.push(Series { name: view.into(), points: vec![point] }),
        }
    }
    plot
}
