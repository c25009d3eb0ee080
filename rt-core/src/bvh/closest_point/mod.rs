//! The point of all surfaces that is closest to a given one, and signed distances.
//!
//! The tree of the rays serves: boxes are visited nearest first, and left out when they are farther
//! away than the best point so far. All distances are computed in f64, from the f32 coordinates
//! that rays see too.

mod search;

use super::blas::Content;
use super::world::World;
use glam::Vec3;
use search::Search;

/// The closest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// The point, in render space.
    pub point: Vec3,
    /// Its distance, in units of the world.
    pub distance: f32,
    /// Weight of the triangle's second corner at the point.
    pub u: f32,
    /// Weight of the third corner.
    pub v: f32,
    /// Triangle within its mesh.
    pub prim: u32,
    /// Index of the instance in the world.
    pub instance: u32,
}

/// The world has other shapes than meshes.
///
/// ```
/// use rt_core::bvh::NoDistance;
///
/// assert!(NoDistance { instance: 2 }.to_string().starts_with("instance 2 is a shape"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "instance {instance} is a shape, and only meshes know the distance to a point: ask a world of \
     the meshes alone"
)]
pub struct NoDistance {
    /// The first such instance.
    pub instance: usize,
}

impl World {
    /// The point of all meshes that is closest to `point` (render space), at most `max_distance`
    /// away. Of triangles at the same distance, as those around a vertex, the lowest instance's
    /// lowest one is named.
    ///
    /// ```
    /// use rt_core::bvh::ClosestPoint;
    /// use rt_core::prelude::*;
    ///
    /// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mesh = TriMesh::new(corners, vec![[0, 1, 2]]);
    /// let world = World::from_mesh(mesh, &BuildOptions::default())?;
    /// let above = Vec3::new(0.25, 0.25, 2.0);
    /// let found: ClosestPoint = world.closest_point(above, f32::INFINITY).unwrap().unwrap();
    /// assert_eq!((found.point, found.distance), (Vec3::new(0.25, 0.25, 0.0), 2.0));
    /// assert_eq!(world.closest_point(Vec3::Z * 2.0, 1.0), Ok(None));
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When the world has shapes that are not meshes.
    pub fn closest_point(
        &self,
        point: Vec3,
        max_distance: f32,
    ) -> Result<Option<ClosestPoint>, NoDistance> {
        let is_shape = |b: &super::blas::Blas| matches!(b.content, Content::Shape { .. });
        if let Some(instance) =
            self.instances().iter().position(|i| is_shape(&self.blas[i.geometry]))
        {
            return Err(NoDistance { instance });
        }
        if !point.is_finite() || max_distance.is_nan() || max_distance < 0.0 {
            return Ok(None);
        }
        Ok(Search::new(self, point, max_distance).find())
    }

    /// The distance to the closest surface, below zero inside: where [`World::instances_around`]
    /// names an instance. `None` for a world without triangles.
    ///
    /// # Errors
    /// When the world has shapes that are not meshes.
    pub fn signed_distance(&self, point: Vec3) -> Result<Option<f32>, NoDistance> {
        let closest = self.closest_point(point, f32::INFINITY)?;
        let outside =
            |c: &ClosestPoint| c.distance == 0.0 || self.instances_around(point).is_empty();
        Ok(closest.map(|c| if outside(&c) { c.distance } else { -c.distance }))
    }
}
