//! Measures the cost of each effect. The same view is rendered without effects and with one effect,
//! in alternation, and the rays traced are counted.

use super::Context;
use crate::image::framing::Framing;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Ratio, Schedule, Variant, Verdict, interleave};
use datasets::generate::nested_wavelet::Size;
use datasets::generate::wavelet::Wavelet;
use datasets::isosurface;
use glam::DVec3;
use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::{Camera, ThinLens};
use rt_core::effects::Effects;
use rt_core::environment::Environment;
use rt_core::light::Light;
use rt_core::material::{Material, SurfaceModel};
use rt_core::ray_stats::RayStats;
use rt_core::render::{RenderOptions, render};
use rt_core::scene::{AmbientOcclusion, Scene};
use std::cell::RefCell;

/// The row that all others are compared with, and the row that shows the scatter of equal work.
const PLAIN: &str = "plain";
const ALL_ALLOWED: &str = "plain, every effect allowed";

struct Case {
    name: &'static str,
    scene: Scene,
    camera: Camera,
    options: RenderOptions,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("case", "", "what is added to the plain picture");
    record.column("effects", "", "effects that ran");
    record.column("time", "ms", "median over the rounds, wall time, all threads");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column(
        "times_plain",
        "",
        "time by that of the plain picture, median of the rounds’ ratios",
    );
    record.column("primary", "", "primary rays");
    record.column("shadow", "", "shadow rays");
    record.column("ambient_occlusion", "", "ambient-occlusion rays");
    record.column("reflection", "", "reflection rays");
    record.column("refraction", "", "refraction rays");
    record.column("transparency", "", "rays continued behind transparent surfaces");
    record.column("path", "", "bounces of the path tracer");
    record.column("rate", "Mray/s", "rays of all kinds by median time");
    record.notes.push(format!(
        "The scene is lit by one point light and ambient light. The row “{ALL_ALLOWED}” draws the \
         plain scene with every \
         effect switched on in the options: the scene needs none, so no secondary ray may be sent \
         (else the experiment fails)."
    ));

    let mesh = if context.quick {
        context.report_step("making the surface")?;
        let grid = Wavelet::with_points(101).grid()?;
        let options = isosurface::Options { normals: true, ..Default::default() };
        isosurface::extract(&grid, &Size::M1.isovalues(), options)?.mesh
    } else {
        let size = Size::M4;
        size.generate(isosurface::Options { normals: true, ..Default::default() })?.mesh
    };
    let pixels = if context.quick { 256 } else { 1024 };
    record.notes.push(format!("{} triangles, {pixels} x {pixels} pixels.", mesh.num_triangles()));
    context.report_step(format!("{} triangles: building", mesh.num_triangles()))?;
    let cases = cases(Scene::new(World::from_mesh(mesh, &BuildOptions::default())?), pixels)?;

    context.report_step(format!("{} images in alternation", cases.len()))?;
    let rays: RefCell<Vec<Option<(RayStats, Effects)>>> = RefCell::new(vec![None; cases.len()]);
    let failed = RefCell::new(None);
    let mut variants: Vec<Variant<'_>> = cases
        .iter()
        .enumerate()
        .map(|(i, c)| {
            let (rays, failed) = (&rays, &failed);
            Variant::new(c.name, move || match render(&c.scene, &c.camera, &c.options) {
                Ok(o) => {
                    rays.borrow_mut()[i] = Some((o.report.rays, o.report.effects));
                    o.report.rays.total()
                }
                Err(e) => {
                    *failed.borrow_mut() = Some(e);
                    0
                }
            })
        })
        .collect();
    let timings = interleave(&context.schedule(Schedule::all_threads(), 20.0), &mut variants)?;
    drop(variants);
    if let Some(e) = failed.into_inner() {
        return Err(e.into());
    }

    let mut bars =
        Plot::bars("Time of a frame by that of the plain picture", Axis::log("ratio", ""), vec![]);
    bars.mark = Some(1.0);
    let mut heights = vec![];
    for (i, (case, seen)) in cases.iter().zip(rays.into_inner()).enumerate() {
        let (Some((r, effects)), Some(time), Some(ratio)) =
            (seen, timings.summary(case.name), timings.ratio(PLAIN, case.name))
        else {
            continue;
        };
        bars.categories.push(case.name.into());
        heights.push((i as f64, ratio.value));
        record.rows.push(
            Row::new()
                .with("case", case.name)
                .with("effects", effects.names().collect::<Vec<_>>().join(", "))
                .with("time", time.median * 1e3)
                .with("time_low", time.low * 1e3)
                .with("time_high", time.high * 1e3)
                .with("times_plain", ratio.value)
                .with("primary", r.primary)
                .with("shadow", r.shadow)
                .with("ambient_occlusion", r.ambient_occlusion)
                .with("reflection", r.reflection)
                .with("refraction", r.refraction)
                .with("transparency", r.transparency)
                .with("path", r.path)
                .with("rate", r.total() as f64 / time.median / 1e6),
        );
        if case.name == ALL_ALLOWED {
            anyhow::ensure!(
                r.total() == r.primary,
                "the plain scene with every effect allowed sent {} secondary rays; it needs none",
                r.total() - r.primary
            );
            record.notes.push(describe_unused_effects(&ratio));
            record.ratios.push(ratio);
        }
    }
    bars.series.push(Series::new("rt-core", heights));
    record.plots.push(bars);
    Ok(())
}

/// Describes the cost of effects that the scene does not need, as far as the rounds show it.
fn describe_unused_effects(ratio: &Ratio) -> String {
    let conclusion = match ratio.verdict() {
        Verdict::Open => "whether unused effects cost time is left open",
        Verdict::Even => "the rounds do not tell the two apart: no cost of unused effects is seen",
        Verdict::Faster => "unused effects cost time here",
        Verdict::Slower => {
            "it was the shorter one, which no unused effect explains: something else differed"
        }
    };
    format!("Its time by that of the plain picture is {}; {conclusion}.", ratio.in_words())
}

fn cases(mut plain: Scene, pixels: u32) -> anyhow::Result<Vec<Case>> {
    let b = plain.world.bounds();
    let (center, radius) = (plain.world.origin() + b.center().as_dvec3(), f64::from(b.radius()));
    let camera = Framing::Fitted.of(&plain.world, [pixels, pixels])?;
    let eye = camera.eye().unwrap_or(center);
    let color = [0.6, 0.65, 0.7];
    let light =
        Light::point(eye + camera.world_from_view() * DVec3::new(radius, 1.5 * radius, 0.0));
    plain.lights = vec![light.without_shadows(), Light::ambient([0.3; 3])];
    plain.materials = vec![Material::phong(color, 0.2, 30.0)];

    let options = RenderOptions::new(pixels, pixels);
    let case = |name, change: &dyn Fn(&mut Scene)| {
        let mut scene = plain.clone();
        change(&mut scene);
        Case { name, scene, camera, options: options.clone() }
    };
    let every = Effects::ALL
        .iter()
        .map(|e| e.0)
        .filter(|e| *e != Effects::PATH_TRACING)
        .fold(Effects::NONE, Effects::union);
    let mirror = |scene: &mut Scene, value: f32| {
        if let SurfaceModel::Phong { mirror, .. } = &mut scene.materials[0].model {
            *mirror = value;
        }
    };
    let around = Environment::Gradient { bottom: [0.1; 3], top: [0.5; 3], up: glam::Vec3::Z };
    let same = |_: &mut Scene| {};
    let lens = ThinLens { aperture_radius: 0.02 * radius, focus_distance: (center - eye).length() };
    Ok(vec![
        case(PLAIN, &same),
        Case {
            options: RenderOptions { effects: Some(every), ..options.clone() },
            ..case(ALL_ALLOWED, &same)
        },
        case("shadows", &|s| s.lights[0].shadows = true),
        case("soft shadows, 4 rays", &|s| {
            s.lights[0].shadows = true;
            s.lights[0] = s.lights[0].with_size(0.2 * radius).expect("a light with a size");
        }),
        case("ambient occlusion, 4 rays", &|s| {
            s.ambient_occlusion = Some(AmbientOcclusion { distance: 0.3 * radius, rays: 4 });
        }),
        case("reflection", &|s| mirror(s, 0.3)),
        case("glossy reflection", &|s| s.materials[0] = Material::pbr(color, 0.0, 0.3)),
        case("refraction", &|s| {
            s.materials[0] = Material::dielectric(1.5);
            s.environment = Some(around.clone());
        }),
        case("transparency", &|s| s.materials[0].opacity = 0.5),
        Case { camera: camera.with_lens(lens)?, ..case("depth of field", &same) },
        Case {
            options: RenderOptions { samples: 4, ..options.clone() },
            ..case("4 samples per pixel", &same)
        },
        Case {
            options: RenderOptions { path_tracing: true, ..options.clone() },
            ..case("path tracing", &same)
        },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes;

    #[test]
    fn the_note_on_unused_effects_follows_the_rounds() {
        let words = |rounds: &[f64]| {
            describe_unused_effects(&Ratio::of_rounds(PLAIN, ALL_ALLOWED, rounds).unwrap())
        };
        assert!(words(&[1.0, 1.01, 0.99, 1.0, 1.0]).contains("no cost of unused effects is seen"));
        let dear = words(&[1.5, 1.6, 1.4, 1.5, 1.5]);
        assert!(
            dear.contains("cost time here") && dear.contains("1.500 (1.400 to 1.600, 5 rounds"),
            "{dear}"
        );
        assert!(words(&[1.5, 1.6, 1.4]).contains("left open"));
    }

    #[test]
    fn unused_effects_send_no_rays_and_each_case_sends_its_own() {
        let mesh = meshes::coarse_wavelet(21).unwrap();
        let scene = Scene::new(World::from_mesh(mesh, &BuildOptions::default()).unwrap());
        for c in cases(scene, 24).unwrap() {
            let r = render(&c.scene, &c.camera, &c.options).unwrap().report.rays;
            let kinds =
                [r.shadow, r.ambient_occlusion, r.reflection, r.refraction, r.transparency, r.path];
            let expected = match c.name {
                n if n.contains("shadows") => Some(0),
                n if n.starts_with("ambient") => Some(1),
                n if n.contains("reflection") => Some(2),
                "refraction" => Some(3),
                "transparency" => Some(4),
                "path tracing" => Some(5),
                _ => None,
            };
            for (i, &n) in kinds.iter().enumerate() {
                // Glass also reflects, and paths also sample lights.
                let may = expected == Some(i) || c.name == "refraction" || c.name == "path tracing";
                assert!(may || n == 0, "{}: kind {i} sent {n} rays", c.name);
                assert!(expected != Some(i) || n > 0, "{}: kind {i} sent none", c.name);
            }
        }
    }
}
