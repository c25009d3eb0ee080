//! Interferograms: superposes the test beam and a reference beam of the same light on one film.
//!
//! With the optical path difference δ the phase is φ = 2π δ/λ. Two beams of equal strength give the
//! intensity `I = (1 + V cos φ)/2` with the visibility V ≤ 1: bright where nothing is disturbed,
//! and never negative. (Equation 5.17 of the dissertation has `sin φ`, which is negative for half
//! of the phases and grey where nothing is disturbed.)
//!
//! *Infinite fringe*: the reference beam is parallel, and fringes are contours of δ. *Finite
//! fringe*: the reference beam is inclined. Without flow there are straight fringes at the distance
//! χ, which the flow bends (equation 5.1): φ grows by 2π/χ along their direction.

use super::Photon;
use crate::optics::Optics;

/// An interferometer.
#[derive(Debug, Clone, Copy)]
pub struct Interferogram {
    pub(super) optics: Optics,
    pub(crate) waves_per_m: f64,
    pub(crate) visibility: f32,
    /// Fringes per metre along right and up; zero for the infinite fringe.
    pub(crate) carrier_per_m: [f64; 2],
    n0: f32,
}

/// The straight fringes of an inclined reference beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fringes {
    /// χ: the distance from one bright line to the next, in object space.
    pub spacing_m: f64,
    /// Direction across the lines, counter-clockwise from the image's right.
    pub angle_deg: f64,
}

impl Interferogram {
    /// An interferometer with light of the vacuum wavelength `wavelength_m` and the visibility
    /// `visibility` (0..=1). `fringes` is `None` for the infinite fringe. `n0` is the index outside
    /// the flow.
    pub fn new(
        optics: Optics,
        wavelength_m: f64,
        visibility: f64,
        fringes: Option<Fringes>,
        n0: f64,
    ) -> Interferogram {
        let carrier = |f: Fringes| {
            let (sin, cos) = f.angle_deg.to_radians().sin_cos();
            [cos / f.spacing_m, sin / f.spacing_m]
        };
        Interferogram {
            optics,
            waves_per_m: 1.0 / wavelength_m,
            visibility: visibility as f32,
            carrier_per_m: fringes.map_or([0.0; 2], carrier),
            n0: n0 as f32,
        }
    }

    /// The phase in waves (φ/2π) where the photon lands.
    #[inline]
    pub fn waves(&self, photon: &Photon<'_>) -> f64 {
        let path_m = self.optics.film_path_difference_m(photon.exit, self.n0);
        let at =
            [0, 1].map(|i| f64::from(photon.start.position_m[i]) + f64::from(photon.shift_m[i]));
        f64::from(path_m) * self.waves_per_m
            + at[0] * self.carrier_per_m[0]
            + at[1] * self.carrier_per_m[1]
    }

    #[inline]
    pub(super) fn energy(&self, photon: &Photon<'_>) -> f32 {
        0.5 + 0.5 * self.visibility * self.cos_phase(photon)
    }

    /// The energy when the fraction T = `left` of the object beam remains: `I = (1 + T + 2 √T V cos
    /// φ)/4`.
    #[inline]
    pub(super) fn dimmed(&self, photon: &Photon<'_>, left: f32) -> f32 {
        0.25 * (1.0 + left) + 0.5 * left.sqrt() * self.visibility * self.cos_phase(photon)
    }

    #[inline]
    fn cos_phase(&self, photon: &Photon<'_>) -> f32 {
        // Whole waves are subtracted in f64; the rest is accurate enough in f32.
        let waves = self.waves(photon);
        let rest = (waves - waves.round()) as f32;
        (std::f32::consts::TAU * rest).cos()
    }
}

/// Number of pairs of neighbouring pixels whose phases differ by more than half a wave. The image
/// cannot resolve the fringes there, and they turn grey. `waves` holds the phases in waves, row by
/// row.
pub fn unresolved_pairs(waves: &[f32], width: usize) -> usize {
    let steep = |a: f32, b: f32| usize::from((a - b).abs() > 0.5);
    let in_rows = waves.chunks_exact(width).flat_map(|r| r.windows(2)).map(|w| steep(w[0], w[1]));
    let in_columns = waves.iter().zip(waves.iter().skip(width)).map(|(a, b)| steep(*a, *b));
    in_rows.chain(in_columns).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Framing;
    use crate::technique::Technique;
    use crate::testing::{ClosedForm, expose_grey};

    const FRAMING: Framing = Framing { width: 200, height: 4, pixel_m: 1e-3, center_m: [0.0; 2] };
    const WAVELENGTH: f64 = 633e-9;

    fn image(paths: &ClosedForm, visibility: f64, fringes: Option<Fringes>) -> Vec<f32> {
        let i = Interferogram::new(Optics::DEFAULT, WAVELENGTH, visibility, fringes, 1.0);
        expose_grey(&Technique::Interferogram(i), paths, FRAMING, 16)
    }

    /// Number of bright lines: upward crossings of the mean level along the first row.
    fn fringes_in(film: &[f32]) -> usize {
        film[..200].windows(2).filter(|w| w[0] < 0.5 && w[1] >= 0.5).count()
    }

    #[test]
    fn a_phase_ramp_shows_its_number_of_fringes() {
        // Over the 0.2 m of the image, the path grows by 12.5 waves.
        let wedge = ClosedForm::path_ramp(12.5 * WAVELENGTH / 0.2);
        let film = image(&wedge, 1.0, None);
        assert!((12..=13).contains(&fringes_in(&film)), "{}", fringes_in(&film));
        let (low, high) = film.iter().fold((1.0f32, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low < 0.02 && high > 0.98, "full range: {low} {high}");
    }

    #[test]
    fn nothing_is_bright_and_visibility_limits_the_range() {
        assert!(
            image(&ClosedForm::prism([0.0; 2]), 1.0, None).iter().all(|v| (v - 1.0).abs() < 1e-6)
        );
        let half = ClosedForm::path_ramp(10.0 * WAVELENGTH / 0.2);
        let film = image(&half, 0.5, None);
        let (low, high) = film.iter().fold((1.0f32, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!((low - 0.25).abs() < 0.01 && (high - 0.75).abs() < 0.01, "{low} {high}");
    }

    #[test]
    fn finite_fringes_are_shifted_by_the_flow() {
        let fringes = Some(Fringes { spacing_m: 0.02, angle_deg: 0.0 });
        let still = image(&ClosedForm::prism([0.0; 2]), 1.0, fringes);
        assert!((9..=10).contains(&fringes_in(&still)), "0.2 m / 0.02 m");
        // A shift of half a wave everywhere exchanges bright and dark.
        let moved = image(&ClosedForm::constant_path(0.5 * WAVELENGTH), 1.0, fringes);
        for (a, b) in still.iter().zip(&moved) {
            assert!((a + b - 1.0).abs() < 2e-3, "{a} {b}");
        }
        // Horizontal fringes are constant along rows.
        let across = image(
            &ClosedForm::prism([0.0; 2]),
            1.0,
            Some(Fringes { spacing_m: 0.02, angle_deg: 90.0 }),
        );
        assert!(across[..200].windows(2).all(|w| (w[0] - w[1]).abs() < 0.2));
    }

    #[test]
    fn a_gaussian_blob_shows_contours_of_its_closed_form() {
        let framing = Framing { width: 64, height: 64, pixel_m: 0.5e-3, center_m: [0.0; 2] };
        let blob = ClosedForm::gaussian(3.2 * WAVELENGTH, 6e-3, 0.0);
        let i = Interferogram::new(Optics::DEFAULT, WAVELENGTH, 1.0, None, 1.0);
        let film = expose_grey(&Technique::Interferogram(i), &blob, framing, 64);
        let mut worst = 0.0f64;
        for (k, s) in framing.pixel_centers().iter().enumerate() {
            let waves = f64::from(blob.exit(s).opd_m) / WAVELENGTH;
            let expected = 0.5 + 0.5 * (std::f64::consts::TAU * waves).cos();
            worst = worst.max((f64::from(film[k]) - expected).abs());
        }
        // The steepest phase is 3.2 waves e^(-1/2)/σ · pixel = 0.16 waves over a pixel. The mean of
        // a cosine over it is lower by (π 0.16)²/6 = 4 %, half of that in I.
        assert!(worst < 0.04, "{worst}");
    }

    #[test]
    fn thousands_of_waves_keep_their_phase() {
        let i = Interferogram::new(Optics::DEFAULT, WAVELENGTH, 1.0, None, 1.0);
        let exit = crate::path::Exit {
            opd_m: (3000.25 * WAVELENGTH) as f32,
            ..crate::path::Exit::UNDISTURBED
        };
        let start = crate::path::Start::default();
        let waves = i.waves(&Photon {
            start: &start,
            exit: &exit,
            image_point_m: [0.0; 2],
            shift_m: [0.0; 2],
        });
        // The rounding of the f32 path itself is 1e-4 waves there.
        assert!((waves - 3000.25).abs() < 2e-4, "{waves}");
    }

    #[test]
    fn fringes_finer_than_pixels_are_counted() {
        assert_eq!(unresolved_pairs(&[0.0, 0.4, 0.8, 0.0, 0.4, 1.4], 3), 2);
    }
}
