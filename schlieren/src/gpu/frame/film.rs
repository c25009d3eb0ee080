//! The film on the device: its layout, and its way back.

use crate::film::{Film, Framing, Tally};
use rayon::prelude::*;

/// Outcomes that film.wgsl counts, in its order.
const OUTCOMES: usize = 7;

/// Where the sums of a film lie in its buffer, in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FilmLayout {
    pixels: usize,
    channels: usize,
    films: usize,
    counts: bool,
}

impl FilmLayout {
    pub(super) fn of<const C: usize>(films: &[Film<C>]) -> FilmLayout {
        FilmLayout {
            pixels: films[0].framing().pixels(),
            channels: C,
            films: films.len(),
            counts: films[0].has_counts(),
        }
    }

    /// The film of a picture that is filtered on the device; two films if its noise is wanted.
    pub(super) fn of_picture<const C: usize>(framing: &Framing, noise: bool) -> FilmLayout {
        let films = if noise { 2 } else { 1 };
        FilmLayout { pixels: framing.pixels(), channels: C, films, counts: false }
    }

    /// Bytes of a picture, or of its noise.
    pub(super) fn picture_bytes(&self) -> u64 {
        4 * (self.pixels * self.channels) as u64
    }

    /// Bytes of the outcomes, and where they begin.
    pub(super) fn outcome_bytes(&self) -> [u64; 2] {
        [4 * self.outcomes() as u64, 8 * OUTCOMES as u64]
    }

    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    pub(super) fn films(&self) -> usize {
        self.films
    }

    pub(super) fn has_counts(&self) -> bool {
        self.counts
    }

    /// First word of the counts of photons.
    pub(super) fn counts(&self) -> usize {
        2 * self.pixels * self.channels * self.films
    }

    /// First word of the outcomes.
    pub(super) fn outcomes(&self) -> usize {
        self.counts() + if self.counts { self.pixels } else { 0 }
    }

    /// Number of words.
    pub(super) fn words(&self) -> usize {
        self.outcomes() + 2 * OUTCOMES
    }
}

/// The sum in two words.
fn sum_of(words: &[u32], at: usize) -> u64 {
    u64::from(words[at]) | u64::from(words[at + 1]) << 32
}

/// Adds what came back to the films.
pub(super) fn add_to_films<const C: usize>(layout: FilmLayout, words: &[u32], films: &[Film<C>]) {
    let sum = |at: usize| sum_of(words, at);
    for (f, film) in films.iter().enumerate() {
        for pixel in 0..layout.pixels {
            let at = 2 * C * (f * layout.pixels + pixel);
            // Which film has counted a photon does not matter: both are added in the end.
            let counted = f == 0 && layout.counts;
            let photons = if counted { words[layout.counts() + pixel] } else { 0 };
            film.add(pixel, std::array::from_fn(|c| sum(at + 2 * c)), photons);
        }
    }
}

/// The pictures that came back, one after the other: the picture itself, and its noise.
pub(super) fn pictures<const C: usize>(words: &[u32]) -> Vec<[f32; C]> {
    let (pixels, _) = words.split_at(words.len() - 2 * OUTCOMES);
    let pixel = |p: &[u32]| std::array::from_fn(|c| f32::from_bits(p[c]));
    pixels.par_chunks_exact(C).with_min_len(1 << 13).map(pixel).collect()
}

/// Counts of outcomes but [`Tally::sent`], and the number of steps: the last of what came back.
pub(super) fn outcomes(words: &[u32]) -> (Tally, u64) {
    let first = words.len() - 2 * OUTCOMES;
    let [stopped, not_a_number, landed, on_film, steps, blocked_by_solids, turned] =
        [0, 1, 2, 3, 4, 5, 6].map(|i| sum_of(words, first + 2 * i));
    let tally = Tally {
        blocked_in_field: stopped,
        blocked_by_solids,
        turned,
        not_a_number,
        landed,
        on_film,
        ..Tally::default()
    };
    (tally, steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Framing;

    #[test]
    fn words_come_back_to_their_pixels() {
        let framing = Framing::fitted(2, 1, [1.0, 1.0]);
        let films = [Film::<1>::new(framing, true), Film::<1>::new(framing, true)];
        let layout = FilmLayout::of(&films);
        assert_eq!((layout.counts(), layout.outcomes(), layout.words()), (8, 10, 24));
        // Energies 1 and 2.5, then 1/2 and 0; 7 and 8 photons; 2^32 steps.
        let half = 1 << 31;
        let mut words = vec![0, 1, half, 2, half, 0, 0, 0, 7, 8];
        words.extend([1, 0, 2, 0, 3, 0, 4, 0, 0, 1, 5, 0, 6, 0]);
        add_to_films(layout, &words, &films);
        let (tally, steps) = outcomes(&words);
        assert_eq!(films[0].to_pixels(1.0), [[1.0], [2.5]]);
        assert_eq!(films[1].to_pixels(1.0), [[0.5], [0.0]]);
        assert_eq!(films[0].counts(), Some(vec![7, 8]));
        let found = [tally.blocked_in_field, tally.not_a_number, tally.landed, tally.on_film];
        assert_eq!((found, steps), ([1, 2, 3, 4], 1 << 32));
        assert_eq!((tally.blocked_by_solids, tally.turned), (5, 6));
    }
}
