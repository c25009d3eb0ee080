//! The film: energy per pixel, summed as integers, so that the picture has the same bits for any
//! number of threads.
//!
//! Light arrives in one of two ways. [`photons`] start at jittered places and land somewhere: a
//! picture with noise, correct for any source and any cut-off. [`beams`] are the cells of a lattice
//! of rays, each carrying its energy to the area that its corners enclose: no noise at all, one ray
//! per pixel.
//!
//! Energy 1 per pixel is what the undisturbed beam without a cut-off leaves there.

pub mod beams;
pub mod photons;
mod tile;

pub(crate) use tile::{PhotonTile, TILE};

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Fixed point: an energy of 1 as an integer. A pixel holds 2³² photons of energy 1 before it
/// overflows; quantisation, 2⁻³³ a photon, is far below the rounding of the f32 energy itself.
const ONE: f64 = 4_294_967_296.0;

/// Energy as an integer. Energies are never negative, and NaN (a march gone wrong) leaves no light;
/// it is counted where it is seen.
#[inline]
pub(crate) fn quantize(energy: f32) -> u64 {
    (f64::from(energy) * ONE) as u64
}

/// What part of the plane of focus the film shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// Pixels per row.
    pub width: u32,
    /// Rows; row 0 is the uppermost.
    pub height: u32,
    /// Side of a pixel, in object space.
    pub pixel_m: f64,
    /// Middle of the picture along the view's right and up.
    pub center_m: [f64; 2],
}

impl Framing {
    /// A picture centred on something of the given sides that shows all of it and as little else as
    /// its shape allows.
    pub fn fitted(width: u32, height: u32, sides_m: [f64; 2]) -> Framing {
        let pixel_m = (sides_m[0] / f64::from(width)).max(sides_m[1] / f64::from(height));
        Framing { width, height, pixel_m, center_m: [0.0; 2] }
    }

    /// Pixels in the picture.
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

    /// The centres of all pixels as starts of on-axis rays, row by row from the top.
    pub fn pixel_centers(&self) -> Vec<crate::path::Start> {
        let center = |i: u32, j: u32| self.plane_from_pixel(f64::from(i) + 0.5, f64::from(j) + 0.5);
        (0..self.height)
            .flat_map(|j| (0..self.width).map(move |i| (i, j)))
            .map(|(i, j)| crate::path::Start {
                position_m: center(i, j).map(|c| c as f32),
                tilt_rad: [0.0; 2],
            })
            .collect()
    }
}

/// What became of the light, in photons (of [`photons`]) or triangles (of [`beams`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Tally {
    /// Sent from the source.
    pub sent: u64,
    /// Reached the plane of the film, inside the picture or beside it.
    pub landed: u64,
    /// Of those, on the picture.
    pub on_film: u64,
    /// Stopped by triangle meshes.
    pub blocked_by_solids: u64,
    /// Stopped inside the field: solid or blank cells.
    pub blocked_in_field: u64,
    /// Bent so far that they left sideways or backwards.
    pub turned: u64,
    /// Came back from the march with a position or energy that is not a number. 0 unless something
    /// is broken.
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

/// Sums of energy and photons. `C` channels: 1, or 3 for colours.
#[derive(Debug)]
pub struct Film<const C: usize> {
    framing: Framing,
    energy: Vec<AtomicU64>,
    count: Option<Vec<AtomicU32>>,
}

impl<const C: usize> Film<C> {
    /// An unexposed film; with `counts` it also counts the photons of each pixel.
    pub fn new(framing: Framing, counts: bool) -> Film<C> {
        let energy = (0..framing.pixels() * C).map(|_| AtomicU64::new(0)).collect();
        let count = counts.then(|| (0..framing.pixels()).map(|_| AtomicU32::new(0)).collect());
        Film { framing, energy, count }
    }

    /// What it shows.
    pub fn framing(&self) -> &Framing {
        &self.framing
    }

    /// Adds integer energy to a pixel. Integers add up to the same in any order.
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

    /// The energy of each pixel over `per_pixel`, the number of photons that the undisturbed beam
    /// leaves in one.
    pub fn developed(&self, per_pixel: f64) -> Vec<[f32; C]> {
        let scale = 1.0 / (ONE * per_pixel);
        self.energy
            .chunks_exact(C)
            .map(|e| std::array::from_fn(|c| (e[c].load(Ordering::Relaxed) as f64 * scale) as f32))
            .collect()
    }

    /// Photons of each pixel, when they were counted.
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

    #[test]
    fn energy_adds_up_exactly() {
        let film = Film::<1>::new(Framing::fitted(1, 1, [1.0, 1.0]), true);
        for _ in 0..1000 {
            film.add(0, [quantize(0.25)], 1);
        }
        film.add(0, [quantize(f32::NAN)], 0);
        assert_eq!(film.developed(1000.0), [[0.25]]);
        assert_eq!(film.counts(), Some(vec![1000]));
    }
}
