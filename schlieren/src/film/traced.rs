//! Exposes a film with exits that were traced elsewhere: one at each corner of a pixel.

use super::beams::expose_beams;
use super::photons::Exposure;
use super::{Film, Framing, Tally};
use crate::path::{Exit, LightPaths, PathQuantities, Start};
use crate::technique::Technique;
use crate::view::View;
use rt_core::sampler::Sampling;
use std::sync::atomic::AtomicBool;

/// Number of corners of the pixels of a film.
pub fn corners(framing: &Framing) -> usize {
    (framing.width as usize + 1) * (framing.height as usize + 1)
}

/// The start of the ray through a corner: they are counted row by row from the upper left one.
pub fn start_of_corner(framing: &Framing, corner: usize) -> Start {
    let columns = framing.width as usize + 1;
    let (x, y) = ((corner % columns) as f64, (corner / columns) as f64);
    framing.start_at(x, y)
}

/// Exposes a film by beams, a cell for each pixel, with the exits of all corners. `None` if there
/// are not as many as corners.
pub fn expose_corners<const C: usize>(
    framing: Framing,
    view: View,
    technique: &Technique,
    exits: Vec<Exit>,
) -> Option<(Film<C>, Tally)> {
    if exits.len() != corners(&framing) {
        return None;
    }
    let paths = Corners { framing, view, exits };
    let exposure = Exposure {
        paths: &paths,
        technique,
        solids: None,
        sampling: Sampling::Sobol,
        seed: 0,
        margin_px: 0,
        tilted_beams: false,
    };
    let film = Film::new(framing, false);
    let tally = expose_beams(&exposure, &film, 1, &AtomicBool::new(false), &|_| ())?;
    Some((film, tally))
}

struct Corners {
    framing: Framing,
    view: View,
    exits: Vec<Exit>,
}

impl LightPaths for Corners {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        let Framing { width, height, pixel_m, center_m } = self.framing;
        for (start, exit) in starts.iter().zip(exits) {
            let [x, y] = start.position_m.map(f64::from);
            let column = (x - center_m[0]) / pixel_m + 0.5 * f64::from(width);
            let row = 0.5 * f64::from(height) - (y - center_m[1]) / pixel_m;
            let corner = row.round() as usize * (width as usize + 1) + column.round() as usize;
            debug_assert_eq!(start_of_corner(&self.framing, corner), *start);
            *exit = self.exits[corner];
        }
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn quantities(&self) -> PathQuantities {
        PathQuantities { opd: true }
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * self.framing.pixel_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutoff::{Cutoff, Knife, KnifePosition};
    use crate::optics::Optics;
    use crate::technique::schlieren::Schlieren;
    use crate::testing::{ClosedForm, beams_grey};

    #[test]
    fn a_film_of_traced_corners_is_that_of_beams() {
        let framing = Framing { width: 24, height: 17, pixel_m: 1e-3, center_m: [3e-4, -2e-3] };
        let blob = ClosedForm::gaussian(1e-7, 4e-3, 0.0);
        let position = KnifePosition::OpenFraction(0.5);
        let knife = Cutoff::Knife(Knife { angle_deg: 30.0, position });
        let shadow = Optics { focus_m: 1.0, ..Optics::DEFAULT };
        for technique in [
            Technique::Schlieren(Schlieren::new(Optics::DEFAULT, &knife, false)),
            Technique::Shadowgraph(shadow),
        ] {
            let expected = beams_grey(&technique, &blob, framing, 1);
            let exits = (0..corners(&framing)).map(|k| blob.exit(&start_of_corner(&framing, k)));
            let exits: Vec<Exit> = exits.collect();
            let wrong = exits[1..].to_vec();
            assert!(expose_corners::<1>(framing, *blob.view(), &technique, wrong).is_none());
            let (film, tally) =
                expose_corners::<1>(framing, *blob.view(), &technique, exits).expect("a film");
            let grey: Vec<f32> = film.to_pixels(1.0).iter().map(|p| p[0]).collect();
            assert_eq!(tally.sent, 2 * 24 * 17);
            // Those of beams have a margin around the film, whose light lands at the edge of it.
            let inner = |k: usize| (2..22).contains(&(k % 24)) && (2..15).contains(&(k / 24));
            let same = (0..grey.len()).filter(|&k| inner(k)).all(|k| grey[k] == expected[k]);
            assert!(same && grey.iter().any(|g| *g != grey[0]));
        }
    }
}
