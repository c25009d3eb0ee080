//! Error against time of volume rendering: the tolerance against fixed steps, on a smooth fog, on
//! thin shells, and on lit shells.

use super::Context;
use super::image_error::{ImageCase, ImageError, VISIBLE_LEVELS, measure_in_turns};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::Schedule;
use datasets::generate::wavelet::Wavelet;
use glam::DVec3;
use rayon::prelude::*;
use rt_core::camera::Camera;
use rt_core::colormap::ColorMap;
use rt_core::grid::Grid;
use rt_core::ray::Ray;
use rt_core::render::RenderOptions;
use rt_core::scene::SceneBuilder;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions, VolumeQuality, VolumeShading, integrate_reference};
use std::sync::Arc;

/// Tolerances in levels, from coarse to fine; the default is 0.5.
const LEVELS: [f32; 10] = [64.0, 16.0, 8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.0625, 0.015_625];

/// Fixed steps in voxels.
const STEPS: [f32; 6] = [4.0, 2.0, 1.0, 0.5, 0.25, 0.125];

/// Tolerance of the reference, in levels.
const REFERENCE_LEVELS: f32 = 1e-3;

/// A medium to draw.
struct Medium {
    name: &'static str,
    volume: Arc<Volume>,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("medium", "", "what is drawn");
    record.column("method", "", "`tolerance` or `fixed steps`");
    record.column("tolerance", "grey level", "tolerance asked for");
    record.column("step", "voxel", "length of a fixed step");
    record.column("time", "ms", "wall time of the image, median over the rounds");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rounds", "", "rounds; all settings of a medium took turns in them");
    record.column("rms_error", "grey level", "root mean square over pixels and channels");
    record.column("largest_error", "grey level", "largest difference of a channel of a pixel");
    record.column("kept", "", "whether the largest error is within the tolerance asked");
    let (points, pixels, step) =
        if context.quick { (41, 64, 1.0 / 32.0) } else { (101, 256, 1.0 / 64.0) };
    record.notes.push(format!(
        "A grey level is 1/255 of white in linear light. The wavelet on {points}³ points, {pixels} \
         x {pixels} pixels, one ray each. References have a tolerance of {REFERENCE_LEVELS} levels."
    ));
    let grid: Arc<Grid> = Arc::new(Wavelet::with_points(points).grid()?);
    let camera = camera_of(&grid)?;
    let mut got = Plot::lines(
        "tolerance asked against largest error got",
        Axis::log("tolerance asked", "grey level"),
        Axis::log("largest error got", "grey level"),
    );
    for medium in media(&grid)? {
        let name = medium.name;
        let mut builder = SceneBuilder::new();
        builder.volume(medium.volume.clone());
        let scene = builder.build()?;
        let case = |volume_quality| ImageCase {
            name: format!("{volume_quality:?}"),
            scene: scene.clone(),
            camera,
            options: RenderOptions {
                volume_quality,
                cancel: context.cancel.clone(),
                ..RenderOptions::new(pixels, pixels)
            },
        };
        let tolerances = LEVELS.map(|levels| VolumeQuality::Tolerance { levels });
        let steps = STEPS.map(|voxels| VolumeQuality::Step { voxels });
        let qualities: Vec<VolumeQuality> = tolerances.into_iter().chain(steps).collect();
        let cases: Vec<ImageCase> = qualities.iter().map(|q| case(*q)).collect();
        let fine = case(VolumeQuality::Tolerance { levels: REFERENCE_LEVELS });
        context.report_step(format!("{name}: reference"))?;
        let (fine, ..) = fine.render()?;
        let exact: Vec<[f64; 4]> = fine.color.iter().map(|c| c.map(f64::from)).collect();
        if name != LIT {
            let off = [2.0 * step, step].map(|step| {
                let independent = independent(&medium.volume, &camera, pixels, step);
                ImageError::of_colors(&fine.color, independent).largest
            });
            record.notes.push(format!(
                "{name}: the reference is at most {:.1e} levels from an independent integrator in \
                 f64 with steps of {} voxel, and {:.1e} with steps of half that length. That \
                 integrator's own error falls to a quarter.",
                off[0],
                2.0 * step,
                off[1]
            ));
        }
        context.report_step(format!("{name}: {} settings in turns", cases.len()))?;
        let images = measure_in_turns(&context.schedule(Schedule::all_threads(), 1.5), &cases)?;
        let mut plot = Plot::lines(
            &format!("{name}: error against time"),
            Axis::log("time", "ms"),
            Axis::log("RMS error", "grey level"),
        );
        plot.mark = Some(VISIBLE_LEVELS);
        let mut curves = [vec![], vec![]];
        let mut kept_points = vec![];
        for (quality, image) in qualities.iter().zip(&images) {
            let error = ImageError::of_colors(&image.frame.color, exact.iter().copied());
            let row = image.timed(Row::new().with("medium", name));
            let row = row.with("rms_error", error.rms).with("largest_error", error.largest);
            let point = (image.time.median * 1e3, error.rms);
            record.rows.push(match *quality {
                VolumeQuality::Step { voxels } => {
                    curves[1].push(point);
                    row.with("method", "fixed steps").with("step", f64::from(voxels))
                }
                VolumeQuality::Tolerance { levels } => {
                    curves[0].push(point);
                    kept_points.push((f64::from(levels), error.largest));
                    let kept = error.largest <= f64::from(levels);
                    row.with("method", "tolerance")
                        .with("tolerance", f64::from(levels))
                        .with("kept", if kept { "yes" } else { "no" })
                }
                _ => row,
            });
        }
        let [by_tolerance, by_steps] = curves;
        plot.series.push(Series::new("tolerance", by_tolerance));
        plot.series.push(Series::new("fixed steps", by_steps));
        record.plots.push(plot);
        got.series.push(Series::new(name, kept_points));
    }
    let asked = LEVELS.map(|l| (f64::from(l), f64::from(l)));
    got.series.push(Series::new("what was asked", asked.to_vec()));
    record.plots.push(got);
    record.notes.push(describe_kept(&record.rows));
    Ok(())
}

/// How many images kept their tolerance.
fn describe_kept(rows: &[Row]) -> String {
    let asked: Vec<&Row> = rows.iter().filter(|r| r.number("tolerance").is_some()).collect();
    let kept = asked.iter().filter(|r| r.text("kept") == Some("yes")).count();
    let part = |r: &&Row| r.number("largest_error").zip(r.number("tolerance"));
    let worst = asked.iter().filter_map(part).map(|(e, t)| e / t).fold(0.0, f64::max);
    format!(
        "{kept} of {} images kept their tolerance at every pixel; the worst has {worst:.2} times \
         its tolerance.",
        asked.len()
    )
}

const LIT: &str = "lit shells";
const SHELLS: &str = "thin shells";

/// Fog, thin shells, and shells lit by a light at the viewer.
fn media(grid: &Arc<Grid>) -> anyhow::Result<Vec<Medium>> {
    let (low, high) = grid.range().unwrap_or((0.0, 1.0));
    let at = |part: f32| low + part * (high - low);
    let size = (grid.max_corner() - grid.origin()).max_element() as f32;
    let colors = || {
        let colors = vec![[0.1, 0.2, 0.8, 1.0], [0.9, 0.9, 0.9, 1.0], [0.8, 0.15, 0.05, 1.0]];
        ColorMap::new(colors, [low, high])
    };
    // Through the middle, about two thirds of the light are absorbed.
    let fog = TransferFunction::new(colors(), vec![[at(0.2), 0.0], [at(1.0), 3.0 / size]])?;
    // Shells of 2 % of the range.
    let mut peaks = vec![];
    for middle in [0.3, 0.45, 0.6, 0.75] {
        peaks.push([at(middle - 0.01), 0.0]);
        peaks.push([at(middle), 60.0 / size]);
        peaks.push([at(middle + 0.01), 0.0]);
    }
    let shells = TransferFunction::new(colors(), peaks)?;
    let shading = VolumeShading { ambient: 0.3, diffuse: 0.7, ..VolumeShading::default() };
    let lit = VolumeOptions { shading: Some(shading), ..VolumeOptions::default() };
    let medium = |name, transfer, options| -> anyhow::Result<Medium> {
        Ok(Medium { name, volume: Arc::new(Volume::new(grid.clone(), transfer, options)?) })
    };
    Ok(vec![
        medium("fog", fog, VolumeOptions::default())?,
        medium(SHELLS, shells.clone(), VolumeOptions::default())?,
        medium(LIT, shells, lit)?,
    ])
}

/// A view of the whole grid, off its axes.
fn camera_of(grid: &Grid) -> anyhow::Result<Camera> {
    let (low, high) = (grid.origin(), grid.max_corner());
    let (middle, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
    let eye = middle + DVec3::new(0.6, -0.9, 0.5).normalize() * (3.0 * radius);
    Ok(Camera::perspective(eye, middle, DVec3::Z, 0.6, 1.0, [radius, 5.0 * radius])?)
}

/// The image by the independent integrator, pixel by pixel from the top left.
fn independent(volume: &Volume, camera: &Camera, pixels: u32, step_voxels: f64) -> Vec<[f64; 4]> {
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % pixels) + 0.5, f64::from(i / pixels) + 0.5);
        let (origin, dir) = camera.world_ray(Camera::ndc_of_pixel(x, y, [pixels; 2]));
        let ray = Ray::new((origin - volume.origin()).as_vec3(), dir.normalize().as_vec3());
        integrate_reference(volume, &ray, 0.0, f32::INFINITY, step_voxels)
    };
    (0..pixels * pixels).into_par_iter().map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_keep_their_tolerance_and_finer_steps_come_closer() {
        let grid = Arc::new(Wavelet::with_points(21).grid().unwrap());
        let pixels = 24;
        let camera = camera_of(&grid).unwrap();
        for medium in media(&grid).unwrap() {
            let mut builder = SceneBuilder::new();
            builder.volume(medium.volume.clone());
            let scene = builder.build().unwrap();
            let draw = |volume_quality| {
                let options =
                    RenderOptions { volume_quality, ..RenderOptions::new(pixels, pixels) };
                let case = ImageCase { name: String::new(), scene: scene.clone(), camera, options };
                case.render().unwrap().0
            };
            let fine = draw(VolumeQuality::Tolerance { levels: REFERENCE_LEVELS });
            let exact: Vec<[f64; 4]> = fine.color.iter().map(|c| c.map(f64::from)).collect();
            let error =
                |quality| ImageError::of_colors(&draw(quality).color, exact.iter().copied());
            // The picture is neither empty nor opaque.
            let light = exact.iter().map(|c| c[3]).fold(0.0, f64::max);
            assert!((0.3..=1.0).contains(&light), "{}: {light}", medium.name);
            // The tolerance is for an estimate. It bounds every pixel of fog. Pixels of thin shells
            // exceed it by an eighth at half a level, and single ones of lit shells several times.
            for levels in [8.0, 0.5] {
                let e = error(VolumeQuality::Tolerance { levels });
                let (worst, limit) = match medium.name {
                    LIT => (e.rms, 1.0),
                    SHELLS => (e.largest, 1.25),
                    _ => (e.largest, 1.0),
                };
                assert!(worst <= limit * f64::from(levels), "{}: {levels}: {e:?}", medium.name);
            }
            // The reference is what the independent integrator approaches with shorter steps.
            if medium.name != LIT {
                let off = [1.0 / 16.0, 1.0 / 64.0].map(|step| {
                    let other = independent(&medium.volume, &camera, pixels, step);
                    ImageError::of_colors(&fine.color, other).rms
                });
                assert!(off[1] < 0.2 * off[0], "{}: {off:?}", medium.name);
            }
            let [coarse, fine] =
                [1.0, 0.125].map(|voxels| error(VolumeQuality::Step { voxels }).rms);
            assert!(fine < 0.5 * coarse, "{}: {fine} {coarse}", medium.name);
        }
    }

    #[test]
    fn the_note_counts_what_kept_its_tolerance() {
        let row = |error: f64, kept: &str| {
            Row::new().with("tolerance", 0.5).with("largest_error", error).with("kept", kept)
        };
        let steps = Row::new().with("step", 1.0).with("largest_error", 40.0);
        let words = describe_kept(&[row(0.2, "yes"), row(1.0, "no"), steps]);
        assert!(words.starts_with("1 of 2 images") && words.contains("2.00 times"), "{words}");
    }
}
