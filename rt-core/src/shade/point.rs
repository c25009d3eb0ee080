//! Points of surfaces that wait for light, and what differs from their material there.

use super::stage::Stage;
use crate::detail::Varied;
use crate::material::SurfaceModel;
use crate::surface::SurfacePoint;
use glam::Vec3;

/// A surface met by a ray of the current wave.
pub(crate) struct Point {
    pub(crate) surface: SurfacePoint,
    /// Unit, towards where the ray came from.
    pub(crate) view: Vec3,
    /// Collected towards `view`.
    pub(crate) radiance: Vec3,
    pub(crate) t: f32,
    /// Ray of the wave.
    pub(crate) lane: u32,
    pub(crate) instance: u32,
    /// False where lights change nothing.
    pub(crate) lit: bool,
    /// Index into [`super::Workspace`]'s list, or [`AS_MATERIAL`].
    pub(super) varied: u32,
}

/// In the place of an index: the point's finish is its material's.
pub(super) const AS_MATERIAL: u32 = u32::MAX;

impl Point {
    /// What differs from the material here. `DETAIL`: whether anything in the wave does; code for waves in which nothing does is made without the question.
    #[inline(always)]
    pub(super) fn varied<'v, const DETAIL: bool>(&self, varied: &'v [Varied]) -> Option<&'v Varied> {
        if !DETAIL || self.varied == AS_MATERIAL { None } else { varied.get(self.varied as usize) }
    }

    /// How it answers light.
    #[inline(always)]
    pub(super) fn model<'v, const DETAIL: bool>(
        &self,
        stage: &'v Stage<'_>,
        varied: &'v [Varied],
    ) -> &'v SurfaceModel {
        match self.varied::<DETAIL>(varied) {
            None => &stage.instances[self.instance as usize].material.model,
            Some(v) => &v.model,
        }
    }
}
