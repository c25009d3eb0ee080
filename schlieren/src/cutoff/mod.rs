//! Describes the cut-off: the transmission of the cut-off plane at each of its points.
//!
//! | kind | passes | dissertation |
//! |---|---|---|
//! | [`Knife`] | one side of an edge at any angle | 5.3.4, equation 5.12 |
//! | [`Aperture`] | the inside of a circle (bright field), or the outside, the complemented circle (dark field) | 5.3.4 |
//! | [`ColorWheel`] | all light, coloured by direction and size of the deflection | equation 5.16 |
//! | [`FilterImage`] | what an image in the plane transmits: a file, or one [painted] by hand | 5.6 |
//!
//! Coordinates are metres in the plane, along the image's right and up. Transmission is linear and
//! at most 1 in each channel.

mod circle;
mod color;
mod image;
pub(crate) mod knife;
pub mod painted;

pub use circle::{Aperture, Passes};
pub use color::ColorWheel;
pub use image::{FilterError, FilterImage};
pub use knife::{Knife, KnifePosition};

use crate::optics::{PlaneVector, SourceImage};

/// Linear red, green, blue.
pub type Rgb = [f32; 3];

/// Transmission of the cut-off plane.
#[derive(Debug, Clone, PartialEq)]
pub enum Cutoff {
    /// No cut-off.
    Open,
    /// A knife's edge.
    Knife(Knife),
    /// A circle or its complement.
    Aperture(Aperture),
    /// A colour wheel.
    Color(ColorWheel),
    /// A filter given as an image.
    Image(FilterImage),
}

impl Cutoff {
    /// Whether the three channels can differ.
    pub fn is_colored(&self) -> bool {
        match self {
            Cutoff::Color(_) => true,
            Cutoff::Image(i) => i.is_colored(),
            _ => false,
        }
    }

    /// The cut-off's name in reports and on command lines.
    pub fn name(&self) -> &'static str {
        match self {
            Cutoff::Open => "open",
            Cutoff::Knife(_) => "knife",
            Cutoff::Aperture(a) => a.passes.name(),
            Cutoff::Color(_) => "color",
            Cutoff::Image(_) => "image",
        }
    }
}

/// A cut-off together with the source image that falls on it, prepared for evaluation per photon.
#[derive(Debug, Clone, PartialEq)]
pub struct CutoffPlane {
    kind: Kind,
    image: SourceImage,
}

/// The prepared cut-off. The trigonometry of knives is precomputed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Knife(knife::Edge),
    Other(Cutoff),
}

impl CutoffPlane {
    /// Prepares `cutoff` for a source whose undisturbed image is `image`.
    pub fn new(cutoff: &Cutoff, image: SourceImage) -> CutoffPlane {
        let kind = match cutoff {
            Cutoff::Knife(k) => Kind::Knife(k.edge(&image)),
            other => Kind::Other(other.clone()),
        };
        CutoffPlane { kind, image }
    }

    /// The prepared cut-off.
    #[cfg(feature = "gpu")]
    pub(crate) fn kind(&self) -> &Kind {
        &self.kind
    }

    /// The undisturbed image of the source.
    pub fn image(&self) -> &SourceImage {
        &self.image
    }

    /// Transmission of light that crosses the plane in one point.
    #[inline]
    pub fn transmission(&self, at_m: PlaneVector) -> Rgb {
        match &self.kind {
            Kind::Knife(k) => [k.transmission(at_m); 3],
            Kind::Other(Cutoff::Aperture(a)) => [a.transmission(at_m); 3],
            Kind::Other(Cutoff::Color(c)) => c.transmission(at_m),
            Kind::Other(Cutoff::Image(i)) => i.transmission(at_m),
            Kind::Other(Cutoff::Open | Cutoff::Knife(_)) => [1.0; 3],
        }
    }

    /// Mean transmission over the source image, shifted by `shift_m` (the effect of a deflection),
    /// if it has a closed form. `None` if the source image has to be sampled. A closed form needs
    /// one photon where sampling needs many.
    #[inline]
    pub fn averaged(&self, shift_m: PlaneVector) -> Option<Rgb> {
        match &self.kind {
            Kind::Knife(k) => Some([k.averaged(shift_m); 3]),
            Kind::Other(Cutoff::Open) => Some([1.0; 3]),
            Kind::Other(_) if self.image == SourceImage::Point => Some(self.transmission(shift_m)),
            Kind::Other(Cutoff::Aperture(a)) => a.averaged(&self.image, shift_m).map(|t| [t; 3]),
            Kind::Other(_) => None,
        }
    }

    /// Whether [`CutoffPlane::averaged`] has a closed form.
    pub fn has_closed_form(&self) -> bool {
        self.averaged([0.0; 2]).is_some()
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use rt_core::sampler::{Sampler, Sampling};

    /// Mean transmission over the source image by sampling: the reference for closed forms.
    pub(crate) fn sampled(cutoff: &CutoffPlane, shift_m: PlaneVector, samples: u32) -> f64 {
        let one = |i: u32| {
            let p = cutoff.image().point_m(Sampler::new(Sampling::Sobol, 1, 0, 0, i).square(0));
            f64::from(cutoff.transmission([p[0] + shift_m[0], p[1] + shift_m[1]])[0])
        };
        (0..samples).map(one).sum::<f64>() / f64::from(samples)
    }

    #[test]
    fn closed_forms_equal_the_sampled_source() {
        let images = [
            SourceImage::Rectangle { half_m: [0.5e-3, 2e-3], axis: [1.0, 0.0] },
            SourceImage::Rectangle { half_m: [0.5e-3, 0.7e-3], axis: [0.6, 0.8] },
            SourceImage::Disc { radius_m: 0.8e-3 },
        ];
        let knife = |angle_deg, position| Cutoff::Knife(Knife { angle_deg, position });
        let cutoffs = [
            knife(0.0, KnifePosition::OpenFraction(0.5)),
            knife(90.0, KnifePosition::OpenFraction(0.2)),
            knife(37.0, KnifePosition::EdgeM(0.1e-3)),
            knife(-120.0, KnifePosition::OpenFraction(0.8)),
            Cutoff::Aperture(Aperture {
                radius_m: 0.5e-3,
                center_m: [0.0; 2],
                passes: Passes::Inside,
            }),
            Cutoff::Aperture(Aperture {
                radius_m: 0.6e-3,
                center_m: [1e-4, 2e-4],
                passes: Passes::Outside,
            }),
        ];
        let mut compared = 0;
        for image in &images {
            for cutoff in &cutoffs {
                let cutoff = CutoffPlane::new(cutoff, *image);
                for shift in [[0.0, 0.0], [2e-4, -1e-4], [-6e-4, 3e-4], [1e-3, 1e-3], [9e-3, 0.0]] {
                    let Some(closed) = cutoff.averaged(shift) else { continue };
                    let reference = sampled(&cutoff, shift, 1 << 14);
                    // With 2^14 points of a (0,2)-sequence and one smooth edge, the observed error
                    // is below 1e-3.
                    let (error, t) = ((f64::from(closed[0]) - reference).abs(), closed[0]);
                    assert!(error < 2e-3, "{cutoff:?} {shift:?}: {t} {reference}");
                    compared += 1;
                }
            }
        }
        assert_eq!(compared, 5 * (3 * 4 + 2), "knives for every source, circles for the disc");
    }
}
