//! What a scene calls for; what it does not call for is not computed, and counters show it.

use super::{BeamsSpec, SamplingSpec, Scene, TechniqueSpec};

/// Parts of the computation that some scenes need and others do not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[allow(clippy::struct_excessive_bools, reason = "a set of flags that serialises with its names")]
pub struct Effects {
    /// Optical paths along the rays.
    pub phase: bool,
    /// A trace per wavelength.
    pub dispersion: bool,
    /// Meshes that block light.
    pub solids: bool,
    /// A tilt for every photon.
    pub tilted_beams: bool,
    /// Differences between neighbouring rays.
    pub differentials: bool,
    /// Light lost in the medium.
    pub absorption: bool,
    /// Light added by the medium.
    pub emission: bool,
    /// A plane of polarisation that the medium turns.
    pub polarisation: bool,
}

impl Effects {
    /// Read from the scene. Tilted beams with [`BeamsSpec::Auto`] are decided when the field's
    /// depth is known; here they count as absent.
    pub fn required_by(scene: &Scene) -> Effects {
        let follows_light = scene.technique.follows_light();
        Effects {
            phase: matches!(scene.technique, TechniqueSpec::Interferogram { .. }),
            dispersion: follows_light && scene.light.wavelengths_nm.len() > 1,
            solids: follows_light && !scene.solids.files.is_empty(),
            tilted_beams: scene.technique.uses_source() && scene.light.beams == BeamsSpec::Tilted,
            differentials: follows_light && matches!(scene.sampling(), SamplingSpec::Beams { .. }),
            absorption: scene.media.absorption.is_some(),
            emission: scene.media.emission.is_some(),
            polarisation: scene.media.rotation.is_some(),
        }
    }
}

/// Work done, by kind. An effect that is not in the scene leaves its counter at 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Counters {
    /// Rays taken through the field for the picture.
    pub rays: u64,
    /// Rays through the pixels' centres, for layers and maps.
    pub map_rays: u64,
    /// Of all rays, those whose optical path was computed.
    pub phase_rays: u64,
    /// Rays of wavelengths after the first.
    pub dispersion_rays: u64,
    /// Questions to the bodies' acceleration structure.
    pub solid_queries: u64,
    /// Rays off the axis.
    pub tilted_rays: u64,
    /// Rays that are corners of cells.
    pub differential_rays: u64,
    /// Rays along which absorption, emission or rotation were collected.
    pub media_rays: u64,
}
