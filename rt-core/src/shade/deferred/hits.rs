//! What passes between the tracing and the shading of a frame: hits with their surfaces, and points
//! that need light.

use crate::surface::SurfacePoint;
use glam::Vec3;

/// A hit with all surface data that shading needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadingHit {
    /// Ray parameter, in units of the ray's direction.
    pub t: f32,
    /// Instance, the same in every part of a scene.
    pub instance: u32,
    /// Primitive of the scene that was traced. Code that merges the hits of parts replaces it by
    /// the number in the whole scene.
    pub primitive: u32,
    /// Window depth, where that layer is requested of a camera ray; else 0.
    pub depth: f32,
    /// Distance from the eye in world units, likewise.
    pub distance: f32,
    /// The surface at the hit.
    pub surface: SurfacePoint,
}

/// What a light ray hits, where light passes through surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightHit {
    /// An opaque surface blocks the ray somewhere, so no other hit matters.
    Blocked,
    /// The closest surface that may transmit light.
    Surface(ShadingHit),
}

/// A point whose incoming light is requested. Its light rays are functions of these data and the
/// seed of its pixel: whoever generates them generates the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightPoint {
    /// Column and row in the whole image.
    pub pixel: [u32; 2],
    /// Whether it sends rays to light sources.
    pub lamps: bool,
    /// Whether it sends ambient occlusion rays.
    pub sky: bool,
    /// First sampler dimension of the ray that hit it; 0 for camera rays.
    pub stream: u32,
    /// Position, render space.
    pub point: Vec3,
    /// Bound on the distance between `point` and the surface that rays hit.
    pub point_error: f32,
    /// Unit face normal, turned against the ray.
    pub face_normal: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
}

impl LightPoint {
    /// The part of the surface that ray generation reads.
    pub(super) fn surface(&self) -> SurfacePoint {
        let LightPoint { point, point_error, face_normal, normal, .. } = *self;
        SurfacePoint {
            point,
            point_error,
            face_normal,
            normal,
            outside: true,
            color: Vec3::ZERO,
            opacity: 1.0,
        }
    }
}
