//! Measures the cost of a better build and the gain for rays: the dissertation's choice between
//! approximate and full builds (section 4.1.2). It also gives the number of frames after which the
//! better build pays off.

use super::Context;
use super::compare::{self, Contender, Kind};
use super::installed_tracers::InstalledBaselines;
use crate::baselines::embree::{Embree, EmbreeScene, Options, Quality};
use crate::meshes::{self, MeshScene};
use crate::plot::{Axis, Plot, Point, Series};
use crate::rays::View;
use crate::record::{Record, Row};
use crate::rt_core_tracer::{Mode, RtCoreTracer};
use crate::runner::{Ratio, Schedule, VERDICT_ROUNDS, order};
use crate::stats::Summary;
use datasets::generate::nested_wavelet::Size;
use rt_core::bvh::{BuildOptions, BuildQuality};
use rt_core::mesh::TriMesh;
use std::sync::Arc;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    compare::explain_columns(record);
    record.column("preset", "", "quality of the build");
    record.column("build", "s", "median of the builds in turns, wall time, all threads");
    record.column("build_low", "s", "fastest of these builds; empty where one was timed");
    record.column("build_high", "s", "slowest of these builds; empty where one was timed");
    record.column("bytes_per_triangle", "B", "memory of the structure, without the input mesh");
    record.notes.push(
        "Every preset gives the same image; only the time differs. A ratio is the time of the \
         fastest build’s rays \
         divided by the preset’s: above 1 the better structure pays. Embree’s medium and high \
         builds (the latter cuts \
         triangles between boxes) trace the same rays; ratios to them are theirs divided by ours."
            .into(),
    );
    let installed = InstalledBaselines::find();
    record.missing.extend(installed.missing.iter().cloned());
    // Only the newest version.
    let embree = installed.embree.last();
    let (size, pixels) = if context.quick { (Size::M1, 512) } else { (Size::M4, 1024) };
    let pipes = meshes::pipes(if context.quick { 600 } else { 2600 });
    let scenes =
        [(format!("wavelet {}", size.name()), context.wavelet(size)?), ("pipes".into(), pipes)];
    for (name, mesh) in &scenes {
        scene(context, record, embree, name, mesh, pixels)?;
    }
    for (name, _) in &scenes {
        record.plots.push(plot(record, name));
    }
    Ok(())
}

fn scene(
    context: &mut Context<'_>,
    record: &mut Record,
    embree: Option<&Embree>,
    name: &str,
    mesh: &Arc<TriMesh>,
    pixels: u32,
) -> anyhow::Result<()> {
    let (built, build_secs) = build_in_turns(context, name, mesh)?;
    let mut baselines: Vec<(String, EmbreeScene)> = vec![];
    for (quality, robust) in
        [Quality::Medium, Quality::High].into_iter().flat_map(|q| [(q, true), (q, false)])
    {
        let Some(e) = embree else { break };
        let options = Options { quality, robust, ..Options::default() };
        let kind = if robust { "robust" } else { "fast" };
        let baseline = format!("{} {}, {kind}", e.name(), quality.name());
        context.report_step(format!("{name}: building {baseline}"))?;
        baselines.push((baseline, EmbreeScene::build(e, mesh, &options)?));
    }
    let view = View::orbit(mesh.bounds());
    let kinds = [Kind::Primary, Kind::AmbientOcclusion];
    let rays_from = MeshScene::one(name, Arc::clone(mesh));
    for (kind, rays) in
        compare::make_rays(&rays_from, &view, pixels, &kinds, &built[0].1.view(Mode::Coherent))
    {
        let rays = if context.quick { rays.thinned(1 << 18) } else { rays };
        context.report_step(format!("{name}: {} rays", kind.name()))?;
        let mode = if kind.coherent() { Mode::Coherent } else { Mode::Incoherent };
        let mut contenders: Vec<Contender<'_>> = built
            .iter()
            .map(|(quality, ours)| Contender {
                tracer_name: quality.name().into(),
                mode: mode.name().into(),
                tracer: Box::new(ours.view(mode)),
            })
            .collect();
        let (width, hint) = (16, if kind.coherent() { "coherent" } else { "incoherent" });
        contenders.extend(baselines.iter().map(|(baseline, scene)| Contender {
            tracer_name: baseline.clone(),
            mode: format!("packets of {width}, {hint}"),
            tracer: Box::new(scene.view(width, kind.coherent())),
        }));
        let schedule = context.schedule(Schedule::one_thread(), 3.0);
        let timings = compare::time(&schedule, kind, &rays, &contenders)?;
        let base = Row::new()
            .with("mesh", name)
            .with("triangles", mesh.num_triangles())
            .with("view", view.name);
        let rows = compare::rows(&base.with("simd", "best"), kind, &rays, &contenders, &timings);
        let (mine, others) = contenders.split_at(built.len());
        for (i, mut row) in rows.into_iter().enumerate() {
            let (tracer, preset, cost) = match built.get(i) {
                Some((quality, ours)) => ("rt-core watertight", quality.name(), ours.cost),
                None => {
                    let (baseline, scene) = &baselines[i - built.len()];
                    (baseline.as_str(), baseline.as_str(), scene.cost)
                }
            };
            let bytes = cost.bytes as f64 / mesh.num_triangles() as f64;
            row = row.with("tracer", tracer).with("preset", preset);
            row = row.with("bytes_per_triangle", bytes);
            record.rows.push(match build_secs.get(i) {
                Some(secs) => row
                    .with("build", secs.median)
                    .with("build_low", secs.low)
                    .with("build_high", secs.high),
                None => row.with("build", cost.wall_secs),
            });
        }
        for other in others {
            let best = mine.last().expect("there are presets");
            if let Some(r) = timings.ratio(&best.name(), &other.name()) {
                let name = format!("{name}, {}: {}", kind.name(), best.tracer_name);
                record.ratios.push(Ratio { name, baseline: other.tracer_name.clone(), ..r });
            }
        }
        for c in &mine[1..] {
            if let Some(r) = timings.ratio(&c.name(), &contenders[0].name()) {
                let name = format!("{name}, {}: {}", kind.name(), c.tracer_name);
                record.ratios.push(Ratio {
                    name,
                    baseline: contenders[0].tracer_name.clone(),
                    ..r
                });
            }
        }
    }
    Ok(())
}

/// A preset and what it built.
type Built = (BuildQuality, RtCoreTracer);

/// Builds the mesh with every preset, one after the other in each round. Gives the last build of
/// each preset and its wall times in seconds. The first round only warms the machine up: pages of
/// the mesh and of the heap are touched for the first time there.
fn build_in_turns(
    context: &mut Context<'_>,
    name: &str,
    mesh: &Arc<TriMesh>,
) -> anyhow::Result<(Vec<Built>, Vec<Summary>)> {
    let qualities = BuildQuality::ALL;
    let rounds = if context.quick { 1 } else { VERDICT_ROUNDS };
    let mut secs = vec![vec![]; qualities.len()];
    let mut built: Vec<Option<RtCoreTracer>> = qualities.iter().map(|_| None).collect();
    for round in 0..=rounds {
        for i in order(qualities.len(), round) {
            let quality = qualities[i];
            let step = format!("{name}: building, {}, round {round} of {rounds}", quality.name());
            context.report_step(step)?;
            // The build before is dropped first, so that each has the same memory at hand.
            built[i] = None;
            let ours = RtCoreTracer::build(mesh, &BuildOptions { quality, ..Default::default() })?;
            if round > 0 {
                secs[i].push(ours.cost.wall_secs);
            }
            built[i] = Some(ours);
        }
    }
    let built = qualities.into_iter().zip(built.into_iter().flatten()).collect();
    Ok((built, secs.iter().filter_map(|s| Summary::of(s)).collect()))
}

/// Time to the n-th frame, including the build: at the intersections, the better build has paid
/// off.
fn plot(record: &Record, mesh: &str) -> Plot {
    let title = format!(
        "{mesh}: build, then frames of these primary and ambient-occlusion rays, one thread tracing"
    );
    let mut plot = Plot::lines(&title, Axis::log("frames", ""), Axis::log("total time", "s"));
    for quality in BuildQuality::ALL {
        let rows = || {
            record.rows.iter().filter(|r| {
                r.text("mesh") == Some(mesh) && r.text("preset") == Some(quality.name())
            })
        };
        let frame_secs: f64 = rows().filter_map(|r| r.number("time")).sum::<f64>() / 1e3;
        let Some(build_secs) = rows().find_map(|r| r.number("build")) else { continue };
        let frames = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];
        let point = |n: &f64| Point { x: *n, y: build_secs + n * frame_secs, range: None };
        plot.series.push(Series {
            name: quality.name().into(),
            points: frames.iter().map(point).collect(),
        });
    }
    plot
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// From the newest record: mesh, preset, build time, and the times of primary rays and of all
    /// rays, in seconds.
    fn recorded() -> Vec<(String, String, f64, [f64; 2])> {
        let runs = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("runs");
        let folders = std::fs::read_dir(runs).expect("bench/runs").flatten();
        let mut files: Vec<PathBuf> =
            folders.map(|f| f.path().join("accuracy-build.csv")).filter(|f| f.is_file()).collect();
        files.sort();
        let text = std::fs::read_to_string(files.last().expect("a record")).expect("text");
        let mut lines = text.lines().filter(|l| !l.starts_with('#'));
        let names: Vec<&str> = lines.next().expect("names").split(',').collect();
        let place = |name: &str| names.iter().position(|n| n.starts_with(name)).expect("a column");
        let [mesh, rays, tracer, time, preset, build] =
            ["mesh", "rays", "tracer", "time [ms]", "preset", "build [s]"].map(place);
        let mut out: Vec<(String, String, f64, [f64; 2])> = vec![];
        // Names of baselines contain commas and quotes; ours do not.
        for row in lines.filter(|l| !l.contains('"')).map(|l| l.split(',').collect::<Vec<_>>()) {
            assert!(row[tracer].starts_with("rt-core"), "{row:?}");
            let number = |i: usize| row[i].parse::<f64>().expect("a number");
            let secs = number(time) / 1e3;
            let primary = if row[rays] == "primary" { secs } else { 0.0 };
            match out.iter_mut().find(|(m, p, ..)| m == row[mesh] && p == row[preset]) {
                Some((.., known)) => *known = [known[0] + primary, known[1] + secs],
                None => {
                    let frame = [primary, secs];
                    out.push((row[mesh].into(), row[preset].into(), number(build), frame));
                }
            }
        }
        out
    }

    /// Reads the record and times nothing: for some mesh and some number of frames, of primary rays
    /// or with ambient occlusion, building with the preset and tracing that many frames takes the
    /// least time.
    #[test]
    fn every_preset_is_the_best_choice_somewhere_in_the_record() {
        let rows = recorded();
        let mut winners = std::collections::BTreeSet::new();
        let meshes: std::collections::BTreeSet<&str> = rows.iter().map(|r| r.0.as_str()).collect();
        let known: Vec<_> = BuildQuality::ALL.iter().map(|q| q.name()).collect();
        for mesh in meshes {
            for (frames, rays) in
                (0..16).flat_map(|k| [(f64::from(1 << k), 0), (f64::from(1 << k), 1)])
            {
                let total = |r: &&(String, String, f64, [f64; 2])| r.2 + frames * r.3[rays];
                let best = rows.iter().filter(|r| r.0 == mesh && known.contains(&r.1.as_str()));
                let best = best.min_by(|a, b| total(a).total_cmp(&total(b))).expect("presets");
                winners.insert(best.1.as_str());
            }
        }
        for name in known {
            assert!(
                winners.contains(name),
                "`{name}` is never the best choice; these are: {winners:?}"
            );
        }
    }
}
