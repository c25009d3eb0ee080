//! Rays counted by what they are for. Always kept: one addition per block of rays.

use crate::effects::Effects;
use std::ops::AddAssign;

/// How many rays were traced, by kind, and how often each effect did something. All zero for a kind
/// the frame did not need.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayStats {
    /// Rays from the camera that can hit something (lanes outside the picture are not counted).
    pub primary: u64,
    /// Rays between surfaces and lights; each further layer of a transparent blocker counts again,
    /// unless something opaque is in the way.
    pub shadow: u64,
    /// Rays of ambient occlusion.
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
    /// Shadow rays that found something.
    pub shadow_blocked: u64,
    /// Ambient occlusion rays that found something.
    pub ambient_occlusion_blocked: u64,
    /// Shadow and ambient occlusion rays that nothing opaque ended, as often as it was asked which
    /// surface that lets light through comes next. All others only needed to know whether anything
    /// is in their way.
    pub light_closest: u64,
    /// Surfaces that were looked up because light may pass through them.
    pub light_lookups: u64,
    /// Paths cut because they reached `max_bounces`; their rest is missing from the picture.
    pub cut_at_max_bounces: u64,
    /// Rays left out because less than `min_contribution` of what they would have met reaches the
    /// pixel; paths never are.
    pub cut_at_min_contribution: u64,
    /// Hits on surfaces with opacity below 1 that were drawn opaque because transparency was left
    /// out.
    pub opacity_ignored: u64,
}

impl RayStats {
    /// Every ray, primary and secondary.
    pub fn total(&self) -> u64 {
        self.primary
            + self.shadow
            + self.ambient_occlusion
            + self.reflection
            + self.refraction
            + self.transparency
            + self.path
    }

    /// How often `effect` (one of [`Effects::ALL`]) changed what a ray sees. 0 means that no pixel
    /// differs because of it. `None` where that is not counted (the lens moves every ray).
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
