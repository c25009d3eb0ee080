//! Error against time of the sampled effects, for low-discrepancy and independent sample points.

use super::Context;
use super::image_error::{ImageCase, ImageError, measure_in_turns};
use crate::image::framing::Framing;
use crate::meshes;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::Schedule;
use glam::DVec3;
use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::Camera;
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::RenderOptions;
use rt_core::sampler::Sampling;
use rt_core::scene::{AmbientOcclusion, Scene};

/// Seed of the references, so that they share no points with any measured image.
const REFERENCE_SEED: u64 = 0x5eed;

/// One sampled quantity: a scene whose number of samples is set by `with`.
struct Quantity {
    name: &'static str,
    scene: Scene,
    /// Returns the scene and the options for the given number of samples.
    with: fn(&Scene, &RenderOptions, u32) -> (Scene, RenderOptions),
}

impl Quantity {
    fn case(&self, camera: &Camera, options: &RenderOptions, n: u32) -> ImageCase {
        let (scene, options) = (self.with)(&self.scene, options, n);
        let name = format!("{}, {}, {n}", self.name, options.sampling.name());
        ImageCase { name, scene, camera: *camera, options }
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("quantity", "", "what is sampled");
    record.column("sampling", "", "how the points are spread");
    record.column("samples", "", "rays per point on the surface, or samples per pixel");
    record.column("time", "ms", "wall time of the image, median over the rounds");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rounds", "", "rounds; all settings of a quantity took turns in them");
    record.column(
        "rms_error",
        "grey level",
        "root mean square over pixels and channels against the reference",
    );
    record.column("largest_error", "grey level", "largest difference of a channel of a pixel");
    record.column("reference_samples", "", "samples of the reference");
    let (pixels, most, reference) = if context.quick { (96, 64, 1024) } else { (256, 256, 16384) };
    record.notes.push(format!(
        "A grey level is 1/255 of white in linear light. References have {reference} \
         low-discrepancy samples with another \
         seed. Ambient occlusion and soft shadows are sampled at the pixel’s centre alone, so that \
         each curve shows one \
         source of error; antialiasing is the pixel’s area."
    ));
    let mesh = meshes::coarse_wavelet(if context.quick { 41 } else { 101 })?;
    let world = World::from_mesh(mesh, &BuildOptions::default())?;
    let camera = Framing::Fitted.of(&world, [pixels, pixels])?;
    for quantity in quantities(world, &camera) {
        let mut plot = Plot::lines(
            &format!("{}: error against time", quantity.name),
            Axis::log("time", "ms"),
            Axis::log("RMS error", "grey level"),
        );
        context.report_step(format!("{}: reference of {reference} samples", quantity.name))?;
        let plain =
            RenderOptions { cancel: context.cancel.clone(), ..RenderOptions::new(pixels, pixels) };
        let options = RenderOptions { seed: REFERENCE_SEED, ..plain.clone() };
        let (exact, ..) = quantity.case(&camera, &options, reference).render()?;
        let counts: Vec<u32> = (0..).map(|k| 1u32 << (2 * k)).take_while(|n| *n <= most).collect();
        let settings: Vec<(Sampling, u32)> =
            Sampling::ALL.into_iter().flat_map(|s| counts.iter().map(move |n| (s, *n))).collect();
        context.report_step(format!("{}: {} settings in turns", quantity.name, settings.len()))?;
        let cases: Vec<ImageCase> = settings
            .iter()
            .map(|&(sampling, n)| {
                quantity.case(&camera, &RenderOptions { sampling, ..plain.clone() }, n)
            })
            .collect();
        let images = measure_in_turns(&context.schedule(Schedule::all_threads(), 5.0), &cases)?;
        for ((sampling, n), image) in settings.iter().zip(&images) {
            let error = ImageError::of(&image.frame, &exact);
            let row = Row::new().with("quantity", quantity.name).with("sampling", sampling.name());
            let row = image.timed(row.with("samples", *n)).with("rms_error", error.rms);
            let row = row.with("largest_error", error.largest);
            record.rows.push(row.with("reference_samples", reference));
        }
        let mut words = vec![];
        for sampling in Sampling::ALL {
            let of = |r: &&Row| {
                r.text("quantity") == Some(quantity.name)
                    && r.text("sampling") == Some(sampling.name())
            };
            let rows: Vec<&Row> = record.rows.iter().filter(of).collect();
            let points = rows.iter().filter_map(|r| r.number("time").zip(r.number("rms_error")));
            plot.series.push(Series::new(sampling.name(), points.collect()));
            let (first, last) = (rows.first(), rows.last());
            let ends =
                first.zip(last).and_then(|(a, b)| a.number("rms_error").zip(b.number("rms_error")));
            if let Some((few, many)) = ends {
                words.push(format!("{} {:.1} times", sampling.name(), few / many));
            }
        }
        record.notes.push(format!(
            "{}: from 1 sample to {most} the error fell: {}. Errors that fall with the square root \
             would have fallen {:.1} times.",
            quantity.name,
            words.join(", "),
            f64::from(most).sqrt()
        ));
        record.plots.push(plot);
    }
    Ok(())
}

fn quantities(world: World, camera: &Camera) -> Vec<Quantity> {
    let b = world.bounds();
    let radius = f64::from(b.radius());
    let eye = camera.eye().unwrap_or(DVec3::ZERO);
    let mut plain = Scene::new(world);
    plain.materials = vec![Material::matte([0.8; 3])];
    let mut ao = plain.clone();
    ao.lights = vec![Light::ambient([1.0; 3])];
    ao.ambient_occlusion = Some(AmbientOcclusion { distance: 0.3 * radius, rays: 1 });
    let mut soft = plain.clone();
    let place = eye + camera.world_from_view() * DVec3::new(radius, 1.5 * radius, 0.0);
    soft.lights = vec![Light::point(place).with_size(0.3 * radius).expect("a light with a size")];
    vec![
        Quantity {
            name: "ambient occlusion",
            scene: ao,
            with: |s, o, rays| {
                let mut scene = s.clone();
                scene.ambient_occlusion =
                    s.ambient_occlusion.map(|a| AmbientOcclusion { rays, ..a });
                (scene, o.clone())
            },
        },
        Quantity {
            name: "soft shadow",
            scene: soft,
            with: |s, o, light_rays| (s.clone(), RenderOptions { light_rays, ..o.clone() }),
        },
        Quantity {
            name: "antialiasing",
            scene: plain,
            with: |s, o, samples| (s.clone(), RenderOptions { samples, ..o.clone() }),
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_samples_come_closer_and_low_discrepancy_closest() {
        let world = World::from_mesh(meshes::coarse_wavelet(21).unwrap(), &BuildOptions::default())
            .unwrap();
        let camera = Framing::Fitted.of(&world, [32, 32]).unwrap();
        for q in quantities(world, &camera) {
            let draw = |sampling, seed, n| {
                let options = RenderOptions { sampling, seed, ..RenderOptions::new(32, 32) };
                q.case(&camera, &options, n).render().unwrap().0
            };
            let exact = draw(Sampling::Sobol, REFERENCE_SEED, 1024);
            let error = |sampling, n| ImageError::of(&draw(sampling, 0, n), &exact).rms;
            let [few, many] = [4, 64].map(|n| error(Sampling::Sobol, n));
            let random = error(Sampling::Random, 64);
            assert!(many < 0.5 * few, "{}: {few} with 4 samples, {many} with 64", q.name);
            assert!(many < random, "{}: {many} low-discrepancy, {random} random", q.name);
        }
    }
}
