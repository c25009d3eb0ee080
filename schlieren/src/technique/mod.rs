//! The techniques that turn deflected light into an image, one per file.
//!
//! | technique | energy that a photon leaves on the film | dissertation |
//! |---|---|---|
//! | [`shadowgraph`] | all its energy, where it lands | 5.3.3 |
//! | [`schlieren`] | what the cut-off lets through | 5.3.4 |
//! | [`interferogram`] | its interference with a reference beam | 5.3.5 |
//! | [`bos`] | the brightness of the background where it came from | – |
//! | [`volume`], [`mod@slice`] | none: images without optics, for comparison | 5.6 |

pub mod bos;
pub mod interferogram;
pub mod schlieren;
pub mod shadowgraph;
pub mod slice;
pub mod volume;

use crate::cutoff::Rgb;
use crate::optics::{Optics, PlaneVector};
use crate::path::{Exit, Start};

/// A photon behind the test section.
#[derive(Debug, Clone, Copy)]
pub struct Photon<'a> {
    /// The undisturbed ray.
    pub start: &'a Start,
    /// Its deviation behind the flow.
    pub exit: &'a Exit,
    /// The image of its source point in the cut-off plane. Zero unless the technique needs source
    /// points ([`Technique::needs_source_points`]) or the beams are tilted.
    pub image_point_m: PlaneVector,
    /// Shift from its start to where it lands, in the plane of focus.
    pub shift_m: PlaneVector,
}

/// A technique that simulates light, with its optics.
#[derive(Debug, Clone)]
pub enum Technique {
    /// A shadowgraph: no cut-off.
    Shadowgraph(Optics),
    /// Schlieren: light is filtered by a cut-off.
    Schlieren(schlieren::Schlieren),
    /// An interferogram: a test beam and a reference beam.
    Interferogram(interferogram::Interferogram),
    /// Background-oriented schlieren: a pattern seen through the flow.
    Bos(bos::Bos),
}

impl Technique {
    /// The optical bench.
    #[inline]
    pub fn optics(&self) -> &Optics {
        match self {
            Technique::Shadowgraph(optics) => optics,
            Technique::Schlieren(s) => &s.optics,
            Technique::Interferogram(i) => &i.optics,
            Technique::Bos(b) => &b.optics,
        }
    }

    /// Whether the technique reads [`Exit::opd_m`].
    pub fn needs_opd(&self) -> bool {
        matches!(self, Technique::Interferogram(_))
    }

    /// Whether each photon needs its own point of the source, because no closed form averages over
    /// the source.
    pub fn needs_source_points(&self) -> bool {
        matches!(self, Technique::Schlieren(s) if s.samples_the_source())
    }

    /// Whether the three channels can differ.
    pub fn is_colored(&self) -> bool {
        matches!(self, Technique::Schlieren(s) if s.is_colored())
    }

    /// Whether rays are traced from the camera's pixels towards the light, so that energy stays in
    /// the pixel of the ray, and not from the light to the film.
    #[inline]
    pub fn samples_from_film(&self) -> bool {
        matches!(self, Technique::Bos(_))
    }

    /// The energy that a photon leaves on the film, before absorption. 1 is that of an undisturbed
    /// photon without a cut-off.
    #[inline]
    pub fn energy(&self, photon: &Photon<'_>) -> Rgb {
        match self {
            Technique::Shadowgraph(_) => [1.0; 3],
            Technique::Schlieren(s) => s.energy(photon),
            Technique::Interferogram(i) => [i.energy(photon); 3],
            Technique::Bos(b) => [b.energy(photon); 3],
        }
    }

    /// The energy that a photon leaves on the film, with [`Exit::transmission`]. Absorption dims
    /// only the object beam, so an interferogram loses contrast before it gets dark.
    #[inline]
    pub fn attenuated_energy(&self, photon: &Photon<'_>) -> Rgb {
        let left = photon.exit.transmission;
        match self {
            Technique::Interferogram(i) if left < 1.0 => [i.dimmed(photon, left); 3],
            _ => self.energy(photon).map(|e| e * left),
        }
    }

    /// The fraction that reaches the film of light that fills a stop in the cut-off plane
    /// uniformly, as light emitted by the flow does. The two beam splitters of an interferometer
    /// pass a quarter of the object beam.
    pub fn passes_evenly(&self, stop_m: f64) -> Rgb {
        match self {
            Technique::Schlieren(s) => s.passes_evenly(stop_m),
            Technique::Interferogram(_) => [0.25; 3],
            Technique::Shadowgraph(_) | Technique::Bos(_) => [1.0; 3],
        }
    }
}
