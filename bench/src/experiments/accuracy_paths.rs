//! Error against time of light that takes several bounces or goes through a lens: samples of path
//! tracing and of depth of field, the limit on bounces, and the smallest share of a mirror's or
//! glass's ray.

use super::Context;
use super::image_error::{ImageCase, ImageError, VISIBLE_LEVELS, measure_in_turns};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::Schedule;
use datasets::generate::shapes::cube;
use glam::{DAffine3, DVec3, Vec3};
use rt_core::bvh::Geometry;
use rt_core::camera::{Camera, ThinLens};
use rt_core::environment::{Background, Environment};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::render::RenderOptions;
use rt_core::sampler::Sampling;
use rt_core::scene::{Appearance, Scene, SceneBuilder};
use rt_core::shapes::{Radii, Spheres};
use rt_core::texture::{Filter, Texture};
use std::sync::Arc;

/// Seed of the references, so that they share no points with any measured image.
const REFERENCE_SEED: u64 = 0x5eed;

/// Limits on bounces; `None` is the end by Russian roulette alone.
const PATH_LIMITS: [Option<u32>; 7] =
    [Some(1), Some(2), Some(4), Some(8), Some(16), Some(32), None];

/// Limits on the bounces of mirrors and glass; the last is the reference.
const TREE_LIMITS: [u32; 7] = [1, 2, 4, 6, 8, 12, 24];

/// Exponents of the smallest share, 2^-e; the default is 2^-10.
const SHARES: [i32; 8] = [2, 4, 6, 8, 9, 10, 12, 16];

/// Smallest share of the images that compare limits on bounces.
const NEGLIGIBLE_SHARE: f32 = 1.0 / 65536.0;

struct Sizes {
    pixels: u32,
    /// Most samples of path tracing, and those of its reference.
    samples: [u32; 2],
    /// Samples of the images that compare limits on bounces.
    bounce_samples: u32,
    /// Pixels of the images of mirrors and glass.
    tree_pixels: u32,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column(
        "part",
        "",
        "what is varied: `samples`, `bounces of paths`, `share` or `bounces`",
    );
    record.column("scene", "", "what is drawn");
    record.column("sampling", "", "how the points are spread");
    record.column("samples", "", "samples per pixel");
    record.column("max_bounces", "", "limit on bounces; `roulette`: none but Russian roulette");
    record.column("min_contribution", "", "smallest share of a ray that is sent");
    record.column("time", "ms", "wall time of the image, median over the rounds");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rounds", "", "rounds; all settings of a scene took turns in them");
    record.column("rays", "", "rays of all kinds");
    record.column("cut", "", "rays that the limit or the share cut off");
    record.column(
        "rms_error",
        "grey level",
        "root mean square over pixels and channels against the reference",
    );
    record.column("largest_error", "grey level", "largest difference of a channel of a pixel");
    record.column("mean_error", "grey level", "mean difference: below 0 where light is missing");
    let sizes = if context.quick {
        Sizes { pixels: 32, samples: [16, 256], bounce_samples: 16, tree_pixels: 96 }
    } else {
        Sizes { pixels: 128, samples: [256, 4096], bounce_samples: 256, tree_pixels: 512 }
    };
    record.notes.push(format!(
        "A grey level is 1/255 of white in linear light. The rooms are closed and lit by a lamp on \
         the ceiling, to which each point sends a shadow ray; {p} x {p} pixels. References of \
         `samples` have {} low-discrepancy samples with another seed. Images of `bounces of paths` \
         have {} samples and the same random numbers as the one without a limit, so that only the \
         light of the paths cut off differs.",
        sizes.samples[1],
        sizes.bounce_samples,
        p = sizes.pixels,
    ));
    record.notes.push(format!(
        "Mirrors and glass: nine balls above a floor that reflects a third, {p} x {p} pixels, one \
         ray through the middle of each, so that there is no noise; depth of field sees them through a lens of radius 0.1 that is \
         focused on the ball in the middle. In `share` the reference sends \
         every ray of at most eight bounces, the default; in `bounces` it has {} bounces and rays \
         of a share of 2^-16 or more.",
        TREE_LIMITS[TREE_LIMITS.len() - 1],
        p = sizes.tree_pixels,
    ));
    for (name, glossy) in [("diffuse room", false), ("glossy room", true)] {
        let (scene, camera) = room(glossy)?;
        sample_counts(context, record, name, &scene, &camera, &sizes, true)?;
        path_bounces(context, record, name, &scene, &camera, &sizes)?;
    }
    let (scene, camera) = balls(1.0)?;
    let focus_distance = camera.eye().map_or(1.0, |eye| eye.length());
    let lens = camera.with_lens(ThinLens { aperture_radius: 0.1, focus_distance })?;
    sample_counts(context, record, "depth of field", &scene, &lens, &sizes, false)?;
    shares(context, record, sizes.tree_pixels)?;
    tree_bounces(context, record, sizes.tree_pixels)
}

/// The columns that all parts fill.
fn row(part: &str, scene: &str, case: &ImageCase, error: ImageError) -> Row {
    Row::new()
        .with("part", part)
        .with("scene", scene)
        .with("sampling", case.options.sampling.name())
        .with("samples", case.options.samples)
        .with("rms_error", error.rms)
        .with("largest_error", error.largest)
        .with("mean_error", error.mean)
}

fn plain(context: &Context<'_>, pixels: u32) -> RenderOptions {
    RenderOptions { cancel: context.cancel.clone(), ..RenderOptions::new(pixels, pixels) }
}

fn levels_axis() -> Axis {
    Axis::log("RMS error", "grey level")
}

/// Points of the rows of one part and scene that satisfy `is`.
fn curve(record: &Record, part: &str, scene: &str, is: impl Fn(&Row) -> bool) -> Vec<(f64, f64)> {
    let of = |r: &&Row| r.text("part") == Some(part) && r.text("scene") == Some(scene) && is(r);
    let rows = record.rows.iter().filter(of);
    rows.filter_map(|r| r.number("time").zip(r.number("rms_error"))).collect()
}

/// Samples per pixel, by sampling, with path tracing or without.
fn sample_counts(
    context: &mut Context<'_>,
    record: &mut Record,
    name: &str,
    scene: &Scene,
    camera: &Camera,
    sizes: &Sizes,
    path_tracing: bool,
) -> anyhow::Result<()> {
    let [most, of_reference] = sizes.samples;
    let case = |sampling: Sampling, seed, samples| ImageCase {
        name: format!("{}, {samples}", sampling.name()),
        scene: scene.clone(),
        camera: *camera,
        options: RenderOptions {
            path_tracing,
            light_rays: 1,
            sampling,
            seed,
            samples,
            ..plain(context, sizes.pixels)
        },
    };
    let counts: Vec<u32> = (0..).map(|k| 1u32 << (2 * k)).take_while(|n| *n <= most).collect();
    let settings = Sampling::ALL.into_iter().flat_map(|s| counts.iter().map(move |n| (s, *n)));
    let cases: Vec<ImageCase> = settings.map(|(s, n)| case(s, 0, n)).collect();
    let reference = case(Sampling::Sobol, REFERENCE_SEED, of_reference);
    context.report_step(format!("{name}: reference of {of_reference} samples"))?;
    let (exact, ..) = reference.render()?;
    context.report_step(format!("{name}: {} settings in turns", cases.len()))?;
    let images = measure_in_turns(&context.schedule(Schedule::all_threads(), 1.0), &cases)?;
    for (case, image) in cases.iter().zip(&images) {
        let error = ImageError::of(&image.frame, &exact);
        record.rows.push(
            image
                .timed(row("samples", name, case, error))
                .with("max_bounces", if path_tracing { "roulette" } else { "8" })
                .with("rays", image.rays.total())
                .with("cut", image.rays.cut_at_max_bounces + image.rays.cut_at_min_contribution),
        );
    }
    let subject = if path_tracing { format!("path tracing, {name}") } else { name.to_owned() };
    let mut plot = Plot::lines(
        &format!("{subject}: error against time"),
        Axis::log("time", "ms"),
        levels_axis(),
    );
    let mut words = vec![];
    for sampling in Sampling::ALL {
        let points =
            curve(record, "samples", name, |r| r.text("sampling") == Some(sampling.name()));
        if let (Some((_, few)), Some((_, many))) = (points.first(), points.last()) {
            words.push(format!("{} {:.1} times", sampling.name(), few / many));
        }
        plot.series.push(Series::new(sampling.name(), points));
    }
    record.notes.push(format!(
        "{subject}: from 1 sample to {most} the error fell: {}. Errors that fall with \
         the square root would have fallen {:.1} times.",
        words.join(", "),
        f64::from(most).sqrt()
    ));
    record.plots.push(plot);
    Ok(())
}

fn path_bounces(
    context: &mut Context<'_>,
    record: &mut Record,
    name: &str,
    scene: &Scene,
    camera: &Camera,
    sizes: &Sizes,
) -> anyhow::Result<()> {
    const PART: &str = "bounces of paths";
    let word = |limit: Option<u32>| limit.map_or("roulette".to_owned(), |n| n.to_string());
    let cases = PATH_LIMITS.map(|max_bounces| ImageCase {
        name: word(max_bounces),
        scene: scene.clone(),
        camera: *camera,
        options: RenderOptions {
            path_tracing: true,
            light_rays: 1,
            samples: sizes.bounce_samples,
            max_bounces,
            ..plain(context, sizes.pixels)
        },
    });
    context.report_step(format!("{name}: {} limits on bounces in turns", cases.len()))?;
    let images = measure_in_turns(&context.schedule(Schedule::all_threads(), 1.0), &cases)?;
    let Some(unlimited) = images.last() else { return Ok(()) };
    for (case, image) in cases.iter().zip(&images) {
        let error = ImageError::of(&image.frame, &unlimited.frame);
        record.rows.push(
            image
                .timed(row(PART, name, case, error))
                .with("max_bounces", word(case.options.max_bounces))
                .with("rays", image.rays.total())
                .with("cut", image.rays.cut_at_max_bounces),
        );
    }
    let title = format!("bounces of paths, {name}: missing light against time");
    let mut plot = Plot::lines(&title, Axis::log("time", "ms"), levels_axis());
    plot.mark = Some(VISIBLE_LEVELS);
    plot.series.push(Series::new("limits 1 to 32", curve(record, PART, name, |_| true)));
    record.plots.push(plot);
    Ok(())
}

fn shares(context: &mut Context<'_>, record: &mut Record, pixels: u32) -> anyhow::Result<()> {
    let mut plot = Plot::lines("smallest share of a ray", Axis::log("time", "ms"), levels_axis());
    plot.mark = Some(VISIBLE_LEVELS);
    let mut words = vec![];
    for (name, window) in [("surroundings up to white", 1.0), ("window 30 times white", 30.0)] {
        let (scene, camera) = balls(window)?;
        let smallest = [0.0].into_iter().chain(SHARES.map(|e| 2f32.powi(-e)));
        let cases: Vec<ImageCase> = smallest
            .map(|min_contribution| ImageCase {
                name: min_contribution.to_string(),
                scene: scene.clone(),
                camera,
                options: RenderOptions { min_contribution, ..plain(context, pixels) },
            })
            .collect();
        context.report_step(format!("{name}: {} shares in turns", cases.len()))?;
        let images = measure_in_turns(&context.schedule(Schedule::all_threads(), 1.0), &cases)?;
        let Some(every) = images.first() else { return Ok(()) };
        for (case, image) in cases.iter().zip(&images) {
            let error = ImageError::of(&image.frame, &every.frame);
            let share = case.options.min_contribution;
            record.rows.push(
                image
                    .timed(row("share", name, case, error))
                    .with("max_bounces", "8")
                    .with("min_contribution", f64::from(share))
                    .with("rays", image.rays.total())
                    .with("cut", image.rays.cut_at_min_contribution),
            );
            if share == RenderOptions::new(1, 1).min_contribution {
                words.push(format!(
                    "{name}: rms {:.2e}, largest {:.2}, {:.2} of the rays",
                    error.rms,
                    error.largest,
                    image.rays.total() as f64 / every.rays.total() as f64
                ));
            }
        }
        plot.series.push(Series::new(name, curve(record, "share", name, |_| true)));
    }
    record.notes.push(format!("The default share, 2^-10, in grey levels: {}.", words.join("; ")));
    record.plots.push(plot);
    Ok(())
}

fn tree_bounces(context: &mut Context<'_>, record: &mut Record, pixels: u32) -> anyhow::Result<()> {
    let name = "surroundings up to white";
    let (scene, camera) = balls(1.0)?;
    let cases = TREE_LIMITS.map(|limit| ImageCase {
        name: limit.to_string(),
        scene: scene.clone(),
        camera,
        options: RenderOptions {
            max_bounces: Some(limit),
            min_contribution: NEGLIGIBLE_SHARE,
            ..plain(context, pixels)
        },
    });
    context
        .report_step(format!("mirrors and glass: {} limits on bounces in turns", cases.len()))?;
    let images = measure_in_turns(&context.schedule(Schedule::all_threads(), 1.0), &cases)?;
    let Some(deepest) = images.last() else { return Ok(()) };
    for ((case, image), limit) in cases.iter().zip(&images).zip(TREE_LIMITS) {
        let error = ImageError::of(&image.frame, &deepest.frame);
        record.rows.push(
            image
                .timed(row("bounces", name, case, error))
                .with("max_bounces", limit.to_string())
                .with("min_contribution", f64::from(NEGLIGIBLE_SHARE))
                .with("rays", image.rays.total())
                .with("cut", image.rays.cut_at_max_bounces),
        );
    }
    let default = record
        .rows
        .iter()
        .find(|r| r.text("part") == Some("bounces") && r.text("max_bounces") == Some("8"))
        .and_then(|r| r.number("rms_error").zip(r.number("largest_error")));
    if let Some((rms, largest)) = default {
        record.notes.push(format!(
            "The default limit on bounces of mirrors and glass, 8, in grey levels: rms {rms:.2}, \
             largest {largest:.0}."
        ));
    }
    let title = "bounces of mirrors and glass";
    let mut plot = Plot::lines(title, Axis::log("time", "ms"), levels_axis());
    plot.mark = Some(VISIBLE_LEVELS);
    plot.series.push(Series::new("limits 1 to 12", curve(record, "bounces", name, |_| true)));
    record.plots.push(plot);
    Ok(())
}

/// The parallelogram with this corner and these edges; its outside is on the side of edge 1 × edge
/// 2.
fn parallelogram(corner: Vec3, [a, b]: [Vec3; 2]) -> TriMesh {
    TriMesh::new(vec![corner, corner + a, corner + a + b, corner + b], vec![[0, 1, 2], [0, 2, 3]])
}

/// A closed room of 2 x 2 x 2 with a red and a green wall, a lamp on its ceiling, a ball and a box,
/// seen from its front wall; all matt, or of rough metal and varnish.
fn room(glossy: bool) -> anyhow::Result<(Scene, Camera)> {
    let mut builder = SceneBuilder::new();
    let white = [0.75; 3];
    let varnish = |color| {
        if glossy { Material::pbr(color, 0.0, 0.25) } else { Material::matte(color) }
    };
    let metal = |color, roughness| {
        if glossy { Material::metal(color, roughness) } else { Material::matte(color) }
    };
    let [x, y, z] = Vec3::AXES.map(|a| 2.0 * a);
    let (low, high) = (Vec3::NEG_ONE, Vec3::ONE);
    builder.mesh(parallelogram(low, [x, y]), varnish(white));
    builder.mesh(parallelogram(high, [-y, -x]), Material::matte(white));
    builder.mesh(parallelogram(low, [y, z]), Material::matte([0.63, 0.06, 0.05]));
    builder.mesh(parallelogram(high, [-z, -y]), Material::matte([0.14, 0.45, 0.09]));
    builder.mesh(parallelogram(low, [z, x]), Material::matte(white));
    builder.mesh(parallelogram(high, [-x, -z]), metal(white, 0.4));
    let ball = Spheres::new(vec![Vec3::new(-0.4, 0.3, -0.6)], Radii::Common(0.4))?;
    builder.shape(Arc::new(ball), metal([0.9, 0.75, 0.5], 0.3));
    let block = builder.geometry(Geometry::Mesh(Arc::new(cube())));
    let paint = builder.material(varnish([0.5, 0.6, 0.8]));
    let place = DAffine3::from_translation(DVec3::new(0.4, 0.1, -0.65))
        * DAffine3::from_rotation_z(0.4)
        * DAffine3::from_scale(DVec3::new(0.5, 0.5, 0.7));
    builder.instance(block, place, Appearance::new(paint));
    let lamp = Light::quad(DVec3::new(-0.3, -0.3, 0.99), [DVec3::Y * 0.6, DVec3::X * 0.6]);
    builder.light(lamp.with_color([1.2; 3]));
    let camera = Camera::perspective(
        DVec3::new(0.0, -0.95, 0.0),
        DVec3::new(0.0, 1.0, -0.1),
        DVec3::Z,
        1.3,
        1.0,
        [0.01, 10.0],
    )?;
    Ok((builder.build()?, camera))
}

/// Balls of glass, of a mirror and of coloured metal above a floor that reflects a third, in
/// surroundings of bright and dark patches with a window of this radiance.
fn balls(window: f32) -> anyhow::Result<(Scene, Camera)> {
    let mut builder = SceneBuilder::new();
    let glass = Material::dielectric(1.5);
    let materials = [glass, Material::metal([0.95; 3], 0.0), Material::metal([1.0, 0.8, 0.4], 0.0)];
    for (kind, material) in materials.into_iter().enumerate() {
        let centers = (0..9)
            .filter(|i| (i + i / 3) % 3 == kind)
            .map(|i| Vec3::new((i % 3) as f32 - 1.0, (i / 3) as f32 - 1.0, 0.0));
        let group = Spheres::new(centers.collect(), Radii::Common(0.45))?;
        builder.shape(Arc::new(group), material);
    }
    let floor = parallelogram(Vec3::new(-4.0, -4.0, -0.5), [8.0 * Vec3::X, 8.0 * Vec3::Y]);
    let mut paint = Material::phong([0.4, 0.42, 0.45], 0.0, 1.0);
    if let rt_core::material::SurfaceModel::Phong { mirror, .. } = &mut paint.model {
        *mirror = 1.0 / 3.0;
    }
    builder.mesh(floor, paint);
    // A parallel light would make highlights on the mirrors that hardly a sample finds.
    // The window is a patch of two texels above the horizon, behind the viewer's left shoulder.
    const WIDTH: usize = 32;
    const HEIGHT: usize = 16;
    let texel = |i: usize| {
        let (column, row) = (i % WIDTH, i / WIDTH);
        match ((column + row) % 2, (column, row)) {
            (_, (4 | 5, 11)) => [window, window, window, 1.0],
            (0, _) => [0.9, 0.95, 1.0, 1.0],
            _ => [0.25, 0.2, 0.15, 1.0],
        }
    };
    let mut image = Texture::from_linear(WIDTH, HEIGHT, (0..WIDTH * HEIGHT).map(texel).collect())?;
    image.filter = Filter::Nearest;
    builder.environment =
        Some(Environment::Image { image: Arc::new(image), up: Vec3::Z, scale: 1.0 });
    builder.background = Background::Environment;
    let (eye, target) = (DVec3::new(1.0, -4.2, 2.2), DVec3::new(0.0, 0.0, -0.1));
    let camera = Camera::perspective(eye, target, DVec3::Z, 0.65, 1.0, [0.1, 100.0])?;
    Ok((builder.build()?, camera))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(scene: &Scene, camera: Camera, options: RenderOptions) -> rt_core::frame::Frame {
        let case = ImageCase { name: String::new(), scene: scene.clone(), camera, options };
        case.render().unwrap().0
    }

    #[test]
    fn samples_of_paths_come_closer_and_limits_only_take_light_away() {
        for glossy in [false, true] {
            let (scene, camera) = room(glossy).unwrap();
            let draw = |sampling, seed, samples, max_bounces| {
                let options = RenderOptions {
                    path_tracing: true,
                    light_rays: 1,
                    sampling,
                    seed,
                    samples,
                    max_bounces,
                    ..RenderOptions::new(16, 16)
                };
                frame(&scene, camera, options)
            };
            let exact = draw(Sampling::Sobol, REFERENCE_SEED, 2048, None);
            let error = |n| ImageError::of(&draw(Sampling::Sobol, 0, n, None), &exact).rms;
            assert!(error(64) < 0.5 * error(4), "{} {}", error(64), error(4));
            // The room is lit, but not overexposed all over.
            let mean = exact.color.iter().map(|c| c[1]).sum::<f32>() / exact.color.len() as f32;
            assert!((0.1..0.9).contains(&mean), "{mean}");
            let unlimited = draw(Sampling::Sobol, 0, 16, None);
            let missing = [1, 4, 16].map(|limit| {
                ImageError::of(&draw(Sampling::Sobol, 0, 16, Some(limit)), &unlimited).mean
            });
            assert!(
                missing[0] < missing[1] && missing[1] < missing[2] && missing[2] <= 0.0,
                "{missing:?}"
            );
        }
    }

    #[test]
    fn a_smaller_share_and_more_bounces_leave_less_out() {
        let (scene, camera) = balls(30.0).unwrap();
        let draw = |min_contribution, max_bounces| {
            let options =
                RenderOptions { min_contribution, max_bounces, ..RenderOptions::new(48, 48) };
            frame(&scene, camera, options)
        };
        let every = draw(0.0, None);
        let [coarse, fine] =
            [0.1, 1e-3].map(|share| ImageError::of(&draw(share, None), &every).rms);
        assert!(fine < 0.2 * coarse && fine > 0.0, "{fine} {coarse}");
        let deep = draw(1e-4, Some(24));
        let [few, many] = [2, 8].map(|limit| ImageError::of(&draw(1e-4, Some(limit)), &deep).rms);
        assert!(many < 0.2 * few, "{many} {few}");
    }
}
