//! Schlieren: filters light in the cut-off plane, where its position depends on its deflection.

use super::Photon;
use crate::cutoff::{Cutoff, CutoffPlane, Rgb};
use crate::optics::Optics;

/// A schlieren set-up.
#[derive(Debug, Clone)]
pub struct Schlieren {
    pub(super) optics: Optics,
    plane: CutoffPlane,
    colored: bool,
    sampled: bool,
    /// Contribution of this light's wavelength to each channel of the filter; `None` for white
    /// light without dispersion.
    band: Option<Rgb>,
}

impl Schlieren {
    /// A set-up with `cutoff` in the bench. With `sample_source` every photon has its own point of
    /// the source, even if a closed form averages over the source. Tilted beams need this, because
    /// light of each source point takes another path through the flow.
    pub fn new(optics: Optics, cutoff: &Cutoff, sample_source: bool) -> Schlieren {
        let plane = CutoffPlane::new(cutoff, optics.source_image());
        let sampled = sample_source || !plane.has_closed_form();
        Schlieren { optics, plane, colored: cutoff.is_colored(), sampled, band: None }
    }

    /// Restricts the light to one wavelength of several: a coloured filter then passes `band ·
    /// rgb`, and the image at this wavelength is grey.
    pub fn with_band(self, band: Rgb) -> Schlieren {
        Schlieren { band: Some(band), ..self }
    }

    pub(crate) fn samples_the_source(&self) -> bool {
        self.sampled
    }

    /// The cut-off plane.
    #[cfg(feature = "gpu")]
    pub(crate) fn plane(&self) -> &CutoffPlane {
        &self.plane
    }

    /// What this light's wavelength contributes to each channel of the filter.
    #[cfg(feature = "gpu")]
    pub(crate) fn band(&self) -> Option<Rgb> {
        self.band
    }

    pub(super) fn is_colored(&self) -> bool {
        self.colored && self.band.is_none()
    }

    #[inline]
    pub(super) fn energy(&self, photon: &Photon<'_>) -> Rgb {
        let at_m = self.optics.cutoff_point_m(photon.image_point_m, photon.exit);
        let closed_form = if self.sampled { None } else { self.plane.averaged(at_m) };
        self.seen(closed_form.unwrap_or_else(|| self.plane.transmission(at_m)))
    }

    /// Transmission of a filter colour for this light's wavelength.
    #[inline]
    fn seen(&self, rgb: Rgb) -> Rgb {
        match self.band {
            Some(band) => [band[0] * rgb[0] + band[1] * rgb[1] + band[2] * rgb[2]; 3],
            None => rgb,
        }
    }

    /// The cut-off's mean transmission over a round stop in its plane, sampled at the centres of a
    /// million squares.
    pub(super) fn passes_evenly(&self, stop_m: f64) -> Rgb {
        const SIDE: u32 = 1024;
        let position = |i: u32| ((f64::from(i) + 0.5) / f64::from(SIDE) - 0.5) * stop_m;
        let (mut sum, mut squares) = ([0.0f64; 3], 0u32);
        for j in 0..SIDE {
            for i in 0..SIDE {
                let at_m = [position(i), position(j)];
                if at_m[0].hypot(at_m[1]) <= 0.5 * stop_m {
                    let rgb = self.seen(self.plane.transmission(at_m.map(|c| c as f32)));
                    (0..3).for_each(|c| sum[c] += f64::from(rgb[c]));
                    squares += 1;
                }
            }
        }
        sum.map(|s| (s / f64::from(squares)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutoff::{ColorWheel, Knife, KnifePosition};
    use crate::testing::{ClosedForm, expose_grey, expose_rgb};
    use crate::{film::Framing, technique::Technique};

    const FRAMING: Framing = Framing { width: 24, height: 16, pixel_m: 1e-3, center_m: [0.0; 2] };
    const HALF_OPEN: KnifePosition = KnifePosition::OpenFraction(0.5);

    #[test]
    fn a_prism_of_known_deflection_has_the_known_grey_level() {
        // f2 = 1.5 m, half of a 1 mm slit open: I = 1/2 + 1.5 ε / 1 mm.
        let prism = ClosedForm::prism([1e-4, 5e-5]);
        // Along the 5 mm of the slit's length the same shift changes the level by a fifth as much.
        for (angle_deg, expected) in [(0.0, 0.65), (90.0, 0.515), (180.0, 0.35), (-90.0, 0.485)] {
            let cutoff = Cutoff::Knife(Knife { angle_deg, position: HALF_OPEN });
            for sampled in [false, true] {
                let s = Schlieren::new(Optics::DEFAULT, &cutoff, sampled);
                let film = expose_grey(&Technique::Schlieren(s), &prism, FRAMING, 64);
                let middle = film[8 * 24 + 12];
                let expected: f32 = expected;
                // Closed form: rounding. Sampled: 64 points of a (0,2)-sequence on a straight edge.
                let tolerance = if sampled { 2.0 / 64.0 } else { 2e-6 };
                assert!(
                    (middle - expected).abs() < tolerance,
                    "{angle_deg} {sampled}: {middle} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_gaussian_blob_is_its_gradient_in_grey_levels() {
        let blob = ClosedForm::gaussian(1e-7, 4e-3, 0.0);
        let cutoff = Cutoff::Knife(Knife { angle_deg: 0.0, position: HALF_OPEN });
        let s = Schlieren::new(Optics::DEFAULT, &cutoff, false);
        let film = expose_grey(&Technique::Schlieren(s), &blob, FRAMING, 64);
        let (mut worst, mut contrast) = (0.0f32, 0.0f32);
        for (i, start) in FRAMING.pixel_centers().iter().enumerate() {
            let expected = 0.5 + 1.5 / 1e-3 * blob.exit(start).deflection_rad[0];
            worst = worst.max((film[i] - expected).abs());
            contrast = contrast.max((expected - 0.5).abs());
        }
        // The pixel's mean differs from its centre by h²/24 of the second derivative (h = σ/4),
        // which is 0.3 % of the contrast.
        assert!(contrast > 0.02 && worst < 0.01 * contrast, "{worst} of {contrast}");
    }

    #[test]
    fn the_color_filter_paints_directions() {
        let cutoff = Cutoff::Color(ColorWheel { radius_m: 1e-3, red_deg: 0.0 });
        let optics = Optics { source: crate::optics::SourceShape::Point, ..Optics::DEFAULT };
        for (deflection, strongest) in
            [([3e-4, 0.0], 0), ([-1.5e-4, 2.6e-4], 1), ([-1.5e-4, -2.6e-4], 2)]
        {
            let technique = Technique::Schlieren(Schlieren::new(optics, &cutoff, false));
            assert!(technique.is_colored() && !technique.needs_source_points());
            let film = expose_rgb(&technique, &ClosedForm::prism(deflection), FRAMING, 4);
            let c = film[8 * 24 + 12];
            assert!(
                (c[strongest] - 1.0).abs() < 0.01 && c[(strongest + 1) % 3] < 0.6,
                "{deflection:?}: {c:?}"
            );
        }
    }
}
