//! Whether points lie inside closed surfaces.

use crate::bvh::streams::{StreamError, same_length};
use crate::bvh::world::World;
use crate::ray::{Ray, RayBlock};
use glam::Vec3;
use std::cell::RefCell;

/// Points whose crossings are collected at a time.
const POINTS: usize = 256;

/// A direction that no model is likely to be aligned with. Any would do: rays through edges and
/// vertices count right too.
const DIRECTION: Vec3 = Vec3::new(0.387_298_3, 0.547_722_6, 0.741_619_9);

impl World {
    /// The instances whose surface encloses `point`, in render space, ascending: a ray from there
    /// leaves each of them an odd number of times. Meshes must be closed; a mesh of several closed
    /// surfaces, one inside the other, is hollow between them. Where the surface passes within
    /// rounding of the point, either answer is possible.
    ///
    /// ```
    /// use rt_core::prelude::*;
    ///
    /// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    /// let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    /// let world = World::from_mesh(TriMesh::new(corners, faces), &BuildOptions::default())?;
    /// assert_eq!(world.instances_around(Vec3::splat(0.2)), [0]);
    /// assert!(world.instances_around(Vec3::splat(0.4)).is_empty());
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    pub fn instances_around(&self, point: Vec3) -> Vec<u32> {
        let mut crossed = Vec::new();
        self.visit_hits(&Ray::new(point, DIRECTION), |hit| {
            crossed.push(hit.instance);
            false
        });
        crossed.sort_unstable();
        let odd = crossed.chunk_by(|a, b| a == b).filter(|c| c.len() % 2 == 1);
        odd.map(|c| c[0]).collect()
    }

    /// For each of many points in render space, whether [`World::instances_around`] is not empty:
    /// whether the surface of any instance encloses it. Points that lie near one another should
    /// follow one another. The calling thread does the work.
    ///
    /// ```
    /// use rt_core::prelude::*;
    ///
    /// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    /// let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    /// let world = World::from_mesh(TriMesh::new(corners, faces), &BuildOptions::default())?;
    /// let mut inside = [false; 2];
    /// world.encloses(&[Vec3::splat(0.2), Vec3::splat(0.4)], &mut inside).unwrap();
    /// assert_eq!(inside, [true, false]);
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// When the slices differ in length; then no point is looked at.
    pub fn encloses(&self, points: &[Vec3], inside: &mut [bool]) -> Result<(), StreamError> {
        same_length(points.len(), inside.len())?;
        for (points, inside) in points.chunks(POINTS).zip(inside.chunks_mut(POINTS)) {
            inside.fill(false);
            let rays: Vec<Ray> = points.iter().map(|p| Ray::new(*p, DIRECTION)).collect();
            let crossed = RefCell::new(Vec::new());
            self.visit_hits_of_group(&RayBlock::from_rays(&rays), &|ray, hit| {
                crossed.borrow_mut().push((ray, hit.instance));
                false
            });
            let mut crossed = crossed.into_inner();
            crossed.sort_unstable();
            for times in crossed.chunk_by(|a, b| a == b).filter(|c| c.len() % 2 == 1) {
                inside[times[0].0] = true;
            }
        }
        Ok(())
    }
}
