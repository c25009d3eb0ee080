//! Geometry other than triangle meshes: any type that can bound its primitives and intersect a ray
//! with one of them.

mod cylinder;
mod error;
mod frustum;
mod isosurface;
pub(crate) mod isosurface_cell;
mod part;
mod rounded_cone;
mod sphere;
mod tube;

pub use cylinder::Cylinders;
pub use error::{ShapeError, ShapeReport};
pub use isosurface::{Isosurface, IsosurfaceNormals, IsosurfaceOptions, IsosurfaceReport};
pub use part::ShapePart;
pub use sphere::Spheres;
pub use tube::Tubes;

use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, Vec3};
use std::any::Any;
use std::sync::Arc;

/// A hit that [`Shape::closest`] found on one primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter, `t_min <= t < t_max`.
    pub t: f32,
    /// First surface coordinate (each shape defines its meaning).
    pub u: f32,
    /// Second surface coordinate.
    pub v: f32,
}

/// A point on a shape in the shape's object space, for shading and for the origins of secondary
/// rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSurface {
    /// The point, projected back onto the surface so that its error does not grow with the ray's
    /// length.
    pub point: Vec3,
    /// Bound on the distance between `point` and the true surface.
    pub point_error: f32,
    /// Unit normal, outward where the shape has an outside.
    pub normal: Vec3,
    /// Normal for shading, of any length, where it is another one: across flat pieces of a curved
    /// surface, for example. Materials can ask for the other ([`crate::material::Material::flat`]).
    pub shading_normal: Option<Vec3>,
    /// Scalar for the material's colour map, if the shape has scalars.
    pub scalar: Option<f32>,
    /// Linear RGBA, if the shape has colours.
    pub color: Option<[f32; 4]>,
}

/// Geometry made of primitives numbered `0..num_primitives()`. Implement it for user-defined
/// geometry.
///
/// Object space is f32 relative to [`Shape::origin`]. Implementations must be deterministic: the
/// same ray and primitive give the same bits every time.
pub trait Shape: Send + Sync {
    /// Number of primitives.
    fn num_primitives(&self) -> usize;

    /// World position (before the instance's transform) of object space's origin.
    fn origin(&self) -> DVec3 {
        DVec3::ZERO
    }

    /// A box that contains primitive `prim`. A primitive with an empty or non-finite box is left
    /// out (and counted).
    fn bounds(&self, prim: u32) -> Aabb;

    /// The first intersection of `ray` with primitive `prim` within `[t_min, t_max)`.
    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit>;

    /// Whether primitive `prim` is hit within `[t_min, t_max)`.
    fn occluded(&self, prim: u32, ray: &Ray) -> bool {
        self.closest(prim, ray).is_some()
    }

    /// The surface at a hit that this shape reported for `ray`.
    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface;

    /// Whether [`Shape::surface`] may return a colour with alpha below 1. Called once, when a scene
    /// is built. If it returns false, the shape is treated as opaque: a hit whose colour
    /// nevertheless has alpha is drawn opaque and counted in
    /// [`crate::ray_stats::RayStats::opacity_ignored`].
    fn has_transparency(&self) -> bool {
        false
    }

    /// A shape with only these primitives (ascending numbers in this shape, kept in that order),
    /// without the data of the others. All results must have the same bits as in this shape.
    /// Returns `None` when the data cannot be split: a part with some of the primitives then keeps
    /// all data.
    fn part(&self, _primitives: &[u32]) -> Option<Arc<dyn Shape>> {
        None
    }

    /// The other shape, for a shape that only changes the appearance of another one. The
    /// primitives, bounds and hits of both must be the same. A world built from a world with that
    /// other shape ([`crate::bvh::World::build_sharing`]) reuses its tree.
    fn tree_of(&self) -> Option<Arc<dyn Shape>> {
        None
    }

    /// Whether a ray takes much longer for a primitive than for its box. Then each has a leaf of
    /// the tree to itself; else up to four share one, and are tested without their boxes.
    fn is_costly(&self) -> bool {
        false
    }

    /// The shape itself, where rt-core knows more of its type than this trait says: the pages of a
    /// stored mesh take many rays at once.
    #[doc(hidden)]
    fn as_any(&self) -> Option<&dyn Any> {
        None
    }

    /// Why answers since the shape was made may be wrong, for a shape whose data can become
    /// unreadable (in a file, for example): what it was, and what to do. A render that finds one
    /// at its end fails with it.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Whether any colour is transparent.
fn any_alpha(colors: &Option<Vec<[f32; 4]>>) -> bool {
    colors.iter().flatten().any(|c| c[3] < 1.0)
}

/// One radius for all elements, or one for each.
#[derive(Debug, Clone, PartialEq)]
pub enum Radii {
    /// The same for all.
    Common(f32),
    /// One per sphere, or per point of a polyline.
    Each(Vec<f32>),
}

/// Selects the elements with these numbers.
fn picked<T: Copy>(all: &[T], numbers: impl Iterator<Item = usize>) -> Vec<T> {
    numbers.map(|i| all[i]).collect()
}

impl Radii {
    /// The radii of the elements with these numbers.
    fn part(&self, numbers: impl Iterator<Item = usize>) -> Radii {
        match self {
            Radii::Common(r) => Radii::Common(*r),
            Radii::Each(r) => Radii::Each(picked(r, numbers)),
        }
    }

    #[inline]
    fn get(&self, i: usize) -> f32 {
        match self {
            Radii::Common(r) => *r,
            Radii::Each(r) => r[i],
        }
    }

    fn check(
        &self,
        shape: &'static str,
        per: &'static str,
        expected: usize,
    ) -> Result<(), ShapeError> {
        match self {
            Radii::Common(_) => Ok(()),
            Radii::Each(r) => error::check_length(shape, "radii", per, expected, r.len()),
        }
    }
}

/// Splits f64 positions into an origin and f32 offsets from it, so that small detail far from zero
/// is kept. The origin is the centre of the finite positions, or zero when they straddle it (f32
/// offsets from zero then lose nothing).
pub fn relative_positions(points: &[DVec3]) -> (DVec3, Vec<Vec3>) {
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in points.iter().filter(|p| p.is_finite()) {
        lo = lo.min(*p);
        hi = hi.max(*p);
    }
    let center = 0.5 * lo + 0.5 * hi;
    let far = center.abs().max_element() > (hi - lo).max_element();
    let origin = if center.is_finite() && far { center.as_vec3().as_dvec3() } else { DVec3::ZERO };
    (origin, points.iter().map(|p| (*p - origin).as_vec3()).collect())
}

/// The box with corners `lo` and `hi` in f64, rounded outwards to f32; empty when a corner is not
/// finite.
pub(crate) fn outward_box(lo: DVec3, hi: DVec3) -> Aabb {
    let (min, max) = (lo.as_vec3(), hi.as_vec3());
    if !(min.is_finite() && max.is_finite()) {
        return Aabb::EMPTY;
    }
    // One ulp past the rounded value. Rays could leak through a box that only touches its surface,
    // because of the one-ulp gap of the traversal's own rounding (see the watertight triangle
    // tests).
    Aabb::new(
        Vec3::new(min.x.next_down(), min.y.next_down(), min.z.next_down()),
        Vec3::new(max.x.next_up(), max.y.next_up(), max.z.next_up()),
    )
}

/// `p` rounded to f32 and a bound on its distance from the true surface, when `p` itself has an
/// error of at most `error`.
pub(crate) fn rounded_point(p: DVec3, error: f64) -> (Vec3, f32) {
    let point = p.as_vec3();
    // Rounding moves each component by at most half an ulp (2⁻²⁴ relative), so the point by √3
    // times as much, plus f32::MIN_POSITIVE for subnormals.
    let rounding =
        3f64.sqrt() * (-24f64).exp2() * p.abs().max_element() + f64::from(f32::MIN_POSITIVE);
    (point, ((rounding + error) as f32).next_up())
}

/// Whether the f32 parameter `t` lies in the ray's `[t_min, t_max)`; false for NaN.
#[inline]
pub(crate) fn in_range(t: f32, ray: &Ray) -> bool {
    t >= ray.t_min && t < ray.t_max
}
