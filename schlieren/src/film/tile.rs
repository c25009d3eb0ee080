//! Sums photons over a tile of the film, on one thread and without atomics.

use super::{Film, quantize};

/// Side of a tile of starts, in pixels.
pub(crate) const TILE: u32 = 32;

/// Width of the border around a tile, in pixels. Photons that land farther out go to the film
/// individually.
const HALO: i64 = 8;

/// Side of the local sums in pixels.
const SIDE: usize = TILE as usize + 2 * HALO as usize;

/// Sums over a tile of the film and its border. [`PhotonTile::flush`] adds them to the film.
pub(crate) struct PhotonTile<'a, const C: usize> {
    film: &'a Film<C>,
    counts: bool,
    /// Pixel of the film at the local sums' upper left corner.
    corner: [i64; 2],
    energy: Vec<[u64; C]>,
    count: Vec<u32>,
}

impl<'a, const C: usize> PhotonTile<'a, C> {
    /// Creates a tile for photons that start in the tile with the upper left pixel (`x`, `y`).
    pub(crate) fn new(film: &'a Film<C>, [x, y]: [i64; 2]) -> Self {
        let counts = film.count.is_some();
        let count = if counts { vec![0; SIDE * SIDE] } else { Vec::new() };
        PhotonTile {
            film,
            counts,
            corner: [x - HALO, y - HALO],
            energy: vec![[0; C]; SIDE * SIDE],
            count,
        }
    }

    /// Adds a photon at a position in pixels. Returns whether it lands on the film.
    #[inline]
    pub(crate) fn deposit(&mut self, [x, y]: [f32; 2], energy: [f32; C]) -> bool {
        let (i, j) = (x.floor() as i64, y.floor() as i64);
        let framing = self.film.framing();
        if i < 0 || j < 0 || i >= i64::from(framing.width) || j >= i64::from(framing.height) {
            return false;
        }
        let energy = energy.map(quantize);
        let (a, b) = (i - self.corner[0], j - self.corner[1]);
        if (0..SIDE as i64).contains(&a) && (0..SIDE as i64).contains(&b) {
            let at = b as usize * SIDE + a as usize;
            for c in 0..C {
                self.energy[at][c] += energy[c];
            }
            if self.counts {
                self.count[at] += 1;
            }
        } else {
            self.film.add(j as usize * framing.width as usize + i as usize, energy, 1);
        }
        true
    }

    /// Adds the sums to the film.
    pub(crate) fn flush(self) {
        let framing = self.film.framing();
        for b in 0..SIDE {
            for a in 0..SIDE {
                let (i, j) = (self.corner[0] + a as i64, self.corner[1] + b as i64);
                let at = b * SIDE + a;
                let photons = if self.counts { self.count[at] } else { 0 };
                // Pixels outside the film have no deposit.
                if self.energy[at] != [0; C] || photons > 0 {
                    self.film.add(
                        j as usize * framing.width as usize + i as usize,
                        self.energy[at],
                        photons,
                    );
                }
            }
        }
    }
}
