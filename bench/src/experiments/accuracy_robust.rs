//! Counts leaks of closed surfaces, and measures the time that leak-free traversal costs.
//!
//! Every ray that starts inside a closed surface must hit it; a miss is a leak. Rays are aimed
//! exactly at mesh vertices, at points on edges, and in random directions. Which triangle is hit is
//! not checked here; the tests compare that with brute force.

use super::Context;
use super::installed_tracers::InstalledBaselines;
use crate::baselines::embree::{EmbreeScene, Options};
use crate::baselines::obvhs::{Obvhs, Preset};
use crate::baselines::{Tracer, count_hits};
use crate::meshes;
use crate::plot::{Axis, Plot, Series};
use crate::rays::{HitBlock, RaySet};
use crate::record::{Record, Row};
use crate::rt_core_tracer::{Mode, RtCoreTracer};
use crate::runner::order;
use crate::{clock, rays};
use glam::DVec3;
use rayon::prelude::*;
use rt_core::bvh::{BuildOptions, Robustness};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Rays per batch; one thread generates, traces and counts a batch.
const BATCH: usize = 1 << 16;

/// A closed mesh and a ball inside it that contains the rays' origins.
struct Case {
    name: &'static str,
    mesh: Arc<TriMesh>,
    center: DVec3,
    radius: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Aim {
    Vertices,
    Edges,
    Random,
}

impl Aim {
    const ALL: [Aim; 3] = [Aim::Vertices, Aim::Edges, Aim::Random];
    fn name(self) -> &'static str {
        match self {
            Aim::Vertices => "vertices",
            Aim::Edges => "edges",
            Aim::Random => "anywhere",
        }
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("tracer", "", "tracer");
    record.column(
        "robustness",
        "",
        "rt-core: fast or watertight; Embree: fast or robust; obvhs has one mode",
    );
    record.column("mesh", "", "closed mesh");
    record.column("triangles", "", "triangles of the mesh");
    record.column("aim", "", "what the rays are aimed at, from inside");
    record.column("rays", "", "number of rays");
    record.column("leaks", "", "rays that came out");
    record.column(
        "seconds",
        "s",
        "CPU time of tracing them, all threads together, without making them",
    );
    let installed = InstalledBaselines::find();
    record.missing.extend(installed.missing.iter().cloned());
    // 12 combinations of mesh and target: 10^8 rays for each of our modes in the full form.
    let (per_combination, baseline_rays) =
        if context.quick { (4 * BATCH, 2 * BATCH) } else { (128 * BATCH, 32 * BATCH) };
    record.notes.push(format!(
        "Every ray starts inside a closed surface, so every miss is a leak. rt-core traces {} rays \
         in each mode, each \
         baseline {}: half from random points one at a time, half from common points as packets. \
         The meshes are a \
         sphere at the origin, the same far from it, a crumpled one, and a globe with needle \
         triangles.",
        12 * per_combination,
        12 * baseline_rays
    ));

    let level = if context.quick { 5 } else { 7 };
    let far = DVec3::new(1000.0, 700.0, -1300.0);
    let sphere = |crumple, center| Arc::new(meshes::crumpled_sphere(level, crumple, center));
    let cases = [
        Case { name: "sphere", mesh: sphere(0.0, DVec3::ZERO), center: DVec3::ZERO, radius: 0.7 },
        Case { name: "sphere far away", mesh: sphere(0.0, far), center: far, radius: 0.7 },
        Case {
            name: "crumpled sphere",
            mesh: sphere(0.02, DVec3::ZERO),
            center: DVec3::ZERO,
            radius: 0.5,
        },
        Case {
            name: "globe",
            mesh: Arc::new(meshes::globe(1000, 60)),
            center: DVec3::ZERO,
            radius: 0.7,
        },
    ];
    for case in &cases {
        let base = Row::new().with("mesh", case.name).with("triangles", case.mesh.num_triangles());
        context.report_step(format!("{}: building", case.name))?;
        let mut ours = vec![];
        for robustness in Robustness::ALL {
            let options = BuildOptions { robustness, ..Default::default() };
            ours.push((robustness, RtCoreTracer::build(&case.mesh, &options)?));
        }
        let mut embree = vec![];
        for e in &installed.embree {
            for (robust, name) in [(false, "fast"), (true, "robust")] {
                let options = Options { robust, ..Default::default() };
                embree.push((e.name(), name, EmbreeScene::build(e, &case.mesh, &options)?));
            }
        }
        let obvhs = Obvhs::build(&case.mesh, Preset::Medium)?;
        let row = |tracer: &str, robustness: &str| {
            base.clone().with("tracer", tracer).with("robustness", robustness)
        };
        let mut tracers = vec![];
        for (robustness, ours) in &ours {
            let modes: [Box<dyn Tracer + '_>; 2] =
                [Box::new(ours.view(Mode::Single)), Box::new(ours.view(Mode::Coherent))];
            tracers.push(TracerUnderTest {
                row: row("rt-core", robustness.name()),
                modes,
                count: per_combination,
            });
        }
        for (name, robust, scene) in &embree {
            let modes: [Box<dyn Tracer + '_>; 2] =
                [Box::new(scene.view(1, false)), Box::new(scene.view(16, true))];
            tracers.push(TracerUnderTest { row: row(name, robust), modes, count: baseline_rays });
        }
        let modes: [Box<dyn Tracer + '_>; 2] = [Box::new(&obvhs), Box::new(&obvhs)];
        tracers.push(TracerUnderTest { row: row("obvhs", "only"), modes, count: baseline_rays });
        context.report_step(format!("{}: {} tracers in turns", case.name, tracers.len()))?;
        record.rows.extend(count_leaks(case, &tracers));
    }
    record.plots.push(plot(record));
    Ok(())
}

/// A tracer in one mode.
struct TracerUnderTest<'a> {
    /// The first columns of its rows.
    row: Row,
    /// Entry points: for single rays and for packets.
    modes: [Box<dyn Tracer + 'a>; 2],
    /// Number of rays for each target.
    count: usize,
}

/// One row per tracer and target. The tracers alternate batch by batch, on the same rays.
fn count_leaks(case: &Case, tracers: &[TracerUnderTest<'_>]) -> Vec<Row> {
    let most = tracers.iter().map(|s| s.count / BATCH).max().unwrap_or(0);
    let mut by_tracer: Vec<Vec<Row>> = vec![vec![]; tracers.len()];
    for aim in Aim::ALL {
        let zero = || vec![(0u64, 0.0f64); tracers.len()];
        let sums = (0..most)
            .into_par_iter()
            .map(|batch| {
                let rays = rays_at_target(case, aim, batch as u64);
                let mut hits = vec![HitBlock::MISS; rays.blocks.len()];
                let mut found = zero();
                for i in order(tracers.len(), batch) {
                    let s = &tracers[i];
                    if batch < s.count / BATCH {
                        let tracer = &*s.modes[batch % 2];
                        let ((), time) = clock::measure(|| tracer.closest(&rays.blocks, &mut hits));
                        found[i] =
                            (rays.len as u64 - count_hits(&rays, &hits), time.thread_cpu_secs);
                    }
                }
                found
            })
            .reduce(zero, |a, b| a.iter().zip(&b).map(|(a, b)| (a.0 + b.0, a.1 + b.1)).collect());
        for ((s, (leaks, secs)), rows) in tracers.iter().zip(sums).zip(&mut by_tracer) {
            let row = s.row.clone().with("aim", aim.name()).with("rays", s.count / BATCH * BATCH);
            rows.push(row.with("leaks", leaks).with("seconds", secs));
        }
    }
    by_tracer.concat()
}

/// A batch of rays from inside, the same for every tracer. Even batches go from random points to
/// random triangles. Odd batches go from one point to triangles in the mesh's order, so that
/// neighbouring rays have similar directions and form packets. Origins are rounded to f32 first, so
/// that the direction is the difference of the numbers that the tracer uses.
fn rays_at_target(case: &Case, aim: Aim, batch: u64) -> RaySet {
    let mut random = SplitMix64::new(batch << 8 | aim as u64);
    let (mesh, packets) = (&case.mesh, batch % 2 == 1);
    let point = |random: &mut SplitMix64| {
        let inside = random.direction() * random.unit().cbrt() * case.radius;
        (case.center + inside).as_vec3().as_dvec3()
    };
    let (common, first) = (point(&mut random), below(&mut random, mesh.num_triangles()));
    RaySet::pack((0..BATCH).map(|i| {
        let origin = if packets { common } else { point(&mut random) };
        let triangle =
            if packets { first + i / 3 } else { below(&mut random, mesh.num_triangles()) };
        let corners = mesh.triangle(triangle % mesh.num_triangles()).map(|p| p.as_dvec3());
        let direction = match aim {
            Aim::Vertices => corners[below(&mut random, 3)] - origin,
            Aim::Edges => {
                let k = below(&mut random, 3);
                // Round the point to f32, like an application.
                let point = corners[k].lerp(corners[(k + 1) % 3], random.unit());
                point.as_vec3().as_dvec3() - origin
            }
            Aim::Random => random.direction(),
        };
        rays::Ray64 { origin, direction, t_max: f64::INFINITY }
    }))
}

/// A random number below `n`, which must not be 0.
fn below(random: &mut SplitMix64, n: usize) -> usize {
    (random.unit() * n as f64) as usize
}

/// Leaks per million rays, by target.
fn plot(record: &Record) -> Plot {
    let categories = Aim::ALL.map(|a| a.name().to_string()).to_vec();
    let title = "Rays that leak through closed surfaces (none drawn where none leaked)";
    let mut plot = Plot::bars(title, Axis::log("leaks per million rays", ""), categories);
    let mut names: Vec<(String, String)> = vec![];
    for r in &record.rows {
        let key = (
            r.text("tracer").unwrap_or("").to_string(),
            r.text("robustness").unwrap_or("").to_string(),
        );
        if !names.contains(&key) {
            names.push(key);
        }
    }
    for (tracer, robustness) in names {
        let per_million = |aim: Aim| {
            let rows = || {
                record.rows.iter().filter(|r| {
                    r.text("tracer") == Some(&tracer)
                        && r.text("robustness") == Some(&robustness)
                        && r.text("aim") == Some(aim.name())
                })
            };
            let sum = |column: &str| rows().filter_map(|r| r.number(column)).sum::<f64>();
            1e6 * sum("leaks") / sum("rays").max(1.0)
        };
        let points =
            Aim::ALL.iter().enumerate().map(|(i, &a)| (i as f64, per_million(a))).collect();
        plot.series.push(Series::new(format!("{tracer} {robustness}"), points));
    }
    plot
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::brute_force::BruteForce;
    use crate::baselines::closest_all;

    /// The reference must not leak either: f64 edge functions from the same numbers.
    #[test]
    fn brute_force_sees_no_leak_where_aim_is_exact() {
        let mesh = Arc::new(meshes::crumpled_sphere(1, 0.02, DVec3::ZERO));
        let case = Case { name: "", mesh, center: DVec3::ZERO, radius: 0.4 };
        let exact = BruteForce::new(&case.mesh);
        for aim in Aim::ALL {
            let mut rays = rays_at_target(&case, aim, 0);
            rays.blocks.truncate(100);
            rays.len = 1600;
            let mut hits = vec![HitBlock::MISS; rays.blocks.len()];
            closest_all(&exact, &rays, &mut hits, 1);
            assert_eq!(count_hits(&rays, &hits), rays.len as u64, "{}", aim.name());
        }
    }

    #[test]
    fn watertight_rt_core_does_not_leak_and_the_rows_say_so() {
        let mesh = Arc::new(meshes::crumpled_sphere(3, 0.02, DVec3::ZERO));
        let case = Case { name: "crumpled", mesh, center: DVec3::ZERO, radius: 0.5 };
        let ours = RtCoreTracer::build(&case.mesh, &BuildOptions::default()).unwrap();
        let modes: [Box<dyn Tracer + '_>; 2] =
            [Box::new(ours.view(Mode::Single)), Box::new(ours.view(Mode::Coherent))];
        let rows =
            count_leaks(&case, &[TracerUnderTest { row: Row::new(), modes, count: 2 * BATCH }]);
        assert_eq!(rows.len(), 3);
        for r in rows {
            assert_eq!(r.number("leaks"), Some(0.0), "{r:?}");
            assert_eq!(r.number("rays"), Some(2.0 * BATCH as f64));
            assert!(r.number("seconds").unwrap() > 0.0);
        }
    }
}
