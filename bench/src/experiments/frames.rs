//! Measures what a whole frame costs beyond its rays. The same view is rendered, and the rays of
//! that picture are traced without shading, in turns on one thread.

use super::Context;
use super::compare::Kind;
use crate::baselines::{Tracer, closest_all, count_hits, count_occluded, occluded_all};
use crate::clock::Clock;
use crate::meshes::{self, MeshScene};
use crate::plot::{Axis, Plot, Point, Series};
use crate::rays::{self, HitBlock, RaySet, View};
use crate::record::{Record, Row};
use crate::rt_core_tracer::{Mode, RtCoreTracer};
use crate::runner::{Ratio, Schedule, Timings, Variant, interleave};
use datasets::generate::nested_wavelet::Size;
use rayon::ThreadPoolBuilder;
use rt_core::camera::Camera;
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::ray_stats::RayStats;
use rt_core::render::{RenderError, RenderOptions, render};
use rt_core::scene::{AmbientOcclusion, Scene};
use std::sync::{Arc, Mutex, PoisonError};

/// What the picture shows besides local light.
struct Case {
    name: &'static str,
    shadows: bool,
    occlusion: bool,
}

const CASES: [Case; 4] = [
    Case { name: "local light", shadows: false, occlusion: false },
    Case { name: "hard shadows", shadows: true, occlusion: false },
    Case { name: "8 ambient occlusion rays", shadows: false, occlusion: true },
    Case { name: "shadows and occlusion", shadows: true, occlusion: true },
];

const KINDS: [Kind; 3] = [Kind::Primary, Kind::Shadow, Kind::AmbientOcclusion];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("scene", "", "name of the scene");
    record.column("triangles", "", "triangles of the scene");
    record.column("view", "", "orbit: the whole scene; close: nearly every pixel shows it");
    record.column("case", "", "what the picture shows besides local light");
    record.column("frame", "ms", "the whole frame, median over the rounds, CPU time, one thread");
    record.column("rays", "ms", "its rays alone, median over the rounds");
    record.column("times_rays", "", "frame by rays, median of the rounds’ ratios");
    record.column("times_rays_low", "", "smallest of the rounds’ ratios");
    record.column("times_rays_high", "", "largest of the rounds’ ratios");
    record.column("primary", "", "primary rays of the frame");
    record.column("shadow", "", "shadow rays of the frame");
    record.column("ambient_occlusion", "", "ambient-occlusion rays of the frame");
    let pixels = if context.quick { 128 } else { 1024 };
    record.notes.push(format!(
        "{pixels} x {pixels} pixels, one sample each, one point light, ambient light, a Phong \
         material. Camera and shadow rays alone go through the query for neighbouring rays, \
         occlusion rays through the one for rays in any direction, in the order of pixels and \
         stored beforehand, so their time has no part for making them. A kind’s time counts as \
         often as the frame sent such rays."
    ));
    for scene in scenes(context)? {
        let bounds = scene.bounds();
        context.report_step(format!("{}: building", scene.name))?;
        let ours = RtCoreTracer::build_scene(&scene, &Default::default())?;
        for view in [View::orbit(bounds), View::close(bounds)] {
            measure(context, record, &scene, &ours, &view, pixels)?;
        }
    }
    plot(record);
    Ok(())
}

fn scenes(context: &mut Context<'_>) -> anyhow::Result<Vec<MeshScene>> {
    let quick = context.quick;
    if quick {
        let wavelet = MeshScene::one("wavelet", meshes::coarse_wavelet(61)?);
        return Ok(vec![wavelet, meshes::city(100)]);
    }
    Ok(vec![
        MeshScene::one("wavelet 1M", context.wavelet(Size::M1)?),
        MeshScene::one("pipes", meshes::pipes(2600)),
        MeshScene::one("terrain", meshes::terrain(4_000_000)),
        meshes::city(3000),
    ])
}

/// The rays that a frame of `view` sends, kind by kind.
fn rays_of_the_frame(
    scene: &MeshScene,
    tracer: &dyn Tracer,
    view: &View,
    pixels: u32,
) -> [RaySet; 3] {
    let primary = view.primary(pixels);
    let mut hits = vec![HitBlock::MISS; primary.blocks.len()];
    closest_all(tracer, &primary, &mut hits, 0);
    let points = rays::surface_points(|i, p| scene.corners(i, p), &primary, &hits, view.radius);
    // A surface that faces away from the light is dark without a ray.
    let faces = |p: &&rays::SurfacePoint| p.normal.dot(view.light() - p.origin) > 0.0;
    let facing: Vec<rays::SurfacePoint> = points.iter().filter(faces).copied().collect();
    [primary, rays::shadow(&facing, view.light()), rays::ambient_occlusion(&points)]
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    scene: &MeshScene,
    ours: &RtCoreTracer,
    view: &View,
    pixels: u32,
) -> anyhow::Result<()> {
    context.report_step(format!("{}, {}", scene.name, view.name))?;
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let tracers = KINDS
        .map(|kind| ours.view(if kind.coherent() { Mode::Coherent } else { Mode::Incoherent }));
    let sets = rays_of_the_frame(scene, &tracers[0], view, pixels);
    let frames = Frames::new(ours, view, pixels)?;
    let buffers = sets.each_ref().map(Answers::of);
    let timings = {
        let mut variants: Vec<Variant<'_>> = vec![];
        for (((kind, set), tracer), buffer) in KINDS.iter().zip(&sets).zip(&tracers).zip(&buffers) {
            let pool = &pool;
            let run = move || pool.install(|| buffer.trace(*kind, tracer, set));
            let check = move || buffer.count(*kind, set);
            variants.push(Variant::checked(kind.name(), run, check));
        }
        variants.extend((0..CASES.len()).map(|i| {
            let (pool, frames) = (&pool, &frames);
            Variant::new(CASES[i].name, move || pool.install(|| frames.render(i)))
        }));
        // The pool's thread works, so the process's CPU time is measured.
        let one_thread =
            Schedule { clock: Clock::ProcessCpu, pin: false, ..Schedule::one_thread() };
        interleave(&context.schedule(one_thread, 2.0), &mut variants)?
    };
    let sent = frames.finished()?;
    for (case, stats) in CASES.iter().zip(sent) {
        let counts = [stats.primary, stats.shadow, stats.ambient_occlusion];
        let Some(ratio) = times_rays(&timings, case, &sets, counts) else { continue };
        let name = format!("{}, {}, {}: its rays alone", scene.name, view.name, case.name);
        let frame = timings.summary(case.name).map_or(f64::NAN, |s| s.median);
        record.rows.push(
            Row::new()
                .with("scene", scene.name.as_str())
                .with("triangles", scene.num_triangles())
                .with("view", view.name)
                .with("case", case.name)
                .with("frame", frame * 1e3)
                .with("rays", frame * 1e3 / ratio.value)
                .with("times_rays", ratio.value)
                .with("times_rays_low", ratio.low)
                .with("times_rays_high", ratio.high)
                .with("primary", stats.primary)
                .with("shadow", stats.shadow)
                .with("ambient_occlusion", stats.ambient_occlusion),
        );
        record.ratios.push(Ratio { name, baseline: "the whole frame".into(), ..ratio });
    }
    Ok(())
}

/// The time of a frame by that of its rays, round by round. Of each kind, as many rays count as the
/// frame sent.
fn times_rays(timings: &Timings, case: &Case, sets: &[RaySet; 3], sent: [u64; 3]) -> Option<Ratio> {
    let frame = timings.get(case.name)?;
    let mut rays = vec![0.0; frame.samples.len()];
    for ((kind, set), sent) in KINDS.iter().zip(sets).zip(sent) {
        // All primary rays count, also those that the frame leaves out because they meet no box.
        let share = match kind {
            Kind::Primary => 1.0,
            _ => sent as f64 / set.len.max(1) as f64,
        };
        for (sum, sample) in rays.iter_mut().zip(&timings.get(kind.name())?.samples) {
            *sum += share * sample.by(timings.clock);
        }
    }
    let ratios: Vec<f64> =
        frame.samples.iter().zip(&rays).map(|(f, r)| f.by(timings.clock) / r).collect();
    Ratio::of_rounds("rays", "frame", &ratios)
}

/// Room for the answers to one set of rays.
struct Answers {
    hits: Mutex<Vec<HitBlock>>,
    masks: Mutex<Vec<u16>>,
}

impl Answers {
    fn of(set: &RaySet) -> Answers {
        let blocks = set.blocks.len();
        Answers {
            hits: Mutex::new(vec![HitBlock::MISS; blocks]),
            masks: Mutex::new(vec![0; blocks]),
        }
    }

    fn trace(&self, kind: Kind, tracer: &dyn Tracer, set: &RaySet) {
        if kind.occlusion() {
            occluded_all(tracer, set, &mut locked(&self.masks), 1);
        } else {
            closest_all(tracer, set, &mut locked(&self.hits), 1);
        }
    }

    fn count(&self, kind: Kind, set: &RaySet) -> u64 {
        if kind.occlusion() {
            count_occluded(&locked(&self.masks))
        } else {
            count_hits(set, &locked(&self.hits))
        }
    }
}

/// What a pool of one thread has written.
fn locked<T>(value: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    value.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The frames of all cases.
struct Frames {
    scenes: Vec<Scene>,
    camera: Camera,
    options: RenderOptions,
    sent: Mutex<Vec<Result<RayStats, RenderError>>>,
}

impl Frames {
    fn new(ours: &RtCoreTracer, view: &View, pixels: u32) -> anyhow::Result<Frames> {
        let [_, up, forward] = view.axes;
        let angle = 2.0 * view.tan_half_fov.atan();
        let range = [1e-3 * view.radius, f64::INFINITY];
        let camera = Camera::perspective(view.eye, view.eye + forward, up, angle, 1.0, range)?;
        let mut plain = Scene::new(Arc::clone(&ours.world));
        plain.materials = vec![Material::phong([0.6, 0.65, 0.7], 0.2, 30.0)];
        let of_case = |case: &Case| {
            let mut scene = plain.clone();
            let light = Light::point(view.light());
            let light = if case.shadows { light } else { light.without_shadows() };
            scene.lights = vec![light, Light::ambient([0.3; 3])];
            let occlusion = AmbientOcclusion { distance: f64::INFINITY, rays: 8 };
            scene.ambient_occlusion = case.occlusion.then_some(occlusion);
            scene
        };
        Ok(Frames {
            scenes: CASES.iter().map(of_case).collect(),
            camera: camera.with_near_far_clipping(false),
            options: RenderOptions::new(pixels, pixels),
            sent: Mutex::new(vec![Ok(RayStats::default()); CASES.len()]),
        })
    }

    /// Renders a case and returns the number of its rays.
    fn render(&self, case: usize) -> u64 {
        let frame = render(&self.scenes[case], &self.camera, &self.options);
        let sent = frame.map(|frame| frame.report.rays);
        let count = sent.as_ref().map_or(0, RayStats::total);
        locked(&self.sent)[case] = sent;
        count
    }

    /// The rays of each case, or the error of one.
    fn finished(self) -> Result<Vec<RayStats>, RenderError> {
        self.sent.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().collect()
    }
}

/// The ratios as bars: a group for each scene and view, a bar for each case.
fn plot(record: &mut Record) {
    let text = |row: &Row, column: &str| row.text(column).unwrap_or_default().to_owned();
    let group = |row: &Row| format!("{}, {}", text(row, "scene"), text(row, "view"));
    let mut groups: Vec<String> = record.rows.iter().map(group).collect();
    groups.dedup();
    let axis = Axis::linear("frame’s time / its rays’ time", "");
    let mut bars = Plot::bars("Time of a frame by that of its rays", axis, groups.clone());
    bars.mark = Some(1.0);
    for case in &CASES {
        let of_case = record.rows.iter().filter(|r| r.text("case") == Some(case.name));
        let points = of_case.filter_map(|row| {
            let x = groups.iter().position(|g| *g == group(row))? as f64;
            let [y, low, high] =
                ["times_rays", "times_rays_low", "times_rays_high"].map(|c| row.number(c));
            Some(Point { x, y: y?, range: low.zip(high) })
        });
        bars.series.push(Series { name: case.name.into(), points: points.collect() });
    }
    record.plots.push(bars);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_sends_as_many_rays_as_the_sets_that_it_is_compared_with() {
        let scene = MeshScene::one("wavelet", meshes::coarse_wavelet(21).unwrap());
        let ours = RtCoreTracer::build_scene(&scene, &Default::default()).unwrap();
        for view in [View::orbit(scene.bounds()), View::close(scene.bounds())] {
            let sets = rays_of_the_frame(&scene, &ours.view(Mode::Coherent), &view, 64);
            let frames = Frames::new(&ours, &view, 64).unwrap();
            (0..CASES.len()).for_each(|case| assert!(frames.render(case) > 0));
            for (case, sent) in CASES.iter().zip(frames.finished().unwrap()) {
                let alone = sets.each_ref().map(|s| s.len as f64);
                let near = |n: u64, alone: f64| (n as f64 / alone - 1.0).abs() < 0.02;
                assert!(sent.primary as f64 <= alone[0], "{}: {}", case.name, sent.primary);
                assert!(!case.shadows && sent.shadow == 0 || near(sent.shadow, alone[1]));
                let occlusion = sent.ambient_occlusion;
                assert!(!case.occlusion && occlusion == 0 || near(occlusion, alone[2]));
            }
        }
    }

    #[test]
    fn a_frame_of_twice_the_time_of_its_rays_is_told_as_two() {
        let sample =
            |secs: f64| crate::clock::Sample { process_cpu_secs: secs, ..Default::default() };
        let timed = |name: &str, secs: f64| crate::runner::Timed {
            name: name.into(),
            samples: vec![sample(secs); 5],
            check: 0,
        };
        let kinds = KINDS.iter().zip([1.0, 2.0, 4.0]).map(|(k, secs)| timed(k.name(), secs));
        let variants = kinds.chain([timed(CASES[3].name, 8.0)]).collect();
        let timings = Timings { clock: Clock::ProcessCpu, variants };
        let set = |len: usize| RaySet { len, blocks: vec![] };
        let sets = [set(100), set(50), set(800)];
        // Half of the shadow rays and half of the occlusion rays: 1 + 1 + 2 seconds.
        let ratio = times_rays(&timings, &CASES[3], &sets, [100, 25, 400]).unwrap();
        assert_eq!((ratio.value, ratio.rounds), (2.0, 5));
    }
}
