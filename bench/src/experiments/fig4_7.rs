//! Figure 4.7: build time against the number of triangles, for fast and for high-quality builds.
//! Also measures the builds of the baselines, and a frame of Mesa's rasteriser, which needs no
//! build.

use super::Context;
use super::installed_tracers::InstalledBaselines;
use super::wavelet_series::{PROGRAM, Step, has_room, steps};
use crate::baselines::BuildCost;
use crate::baselines::embree::{EmbreeScene, Options, Quality};
use crate::baselines::obvhs::{Obvhs, Preset};
use crate::memory;
use crate::meshes;
use crate::opengl::{Mesa, MesaFrames};
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::rt_core_tracer::RtCoreTracer;
use crate::runner::{VERDICT_ROUNDS, order};
use crate::stats::Summary;
use datasets::generate::nested_wavelet::Size;
use rt_core::bvh::{BuildOptions, BuildQuality, Storage};
use rt_core::mesh::TriMesh;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A builder of a tracer.
struct Builder<'a> {
    name: String,
    build: Box<dyn Fn() -> anyhow::Result<BuildCost> + 'a>,
    /// Whether it is measured however long it takes.
    is_main: bool,
}

/// What a builder took for the mesh before, from which its cost of the next one is foreseen.
#[derive(Clone, Copy)]
struct Before {
    triangles: usize,
    secs: f64,
    bytes_per_triangle: f64,
}

/// Other builders than the main ones are left out where a build would take longer, in seconds.
const PATIENCE: f64 = 10.0;
/// Builders that do not tell what they hold while they build are taken to hold so many times the
/// result: obvhs has a binary tree, and boxes of all triangles, besides the wide tree.
const WHILE_BUILDING: f64 = 3.0;

const BYTES: &str = "bytes_per_triangle";
const PEAK: &str = "peak_bytes_per_triangle";
const RESIDENT: &str = "resident_bytes_per_triangle";

/// Bytes a triangle that a builder holds besides what its cost counts: Embree gets a copy of
/// positions and indices.
fn copied_by(builder: &str) -> f64 {
    if builder.starts_with("Embree") { 18.0 } else { 0.0 }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("triangles", "", "triangles of the wavelet surfaces");
    record.column("builder", "", "tracer and preset, or renderer of a frame");
    record.column("threads", "", "threads that build; empty for frames");
    record.column("time", "s", "median over the rounds, wall time");
    record.column("time_low", "s", "fastest round");
    record.column("time_high", "s", "slowest round");
    record.column("cpu", "s", "median CPU time of all threads");
    record.column("rate", "Mtriangle/s", "triangles by median time");
    record.column(BYTES, "B", "memory of the structure, without the input mesh");
    record.column(
        PEAK,
        "B",
        "the most held while building: what Embree reports, what the heap grew by for rt-core",
    );
    record.column(
        RESIDENT,
        "B",
        "what the program's resident memory grew by while building, at most, by the kernel; memory \
         that it kept from before and used again is not in it",
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
    let mut series =
        BuildSeries { installed: &installed, mesa: mesa.as_ref(), before: BTreeMap::new() };
    if context.thesis {
        record.notes.push("The sizes of the dissertation (--thesis).".into());
    }
    if context.quick {
        let meshes = [meshes::coarse_wavelet(51)?, meshes::coarse_wavelet(101)?];
        for (mesh, rounds) in
            meshes.into_iter().zip([3, 3]).chain([(context.wavelet(Size::M1)?, 2)])
        {
            let rows = record.rows.len();
            series.measure(context, record, &mesh, rounds)?;
            series.learn(&record.rows[rows..]);
        }
    } else {
        for step in steps(context.thesis) {
            // A round of the largest meshes takes ten minutes.
            let rounds = match step {
                Step::Beyond(_) => 1,
                Step::Named(Size::M64) => 3,
                Step::Named(_) => VERDICT_ROUNDS,
            };
            let rows = record.rows.len();
            context.part(record, &step.name(), |context, record| {
                match step.mesh(context)? {
                    Ok(mesh) => series.measure(context, record, &mesh, rounds)?,
                    Err(why) => record.missing.push(why),
                }
                Ok(())
            })?;
            series.learn(&record.rows[rows..]);
        }
    }
    record.plots.push(plot(record));
    Ok(())
}

/// Builders, and what they took for the mesh before.
struct BuildSeries<'a> {
    installed: &'a InstalledBaselines,
    mesa: Option<&'a Mesa>,
    before: BTreeMap<String, Before>,
}

impl BuildSeries<'_> {
    /// Builds one mesh with all builders in alternation.
    fn measure(
        &mut self,
        context: &mut Context<'_>,
        record: &mut Record,
        mesh: &Arc<TriMesh>,
        rounds: usize,
    ) -> anyhow::Result<()> {
        let n = mesh.num_triangles();
        let mut builders = builders(mesh, self.installed);
        builders.retain(|builder| match self.foreseen(builder, n) {
            Ok(()) => true,
            Err(why) => {
                record.missing.push(format!("{n} triangles: {} {why}", builder.name));
                false
            }
        });
        let mut costs: Vec<Vec<BuildCost>> = vec![vec![]; builders.len()];
        let mut resident = vec![0; builders.len()];
        let before = |builder: &Builder<'_>| self.before.get(&builder.name);
        let most = builders.iter().filter_map(before).map(|b| b.bytes_per_triangle);
        let most = most.fold(0.0, f64::max);
        let mut drawn = self.program(context, record, mesh, most)?;
        for round in 0..rounds {
            for i in order(builders.len() + 1, round) {
                let now = builders.get(i).map_or("llvmpipe", |b| &b.name);
                context.report_step(format!(
                    "{n} triangles, round {} of {rounds}: {now}",
                    round + 1
                ))?;
                match (builders.get(i), &mut drawn) {
                    (Some(builder), _) => {
                        let (cost, held) = memory::resident_during(&builder.build);
                        costs[i].push(cost?);
                        resident[i] = held.unwrap_or(0).max(resident[i]);
                    }
                    (None, Some(frames)) => frames.take(FRAMES_PER_ROUND)?,
                    (None, None) => {}
                }
            }
        }
        for ((builder, costs), resident) in builders.iter().zip(&costs).zip(resident) {
            record.rows.push(row(&builder.name, mesh, costs, resident));
        }
        if let Some(frames) = drawn {
            let row = Row::new()
                .with("triangles", n)
                .with("builder", format!("a frame of {}", frames.name()));
            record.rows.push(frames.end(row, 1.0)?);
        }
        Ok(())
    }

    /// Takes from the rows of a mesh what its builders took.
    fn learn(&mut self, rows: &[Row]) {
        for row in rows {
            let number = |column: &str| row.number(column);
            let (Some(name), Some(triangles), Some(secs), Some(bytes)) =
                (row.text("builder"), number("triangles"), number("time"), number(BYTES))
            else {
                // Frames of llvmpipe hold no structure.
                continue;
            };
            let most = number(PEAK).map_or(WHILE_BUILDING * bytes, |peak| peak.max(bytes));
            // A library may hold more than it reports: above 100 million triangles, which seemed to
            // fit, the kernel ended the program.
            let bytes_per_triangle = (most + copied_by(name)).max(number(RESIDENT).unwrap_or(0.0));
            let before = Before { triangles: triangles as usize, secs, bytes_per_triangle };
            self.before.insert(name.to_owned(), before);
        }
    }

    /// Whether a builder has the memory and the time for a mesh of `n` triangles.
    fn foreseen(&self, builder: &Builder<'_>, n: usize) -> Result<(), String> {
        let Some(before) = self.before.get(&builder.name) else {
            return if self.before.is_empty() {
                Ok(())
            } else {
                Err("was left out of a smaller mesh".into())
            };
        };
        has_room(before.bytes_per_triangle * n as f64)?;
        let secs = before.secs * n as f64 / before.triangles as f64;
        if builder.is_main || secs <= PATIENCE {
            return Ok(());
        }
        Err(format!("would take about {secs:.0} s, and is measured up to {PATIENCE} s"))
    }

    /// A program that draws the mesh by llvmpipe, if there is room for it beside builders that take
    /// `most` bytes a triangle.
    fn program(
        &self,
        context: &mut Context<'_>,
        record: &mut Record,
        mesh: &Arc<TriMesh>,
        most: f64,
    ) -> anyhow::Result<Option<MesaFrames>> {
        let n = mesh.num_triangles();
        context.report_step(format!("{n} triangles: a program for llvmpipe"))?;
        let drawn = self.mesa.map(|mesa| {
            has_room((PROGRAM + most) * n as f64)
                .map_err(|why| format!("a program for llvmpipe, beside a builder, {why}"))?;
            mesa.draw(mesh, 1024).map_err(|e| format!("{e:#}"))
        });
        let drawn = drawn.transpose();
        Ok(drawn.map_err(|why| record.missing.push(format!("{n} triangles: {why}"))).ok().flatten())
    }
}

/// Frames per round: a frame is short compared with the builds of its round.
const FRAMES_PER_ROUND: usize = 3;

fn builders<'a>(mesh: &'a Arc<TriMesh>, installed: &'a InstalledBaselines) -> Vec<Builder<'a>> {
    let mut list: Vec<Builder<'a>> = vec![];
    let ours = [
        (BuildQuality::Fast, Storage::Plain),
        (BuildQuality::Balanced, Storage::Plain),
        (BuildQuality::Balanced, Storage::Compact),
        (BuildQuality::Best, Storage::Plain),
    ];
    for (quality, storage) in ours {
        let options = BuildOptions { quality, storage, ..Default::default() };
        let compact = if storage == Storage::Compact { ", compact" } else { "" };
        list.push(Builder {
            name: format!("rt-core {}{compact}", quality.name()),
            build: Box::new(move || Ok(RtCoreTracer::build(mesh, &options)?.cost)),
            is_main: quality != BuildQuality::Best,
        });
    }
    for e in &installed.embree {
        let ways = Quality::ALL.into_iter().map(|q| (q, false)).chain([(Quality::Medium, true)]);
        for (quality, compact) in ways {
            let options = Options { quality, compact, robust: true, ..Default::default() };
            let in_words = if compact { ", compact" } else { "" };
            list.push(Builder {
                name: format!("{} {}{in_words}", e.name(), quality.name()),
                build: Box::new(move || Ok(EmbreeScene::build(e, mesh, &options)?.cost)),
                is_main: quality != Quality::High,
            });
        }
    }
    for preset in Preset::ALL {
        list.push(Builder {
            name: format!("obvhs {}", preset.name()),
            build: Box::new(move || Ok(Obvhs::build(mesh, preset)?.cost)),
            is_main: false,
        });
    }
    list
}

fn row(name: &str, mesh: &TriMesh, costs: &[BuildCost], resident: u64) -> Row {
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
        .with(BYTES, cost.bytes as f64 / n)
        .with(PEAK, costs.iter().filter_map(|c| c.peak_bytes).max().map(|b| b as f64 / n))
        .with(RESIDENT, (resident > 0).then_some(resident as f64 / n))
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
