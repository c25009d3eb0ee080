//! Exposes a film to the light of every spectral line through the test section, and filters the
//! noise.

use super::margin;
use super::on_gpu::{self, FilmControl};
use super::paths::Accuracy;
use super::{
    Control, Layers, PlannedPaths, RenderError, RenderOutput, Report, TestSection, technique,
};
use crate::film::beams::expose_beams;
use crate::film::photons::{ExposedFilm, Exposure, LandedPhoton, expose};
use crate::film::{Film, Framing, Tally};
use crate::filter::Filter;
use crate::optics::{Optics, SourceImage};
use crate::path::PathQuantities;
use crate::scene::{BeamsSpec, Jitter, SamplingSpec, Scene, TechniqueSpec};
use crate::spectrum::film_colors;
use rayon::prelude::*;
use rt_core::sampler::Sampling;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Largest distance between the beams of an extended source and the axial beam, in pixels, within
/// the flow or up to the plane in focus.
fn beam_spread_px(scene: &Scene, section: &TestSection, optics: &Optics, framing: &Framing) -> f64 {
    if !scene.technique.uses_source() {
        return 0.0;
    }
    let reach_m = match optics.source_image() {
        SourceImage::Point => 0.0,
        SourceImage::Rectangle { half_m, .. } => half_m[0].hypot(half_m[1]),
        SourceImage::Disc { radius_m } => radius_m,
    };
    let lever_m = optics.focus_m.abs().max(0.5 * section.depth_m());
    reach_m / optics.schlieren_focal_length_m * lever_m / framing.pixel_m
}

/// Exposes the film to every line of the spectrum and adds up their colours. Returns the paths of
/// the first line.
pub(super) fn expose_lines<'a>(
    scene: &Scene,
    section: &'a TestSection,
    layers: Layers,
    control: &Control<'_>,
    r: &mut RenderOutput,
) -> Result<Option<PlannedPaths<'a>>, RenderError> {
    let (framing, optics) = (r.framing, scene.optics());
    let lines = scene.lines();
    let spread_px = beam_spread_px(scene, section, &optics, &framing);
    let by_photons = matches!(scene.sampling(), SamplingSpec::Photons { .. });
    let tilted_beams = by_photons
        && match scene.light.beams {
            BeamsSpec::Auto => spread_px > 0.5,
            BeamsSpec::Axial => false,
            BeamsSpec::Tilted => scene.technique.uses_source(),
        };
    if spread_px > 0.5 && !tilted_beams {
        r.report.warnings.push(format!(
            "the source's extent would blur the image by {spread_px:.1} pixels, which is ignored; \
             use photons with light.beams = \"auto\""
        ));
    }
    r.report.effects.tilted_beams = tilted_beams;
    let against_light = matches!(scene.technique, TechniqueSpec::Bos { .. });
    let colors = film_colors(&lines);
    r.colored = lines.len() > 1;
    let mut first = None;

    for line in 0..lines.len() {
        let n0 = section.n0(line);
        let t = technique(scene, line, &framing, n0, tilted_beams)?;
        let accuracy = match first.as_ref().and_then(|f: &PlannedPaths<'_>| f.choice) {
            Some(choice) => Accuracy::Known(choice),
            None => Accuracy::measured(line == 0 && (layers.map || layers.accuracy)),
        };
        let quantities = PathQuantities { opd: t.needs_opd() };
        let planned = section.paths_of(scene, line, quantities, against_light, accuracy)?;
        if line == 0 {
            r.report.add_plan(&planned);
        }
        let margin_px = if t.samples_from_film() {
            0
        } else {
            margin::margin_px(&planned, scene, section, line, framing, &mut r.report)
        };
        let (sampling, seed) = match scene.sampling() {
            SamplingSpec::Photons { jitter: Jitter::Random, seed, .. } => (Sampling::Random, seed),
            SamplingSpec::Photons { seed, .. } => (Sampling::Sobol, seed),
            SamplingSpec::Beams { .. } => (Sampling::Sobol, 0),
        };
        let setup = Exposure {
            paths: &*planned.paths,
            technique: &t,
            solids: section.solids.as_ref(),
            sampling,
            seed,
            margin_px,
            tilted_beams,
        };
        let part = |done: f64| (control.progress)((line as f64 + done) / lines.len() as f64);
        let line_layers = Layers {
            counts: layers.counts && line == 0,
            noise: layers.noise && line == 0,
            ..layers
        };
        let (scale, before) = (scene.exposure() as f32, r.report.counters.rays);
        let light = Light { planned: &planned, setup, layers: line_layers };
        if t.is_colored() {
            let film = expose_line::<3>(scene, &light, framing, control.cancel, &part, r)?;
            r.colored = true;
            r.pixels = film.into_par_iter().map(|p| p.map(|v| v * scale)).collect();
        } else {
            let film = expose_line::<1>(scene, &light, framing, control.cancel, &part, r)?;
            let color = if lines.len() > 1 { colors[line] } else { [1.0; 3] };
            add_line(&mut r.pixels, film, color, scale);
        }
        r.report.add_traced(&*planned.paths);
        if line == 0 {
            r.report.skip_report = planned.paths.skip_report();
        }
        let counters = &mut r.report.counters;
        let rays = counters.rays - before;
        counters.phase_rays += if t.needs_opd() { rays } else { 0 };
        counters.tilted_rays += if tilted_beams { rays } else { 0 };
        counters.dispersion_rays += if line > 0 { rays } else { 0 };
        counters.media_rays += planned.take_media_rays();
        r.report.add_cells(&planned);
        r.report.add_device(&planned);
        first.get_or_insert(planned);
    }
    Ok(first)
}

/// Adds the brightness of a line to the pixels, of which there are none before the first.
fn add_line(pixels: &mut Vec<[f32; 3]>, film: Vec<[f32; 1]>, color: [f32; 3], scale: f32) {
    let colored = |f: [f32; 1]| color.map(|c| f[0] * c * scale);
    if pixels.is_empty() {
        *pixels = film.into_par_iter().map(colored).collect();
    } else {
        pixels.par_iter_mut().zip(film).for_each(|(p, f)| {
            let more = colored(f);
            (0..3).for_each(|c| p[c] += more[c]);
        });
    }
}

/// The light of one line, and the layers that are wanted of it.
struct Light<'a, 'b> {
    planned: &'a PlannedPaths<'b>,
    setup: Exposure<'a>,
    layers: Layers,
}

/// The filtered film of one line: energy per pixel.
fn expose_line<const C: usize>(
    scene: &Scene,
    light: &Light<'_, '_>,
    framing: Framing,
    cancel: &AtomicBool,
    progress: &(dyn Fn(f64) + Sync),
    r: &mut RenderOutput,
) -> Result<Vec<[f32; C]>, RenderError> {
    let Light { planned, ref setup, layers } = *light;
    let done = AtomicU64::new(0);
    let side = |n: u32| u64::from(n) + 2 * u64::from(setup.margin_px);
    let per_pass = side(framing.width) * side(framing.height);
    let finished = |total: u64, rays: u64| {
        let so_far = done.fetch_add(rays, Ordering::Relaxed) + rays;
        progress(so_far as f64 / total as f64);
    };
    let film = match scene.sampling() {
        SamplingSpec::Beams { cells_per_side } => {
            let total = per_pass * u64::from(cells_per_side).pow(2);
            let progress = |n| finished(total, n);
            let control = FilmControl { cancel, progress: &progress };
            let by_gpu = on_gpu::photograph_beams(
                planned,
                setup,
                framing,
                cells_per_side,
                &control,
                &mut r.report,
            )?;
            let (picture, tally) = match by_gpu {
                Some(made) => (made.pixels, made.tally),
                None => {
                    let film = Film::<C>::new(framing, false);
                    let tally = expose_beams(setup, &film, cells_per_side, cancel, &progress)
                        .ok_or(RenderError::Cancelled)?;
                    (film.to_pixels(1.0), tally)
                }
            };
            r.report.tally.add(&tally);
            let rays = done.load(Ordering::Relaxed);
            r.report.counters.differential_rays += rays;
            r.report.counters.rays += rays;
            r.report.counters.solid_queries += if setup.solids.is_some() { rays } else { 0 };
            picture
        }
        SamplingSpec::Photons { samples, filter, .. } => {
            let filter = filter.filter().shrunk(samples);
            let total = per_pass * u64::from(samples);
            let keep = matches!(filter, Filter::Cone { .. });
            if keep && total > crate::filter::cone::MAX_PHOTONS {
                let limit = crate::filter::cone::MAX_PHOTONS;
                return Err(RenderError::TooManyPhotons { photons: total, limit });
            }
            let two = layers.noise && samples > 1;
            let progress = |n| finished(total, n);
            let control = FilmControl { cancel, progress: &progress };
            if !layers.counts {
                let by_gpu = on_gpu::photograph_photons(
                    planned,
                    setup,
                    framing,
                    (samples, filter, two),
                    &control,
                    &mut r.report,
                )?;
                if let Some(made) = by_gpu {
                    add_photons(&mut r.report, &made.tally, setup);
                    if let Some(noise) = made.noise {
                        r.noise = Some(strongest(&noise, scene.exposure() as f32));
                    }
                    return Ok(made.pixels);
                }
            }
            let films: Vec<Film<C>> =
                (0..if two { 2 } else { 1 }).map(|_| Film::new(framing, layers.counts)).collect();
            // Without counts, the device was asked above, and has refused.
            let by_gpu = match layers.counts {
                false => None,
                true => on_gpu::expose_photons(
                    planned,
                    setup,
                    &films,
                    (samples, filter),
                    &control,
                    &mut r.report,
                )?,
            };
            let (exposed, picture) = match by_gpu {
                Some((tally, picture)) => (ExposedFilm { tally, landed: Vec::new() }, picture),
                None => {
                    let exposed = expose(setup, &films, 0..samples, keep, cancel, &progress)
                        .ok_or(RenderError::Cancelled)?;
                    (exposed, None)
                }
            };
            add_photons(&mut r.report, &exposed.tally, setup);
            if two {
                r.noise = Some(noise(&films, samples, filter, scene.exposure()));
            }
            if let [first, second] = &films[..] {
                first.add_film(second);
            }
            if layers.counts {
                r.counts = films[0].counts();
            }
            picture.unwrap_or_else(|| {
                let pixels = films[0].to_pixels(f64::from(samples));
                filtered(&pixels, &exposed.landed, &framing, filter, samples)
            })
        }
    };
    Ok(film)
}

/// Notes the photons of a line.
fn add_photons(report: &mut Report, tally: &Tally, setup: &Exposure<'_>) {
    report.tally.add(tally);
    report.counters.rays += tally.sent - tally.blocked_by_solids;
    report.counters.solid_queries += if setup.solids.is_some() { tally.sent } else { 0 };
}

/// Filters the noise of a film.
fn filtered<const C: usize>(
    film: &[[f32; C]],
    landed: &[LandedPhoton<C>],
    framing: &Framing,
    filter: Filter,
    samples: u32,
) -> Vec<[f32; C]> {
    let width = framing.width as usize;
    match filter {
        Filter::None => film.to_vec(),
        Filter::Gaussian { sigma_px } => crate::filter::gaussian::gaussian(film, width, sigma_px),
        Filter::Mean { radius_px } => crate::filter::mean::mean(film, width, radius_px),
        Filter::Cone { nearest } => {
            crate::filter::cone::cone(landed, framing, nearest, f64::from(samples))
        }
    }
}

/// Half the difference between two halves of the photons, filtered like the image. With a cone
/// filter it is the noise of the unfiltered film.
fn noise<const C: usize>(
    films: &[Film<C>],
    samples: u32,
    filter: Filter,
    exposure: f64,
) -> Vec<f32> {
    let halves = [samples.div_ceil(2), samples / 2];
    let half_images: Vec<Vec<[f32; C]>> =
        films.iter().zip(halves).map(|(f, n)| f.to_pixels(f64::from(n))).collect();
    let difference: Vec<[f32; C]> = half_images[0]
        .iter()
        .zip(&half_images[1])
        .map(|(a, b)| std::array::from_fn(|c| 0.5 * exposure as f32 * (a[c] - b[c])))
        .collect();
    let width = films[0].framing().width as usize;
    let difference = match filter {
        Filter::Gaussian { sigma_px } => {
            crate::filter::gaussian::gaussian(&difference, width, sigma_px)
        }
        Filter::Mean { radius_px } => crate::filter::mean::mean(&difference, width, radius_px),
        Filter::None | Filter::Cone { .. } => difference,
    };
    strongest(&difference, 1.0)
}

/// The largest deviation of each pixel's channels, times the exposure.
fn strongest<const C: usize>(difference: &[[f32; C]], exposure: f32) -> Vec<f32> {
    let of = |d: &[f32; C]| d.iter().fold(0.0f32, |m, v| m.max((exposure * v).abs()));
    difference.par_iter().map(of).collect()
}
