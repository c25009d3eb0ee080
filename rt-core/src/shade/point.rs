//! Points of surfaces that wait for light, and what differs from their material there.

use super::frame_context::FrameContext;
use crate::material::SurfaceModel;
use crate::material_maps::SurfaceParameters;
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
    /// Index into [`super::Workspace`]'s list, or [`NO_PARAMETERS`].
    pub(super) parameters: u32,
}

/// In the place of an index: the point's finish is its material's.
pub(super) const NO_PARAMETERS: u32 = u32::MAX;

impl Point {
    /// What differs from the material here. `MAPS`: whether anything in the wave does; code for
    /// waves in which nothing does is made without the question.
    #[inline(always)]
    pub(super) fn parameters<'v, const MAPS: bool>(
        &self,
        parameters: &'v [SurfaceParameters],
    ) -> Option<&'v SurfaceParameters> {
        if !MAPS || self.parameters == NO_PARAMETERS {
            None
        } else {
            parameters.get(self.parameters as usize)
        }
    }

    /// How it answers light.
    #[inline(always)]
    pub(super) fn model<'v, const MAPS: bool>(
        &self,
        context: &'v FrameContext<'_>,
        parameters: &'v [SurfaceParameters],
    ) -> &'v SurfaceModel {
        match self.parameters::<MAPS>(parameters) {
            None => &context.instances[self.instance as usize].material.model,
            Some(v) => &v.model,
        }
    }
}
