//! The effects that an image needs in addition to primary rays and local lighting. By default the
//! renderer determines them from the scene.
//!
//! The renderer runs one pass per effect over a tile of rays. It never enters a pass outside the
//! set: an unused effect costs one test per tile, and its ray counter in
//! [`crate::ray_stats::RayStats`] stays 0.

use crate::camera::Camera;
use std::fmt;

/// A set of effects.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Effects(u32);

impl Effects {
    /// Primary rays and local lighting only.
    pub const NONE: Effects = Effects(0);
    /// Rays to lights.
    pub const SHADOWS: Effects = Effects(1);
    /// Shadow rays to points distributed over lights that have a size.
    pub const SOFT_SHADOWS: Effects = Effects(1 << 1);
    /// Rays over the hemisphere that attenuate ambient and environment light.
    pub const AMBIENT_OCCLUSION: Effects = Effects(1 << 2);
    /// Mirror reflection.
    pub const REFLECTION: Effects = Effects(1 << 3);
    /// Reflection blurred by roughness.
    pub const GLOSSY_REFLECTION: Effects = Effects(1 << 4);
    /// Rays through dielectrics, with total internal reflection and absorption.
    pub const REFRACTION: Effects = Effects(1 << 5);
    /// Surfaces with opacity below 1, culled sides.
    pub const TRANSPARENCY: Effects = Effects(1 << 6);
    /// A lens with an aperture.
    pub const DEPTH_OF_FIELD: Effects = Effects(1 << 7);
    /// Direct volume rendering.
    pub const VOLUMES: Effects = Effects(1 << 8);
    /// Light over any number of bounces (replaces the approximations ambient occlusion and ambient
    /// light).
    pub const PATH_TRACING: Effects = Effects(1 << 9);

    /// Every effect with its name in reports and on command lines.
    pub const ALL: [(Effects, &'static str); 10] = [
        (Effects::SHADOWS, "shadows"),
        (Effects::SOFT_SHADOWS, "soft shadows"),
        (Effects::AMBIENT_OCCLUSION, "ambient occlusion"),
        (Effects::REFLECTION, "reflection"),
        (Effects::GLOSSY_REFLECTION, "glossy reflection"),
        (Effects::REFRACTION, "refraction"),
        (Effects::TRANSPARENCY, "transparency"),
        (Effects::DEPTH_OF_FIELD, "depth of field"),
        (Effects::VOLUMES, "volumes"),
        (Effects::PATH_TRACING, "path tracing"),
    ];

    /// [`Effects::DEPTH_OF_FIELD`] when the camera's lens has an aperture.
    pub fn required_by_camera(camera: &Camera) -> Effects {
        if camera.lens().is_some_and(|l| l.aperture_radius > 0.0) {
            Effects::DEPTH_OF_FIELD
        } else {
            Effects::NONE
        }
    }

    /// True when every effect of `other` is in the set.
    #[inline]
    pub const fn contains(self, other: Effects) -> bool {
        self.0 & other.0 == other.0
    }

    /// True when an effect of `other` is in the set.
    #[inline]
    pub const fn intersects(self, other: Effects) -> bool {
        self.0 & other.0 != 0
    }

    /// Effects in either set.
    pub const fn union(self, other: Effects) -> Effects {
        Effects(self.0 | other.0)
    }

    /// Effects in both sets.
    pub const fn intersection(self, other: Effects) -> Effects {
        Effects(self.0 & other.0)
    }

    /// Effects of this set that are not in `other`.
    pub const fn without(self, other: Effects) -> Effects {
        Effects(self.0 & !other.0)
    }

    /// This set, united with `other` if `when` is true.
    #[must_use]
    pub const fn with_if(self, when: bool, other: Effects) -> Effects {
        if when { self.union(other) } else { self }
    }

    /// True for the empty set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The names in the set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Effects::ALL.into_iter().filter(move |(e, _)| self.contains(*e)).map(|(_, n)| n)
    }
}

/// Up to this roughness, a lobe is narrower than a pixel and is treated as a mirror.
pub(crate) const MIRROR_ROUGHNESS: f32 = 1e-3;

/// The effect whose rays a lobe of this roughness sends.
#[inline]
pub(crate) fn reflection_of(roughness: f32) -> Effects {
    if roughness <= MIRROR_ROUGHNESS { Effects::REFLECTION } else { Effects::GLOSSY_REFLECTION }
}

impl std::ops::BitOr for Effects {
    type Output = Effects;
    fn bitor(self, o: Effects) -> Effects {
        self.union(o)
    }
}

impl fmt::Debug for Effects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.names()).finish()
    }
}
