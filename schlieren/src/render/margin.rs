//! The margin around an image whose light is bent into it.

use super::{PlannedPaths, Report, TestSection};
use crate::film::Framing;
use crate::optics::Optics;
use crate::path::{Exit, LightPaths, Start, Status};
use crate::scene::{Scene, TechniqueSpec};
use crate::view::View;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Rays along each side of the lattice of rays that measures a margin.
const PROBES: u32 = 64;

/// Keeps the largest shift for the next image by the same light.
#[derive(Default)]
pub(super) struct ShiftCache(Mutex<Option<(Light, f64)>>);

/// What the shift depends on, for a field.
#[derive(PartialEq)]
struct Light {
    /// Method, interpolant and steps.
    march: String,
    against_light: bool,
    view: View,
    optics: Optics,
    framing: Framing,
}

/// Width of the margin around the image, in pixels, from which light can be deflected into it. It
/// is the largest shift found by a coarse lattice of rays over 1.5 times the image's size, plus a
/// quarter for what the lattice misses.
pub(super) fn margin_px(
    planned: &PlannedPaths<'_>,
    scene: &Scene,
    section: &TestSection,
    line: usize,
    framing: Framing,
    report: &mut Report,
) -> u32 {
    let light = Light {
        march: planned.description.clone(),
        against_light: matches!(scene.technique, TechniqueSpec::Bos { .. }),
        view: section.view,
        optics: scene.optics(),
        framing,
    };
    let optics = light.optics;
    let measured = || largest_shift_px(&*planned.paths, &optics, &framing);
    // Gas that absorbs stops rays. What is skipped is counted for each image.
    let is_alone = scene.media.is_empty() && scene.march.skip_rad == 0.0;
    let cache = section.caches.get(line).filter(|_| is_alone);
    let farthest_px = match cache {
        None => measured(),
        Some(caches) => {
            let ShiftCache(kept) = &caches.shift;
            let lock = || kept.lock().unwrap_or_else(PoisonError::into_inner);
            let known = lock().as_ref().filter(|(of, _)| *of == light).map(|(_, px)| *px);
            known.unwrap_or_else(|| {
                let px = measured();
                *lock() = Some((light, px));
                px
            })
        }
    };
    let needed_px = (1.25 * farthest_px + 1.0).ceil();
    let limit = f64::from(framing.width.max(framing.height));
    if needed_px > limit {
        report.warnings.push(format!(
            "light is displaced by {farthest_px:.0} pixels, more than the image's size; light from \
             farther away is ignored. Move the film nearer or enlarge the field of view"
        ));
    }
    let margin = needed_px.min(limit) as u32;
    report.margin_px = report.margin_px.max(margin);
    margin
}

/// The largest shift of a lattice of rays, in pixels.
fn largest_shift_px(paths: &dyn LightPaths, optics: &Optics, framing: &Framing) -> f64 {
    let probe = |i: u32, n: u32| {
        (f64::from(i) + 0.5) / f64::from(PROBES) * 1.5 * f64::from(n) - 0.25 * f64::from(n)
    };
    let starts: Vec<Start> = (0..PROBES * PROBES)
        .map(|k| {
            let at = framing.plane_from_pixel(
                probe(k % PROBES, framing.width),
                probe(k / PROBES, framing.height),
            );
            Start { position_m: at.map(|c| c as f32), tilt_rad: [0.0; 2] }
        })
        .collect();
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace_parallel(&starts, &mut exits);
    let lands = |e: &Exit| e.transmission > 0.0 && e.status != Status::Turned;
    let shift_px = |(s, e): (&Start, &Exit)| {
        let [x, y] = optics.film_shift_m(s, e);
        f64::from(x.abs().max(y.abs())) / framing.pixel_m
    };
    let landed = starts.par_iter().zip(&exits).filter(|(_, e)| lands(e));
    landed.map(shift_px).reduce(|| 0.0, f64::max)
}
