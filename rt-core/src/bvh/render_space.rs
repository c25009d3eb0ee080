//! From world coordinates to those in which rays are traced.

use super::placement::distance_to_sphere;
use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, Vec3};

/// The shift from world coordinates in `f64` to render space in `f32`, for many rays and points.
///
/// ```
/// use rt_core::glam::DVec3;
/// use rt_core::prelude::*;
///
/// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
/// let world =
///     World::from_mesh(TriMesh::new(corners, vec![[0, 1, 2]]), &BuildOptions::default())?;
/// let space = world.render_space();
/// let (ray, moved) = space.ray(DVec3::new(0.25, 0.25, 1e9), DVec3::NEG_Z);
/// let hit = world.closest(&ray).unwrap();
/// assert_eq!(f64::from(hit.t) + moved, 1e9);
/// # Ok::<(), rt_core::bvh::BuildError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct RenderSpace {
    origin: DVec3,
    /// The ball around everything.
    center: DVec3,
    radius: f64,
    /// Origins farther from its centre than this, along any axis, are moved.
    far: f64,
}

impl RenderSpace {
    pub(super) fn new(origin: DVec3, bounds: Aabb) -> Self {
        let radius = f64::from(bounds.radius());
        if bounds.is_empty() {
            return RenderSpace { origin, center: DVec3::ZERO, radius: 0.0, far: f64::INFINITY };
        }
        RenderSpace { origin, center: bounds.center().as_dvec3(), radius, far: 64.0 * radius }
    }

    /// As [`World::render_from_world`](super::World::render_from_world).
    #[inline]
    pub fn point(&self, p: DVec3) -> Vec3 {
        (p - self.origin).as_vec3()
    }

    /// As [`World::ray_from_world`](super::World::ray_from_world).
    #[inline]
    pub fn ray(&self, origin: DVec3, dir: DVec3) -> (Ray, f64) {
        let o = origin - self.origin;
        let far = (o - self.center).abs().max_element() > self.far;
        let moved = if far { distance_to_sphere(o, dir, self.center, self.radius) } else { 0.0 };
        (Ray::new((o + dir * moved).as_vec3(), dir.as_vec3()), moved)
    }
}
