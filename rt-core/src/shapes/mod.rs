//! Geometry that is not a triangle mesh: anything that can bound its primitives and intersect a ray with one of them.

use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, Vec3};

/// What [`Shape::closest`] found on one primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter, `t_min <= t < t_max`.
    pub t: f32,
    /// First surface coordinate (its meaning is the shape's).
    pub u: f32,
    /// Second surface coordinate.
    pub v: f32,
}

/// A point on a shape, for shading and for starting secondary rays; in the shape's object space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSurface {
    /// The point, projected back onto the surface so that its error does not grow with the ray's length.
    pub point: Vec3,
    /// Bound on the distance between `point` and the true surface.
    pub point_error: f32,
    /// Unit normal, outward where the shape has an outside.
    pub normal: Vec3,
    /// Scalar for the material's colour map, when the shape carries one.
    pub scalar: Option<f32>,
    /// Linear RGBA, when the shape carries colours.
    pub color: Option<[f32; 4]>,
}

/// Geometry made of primitives numbered `0..num_primitives()`: the door for user-defined geometry.
///
/// Object space is f32 relative to [`Shape::origin`]. Implementations must be deterministic: the same ray and primitive
/// give the same bits every time.
pub trait Shape: Send + Sync {
    /// How many primitives.
    fn num_primitives(&self) -> usize;

    /// World position (before the instance's transform) of object space's origin.
    fn origin(&self) -> DVec3 {
        DVec3::ZERO
    }

    /// A box that contains primitive `prim`. An empty or non-finite box leaves the primitive out (it is counted).
    fn bounds(&self, prim: u32) -> Aabb;

    /// The first intersection of `ray` with primitive `prim` within `[t_min, t_max)`.
    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit>;

    /// Whether anything of primitive `prim` lies within `[t_min, t_max)`.
    fn occluded(&self, prim: u32, ray: &Ray) -> bool {
        self.closest(prim, ray).is_some()
    }

    /// The surface at a hit this shape reported for `ray`.
    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface;
}
