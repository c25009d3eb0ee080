//! Code that the curves of error against time of rt-core share: images in turns, and how far they
//! are from a reference.

use crate::clock::{self, Clock, Sample};
use crate::record::Row;
use crate::runner::{Schedule, Variant, interleave};
use crate::stats::Summary;
use datasets::cli::Interrupted;
use rt_core::camera::Camera;
use rt_core::frame::Frame;
use rt_core::ray_stats::RayStats;
use rt_core::render::{RenderOptions, StopReason, render};
use rt_core::scene::Scene;
use std::cell::RefCell;

/// Differences below half a grey level vanish when an image is rounded to 8 bits.
pub(super) const VISIBLE_LEVELS: f64 = 0.5;

/// One image of a comparison.
pub(super) struct ImageCase {
    pub(super) name: String,
    pub(super) scene: Scene,
    pub(super) camera: Camera,
    pub(super) options: RenderOptions,
}

impl ImageCase {
    /// Renders the image; returns it with the rays that it took and the renderer's time.
    pub(super) fn render(&self) -> anyhow::Result<(Frame, RayStats, Sample)> {
        let (output, sample) = clock::measure(|| render(&self.scene, &self.camera, &self.options));
        let output = output?;
        if output.report.stopped == StopReason::Cancelled {
            return Err(Interrupted.into());
        }
        Ok((output.frame, output.report.rays, sample))
    }
}

/// An image and the time that it takes.
pub(super) struct MeasuredImage {
    pub(super) frame: Frame,
    pub(super) rays: RayStats,
    /// Wall time in seconds, over the rounds.
    pub(super) time: Summary,
    pub(super) rounds: usize,
}

impl MeasuredImage {
    /// `row` with the columns `time`, `time_low`, `time_high` (ms) and `rounds`.
    pub(super) fn timed(&self, row: Row) -> Row {
        row.with("time", self.time.median * 1e3)
            .with("time_low", self.time.low * 1e3)
            .with("time_high", self.time.high * 1e3)
            .with("rounds", self.rounds)
    }
}

/// Renders all cases in turns, so that a slow minute of the machine affects all of them.
pub(super) fn measure_in_turns(
    schedule: &Schedule,
    cases: &[ImageCase],
) -> anyhow::Result<Vec<MeasuredImage>> {
    let images: RefCell<Vec<Option<(Frame, RayStats)>>> = RefCell::new(vec![None; cases.len()]);
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let mut variants: Vec<Variant<'_>> = cases
        .iter()
        .enumerate()
        .map(|(i, case)| {
            let (images, failed) = (&images, &failed);
            Variant::timed(case.name.clone(), move || match case.render() {
                Ok((frame, rays, sample)) => {
                    images.borrow_mut()[i] = Some((frame, rays));
                    sample
                }
                // After Ctrl-C, images end at once.
                Err(e) => {
                    failed.borrow_mut().get_or_insert(e);
                    Sample::default()
                }
            })
        })
        .collect();
    let timings = interleave(schedule, &mut variants)?;
    drop(variants);
    if let Some(e) = failed.into_inner() {
        return Err(e);
    }
    let measured = |(timed, image): (&crate::runner::Timed, Option<(Frame, RayStats)>)| {
        let (frame, rays) = image?;
        let (time, rounds) = (timed.summary(Clock::Wall), timed.samples.len());
        Some(MeasuredImage { frame, rays, time, rounds })
    };
    Ok(timings.variants.iter().zip(images.into_inner()).filter_map(measured).collect())
}

/// How far an image is from a reference, over all pixels and colour channels, in grey levels (1/255
/// of white, linear light).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImageError {
    /// Root mean square.
    pub(super) rms: f64,
    /// Largest difference.
    pub(super) largest: f64,
    /// Mean difference: negative where light is missing.
    pub(super) mean: f64,
}

impl ImageError {
    pub(super) fn of(image: &Frame, reference: &Frame) -> ImageError {
        ImageError::of_colors(&image.color, reference.color.iter().map(|c| c.map(f64::from)))
    }

    /// Of colours and the reference's colours, pixel by pixel.
    pub(super) fn of_colors(
        image: &[[f32; 4]],
        reference: impl IntoIterator<Item = [f64; 4]>,
    ) -> ImageError {
        let (mut squares, mut largest, mut sum) = (0.0, 0.0f64, 0.0);
        for (x, y) in image.iter().zip(reference) {
            for c in 0..3 {
                let d = (f64::from(x[c]) - y[c]) * 255.0;
                squares += d * d;
                sum += d;
                largest = if d.is_nan() { f64::NAN } else { largest.max(d.abs()) };
            }
        }
        let count = (3 * image.len().max(1)) as f64;
        ImageError { rms: (squares / count).sqrt(), largest, mean: sum / count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_in_grey_levels_and_keep_the_sign_of_the_mean() {
        let levels = |v: f32| [v / 255.0, v / 255.0, v / 255.0, 1.0];
        let reference = [levels(10.0), levels(20.0)].map(|c| c.map(f64::from));
        let e = ImageError::of_colors(&[levels(7.0), levels(21.0)], reference);
        assert!((e.largest - 3.0).abs() < 1e-5 && (e.mean + 1.0).abs() < 1e-5, "{e:?}");
        assert!((e.rms - 5f64.sqrt()).abs() < 1e-5, "{e:?}");
        let broken = ImageError::of_colors(&[[f32::NAN; 4]], reference);
        assert!(broken.largest.is_nan() && broken.rms.is_nan());
    }
}
