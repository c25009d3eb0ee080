//! Collects light on a film: energy per pixel, summed as integers. The image has the same bits for
//! any number of threads.
//!
//! There are two methods of exposure. [`photons`] start at jittered positions. The image has noise
//! but is correct for any source and cut-off. [`beams`] are the cells of a lattice of rays. Each
//! carries its energy to the area that its corners enclose. The image has no noise and needs one
//! ray per pixel.
//!
//! The undisturbed beam without a cut-off leaves energy 1 in each pixel.

pub mod beams;
pub mod photons;
mod polygon_area;
mod signed_area;
mod tile;
pub mod traced;

pub(crate) use tile::{PhotonTile, TILE};

use crate::path::{Exit, LightPaths, Start};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// Traces rays on this thread, some at a time. Returns false when `cancel` was set; exits are then
/// partly computed and must be discarded.
pub(crate) fn trace_unless_cancelled(
    paths: &dyn LightPaths,
    starts: &[Start],
    exits: &mut [Exit],
    cancel: &AtomicBool,
) -> bool {
    let at_once = paths.rays_at_once().unwrap_or(starts.len()).max(1);
    for (starts, exits) in starts.chunks(at_once).zip(exits.chunks_mut(at_once)) {
        if cancel.load(Ordering::Relaxed) {
            return false;
        }
        paths.trace(starts, exits);
    }
    true
}

/// Rays of each thread between two looks at `cancel`: eight pieces of
/// [`LightPaths::trace_parallel`], so that threads end at about the same time.
const PER_THREAD: usize = 8 * 1024;

/// As [`trace_unless_cancelled`], on all threads, and in the order of rays that the paths choose.
/// `progress` gets the number of rays after each piece.
pub(crate) fn trace_parallel_unless_cancelled(
    paths: &dyn LightPaths,
    starts: &[Start],
    exits: &mut [Exit],
    cancel: &AtomicBool,
    progress: &(dyn Fn(usize) + Sync),
) -> bool {
    let at_once = match paths.rays_at_once() {
        Some(_) => PER_THREAD * rayon::current_num_threads(),
        None => starts.len().max(1),
    };
    for (starts, exits) in starts.chunks(at_once).zip(exits.chunks_mut(at_once)) {
        if cancel.load(Ordering::Relaxed) {
            return false;
        }
        paths.trace_parallel(starts, exits);
        progress(starts.len());
    }
    !cancel.load(Ordering::Relaxed)
}

/// Energy 1 in fixed point. A pixel holds 2³² photons of energy 1 before it overflows. The
/// quantisation error, 2⁻³³ per photon, is far below the rounding of the f32 energy.
const ONE: f64 = 4_294_967_296.0;

/// Converts energy to an integer. Energies are never negative. NaN, which only a faulty march
/// produces, becomes zero; the exposure counts it.
#[inline]
pub(crate) fn quantize(energy: f32) -> u64 {
    (f64::from(energy) * ONE) as u64
}

/// The part of the plane of focus that the film shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows; row 0 is the top.
    pub height: u32,
    /// Side of a pixel in object space.
    pub pixel_m: f64,
    /// Centre of the image along the view's right and up.
    pub center_m: [f64; 2],
}

impl Framing {
    /// The smallest image of `width` by `height` square pixels, centred on the origin, that shows a
    /// whole rectangle of the given sides.
    pub fn fitted(width: u32, height: u32, sides_m: [f64; 2]) -> Framing {
        let pixel_m = (sides_m[0] / f64::from(width)).max(sides_m[1] / f64::from(height));
        Framing { width, height, pixel_m, center_m: [0.0; 2] }
    }

    /// Number of pixels in the image.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The point of the plane at `x`, `y` in pixels from the upper left corner; (0.5, 0.5) is the
    /// first pixel's centre.
    pub fn plane_from_pixel(&self, x: f64, y: f64) -> [f64; 2] {
        [
            self.center_m[0] + (x - 0.5 * f64::from(self.width)) * self.pixel_m,
            self.center_m[1] - (y - 0.5 * f64::from(self.height)) * self.pixel_m,
        ]
    }

    /// The start of an on-axis ray through the point at `x`, `y`, as for
    /// [`Framing::plane_from_pixel`].
    pub(crate) fn start_at(&self, x: f64, y: f64) -> Start {
        let at_m = self.plane_from_pixel(x, y);
        Start { position_m: at_m.map(|c| c as f32), tilt_rad: [0.0; 2] }
    }

    /// The centres of all pixels as starts of on-axis rays, row by row from the top.
    pub fn pixel_centers(&self) -> Vec<Start> {
        (0..self.height)
            .flat_map(|j| (0..self.width).map(move |i| (i, j)))
            .map(|(i, j)| self.start_at(f64::from(i) + 0.5, f64::from(j) + 0.5))
            .collect()
    }
}

/// Counts of the light by outcome, in photons (of [`photons`]) or triangles (of [`beams`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Tally {
    /// Sent from the source.
    pub sent: u64,
    /// Reached the plane of the film, inside or outside the image.
    pub landed: u64,
    /// Of those, inside the image.
    pub on_film: u64,
    /// Blocked by triangle meshes.
    pub blocked_by_solids: u64,
    /// Blocked inside the field by solid or blank cells.
    pub blocked_in_field: u64,
    /// Left sideways or backwards because they were bent too far.
    pub turned: u64,
    /// Left the march with a position or energy that is not finite. Always 0 unless there is a bug.
    pub not_a_number: u64,
}

impl Tally {
    pub(crate) fn add(&mut self, o: &Tally) {
        self.sent += o.sent;
        self.landed += o.landed;
        self.on_film += o.on_film;
        self.blocked_by_solids += o.blocked_by_solids;
        self.blocked_in_field += o.blocked_in_field;
        self.turned += o.turned;
        self.not_a_number += o.not_a_number;
    }
}

/// A picture, filtered.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Photograph<const C: usize> {
    /// Brightness of each pixel.
    pub(crate) pixels: Vec<[f32; C]>,
    /// Half the difference of the pictures of two halves of the photons, if it was wanted.
    pub(crate) noise: Option<Vec<[f32; C]>>,
    /// What became of the light.
    pub(crate) tally: Tally,
}

/// Sums of energy and photons per pixel. `C` is the number of channels: 1, or 3 for colours.
#[derive(Debug)]
pub struct Film<const C: usize> {
    framing: Framing,
    energy: Vec<AtomicU64>,
    count: Option<Vec<AtomicU32>>,
}

impl<const C: usize> Film<C> {
    /// Creates an unexposed film. With `counts` it also counts the photons of each pixel.
    pub fn new(framing: Framing, counts: bool) -> Film<C> {
        let energy = (0..framing.pixels() * C).map(|_| AtomicU64::new(0)).collect();
        let count = counts.then(|| (0..framing.pixels()).map(|_| AtomicU32::new(0)).collect());
        Film { framing, energy, count }
    }

    /// The part of the plane of focus that it shows.
    pub fn framing(&self) -> &Framing {
        &self.framing
    }

    /// Whether it counts photons.
    #[cfg(feature = "gpu")]
    pub(crate) fn has_counts(&self) -> bool {
        self.count.is_some()
    }

    /// Adds integer energy to a pixel. The sum of integers does not depend on their order.
    #[inline]
    pub(crate) fn add(&self, pixel: usize, energy: [u64; C], photons: u32) {
        for (c, e) in energy.into_iter().enumerate().filter(|(_, e)| *e > 0) {
            self.energy[pixel * C + c].fetch_add(e, Ordering::Relaxed);
        }
        if let Some(count) = self.count.as_ref().filter(|_| photons > 0) {
            count[pixel].fetch_add(photons, Ordering::Relaxed);
        }
    }

    /// Adds another film of the same framing.
    pub fn add_film(&self, other: &Film<C>) {
        for (a, b) in self.energy.iter().zip(&other.energy) {
            a.fetch_add(b.load(Ordering::Relaxed), Ordering::Relaxed);
        }
        for (a, b) in self.count.iter().flatten().zip(other.count.iter().flatten()) {
            a.fetch_add(b.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }

    /// The energy of each pixel divided by `per_pixel`, the number of photons that the undisturbed
    /// beam leaves in a pixel.
    pub fn to_pixels(&self, per_pixel: f64) -> Vec<[f32; C]> {
        let scale = 1.0 / (ONE * per_pixel);
        self.energy
            .chunks_exact(C)
            .map(|e| std::array::from_fn(|c| (e[c].load(Ordering::Relaxed) as f64 * scale) as f32))
            .collect()
    }

    /// Number of photons of each pixel, if they were counted.
    pub fn counts(&self) -> Option<Vec<u32>> {
        self.count.as_ref().map(|c| c.iter().map(|n| n.load(Ordering::Relaxed)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn row_0_is_the_top_and_the_larger_side_fills_the_frame() {
        let f = Framing::fitted(4, 2, [2.0, 0.5]);
        assert_eq!(f.pixel_m, 0.5);
        let starts = f.pixel_centers();
        assert_eq!(starts[0].position_m, [-0.75, 0.25]);
        assert_eq!(starts[7].position_m, [0.75, -0.25]);
        // A tall field in a wide frame is not cropped.
        assert_eq!(Framing::fitted(4, 2, [0.5, 2.0]).pixel_m, 1.0);
    }

    /// Paths that cancel while they trace.
    struct Cancelling<'a> {
        paths: crate::testing::ClosedForm,
        cancel: &'a AtomicBool,
        traced: std::sync::atomic::AtomicUsize,
    }

    impl LightPaths for Cancelling<'_> {
        fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
            self.traced.fetch_add(starts.len(), Ordering::Relaxed);
            self.cancel.store(true, Ordering::Relaxed);
            self.paths.trace(starts, exits);
        }

        fn view(&self) -> &crate::view::View {
            self.paths.view()
        }

        fn quantities(&self) -> crate::path::PathQuantities {
            self.paths.quantities()
        }

        fn difference_step_m(&self) -> f64 {
            self.paths.difference_step_m()
        }
    }

    #[test]
    fn a_cancelled_exposure_ends_within_a_tile() {
        let technique = crate::technique::Technique::Shadowgraph(crate::optics::Optics::DEFAULT);
        let framing = Framing::fitted(32, 32, [1.0, 1.0]);
        for by_photons in [true, false] {
            let cancel = AtomicBool::new(false);
            let prism = crate::testing::ClosedForm::prism([1e-4, 0.0]);
            let paths = Cancelling { paths: prism, cancel: &cancel, traced: 0.into() };
            let exposure = photons::Exposure {
                paths: &paths,
                technique: &technique,
                solids: None,
                sampling: rt_core::sampler::Sampling::Sobol,
                seed: 0,
                margin_px: 0,
                tilted_beams: false,
            };
            let film = Film::<1>::new(framing, false);
            let nothing = |_: u64| ();
            let is_none = if by_photons {
                let films = [film];
                photons::expose(&exposure, &films, 0..64, false, &cancel, &nothing).is_none()
            } else {
                beams::expose_beams(&exposure, &film, 16, &cancel, &nothing).is_none()
            };
            // One tile has 1024 rays in each of 64 passes, and a band of beams sixteen rows of 513.
            // Each thread may be within a call of 256.
            let traced = paths.traced.into_inner();
            let most = 256 * rayon::current_num_threads();
            assert!(is_none && traced > 0 && traced <= most, "{by_photons}: {traced}");
        }
    }

    #[test]
    fn energy_adds_up_exactly() {
        let film = Film::<1>::new(Framing::fitted(1, 1, [1.0, 1.0]), true);
        for _ in 0..1000 {
            film.add(0, [quantize(0.25)], 1);
        }
        film.add(0, [quantize(f32::NAN)], 0);
        assert_eq!(film.to_pixels(1000.0), [[0.25]]);
        assert_eq!(film.counts(), Some(vec![1000]));
    }
}
