//! Measures scenes of thousands of small meshes: what rays and builds cost when each mesh is a
//! geometry of its own, against the same triangles in one mesh and against Embree.

use super::Context;
use super::compare::{self, Contender, Kind};
use super::installed_tracers::InstalledBaselines;
use crate::baselines::BuildCost;
use crate::baselines::embree::{Embree, EmbreeScene, Options};
use crate::clock::{Clock, Sample};
use crate::meshes::{self, MeshScene};
use crate::plot::{Axis, Plot, Point, Series};
use crate::rays::View;
use crate::record::{Record, Row};
use crate::rt_core_tracer::{Mode, RtCoreTracer};
use crate::runner::{Ratio, Schedule, Timings, Variant, interleave};
use rayon::ThreadPoolBuilder;
use std::cell::RefCell;

const APART: &str = "rt-core, apart";
const MERGED: &str = "rt-core, merged";
const ONE_THREAD: &str = "rt-core, apart, one thread";

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    compare::explain_columns(record);
    record.column("meshes", "", "meshes of the scene, each a geometry of its own");
    record.column("build", "s", "build, median over the rounds, wall time");
    record.column("build_low", "s", "fastest round");
    record.column("build_high", "s", "slowest round");
    record.column("build_cpu", "s", "build, median over the rounds, CPU time of all threads");
    record.notes.push(
        "Apart: each mesh is a geometry of its own. Merged: the same triangles in one mesh. One \
         thread traces. Embree’s build begins when its geometries are attached to the scene; \
         rt-core’s begins with the meshes, so that it alone has the cost of many geometries in its \
         build. Embree’s time of rays is that of the faster of packets of 16 and single rays, \
         fast mode."
            .into(),
    );
    let installed = InstalledBaselines::find();
    record.missing.extend(installed.missing.iter().cloned());
    let embree = installed.embree.last();
    for scene in scenes(context.quick) {
        let whole = scene.merged();
        builds(context, record, &scene, &whole, embree)?;
        rays(context, record, &scene, &whole, embree)?;
    }
    plot(record);
    Ok(())
}

fn scenes(quick: bool) -> Vec<MeshScene> {
    if quick { vec![meshes::spheres(1000)] } else { all_scenes() }
}

fn all_scenes() -> Vec<MeshScene> {
    let spheres = |count, name: &str| MeshScene { name: name.into(), ..meshes::spheres(count) };
    vec![spheres(10_000, "10,000 spheres"), spheres(100_000, "100,000 spheres"), meshes::city(3000)]
}

/// Embree's name with its division of the triangles.
fn embree_name(embree: &Embree, division: &str) -> String {
    format!("{}, {division}", embree.name())
}

fn base_row(scene: &MeshScene) -> Row {
    Row::new()
        .with("mesh", scene.name.as_str())
        .with("triangles", scene.num_triangles())
        .with("meshes", scene.meshes.len())
        .with("simd", "best")
}

// ---- Builds -------------------------------------------------------------------------------------

fn builds(
    context: &mut Context<'_>,
    record: &mut Record,
    scene: &MeshScene,
    whole: &MeshScene,
    embree: Option<&Embree>,
) -> anyhow::Result<()> {
    context.report_step(format!("{}: builds", scene.name))?;
    let one_thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let sample = |cost: Result<BuildCost, anyhow::Error>| match cost {
        Ok(cost) => Sample {
            wall_secs: cost.wall_secs,
            thread_cpu_secs: f64::NAN,
            process_cpu_secs: cost.cpu_secs,
        },
        Err(e) => {
            *failed.borrow_mut() = Some(e);
            Sample::default()
        }
    };
    let ours = |scene: &MeshScene| Ok(RtCoreTracer::build_scene(scene, &Default::default())?.cost);
    let theirs = |embree: &Embree, scene: &MeshScene| {
        Ok(EmbreeScene::build_scene(embree, scene, &Options::default())?.cost)
    };
    let mut variants = vec![
        Variant::timed(APART, || sample(ours(scene))),
        Variant::timed(MERGED, || sample(ours(whole))),
        Variant::timed(ONE_THREAD, || sample(one_thread.install(|| ours(scene)))),
    ];
    if let Some(e) = embree {
        for (division, scene) in [("apart", scene), ("merged", whole)] {
            variants
                .push(Variant::timed(embree_name(e, division), move || sample(theirs(e, scene))));
        }
    }
    let schedule = context.schedule(Schedule::all_threads(), 3.0);
    let timings = interleave(&schedule, &mut variants)?;
    drop(variants);
    if let Some(e) = failed.into_inner() {
        return Err(e);
    }
    for timed in &timings.variants {
        let (wall, cpu) = (timed.summary(Clock::Wall), timed.summary(Clock::ProcessCpu));
        record.rows.push(
            base_row(scene)
                .with("tracer", timed.name.as_str())
                .with("build", wall.median)
                .with("build_low", wall.low)
                .with("build_high", wall.high)
                .with("build_cpu", cpu.median),
        );
    }
    let what = format!("{}, build", scene.name);
    push_ratio(record, &timings, &what, APART, MERGED);
    push_ratio(record, &timings, &what, APART, ONE_THREAD);
    if let Some(e) = embree {
        push_ratio(record, &timings, &what, APART, &embree_name(e, "apart"));
    }
    Ok(())
}

fn push_ratio(record: &mut Record, timings: &Timings, what: &str, ours: &str, baseline: &str) {
    if let Some(ratio) = timings.ratio(ours, baseline) {
        record.ratios.push(Ratio { name: format!("{what}: {ours}"), ..ratio });
    }
}

// ---- Rays ---------------------------------------------------------------------------------------

fn rays(
    context: &mut Context<'_>,
    record: &mut Record,
    scene: &MeshScene,
    whole: &MeshScene,
    embree: Option<&Embree>,
) -> anyhow::Result<()> {
    context.report_step(format!("{}: building for rays", scene.name))?;
    let ours = [
        (APART, RtCoreTracer::build_scene(scene, &Default::default())?),
        (MERGED, RtCoreTracer::build_scene(whole, &Default::default())?),
    ];
    let mut theirs = vec![];
    if let Some(e) = embree {
        for (division, scene) in [("apart", scene), ("merged", whole)] {
            let built = EmbreeScene::build_scene(e, scene, &Options::default())?;
            theirs.push((embree_name(e, division), built));
        }
    }
    let (bounds, pixels) = (scene.bounds(), if context.quick { 256 } else { 1024 });
    for view in [View::orbit(bounds), View::close(bounds)] {
        let finder = ours[0].1.view(Mode::Coherent);
        for (kind, rays) in compare::make_rays(scene, &view, pixels, &Kind::ALL, &finder) {
            let rays = rays.thinned(if context.quick { 1 << 16 } else { 1 << 20 });
            if rays.len == 0 {
                continue;
            }
            context.report_step(format!("{}, {}: {} rays", scene.name, view.name, kind.name()))?;
            let contenders = contenders(kind, &ours, &theirs);
            let schedule = context.schedule(Schedule::one_thread(), 2.0);
            let timings = compare::time(&schedule, kind, &rays, &contenders)?;
            let base = base_row(scene).with("view", view.name);
            record.rows.extend(compare::rows(&base, kind, &rays, &contenders, &timings));
            let what = format!("{}, {}, {}", scene.name, view.name, kind.name());
            let apart = &contenders[0].name();
            if let Some(ratio) = timings.ratio(apart, &contenders[1].name()) {
                let (name, baseline) = (format!("{what}: {APART}"), MERGED.into());
                record.ratios.push(Ratio { name, baseline, ..ratio });
            }
            let Some((name, _)) = theirs.first() else { continue };
            let Some(best) = compare::best_mode(name, &contenders, &timings) else { continue };
            if let Some(ratio) = timings.ratio(apart, &best) {
                record.ratios.push(Ratio { name: format!("{what}: {APART}"), ..ratio });
            }
        }
    }
    Ok(())
}

/// Ours apart and merged come first, in the mode that suits the rays.
fn contenders<'a>(
    kind: Kind,
    ours: &'a [(&str, RtCoreTracer)],
    theirs: &'a [(String, EmbreeScene)],
) -> Vec<Contender<'a>> {
    let mode = if kind.coherent() { Mode::Coherent } else { Mode::Incoherent };
    let mut list: Vec<Contender<'_>> = vec![];
    for (name, tracer) in ours {
        list.push(Contender {
            tracer_name: (*name).into(),
            mode: mode.name().into(),
            tracer: Box::new(tracer.view(mode)),
        });
    }
    for (name, scene) in theirs {
        for (width, mode) in [(16, "packets of 16"), (1, "single rays")] {
            list.push(Contender {
                tracer_name: name.clone(),
                mode: mode.into(),
                tracer: Box::new(scene.view(width, kind.coherent())),
            });
        }
    }
    list
}

/// Rays among meshes that are apart against those among the same triangles in one mesh.
fn plot(record: &mut Record) {
    let axis = Axis::linear("time merged / time apart", "");
    let kinds: Vec<String> = Kind::ALL.iter().map(|k| k.name().to_string()).collect();
    let mut bars = Plot::bars("Rays among many meshes, against one mesh", axis, kinds.clone());
    bars.mark = Some(1.0);
    for ratio in record.ratios.iter().filter(|r| r.baseline == MERGED) {
        let Some(what) = ratio.name.strip_suffix(&format!(": {APART}")) else { continue };
        // "scene, view, kind"; the names of scenes and kinds may contain commas.
        let ends = |(_, kind): &(usize, &String)| what.ends_with(&format!(", {kind}"));
        let longest = kinds.iter().enumerate().filter(ends).max_by_key(|(_, kind)| kind.len());
        let Some((x, kind)) = longest else { continue };
        let group = what.trim_end_matches(kind.as_str()).trim_end_matches(", ");
        let range = Some((ratio.low, ratio.high));
        let point = Point { x: x as f64, y: ratio.value, range };
        match bars.series.iter_mut().find(|s| s.name == group) {
            Some(series) => series.points.push(point),
            None => bars.series.push(Series { name: group.into(), points: vec![point] }),
        }
    }
    record.plots.push(bars);
}
