//! Counts rays by kind. Counting is always on: it costs one addition per block of rays.

use crate::effects::Effects;
use std::ops::AddAssign;

/// How many rays were traced, by kind, and how often each effect changed something. Kinds that the
/// frame did not need are zero.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RayStats {
    /// Rays from the camera that can hit something (lanes outside the image are not counted).
    pub primary: u64,
    /// Rays between surfaces and lights. Each further layer of a transparent blocker counts as
    /// another ray, unless an opaque surface blocks the ray.
    pub shadow: u64,
    /// Ambient occlusion rays.
    pub ambient_occlusion: u64,
    /// Mirror and glossy reflection.
    pub reflection: u64,
    /// Rays that entered or left a dielectric.
    pub refraction: u64,
    /// Rays continued behind a transparent or culled surface.
    pub transparency: u64,
    /// Bounces of the path tracer.
    pub path: u64,
    /// Ray segments integrated through volumes.
    pub volume: u64,
    /// Shadow rays that hit something.
    pub shadow_blocked: u64,
    /// Ambient occlusion rays that hit something.
    pub ambient_occlusion_blocked: u64,
    /// Closest-hit queries for the next transmissive surface, of shadow and ambient occlusion rays
    /// that no opaque surface blocks. All other rays need only an any-hit query.
    pub light_closest: u64,
    /// Surfaces that were looked up because they may transmit light.
    pub light_lookups: u64,
    /// Paths ended because they reached `max_bounces`; their remaining light is missing from the
    /// image.
    pub cut_at_max_bounces: u64,
    /// Rays that were not sent because less than `min_contribution` of their radiance reaches the
    /// pixel; path tracing sends all of them.
    pub cut_at_min_contribution: u64,
    /// Hits on surfaces with opacity below 1 that were rendered opaque because transparency was
    /// left out.
    pub opacity_ignored: u64,
}

impl RayStats {
    /// Number of rays of all kinds.
    pub fn total(&self) -> u64 {
        self.primary
            + self.shadow
            + self.ambient_occlusion
            + self.reflection
            + self.refraction
            + self.transparency
            + self.path
    }

    /// How often `effect` (one of [`Effects::ALL`]) changed what a ray sees. 0 means that it
    /// changes no pixel. `None` for effects that are not counted (the lens moves every ray).
    pub fn times_effective(&self, effect: Effects) -> Option<u64> {
        if effect == Effects::SHADOWS || effect == Effects::SOFT_SHADOWS {
            Some(self.shadow_blocked)
        } else if effect == Effects::AMBIENT_OCCLUSION {
            Some(self.ambient_occlusion_blocked)
        } else if effect == Effects::REFLECTION || effect == Effects::GLOSSY_REFLECTION {
            Some(self.reflection)
        } else if effect == Effects::REFRACTION {
            Some(self.refraction)
        } else if effect == Effects::TRANSPARENCY {
            Some(self.transparency)
        } else if effect == Effects::PATH_TRACING {
            Some(self.path)
        } else if effect == Effects::VOLUMES {
            Some(self.volume)
        } else {
            None
        }
    }
}

impl AddAssign for RayStats {
    fn add_assign(&mut self, o: RayStats) {
        self.primary += o.primary;
        self.shadow += o.shadow;
        self.ambient_occlusion += o.ambient_occlusion;
        self.reflection += o.reflection;
        self.refraction += o.refraction;
        self.transparency += o.transparency;
        self.path += o.path;
        self.volume += o.volume;
        self.shadow_blocked += o.shadow_blocked;
        self.ambient_occlusion_blocked += o.ambient_occlusion_blocked;
        self.light_closest += o.light_closest;
        self.light_lookups += o.light_lookups;
        self.cut_at_max_bounces += o.cut_at_max_bounces;
        self.cut_at_min_contribution += o.cut_at_min_contribution;
        self.opacity_ignored += o.opacity_ignored;
    }
}
