//! Surface points that wait for light, and their parameters where these differ from the material.

use super::frame_context::FrameContext;
use crate::material::SurfaceModel;
use crate::material_maps::SurfaceParameters;
use crate::surface::SurfacePoint;
use glam::Vec3;

/// A surface point hit by a ray of the current wavefront.
#[derive(Clone)]
pub(crate) struct Point {
    pub(crate) surface: SurfacePoint,
    /// Unit, towards the origin of the ray.
    pub(crate) view: Vec3,
    /// Radiance collected towards `view`.
    pub(crate) radiance: Vec3,
    pub(crate) t: f32,
    /// Ray of the wavefront.
    pub(crate) lane: u32,
    pub(crate) instance: u32,
    /// False where lights change nothing.
    pub(crate) lit: bool,
    /// Whether the camera sees it, also through translucent layers, and not a mirror or glass.
    pub(super) before_camera: bool,
    /// Index into [`super::Workspace`]'s list, or [`NO_PARAMETERS`].
    pub(super) parameters: u32,
}

/// Instead of an index: the point has its material's own parameters.
pub(super) const NO_PARAMETERS: u32 = u32::MAX;

/// Whether some material of the scene has maps. Frames without maps use separately compiled code in
/// which looking for them costs nothing.
pub(super) trait Maps {
    const USED: bool;
}

/// Some material has maps.
pub(super) struct WithMaps;

/// No material has maps.
pub(super) struct WithoutMaps;

impl Maps for WithMaps {
    const USED: bool = true;
}

impl Maps for WithoutMaps {
    const USED: bool = false;
}

impl Point {
    /// Nowhere yet.
    pub(super) const BLANK: Point = Point {
        surface: SurfacePoint {
            point: Vec3::ZERO,
            point_error: 0.0,
            face_normal: Vec3::ZERO,
            normal: Vec3::ZERO,
            outside: false,
            color: Vec3::ZERO,
            opacity: 0.0,
        },
        view: Vec3::ZERO,
        radiance: Vec3::ZERO,
        t: 0.0,
        lane: 0,
        instance: 0,
        lit: false,
        before_camera: false,
        parameters: NO_PARAMETERS,
    };

    /// Unit, the direction in which lights are seen reflected: [`Point::view`] unless the camera
    /// has a [viewer](crate::camera::Camera::with_viewer).
    #[inline(always)]
    pub(super) fn towards_viewer(&self, viewer: Option<Vec3>) -> Vec3 {
        match viewer.filter(|_| self.before_camera) {
            Some(viewer) => (viewer - self.surface.point).normalize_or_zero(),
            None => self.view,
        }
    }

    /// The surface parameters of this point, where they differ from the material.
    #[inline(always)]
    pub(super) fn parameters<'v, M: Maps>(
        &self,
        parameters: &'v [SurfaceParameters],
    ) -> Option<&'v SurfaceParameters> {
        if !M::USED || self.parameters == NO_PARAMETERS {
            None
        } else {
            parameters.get(self.parameters as usize)
        }
    }

    /// The reflection model of this point.
    #[inline(always)]
    pub(super) fn model<'v, M: Maps>(
        &self,
        context: &'v FrameContext<'_>,
        parameters: &'v [SurfaceParameters],
    ) -> &'v SurfaceModel {
        match self.parameters::<M>(parameters) {
            None => &context.instances[self.instance as usize].material.model,
            Some(v) => &v.model,
        }
    }
}
