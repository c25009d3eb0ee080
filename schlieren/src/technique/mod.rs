//! How light becomes a picture: one technique a file.
//!
//! | technique | a photon leaves on the film | thesis |
//! |---|---|---|
//! | [`shadowgraph`] | all its energy, where it lands | 5.3.3 |
//! | [`schlieren`] | what the cut-off lets through | 5.3.4 |
//! | [`interferogram`] | what interference with a reference beam leaves | 5.3.5 |
//! | [`bos`] | the light of the background it came from | – |
//! | [`volume`], [`mod@slice`] | nothing: pictures without optics, to compare with | 5.6 |

pub mod bos;
pub mod interferogram;
pub mod schlieren;
pub mod shadowgraph;
pub mod slice;
pub mod volume;

use crate::cutoff::Rgb;
use crate::optics::{Across, Optics};
use crate::path::{Exit, Start};

/// A photon behind the test section.
#[derive(Debug, Clone, Copy)]
pub struct Photon<'a> {
    /// Its undisturbed ray.
    pub start: &'a Start,
    /// What the flow did to it.
    pub exit: &'a Exit,
    /// The image of its source point in the cut-off plane; zero unless
    /// [`Technique::needs_source_points`] or tilted beams.
    pub image_point_m: Across,
    /// Where it lands in the plane of focus, from its start.
    pub shift_m: Across,
}

/// A technique that follows light.
#[derive(Debug, Clone)]
pub enum Technique {
    /// No cut-off.
    Shadowgraph(Optics),
    /// Light past a cut-off.
    Schlieren(schlieren::Schlieren),
    /// Two beams.
    Interferogram(interferogram::Interferogram),
    /// A pattern seen through the flow.
    Bos(bos::Bos),
}

impl Technique {
    /// The optical bench it stands on.
    #[inline]
    pub fn optics(&self) -> &Optics {
        match self {
            Technique::Shadowgraph(optics) => optics,
            Technique::Schlieren(s) => &s.optics,
            Technique::Interferogram(i) => &i.optics,
            Technique::Bos(b) => &b.optics,
        }
    }

    /// True when it reads [`Exit::opd_m`].
    pub fn needs_opd(&self) -> bool {
        matches!(self, Technique::Interferogram(_))
    }

    /// True when each photon needs a point of the source, because no closed form averages over it.
    pub fn needs_source_points(&self) -> bool {
        matches!(self, Technique::Schlieren(s) if s.samples_the_source())
    }

    /// True when its three channels can differ.
    pub fn is_colored(&self) -> bool {
        matches!(self, Technique::Schlieren(s) if s.is_colored())
    }

    /// True when rays are sent from the camera's pixels towards the light (and energy stays in the
    /// pixel they were sent from), not from the light to the film.
    #[inline]
    pub fn looks_from_film(&self) -> bool {
        matches!(self, Technique::Bos(_))
    }

    /// The energy a photon leaves, before absorption; 1 is an undisturbed photon without a cut-off.
    #[inline]
    pub fn energy(&self, photon: &Photon<'_>) -> Rgb {
        match self {
            Technique::Shadowgraph(_) => [1.0; 3],
            Technique::Schlieren(s) => s.energy(photon),
            Technique::Interferogram(i) => [i.energy(photon); 3],
            Technique::Bos(b) => [b.energy(photon); 3],
        }
    }

    /// The energy a photon leaves of what [`Exit::transmission`] says has come through. Absorption
    /// dims the object beam, so an interferogram loses contrast before it gets dark.
    #[inline]
    pub fn landed(&self, photon: &Photon<'_>) -> Rgb {
        let left = photon.exit.transmission;
        match self {
            Technique::Interferogram(i) if left < 1.0 => [i.dimmed(photon, left); 3],
            _ => self.energy(photon).map(|e| e * left),
        }
    }

    /// The part that reaches the film of light that fills a stop in the cut-off plane evenly: what
    /// the flow itself emits. An interferometer's two beam splitters leave a quarter of the object
    /// beam.
    pub fn passes_evenly(&self, stop_m: f64) -> Rgb {
        match self {
            Technique::Schlieren(s) => s.passes_evenly(stop_m),
            Technique::Interferogram(_) => [0.25; 3],
            Technique::Shadowgraph(_) | Technique::Bos(_) => [1.0; 3],
        }
    }
}
