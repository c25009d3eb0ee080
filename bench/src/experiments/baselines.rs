//! Compares rt-core with Embree 3, Embree 4 and obvhs on the same meshes and rays, in one process,
//! in alternation.
//!
//! rt-core's watertight mode is compared with every mode of the baselines, even those that are not
//! robust. Each baseline uses the packet width that is fastest for it.

use super::Context;
use super::compare::{self, Kind};
use super::installed_tracers::{InstalledBaselines, Isa, TracerSet};
use crate::meshes::{self, MeshScene};
use crate::plot::{Axis, Plot, Point, Series};
use crate::rays::View;
use crate::record::{Record, Row};
use crate::runner::{Ratio, Schedule};
use datasets::generate::nested_wavelet::Size;

const OURS: &str = "rt-core watertight";
const OURS_FAST: &str = "rt-core fast";

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    compare::explain_columns(record);
    record.column("meshes", "", "meshes of the scene, each a geometry of its own");
    record.column("instances", "", "placed meshes, each with all of its triangles");
    record.column("build", "s", "build on all threads, wall time");
    record.column("build_cpu", "s", "build, CPU time of all threads");
    record.column("bytes_per_triangle", "B", "memory of the structure, without the input mesh");
    record.column(
        "peak_bytes_per_triangle",
        "B",
        "the most held while building: what Embree reports, what the heap grew by for rt-core",
    );
    let installed = InstalledBaselines::find();
    record.missing.extend(installed.missing.iter().cloned());
    record.notes.push(
        "One thread traces; every tracer gets the same rays in the same order, in turns within one \
         process. A baseline's \
         time is that of its fastest mode. rt-core uses its packet entry point for rays that go \
         the same way and its \
         sorting entry point for the others, whichever is faster. obvhs is compiled for the \
         baseline instruction set \
         and computes no barycentric coordinates."
            .into(),
    );

    if let Some(scene) = context.mesh.clone() {
        // What this page's reader asked for, and nothing else.
        for isa in if context.quick { &[Isa::Best][..] } else { &[Isa::Best, Isa::Avx2] } {
            measure(context, record, &installed, &scene, *isa)?;
        }
        plots(record);
        return Ok(());
    }
    for &(name, isas) in if context.quick { QUICK } else { FULL } {
        context.report_step(format!("making {name}"))?;
        let scene = scene(context, name)?;
        for &isa in isas {
            measure(context, record, &installed, &scene, isa)?;
        }
    }
    plots(record);
    Ok(())
}

/// Most time that rt-core gets for one round of one kind of rays.
const PASS_SECS: f64 = 0.1;

/// The scenes, and the instruction sets on which each is measured.
const FULL: &[(&str, &[Isa])] = &[
    ("wavelet 1M", &[Isa::Best, Isa::Avx2, Isa::Sse42]),
    ("wavelet 16M", &[Isa::Best]),
    ("pipes", &[Isa::Best, Isa::Avx2]),
    ("cells", &[Isa::Best]),
    ("terrain", &[Isa::Best]),
    ("city", &[Isa::Best, Isa::Avx2]),
    ("forest", &[Isa::Best]),
    ("slivers", &[Isa::Best]),
];
const QUICK: &[(&str, &[Isa])] =
    &[("wavelet 1M", BEST), ("pipes", BEST), ("city", BEST), ("forest", BEST)];
const BEST: &[Isa] = &[Isa::Best];

/// Makes a scene of [`FULL`], smaller for quick runs.
fn scene(context: &mut Context<'_>, name: &str) -> anyhow::Result<MeshScene> {
    let quick = context.quick;
    let size = |full: u32, short: u32| if quick { short } else { full };
    let mesh = match name {
        "wavelet 1M" => context.wavelet(Size::M1)?,
        "wavelet 16M" => context.wavelet(Size::M16)?,
        "pipes" => meshes::pipes(size(2600, 600)),
        "cells" => meshes::cells(size(69, 25)),
        "terrain" => meshes::terrain(size(4_000_000, 200_000)),
        "slivers" => meshes::slivers(size(500_000, 50_000)),
        "city" => return Ok(meshes::city(size(3000, 300))),
        "forest" => return Ok(meshes::forest(size(20_000, 1000))),
        _ => anyhow::bail!("there is no scene `{name}`"),
    };
    Ok(MeshScene::one(name, mesh))
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    installed: &InstalledBaselines,
    scene: &MeshScene,
    isa: Isa,
) -> anyhow::Result<()> {
    let (name, triangles) = (scene.name.as_str(), scene.num_triangles());
    let full_name =
        if isa == Isa::Best { name.to_string() } else { format!("{name}, {}", isa.name()) };
    let tracers = TracerSet::build(scene, installed, isa, &mut |s| {
        context.report_step(format!("{full_name}: {s}"))
    })?;
    let left_out = |fault: &String| format!("{full_name}: {fault}");
    record.missing.extend(tracers.faults().iter().map(left_out));
    let base = Row::new()
        .with("mesh", name)
        .with("triangles", triangles)
        .with("meshes", scene.meshes.len())
        .with("instances", scene.instances.len())
        .with("simd", isa.name());

    // ---- Builds. Each was built once; fig4.7 measures build times in alternation.
    for (tracer, cost) in tracers.costs() {
        let per_triangle = |bytes: u64| bytes as f64 / triangles as f64;
        let row = base.clone().with("tracer", tracer).with("build", cost.wall_secs);
        let row = row
            .with("build_cpu", cost.cpu_secs)
            .with("bytes_per_triangle", per_triangle(cost.bytes));
        record.rows.push(row.with("peak_bytes_per_triangle", cost.peak_bytes.map(per_triangle)));
    }

    // ---- Rays.
    let size = if context.quick { 512 } else { 1024 };
    let bounds = scene.bounds();
    let views = [View::orbit(bounds), View::close(bounds)];
    let views = if context.quick && name != "wavelet 1M" { &views[..1] } else { &views[..] };
    for view in views {
        let kinds = if context.quick {
            &[Kind::Primary, Kind::Shadow, Kind::AmbientOcclusion][..]
        } else {
            &Kind::ALL
        };
        let watertight = tracers.ours[0].1.view(crate::rt_core_tracer::Mode::Coherent);
        for (kind, rays) in compare::make_rays(scene, view, size, kinds, &watertight) {
            // Eight ambient-occlusion rays per pixel: a subset of blocks from the whole image is
            // enough.
            let rays = rays.thinned(if context.quick { 1 << 18 } else { 1 << 21 });
            if rays.len == 0 {
                continue;
            }
            context.report_step(format!("{full_name}, {}: {} rays", view.name, kind.name()))?;
            let contenders = tracers.contenders(kind, !context.quick);
            // Seventeen tracers and modes take turns in at least five rounds.
            let rays = match contenders.first() {
                Some(ours) => compare::limited(rays, kind, ours, PASS_SECS),
                None => rays,
            };
            let schedule = context.schedule(Schedule::one_thread(), 2.5);
            let timings = compare::time(&schedule, kind, &rays, &contenders)?;
            let base = base.clone().with("view", view.name);
            record.rows.extend(compare::rows(&base, kind, &rays, &contenders, &timings));
            let what = format!("{full_name}, {}, {}", view.name, kind.name());
            for baseline in tracers.baseline_names() {
                let Some(best) = compare::best_mode(baseline, &contenders, &timings) else {
                    continue;
                };
                let ours: &[&str] =
                    if baseline.ends_with("robust") { &[OURS] } else { &[OURS, OURS_FAST] };
                for tracer in ours {
                    // Our mode for this kind of rays comes first. The best mode is selected for
                    // baselines only.
                    let Some(c) = contenders.iter().find(|c| c.tracer_name == *tracer) else {
                        continue;
                    };
                    if let Some(r) = timings.ratio(&c.name(), &best) {
                        record.ratios.push(Ratio { name: format!("{what}: {tracer}"), ..r });
                    }
                }
            }
        }
    }
    Ok(())
}

/// Ratios of our watertight mode as bars, one plot per mesh and view.
fn plots(record: &mut Record) {
    let mut groups: Vec<(String, Vec<(String, Ratio)>)> = vec![];
    for r in &record.ratios {
        let Some(what) = r.name.strip_suffix(&format!(": {OURS}")) else { continue };
        // The label is "mesh, view, rays"; the name of the rays may contain a comma.
        let kind = Kind::ALL
            .iter()
            .map(|k| k.name())
            .filter(|k| what.ends_with(k))
            .max_by_key(|k| k.len());
        let Some(kind) = kind else { continue };
        let scene = what.trim_end_matches(kind).trim_end_matches(", ").to_string();
        match groups.iter_mut().find(|(s, _)| *s == scene) {
            Some((_, list)) => list.push((kind.to_string(), r.clone())),
            None => groups.push((scene, vec![(kind.to_string(), r.clone())])),
        }
    }
    for (scene, list) in groups {
        let mut kinds: Vec<String> = list.iter().map(|(k, _)| k.clone()).collect();
        kinds.dedup();
        let mut plot = Plot::bars(
            &format!("{scene}: baseline’s time / rt-core’s time (watertight)"),
            Axis::linear("ratio, above 1 rt-core is faster", ""),
            kinds.clone(),
        );
        plot.mark = Some(1.0);
        for (kind, ratio) in list {
            let baseline = family(&ratio.baseline);
            let x = kinds.iter().position(|k| *k == kind).unwrap_or(0) as f64;
            let point = Point { x, y: ratio.value, range: Some((ratio.low, ratio.high)) };
            match plot.series.iter_mut().find(|s| s.name == baseline) {
                Some(s) => s.points.push(point),
                None => plot.series.push(Series { name: baseline, points: vec![point] }),
            }
        }
        record.plots.push(plot);
    }
}

/// A baseline's name without its mode.
fn family(baseline: &str) -> String {
    baseline.split(", ").next().unwrap_or(baseline).to_string()
}
