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
        BuildRequest { whole: Some(whole), ..request }.build(geometries, instances)
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
