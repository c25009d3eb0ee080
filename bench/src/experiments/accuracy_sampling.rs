//! Error against time of the sampled effects, for low-discrepancy and independent sample points.

use super::Context;
use crate::clock::{self, Clock, Sample};
use crate::image::framing::Framing;
use crate::meshes;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use datasets::cli::Interrupted;
use glam::DVec3;
use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::Camera;
use rt_core::frame::Frame;
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::{RenderOptions, StopReason, render};
use rt_core::sampler::Sampling;
use rt_core::scene::{AmbientOcclusion, Scene};
use std::cell::RefCell;

/// Seed of the references, so that they share no points with any measured image.
const REFERENCE_SEED: u64 = 0x5eed;

/// One sampled quantity: a scene whose number of samples is set by `with`.
struct Quantity {
    name: &'static str,
    scene: Scene,
    /// Returns the scene and the options for the given number of samples.
    with: fn(&Scene, &RenderOptions, u32) -> (Scene, RenderOptions),
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
        let (exact, _) = image(&quantity, &camera, &options, reference)?;
        // All settings of a quantity alternate, so that a slow minute of the machine affects all of
        // them.
        let counts: Vec<u32> = (0..).map(|k| 1u32 << (2 * k)).take_while(|n| *n <= most).collect();
        let settings: Vec<(Sampling, u32)> =
            Sampling::ALL.into_iter().flat_map(|s| counts.iter().map(move |n| (s, *n))).collect();
        context.report_step(format!("{}: {} settings in turns", quantity.name, settings.len()))?;
        let frames: RefCell<Vec<Option<Frame>>> = RefCell::new(vec![None; settings.len()]);
        let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
        let mut variants: Vec<Variant<'_>> = settings
            .iter()
            .enumerate()
            .map(|(i, &(sampling, n))| {
                let options = RenderOptions { sampling, ..plain.clone() };
                let (quantity, camera, frames, failed) = (&quantity, &camera, &frames, &failed);
                Variant::timed(format!("{}, {n}", sampling.name()), move || {
                    // After Ctrl-C, images end at once.
                    match image(quantity, camera, &options, n) {
                        Ok((frame, sample)) => {
                            frames.borrow_mut()[i] = Some(frame);
                            sample
                        }
                        Err(e) => {
                            failed.borrow_mut().get_or_insert(e);
                            Sample::default()
                        }
                    }
                })
            })
            .collect();
        let timings = interleave(&context.schedule(Schedule::all_threads(), 5.0), &mut variants)?;
        drop(variants);
        if let Some(e) = failed.into_inner() {
            return Err(e);
        }
        for ((timed, (sampling, n)), frame) in
            timings.variants.iter().zip(&settings).zip(frames.into_inner())
        {
            let (Some(frame), time) = (frame, timed.summary(Clock::Wall)) else { continue };
            let (rms, largest) = difference(&frame, &exact);
            let row = Row::new().with("quantity", quantity.name).with("sampling", sampling.name());
            let row = row.with("samples", *n).with("time", time.median * 1e3);
            let row = row.with("time_low", time.low * 1e3).with("time_high", time.high * 1e3);
            let row = row.with("rounds", timed.samples.len()).with("rms_error", rms);
            record
                .rows
                .push(row.with("largest_error", largest).with("reference_samples", reference));
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

/// Renders the image; returns it with the time that the renderer took.
fn image(
    q: &Quantity,
    camera: &Camera,
    options: &RenderOptions,
    n: u32,
) -> anyhow::Result<(Frame, Sample)> {
    let (scene, options) = (q.with)(&q.scene, options, n);
    let (output, sample) = clock::measure(|| render(&scene, camera, &options));
    let output = output?;
    if output.report.stopped == StopReason::Cancelled {
        return Err(Interrupted.into());
    }
    Ok((output.frame, sample))
}

/// Root mean square and largest difference of the colour channels, in grey levels.
fn difference(a: &Frame, b: &Frame) -> (f64, f64) {
    let (mut squares, mut largest) = (0.0, 0.0f64);
    for (x, y) in a.color.iter().zip(&b.color) {
        for c in 0..3 {
            let d = f64::from(x[c] - y[c]) * 255.0;
            squares += d * d;
            largest = largest.max(d.abs());
        }
    }
    ((squares / (3 * a.color.len().max(1)) as f64).sqrt(), largest)
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
                image(&q, &camera, &options, n).unwrap().0
            };
            let exact = draw(Sampling::Sobol, REFERENCE_SEED, 1024);
            let error = |sampling, n| difference(&draw(sampling, 0, n), &exact).0;
            let [few, many] = [4, 64].map(|n| error(Sampling::Sobol, n));
            let random = error(Sampling::Random, 64);
            assert!(many < 0.5 * few, "{}: {few} with 4 samples, {many} with 64", q.name);
            assert!(many < random, "{}: {many} low-discrepancy, {random} random", q.name);
        }
    }
}
