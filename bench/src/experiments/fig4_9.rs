//! Figure 4.9: frame time against the number of triangles for the same view, with primary rays and
//! a headlight, and with frames of Mesa's rasteriser.

use super::Context;
use super::wavelet_series::{PROGRAM, Step, has_room, steps};
use crate::clock::{Clock, Sample};
use crate::image::framing::Framing;
use crate::memory;
use crate::opengl::{Mesa, MesaFrames};
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use datasets::catalogue;
use rt_core::bvh::{BuildOptions, Storage, World};
use rt_core::camera::Camera;
use rt_core::mesh::TriMesh;
use rt_core::render::{RenderOptions, render};
use rt_core::scene::Scene;
use std::cell::RefCell;
use std::sync::Arc;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("triangles", "", "triangles of the wavelet surfaces");
    record.column(
        "view",
        "",
        "view of the data set, by a plain tree or a compact one; `llvmpipe`: the whole of it, \
         turning, drawn by an unmodified program",
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
    record.column(
        "peak_bytes_per_triangle",
        "B",
        "what the heap grew by while building, at most: the mesh is not in it",
    );
    record.column(
        "resident_bytes_per_triangle",
        "B",
        "what the program's resident memory grew by while building, at most, by the kernel; memory \
         that it kept from before and used again is not in it",
    );
    record.notes.push(
        "A frame through the renderer: one primary ray a pixel, headlight, matte material, no \
         secondary rays, from the \
         same camera for all sizes. Views and llvmpipe take turns, a frame each. Where a ray \
         tracer’s time and a rasteriser’s \
         cross is the point of the dissertation’s figure."
            .into(),
    );
    let mesa = Mesa::find().map_err(|missing| record.missing.extend(missing)).ok();
    if context.thesis {
        record.notes.push("The sizes of the dissertation (--thesis).".into());
    }
    let pixels = if context.quick { 512 } else { 1024 };
    let all = steps(context.thesis);
    for &step in if context.quick { &all[..3] } else { &all[..] } {
        context.part(record, &step.name(), |context, record| {
            match step.mesh(context)? {
                Ok(mesh) => measure(context, record, mesa.as_ref(), step, &mesh, pixels)?,
                Err(why) => record.missing.push(why),
            }
            Ok(())
        })?;
    }
    record.notes.extend(describe_growth(record));
    record.plots.push(plot(record));
    Ok(())
}

/// Describes how the time of each view grew from its smallest to its largest number of triangles:
/// a renderer that takes more memory ends before the others.
fn describe_growth(record: &Record) -> Option<String> {
    let series = plot(record).series;
    let words = series.iter().filter_map(|series| {
        let (first, last) = (series.points.first()?, series.points.last()?);
        let (more, longer) = (last.x / first.x, last.y / first.y);
        (more > 1.0).then(|| {
            format!(
                "{} {longer:.2} times with {more:.0} times as many ({:.0} million)",
                series.name,
                last.x / 1e6
            )
        })
    });
    let words: Vec<String> = words.collect();
    (!words.is_empty()).then(|| {
        format!("From the smallest mesh on, the time of a frame grew: {}.", words.join("; "))
    })
}

/// Bytes a triangle of a tree while it is built, at most: figure 4.7 has 91 and 34 for a million.
fn bytes_while_building(storage: Storage) -> f64 {
    match storage {
        Storage::Plain => 92.0,
        Storage::Compact => 35.0,
    }
}

/// The mesh with a tree of one kind.
struct Built {
    storage: Storage,
    scene: Scene,
    build_secs: f64,
    bytes: usize,
    peak_bytes: u64,
    resident_bytes: Option<u64>,
}

/// The mesh with a tree of each kind that there is room for.
fn built(
    context: &mut Context<'_>,
    record: &mut Record,
    mesh: &Arc<TriMesh>,
) -> anyhow::Result<Vec<Built>> {
    let n = mesh.num_triangles();
    let mut all = vec![];
    for storage in Storage::ALL {
        let name = storage.name();
        context.report_step(format!("{n} triangles: building, {name}"))?;
        if let Err(why) = has_room(bytes_while_building(storage) * n as f64) {
            record.missing.push(format!("{n} triangles: a {name} tree {why}"));
            continue;
        }
        let options = BuildOptions { storage, ..BuildOptions::default() };
        let ((world, peak_bytes), resident_bytes) =
            memory::resident_during(|| memory::peak(|| World::from_mesh(mesh.clone(), &options)));
        let scene = Scene::new(world?);
        let report = scene.world.report();
        let (build_secs, bytes) = (report.total.as_secs_f64(), report.bytes);
        all.push(Built { storage, scene, build_secs, bytes, peak_bytes, resident_bytes });
    }
    Ok(all)
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    mesa: Option<&Mesa>,
    step: Step,
    mesh: &Arc<TriMesh>,
    pixels: u32,
) -> anyhow::Result<()> {
    let built = built(context, record, mesh)?;
    let options = RenderOptions::new(pixels, pixels);
    let n = mesh.num_triangles();
    let mut drawn: Option<MesaFrames> = None;
    if let Some(mesa) = mesa {
        context.report_step(format!("{n} triangles: a program for llvmpipe"))?;
        let room = has_room(PROGRAM * step.triangles() as f64);
        let room = room.map_err(|why| format!("a program for llvmpipe {why}"));
        let started = room.and_then(|()| mesa.draw(mesh, pixels).map_err(|e| format!("{e:#}")));
        drawn = started.map_err(|why| record.missing.push(format!("{n} triangles: {why}"))).ok();
    }
    let mut pictures: Vec<(String, &Built, Camera)> = vec![];
    for one in &built {
        for view in catalogue::find("wavelet")?.views() {
            let name = match one.storage {
                Storage::Plain => view.name.clone(),
                Storage::Compact => format!("{}, compact", view.name),
            };
            let camera = Framing::At(view).of(&one.scene.world, [pixels, pixels])?;
            pictures.push((name, one, camera));
        }
    }
    context.report_step(format!("{n} triangles: frames in turns"))?;
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let mut variants: Vec<Variant<'_>> = pictures
        .iter()
        .map(|(name, one, camera)| {
            let (scene, options, failed) = (&one.scene, &options, &failed);
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
        let ours = pictures.iter().find(|(name, ..)| *name == timed.name);
        record.rows.push(match ours {
            Some((_, one, _)) => row
                .with("covered", timed.check)
                .with("threads", rayon::current_num_threads())
                .with("rate", rays / wall.median / 1e6)
                .with("build", one.build_secs)
                .with("bytes_per_triangle", one.bytes as f64 / n as f64)
                .with("peak_bytes_per_triangle", one.peak_bytes as f64 / n as f64)
                .with(
                    "resident_bytes_per_triangle",
                    one.resident_bytes.map(|bytes| bytes as f64 / n as f64),
                ),
            None => row,
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
