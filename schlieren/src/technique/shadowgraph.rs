//! Shadowgraph: without a cut-off, light lands where it is deflected to, and the film is bright
//! where light concentrates.
//!
//! Behind a thin flow with deflections u(x), a film at the distance D has the intensity `I(x + D u)
//! = 1/|det(1 + D ∇u)|`, summed over all x that land at the same point. For weak flows `I - 1 = -D
//! ∇·u`, the Laplacian of the optical path. When D reaches the shortest focal length of the flow,
//! the determinant vanishes: a caustic.
//!
//! This module only has tests. The energy of [`crate::technique::Technique::Shadowgraph`] is 1, and
//! the film does the work: [`crate::film::photons`] as in the dissertation, with noise, or
//! [`crate::film::beams`] without noise.

#[cfg(test)]
mod tests {
    use crate::film::Framing;
    use crate::optics::Optics;
    use crate::technique::Technique;
    use crate::testing::{ClosedForm, beams_grey, expose_grey};

    const FRAMING: Framing = Framing { width: 96, height: 96, pixel_m: 0.5e-3, center_m: [0.0; 2] };
    const SIGMA: f64 = 6e-3;

    fn at(distance_m: f64) -> Technique {
        Technique::Shadowgraph(Optics { focus_m: distance_m, ..Optics::DEFAULT })
    }

    /// `I = 1/|det(1 + D ∇u)|` of a radial deflection u(r) = -(opd/σ²) r, opd = A exp(-r²/2σ²), at
    /// r + D u(r).
    fn closed_form(amplitude_m: f64, distance_m: f64, landing_r: f64) -> f64 {
        let opd = |r: f64| amplitude_m * (-0.5 * (r / SIGMA).powi(2)).exp();
        let u = |r: f64| -r / (SIGMA * SIGMA) * opd(r);
        let du = |r: f64| (r * r / (SIGMA * SIGMA) - 1.0) / (SIGMA * SIGMA) * opd(r);
        // Without a caustic, landing points are in the order of their starts, so bisection finds
        // the start.
        let (mut low, mut high) = (0.0, 2.0 * landing_r + 1e-6);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if middle + distance_m * u(middle) < landing_r { low = middle } else { high = middle }
        }
        let tangential = if low > 1e-9 { u(low) / low } else { du(0.0) };
        1.0 / ((1.0 + distance_m * du(low)) * (1.0 + distance_m * tangential)).abs()
    }

    #[test]
    fn beams_equal_the_inverse_determinant_without_noise() {
        // Weak (1e-3 of contrast) to strong (the middle 4 times as bright).
        for (amplitude_m, distance_m) in [(2e-8, 1.0), (2e-6, 1.0), (1.8e-5, 1.0), (-1.8e-5, 1.0)] {
            let blob = ClosedForm::gaussian(amplitude_m, SIGMA, 0.0);
            let film = beams_grey(&at(distance_m), &blob, FRAMING, 1);
            let (mut worst, mut contrast) = (0.0f64, 0.0f64);
            for (i, s) in FRAMING.pixel_centers().iter().enumerate() {
                let r = f64::from(s.position_m[0]).hypot(f64::from(s.position_m[1]));
                let expected = closed_form(amplitude_m, distance_m, r);
                worst = worst.max((f64::from(film[i]) - expected).abs());
                contrast = contrast.max((expected - 1.0).abs());
            }
            // The error is of second order in pixel/σ = 1/12, in the image and in the cell: 0.7 %
            // each, and more where the middle contracts.
            assert!(worst < 0.02 * contrast, "{amplitude_m}: {worst} of {contrast}");
        }
    }

    #[test]
    fn photons_converge_to_the_beams() {
        let blob = ClosedForm::gaussian(1.8e-5, SIGMA, 0.0);
        let reference = beams_grey(&at(1.0), &blob, FRAMING, 2);
        let rms = |samples| {
            let film = expose_grey(&at(1.0), &blob, FRAMING, samples);
            let sum: f64 = film.iter().zip(&reference).map(|(a, b)| f64::from(a - b).powi(2)).sum();
            (sum / film.len() as f64).sqrt()
        };
        let (few, many) = (rms(4), rms(64));
        // The error of independent photons would fall by a factor of 4; a low-discrepancy sequence
        // through a smooth map does better.
        assert!(many < few / 5.0 && many < 0.02, "{few} {many}");
    }

    #[test]
    fn energy_is_conserved_through_a_caustic() {
        // Beyond the focal length the rays have crossed, but no light is lost.
        let blob = ClosedForm::gaussian(1.2e-4, SIGMA / 2.0, 0.0);
        for film in
            [beams_grey(&at(1.0), &blob, FRAMING, 1), expose_grey(&at(1.0), &blob, FRAMING, 16)]
        {
            let mean = film.iter().map(|v| f64::from(*v)).sum::<f64>() / film.len() as f64;
            let brightest = film.iter().copied().fold(0.0f32, f32::max);
            assert!((mean - 1.0).abs() < 2e-3 && brightest > 3.0, "{mean} {brightest}");
        }
    }

    #[test]
    fn focused_into_the_flow_there_is_no_shadowgraph() {
        let blob = ClosedForm::gaussian(1.8e-5, SIGMA, 0.1);
        let film = beams_grey(&at(0.1), &blob, FRAMING, 1);
        assert!(film.iter().all(|v| (v - 1.0).abs() < 1e-5));
    }
}
