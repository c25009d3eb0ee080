//! The film on the device: its layout, and its way back.

use crate::film::{Film, Tally};

/// Outcomes that film.wgsl counts, in its order.
const OUTCOMES: usize = 6;

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

/// Adds what came back to the films. Returns the counts of outcomes but [`Tally::sent`], and the
/// number of steps.
pub(super) fn add_to_films<const C: usize>(
    layout: FilmLayout,
    words: &[u32],
    films: &[Film<C>],
) -> (Tally, u64) {
    let sum = |at: usize| u64::from(words[at]) | u64::from(words[at + 1]) << 32;
    for (f, film) in films.iter().enumerate() {
        for pixel in 0..layout.pixels {
            let at = 2 * C * (f * layout.pixels + pixel);
            // Which film has counted a photon does not matter: both are added in the end.
            let counted = f == 0 && layout.counts;
            let photons = if counted { words[layout.counts() + pixel] } else { 0 };
            film.add(pixel, std::array::from_fn(|c| sum(at + 2 * c)), photons);
        }
    }
    let [stopped, not_a_number, landed, on_film, steps, blocked_by_solids] =
        [0, 1, 2, 3, 4, 5].map(|i| sum(layout.outcomes() + 2 * i));
    let tally = Tally {
        blocked_in_field: stopped,
        blocked_by_solids,
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
        assert_eq!((layout.counts(), layout.outcomes(), layout.words()), (8, 10, 22));
        // Energies 1 and 2.5, then 1/2 and 0; 7 and 8 photons; 2^32 steps.
        let half = 1 << 31;
        let mut words = vec![0, 1, half, 2, half, 0, 0, 0, 7, 8];
        words.extend([1, 0, 2, 0, 3, 0, 4, 0, 0, 1, 5, 0]);
        let (tally, steps) = add_to_films(layout, &words, &films);
        assert_eq!(films[0].to_pixels(1.0), [[1.0], [2.5]]);
        assert_eq!(films[1].to_pixels(1.0), [[0.5], [0.0]]);
        assert_eq!(films[0].counts(), Some(vec![7, 8]));
        let found = [tally.blocked_in_field, tally.not_a_number, tally.landed, tally.on_film];
        assert_eq!((found, steps, tally.blocked_by_solids), ([1, 2, 3, 4], 1 << 32, 5));
    }
}
