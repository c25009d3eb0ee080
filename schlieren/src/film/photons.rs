//! Exposes a film by photons: sends the beam as jittered rays from every pixel and records where
//! the flow deflects them to.
//!
//! The starts form a low-discrepancy sequence in each pixel. They depend on pixel, pass and seed
//! alone, so passes can be added at any time. Pixels outside the image, up to `margin_px` away,
//! also send photons, because light from there reaches the image's edge.

use super::{Film, Framing, PhotonTile, TILE, Tally, trace_unless_cancelled};
use crate::optics::PlaneVector;
use crate::path::{Exit, LightPaths, Start, Status};
use crate::solids::Solids;
use crate::technique::{Photon, Technique};
use rayon::prelude::*;
use rt_core::sampler::{Sampler, Sampling};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Dimensions of the sampler, for the position in a pixel and the point of the source.
const JITTER: u32 = 0;
const SOURCE: u32 = 1;

/// What light is sent, and how its exits become energy.
#[derive(Clone, Copy)]
pub struct Exposure<'a> {
    /// Traces photons through the flow.
    pub paths: &'a dyn LightPaths,
    /// Turns exits into energy.
    pub technique: &'a Technique,
    /// Bodies in the test section.
    pub solids: Option<&'a Solids>,
    /// Sequence of the jitter: low-discrepancy, or random for comparison.
    pub sampling: Sampling,
    /// Seed of the jitter.
    pub seed: u64,
    /// Width of the margin around the image that also sends light, in pixels.
    pub margin_px: u32,
    /// Whether every photon travels in the beam of its own source point, so that an extended source
    /// blurs what is out of focus. Otherwise all photons travel in the axial beam.
    pub tilted_beams: bool,
}

/// A photon that leaves its pixel.
pub(crate) struct SentPhoton {
    pub(crate) start: Start,
    /// Its start in pixels from the image's upper left corner.
    position_px: [f32; 2],
    /// The image of its source point in the cut-off plane.
    image_point_m: PlaneVector,
}

impl Exposure<'_> {
    /// The photon of a pixel in a pass.
    pub(crate) fn send(&self, framing: &Framing, [x, y]: [i64; 2], pass: u32) -> SentPhoton {
        // Pixels of the margin have negative coordinates. They wrap to other u32 values, which are
        // as good for the sampler.
        let sampler = Sampler::new(self.sampling, self.seed, x as u32, y as u32, pass);
        let jitter = sampler.square(JITTER);
        let mut start =
            framing.start_at(x as f64 + f64::from(jitter[0]), y as f64 + f64::from(jitter[1]));
        let mut image_point_m = [0.0; 2];
        if self.tilted_beams || self.technique.needs_source_points() {
            let optics = self.technique.optics();
            image_point_m = optics.source_image().point_m(sampler.square(SOURCE));
            if self.tilted_beams {
                start.tilt_rad = optics.tilt_rad(image_point_m);
            }
        }
        let position_px = [x as f32 + jitter[0], y as f32 + jitter[1]];
        SentPhoton { start, position_px, image_point_m }
    }

    /// Whether a body stops the light of a start.
    pub(crate) fn is_behind_body(&self, start: &Start) -> bool {
        self.solids.is_some_and(|s| s.block(self.paths.view(), start))
    }
}

/// A photon on the film, stored for filters that search for neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LandedPhoton<const C: usize> {
    /// Position in pixels from the image's upper left corner; may lie outside the image.
    pub at_px: [f32; 2],
    /// Energy: 1 for an undisturbed photon without a cut-off.
    pub energy: [f32; C],
}

/// Result of [`expose`].
#[derive(Debug, Default)]
pub struct ExposedFilm<const C: usize> {
    /// Counts of photons by outcome.
    pub tally: Tally,
    /// All landed photons if `keep` was set, in an order that does not depend on threads.
    pub landed: Vec<LandedPhoton<C>>,
}

/// Sends the passes `passes`, with one photon per pixel and pass. Pass i exposes film `i %
/// films.len()`; the difference of two films estimates the noise. `progress` receives the number of
/// photons of each tile. Returns `None` when `cancel` was set; the films are then partly exposed
/// and must be discarded.
pub fn expose<const C: usize>(
    exposure: &Exposure<'_>,
    films: &[Film<C>],
    passes: Range<u32>,
    keep: bool,
    cancel: &AtomicBool,
    progress: &(dyn Fn(u64) + Sync),
) -> Option<ExposedFilm<C>> {
    let framing = *films.first()?.framing();
    let margin = i64::from(exposure.margin_px);
    let along = |n: u32| (-margin..i64::from(n) + margin).step_by(TILE as usize);
    let corners: Vec<[i64; 2]> =
        along(framing.height).flat_map(|y| along(framing.width).map(move |x| [x, y])).collect();
    let limit = [i64::from(framing.width) + margin, i64::from(framing.height) + margin];
    let tiles: Vec<ExposedFilm<C>> = corners
        .par_iter()
        .map(|&corner| {
            let mut done = ExposedFilm::default();
            if !cancel.load(Ordering::Relaxed) {
                let end = [0, 1].map(|i| (corner[i] + i64::from(TILE)).min(limit[i]));
                let area = [corner, end];
                expose_tile(exposure, films, area, passes.clone(), keep, cancel, &mut done);
                progress(done.tally.sent);
            }
            done
        })
        .collect();
    if cancel.load(Ordering::Relaxed) {
        return None;
    }
    let mut all = ExposedFilm::default();
    for mut tile in tiles {
        all.tally.add(&tile.tally);
        all.landed.append(&mut tile.landed);
    }
    Some(all)
}

fn expose_tile<const C: usize>(
    exposure: &Exposure<'_>,
    films: &[Film<C>],
    [corner, end]: [[i64; 2]; 2],
    passes: Range<u32>,
    keep: bool,
    cancel: &AtomicBool,
    done: &mut ExposedFilm<C>,
) {
    let framing = *films[0].framing();
    let (technique, optics) = (exposure.technique, exposure.technique.optics());
    let mut tiles: Vec<PhotonTile<'_, C>> =
        films.iter().map(|f| PhotonTile::new(f, corner)).collect();
    let capacity = (TILE * TILE) as usize;
    let (mut starts, mut positions_px) =
        (Vec::with_capacity(capacity), Vec::with_capacity(capacity));
    let mut image_points: Vec<PlaneVector> = Vec::with_capacity(capacity);
    let mut exits = vec![Exit::UNDISTURBED; capacity];
    let to_pixels = (1.0 / framing.pixel_m) as f32;

    for pass in passes {
        // Start at a jittered position in every pixel.
        starts.clear();
        positions_px.clear();
        image_points.clear();
        for y in corner[1]..end[1] {
            for x in corner[0]..end[0] {
                let sent = exposure.send(&framing, [x, y], pass);
                done.tally.sent += 1;
                if exposure.is_behind_body(&sent.start) {
                    done.tally.blocked_by_solids += 1;
                    continue;
                }
                starts.push(sent.start);
                positions_px.push(sent.position_px);
                image_points.push(sent.image_point_m);
            }
        }

        // Trace through the flow.
        let exits = &mut exits[..starts.len()];
        if !trace_unless_cancelled(exposure.paths, &starts, exits, cancel) {
            return;
        }

        // Deposit on the film.
        let tile = &mut tiles[pass as usize % films.len()];
        for i in 0..starts.len() {
            let (start, exit) = (&starts[i], &exits[i]);
            if exit.status == Status::Turned {
                done.tally.turned += 1;
                continue;
            }
            if exit.transmission <= 0.0 {
                done.tally.blocked_in_field += 1;
                continue;
            }
            let shift_m = optics.film_shift_m(start, exit);
            let energy = technique.attenuated_energy(&Photon {
                start,
                exit,
                image_point_m: image_points[i],
                shift_m,
            });
            let shift = if technique.samples_from_film() { [0.0; 2] } else { shift_m };
            // A NaN or infinity in either becomes NaN here; comparisons with it are false.
            let check = (shift[0] + shift[1] + energy[0] + energy[1] + energy[2]) * 0.0;
            if check != 0.0 {
                done.tally.not_a_number += 1;
                continue;
            }
            let at_px = [
                positions_px[i][0] + shift[0] * to_pixels,
                positions_px[i][1] - shift[1] * to_pixels,
            ];
            let energy: [f32; C] = std::array::from_fn(|c| energy[c]);
            done.tally.landed += 1;
            done.tally.on_film += u64::from(tile.deposit(at_px, energy));
            if keep {
                done.landed.push(LandedPhoton { at_px, energy });
            }
        }
    }
    tiles.into_iter().for_each(PhotonTile::flush);
}
