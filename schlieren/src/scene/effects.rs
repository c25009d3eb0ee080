//! The effects that a scene needs. Others are not computed, which counters verify.

use super::{BeamsSpec, SamplingSpec, Scene, TechniqueSpec};

/// Parts of the computation that some scenes need and others do not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[allow(clippy::struct_excessive_bools, reason = "a set of flags that serialises with its names")]
pub struct Effects {
    /// Computes optical paths along the rays.
    pub phase: bool,
    /// Traces each wavelength separately.
    pub dispersion: bool,
    /// Has meshes that block light.
    pub solids: bool,
    /// Gives every photon its own tilt.
    pub tilted_beams: bool,
    /// Uses differences between neighbouring rays.
    pub differentials: bool,
    /// The medium absorbs light.
    pub absorption: bool,
    /// The medium emits light.
    pub emission: bool,
    /// The medium rotates the plane of polarisation.
    pub polarisation: bool,
}

impl Effects {
    /// The effects of a scene. Tilted beams with [`BeamsSpec::Auto`] are decided later, when the
    /// field's depth is known, and are false here.
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

/// Counts of work by kind. The counter of an effect that is not in the scene stays 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Counters {
    /// Rays traced through the field for the image.
    pub rays: u64,
    /// Rays through the pixels' centres, for layers and maps.
    pub map_rays: u64,
    /// Rays whose optical path was computed.
    pub phase_rays: u64,
    /// Rays of wavelengths after the first.
    pub dispersion_rays: u64,
    /// Queries of the bodies' acceleration structure.
    pub solid_queries: u64,
    /// Rays of tilted beams.
    pub tilted_rays: u64,
    /// Rays that are corners of cells.
    pub differential_rays: u64,
    /// Rays along which absorption, emission or rotation were integrated.
    pub media_rays: u64,
}
