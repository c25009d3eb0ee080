//! How many rays the points of a frame send to each light, and where to.

use crate::effects::Effects;
use crate::light::ResolvedLight;

/// The rays that every point sends to one light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightSampling {
    /// Whether there are shadow rays at all.
    pub(crate) traced: bool,
    /// Whether they aim at different points of the light.
    pub(crate) spread: bool,
    /// How many.
    pub(crate) count: u32,
    /// Number of the first one among all light rays of a point.
    pub(crate) first_number: u32,
}

impl LightSampling {
    /// One for each of `lights`, and the number of rays to them all.
    pub(crate) fn of(
        lights: &[ResolvedLight],
        effects: Effects,
        light_rays: u32,
    ) -> (Vec<LightSampling>, u32) {
        let shadows = effects.contains(Effects::SHADOWS);
        let soft = effects.contains(Effects::SOFT_SHADOWS);
        let mut first_number = 0;
        let of_light = |light: &ResolvedLight| {
            let traced = shadows && light.shadows;
            let spread = soft && light.size > 0.0 && traced;
            let count = if spread { light_rays } else { 1 };
            let light_sampling = LightSampling { traced, spread, count, first_number };
            first_number += if traced { count } else { 0 };
            light_sampling
        };
        (lights.iter().map(of_light).collect(), first_number)
    }
}
