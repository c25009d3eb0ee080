//! Figure 4.7: build time against the number of triangles, for fast and for high-quality builds.
//! Also measures the builds of the baselines, and a frame of Mesa's rasteriser, which needs no
//! build.

use super::Context;
use super::installed_tracers::InstalledBaselines;
use crate::baselines::BuildCost;
use crate::baselines::embree::{EmbreeScene, Options, Quality};
use crate::baselines::obvhs::{Obvhs, Preset};
use crate::meshes;
use crate::opengl::{Mesa, MesaFrames};
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::rt_core_tracer::RtCoreTracer;
use crate::runner::{VERDICT_ROUNDS, order};
use crate::stats::Summary;
use datasets::generate::nested_wavelet::Size;
use rt_core::bvh::{BuildOptions, BuildQuality};
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// A named builder.
type Builder<'a> = (String, Box<dyn Fn() -> anyhow::Result<BuildCost> + 'a>);

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("triangles", "", "triangles of the wavelet surfaces");
    record.column("builder", "", "tracer and preset, or renderer of a frame");
    record.column("threads", "", "threads that build; empty for frames");
    record.column("time", "s", "median over the rounds, wall time");
    record.column("time_low", "s", "fastest round");
    record.column("time_high", "s", "slowest round");
    record.column("cpu", "s", "median CPU time of all threads");
    record.column("rate", "Mtriangle/s", "triangles by median time");
    record.column("bytes_per_triangle", "B", "memory of the structure, without the input mesh");
    record.column(
        "peak_bytes_per_triangle",
        "B",
        "the most held while building: what Embree reports, what the heap grew by for rt-core",
    );
    let installed = InstalledBaselines::find();
    record.missing.extend(installed.missing.iter().cloned());
    let mesa = Mesa::find().map_err(|missing| record.missing.extend(missing)).ok();
    record.notes.push(
        "Wall time from triangles in memory to a structure that rays can use, on all threads. The \
         dissertation’s \
         builds took under 1 s for 1 million triangles (approximate) to over 60 s for 256 million, \
         on one 8-core \
         node (2012)."
            .into(),
    );
    record.notes.push(
        "A frame of llvmpipe is one of an unmodified program that keeps the mesh in buffers, 1024 \
         x 1024 pixels, measured in the same rounds: \
         what a program waits for anyway each time its image changes, and so the yardstick for a \
         build that is needed once."
            .into(),
    );
    let with = Baselines { installed: &installed, mesa: mesa.as_ref() };
    if context.quick {
        for points in [51, 101] {
            let mesh = meshes::coarse_wavelet(points)?;
            measure(context, record, &with, &mesh, 3, false)?;
        }
        let mesh = context.wavelet(Size::M1)?;
        measure(context, record, &with, &mesh, 2, false)?;
    } else {
        for size in Size::ALL {
            if fits_in_memory(size, record) {
                let mesh = context.wavelet(size)?;
                // Slow builders are omitted where they would take minutes each.
                let small = size <= Size::M4;
                measure(context, record, &with, &mesh, VERDICT_ROUNDS, small)?;
            }
        }
    }
    record.plots.push(plot(record));
    Ok(())
}

/// The baselines for our builds.
struct Baselines<'a> {
    installed: &'a InstalledBaselines,
    mesa: Option<&'a Mesa>,
}

/// Builds one mesh with all builders in alternation.
fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    with: &Baselines<'_>,
    mesh: &Arc<TriMesh>,
    rounds: usize,
    slow_too: bool,
) -> anyhow::Result<()> {
    let n = mesh.num_triangles();
    let builders = builders(mesh, with.installed, slow_too);
    let mut costs: Vec<Vec<BuildCost>> = vec![vec![]; builders.len()];
    context.report_step(format!("{n} triangles: a program for llvmpipe"))?;
    let mut drawn: Option<MesaFrames> = None;
    if let Some(mesa) = with.mesa {
        drawn = mesa
            .draw(mesh, 1024)
            .map_err(|e| record.missing.push(format!("{n} triangles: {e:#}")))
            .ok();
    }
    for round in 0..rounds {
        context.report_step(format!("{n} triangles, round {} of {rounds}", round + 1))?;
        for i in order(builders.len() + 1, round) {
            match (builders.get(i), &mut drawn) {
                (Some((_, build)), _) => costs[i].push(build()?),
                (None, Some(frames)) => frames.take(FRAMES_PER_ROUND)?,
                (None, None) => {}
            }
        }
    }
    for ((name, _), costs) in builders.iter().zip(&costs) {
        record.rows.push(row(name, mesh, costs));
    }
    if let Some(frames) = drawn {
        let row = Row::new()
            .with("triangles", n)
            .with("builder", format!("a frame of {}", frames.name()));
        record.rows.push(frames.end(row, 1.0)?);
    }
    Ok(())
}

/// Frames per round: a frame is short compared with the builds of its round.
const FRAMES_PER_ROUND: usize = 3;

fn builders<'a>(
    mesh: &'a Arc<TriMesh>,
    installed: &'a InstalledBaselines,
    slow_too: bool,
) -> Vec<Builder<'a>> {
    let mut list: Vec<Builder<'a>> = vec![];
    for quality in BuildQuality::ALL {
        if quality == BuildQuality::Best && !slow_too {
            continue;
        }
        let options = BuildOptions { quality, ..Default::default() };
        let build = move || Ok(RtCoreTracer::build(mesh, &options)?.cost);
        list.push((format!("rt-core {}", quality.name()), Box::new(build)));
    }
    for e in &installed.embree {
        for quality in Quality::ALL {
            if quality != Quality::High || slow_too {
                let options = Options { quality, robust: true, ..Default::default() };
                let build = move || Ok(EmbreeScene::build(e, mesh, &options)?.cost);
                list.push((format!("{} {}", e.name(), quality.name()), Box::new(build)));
            }
        }
    }
    let presets = if slow_too { &Preset::ALL[..] } else { &[Preset::Fastest, Preset::Medium] };
    for &preset in presets {
        let build = move || Ok(Obvhs::build(mesh, preset)?.cost);
        list.push((format!("obvhs {}", preset.name()), Box::new(build)));
    }
    list
}

fn row(name: &str, mesh: &TriMesh, costs: &[BuildCost]) -> Row {
    let n = mesh.num_triangles() as f64;
    let of = |f: &dyn Fn(&BuildCost) -> f64| Summary::of(&costs.iter().map(f).collect::<Vec<_>>());
    let row = Row::new().with("triangles", mesh.num_triangles()).with("builder", name);
    let row = row.with("threads", rayon::current_num_threads());
    let (Some(wall), Some(cpu), Some(cost)) =
        (of(&|c| c.wall_secs), of(&|c| c.cpu_secs), costs.last())
    else {
        return row;
    };
    row.with("time", wall.median)
        .with("time_low", wall.low)
        .with("time_high", wall.high)
        .with("cpu", cpu.median)
        .with("rate", n / wall.median / 1e6)
        .with("bytes_per_triangle", cost.bytes as f64 / n)
        .with("peak_bytes_per_triangle", cost.peak_bytes.map(|b| b as f64 / n))
}

/// Checks that a size fits in memory; otherwise reports it in the record. The largest sizes need up
/// to 400 bytes per triangle while building.
pub(super) fn fits_in_memory(size: Size, record: &mut Record) -> bool {
    let needed_gib = size.triangles() as f64 * 400.0 / (1u64 << 30) as f64;
    let there_gib = record.machine.memory_gib;
    let fits = there_gib == 0.0 || needed_gib < 0.8 * there_gib;
    if !fits {
        record.missing.push(format!(
            "{} triangles: building needs about {needed_gib:.0} GiB and this machine has \
             {there_gib:.0} GiB",
            size.name()
        ));
    }
    fits
}

fn plot(record: &Record) -> Plot {
    let mut plot = Plot::lines("Build time", Axis::log("triangles", ""), Axis::log("time", "s"));
    for row in &record.rows {
        let number = |c: &str| row.number(c);
        let (Some(name), Some(x), Some(y)) =
            (row.text("builder"), number("triangles"), number("time"))
        else {
            continue;
        };
        let point = Point { x, y, range: number("time_low").zip(number("time_high")) };
        match plot.series.iter_mut().find(|s| s.name == name) {
            Some(s) => s.points.push(point),
            None => plot.series.push(Series { name: name.into(), points: vec![point] }),
        }
    }
    plot
}
