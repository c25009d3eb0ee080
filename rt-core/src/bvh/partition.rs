//! Worlds that hold a part of a larger world's primitives and return the same hits for them as the
//! larger world.
//!
//! The bits of a hit depend on more than the primitive: rays are transformed to the geometry's
//! local space, origins of rays from far away are first moved along the ray, and render space has
//! an origin. All of these are chosen from bounds. A part therefore uses the choices of the whole
//! world ([`GlobalLayout`]). Then the nearest of the hits of all parts, ties to the lowest id, is
//! the hit of the whole world.

use super::blas::Blas;
use super::build::{Progress, Stopped, UNWATCHED};
use super::error::BuildError;
use super::geometry::{Geometry, Instance, Sources};
use super::layout::local_frame::LocalFrame;
use super::mesh_group::GroupLayout;
use super::options::BuildOptions;
use super::world::{BuildRequest, World};
use crate::math::Aabb;
use glam::{DAffine3, DVec3};

/// What a world has chosen from the bounds of all its geometry; see [`World::build_part`].
#[derive(Debug, Clone, PartialEq)]
pub struct GlobalLayout {
    pub(super) origin: DVec3,
    pub(super) bounds: Aabb,
    /// Local space of each geometry, and its bounds there.
    pub(super) geometries: Vec<(LocalFrame, Aabb)>,
    /// The meshes that share one tree.
    pub(super) group: Option<GroupLayout>,
}

impl World {
    /// The choices of this world that its parts need.
    pub fn global_layout(&self) -> GlobalLayout {
        GlobalLayout {
            origin: self.origin(),
            bounds: self.bounds(),
            geometries: self.blas.iter().map(|b| (b.frame, b.reach())).collect(),
            group: self.group.as_ref().map(|g| GroupLayout {
                instances: g.members.iter().map(|m| m.instance).collect(),
                frame: g.frame,
                reach: g.reach,
            }),
        }
    }

    /// Bounds in render space of the primitives that this world holds: smaller than
    /// [`World::bounds`] for a part.
    pub fn own_bounds(&self) -> Aabb {
        self.tlas.bounds
    }

    /// A world of some of another world's primitives. `geometries` and `instances` have the number
    /// and order of the whole world (a geometry may have no primitive left), meshes keep their
    /// origin, and primitives keep their order. Then for every ray [`World::closest`] of the whole
    /// world equals, bit for bit, the nearest of the hits of any parts that together have all
    /// primitives, ties to the lowest instance and then the lowest primitive of the whole world.
    ///
    /// ```
    /// # use rt_core::{bvh::*, mesh::TriMesh, ray::Ray, glam::{DAffine3, Vec3}};
    /// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.0, 0.0, 1.0)];
    /// let both = TriMesh::new(corners.clone(), vec![[0, 1, 2], [0, 1, 3]]);
    /// let whole = World::from_mesh(both, &BuildOptions::default())?;
    /// let second = TriMesh::new(vec![corners[0], corners[1], corners[3]], vec![[0, 1, 2]]);
    /// let part = World::build_part(
    ///     vec![Geometry::Mesh(second.into())],
    ///     whole.instances().to_vec(),
    ///     &whole.global_layout(),
    ///     &BuildOptions::default(),
    /// )?;
    /// let ray = Ray::new(Vec3::new(0.2, 9.0, 0.2), -Vec3::Y);
    /// assert_eq!(part.closest(&ray).map(|h| h.t), whole.closest(&ray).map(|h| h.t));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`World::build`], [`BuildError::NotAPart`] when the numbers of geometries differ, and
    /// [`BuildError::NotAMember`] when an instance differs from that of the whole world.
    pub fn build_part(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        whole: &GlobalLayout,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        World::build_part_sharing(geometries, instances, whole, options, None)
    }

    /// As [`World::build_part`], but reuses the tree of every geometry that `previous`, a part of
    /// an earlier time step, also has (the same [`Arc`](std::sync::Arc)), where the local space of
    /// the whole has stayed the same.
    ///
    /// # Errors
    /// As [`World::build_part`].
    pub fn build_part_sharing(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        whole: &GlobalLayout,
        options: &BuildOptions,
        previous: Option<&World>,
    ) -> Result<World, BuildError> {
        if geometries.len() != whole.geometries.len() {
            return Err(BuildError::NotAPart {
                expected: whole.geometries.len(),
                found: geometries.len(),
            });
        }
        let is_member = |&&i: &&u32| {
            instances.get(i as usize).is_some_and(|instance| {
                instance.world_from_object == DAffine3::IDENTITY
                    && geometries.get(instance.geometry).is_some_and(Geometry::is_mesh)
            })
        };
        let members = whole.group.iter().flat_map(|g| &g.instances);
        if let Some(&instance) = members.clone().find(|i| !is_member(i)) {
            return Err(BuildError::NotAMember { instance: instance as usize });
        }
        let request = BuildRequest::new(options, &UNWATCHED);
        BuildRequest { whole: Some(whole), previous, ..request }.build(geometries, instances)
    }
}

/// The structure of geometry `index`, which was checked, in its own local space or in that of the
/// whole world.
pub(super) fn blas_of(
    index: usize,
    sources: Sources<'_>,
    options: &BuildOptions,
    whole: Option<&GlobalLayout>,
    progress: &Progress<'_>,
) -> Result<Blas, Stopped> {
    let given = whole.map(|w| w.geometries[index]);
    match &sources.geometries[index] {
        Geometry::Shape(s) => Blas::for_shape(s.clone(), options, given, progress),
        _ => Blas::for_mesh(sources.triangles(index), options, given, progress),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::ray::Ray;
    use crate::test_shapes::sphere;
    use std::sync::Arc;

    fn at(center: DVec3) -> Arc<TriMesh> {
        let mut mesh = sphere(2);
        mesh.positions.iter_mut().for_each(|p| *p += center.as_vec3());
        Arc::new(mesh)
    }

    /// The trees of `geometries` in a part of themselves.
    fn part(geometries: &[Geometry], places: &[DAffine3], previous: Option<&World>) -> World {
        let instances: Vec<Instance> = places
            .iter()
            .enumerate()
            .map(|(geometry, &world_from_object)| Instance { geometry, world_from_object })
            .collect();
        let options = BuildOptions::default();
        let whole = World::build(geometries.to_vec(), instances.clone(), &options).unwrap();
        let layout = whole.global_layout();
        World::build_part_sharing(geometries.to_vec(), instances, &layout, &options, previous)
            .unwrap()
    }

    #[test]
    fn a_part_takes_trees_from_an_earlier_part_in_the_same_space_alone() {
        let turned = DAffine3::from_rotation_x(0.4);
        for places in [[turned; 2], [DAffine3::IDENTITY; 2]] {
            let (still, moved) = (at(DVec3::ZERO), at(DVec3::X * 3.0));
            let both = |b: Arc<TriMesh>| vec![Geometry::Mesh(still.clone()), Geometry::Mesh(b)];
            let first = part(&both(moved), &places, None);
            let step = both(at(DVec3::X * 4.0));
            let second = part(&step, &places, Some(&first));
            let fresh = part(&step, &places, None);
            // Where every mesh has a tree of its own, that of the still one is the same.
            if places[0] == turned {
                assert!(Arc::ptr_eq(&first.blas[0], &second.blas[0]));
                assert!(!Arc::ptr_eq(&first.blas[1], &second.blas[1]));
            }
            assert_eq!(second.global_layout(), fresh.global_layout());
            for k in 0..200 {
                let x = -1.0 + 0.03 * k as f32;
                let ray = Ray::new(glam::Vec3::new(x, 0.1, 9.0), glam::Vec3::NEG_Z);
                assert_eq!(second.closest(&ray), fresh.closest(&ray), "{x}");
            }
            // Far away, the local space is another one: nothing can be taken over.
            let far: Vec<Geometry> = [DVec3::X * 900.0, DVec3::X * 903.0]
                .map(|center| Geometry::Mesh(at(center)))
                .to_vec();
            let third = part(&far, &places, Some(&second));
            assert_eq!(third.global_layout(), part(&far, &places, None).global_layout());
        }
    }
}
