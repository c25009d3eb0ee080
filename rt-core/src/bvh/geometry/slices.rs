//! Meshes whose arrays the caller keeps.

use super::{Geometry, MeshExtent, check_triangles};
use crate::bvh::error::BuildError;
use crate::math::Aabb;
use crate::mesh::{MeshSlices, Triangles};
use glam::DVec3;

/// What a world keeps of a mesh that it was built from slices of: a few numbers, not the arrays.
///
/// ```
/// use rt_core::mesh::MeshSlices;
/// use rt_core::prelude::*;
///
/// let (corners, triangle) = ([0., 0., 0., 1., 0., 0., 0., 1., 0.], [0, 1, 2]);
/// let mesh = MeshSlices::new(&corners, &triangle);
/// let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
/// let world = World::from_slices(&[mesh], vec![placed], &BuildOptions::default())?;
/// let Geometry::Slices(facts) = &world.geometries()[0] else { panic!() };
/// assert_eq!((facts.num_vertices(), facts.num_triangles()), (3, 1));
/// # Ok::<(), rt_core::bvh::BuildError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SliceFacts {
    origin: DVec3,
    bounds: Aabb,
    vertices: usize,
    triangles: usize,
    /// Triangles that a refit made invalid, ascending: leaves hold points in their place.
    unusable: Vec<u32>,
}

impl SliceFacts {
    pub(in crate::bvh) fn of(mesh: Triangles<'_>) -> SliceFacts {
        SliceFacts {
            origin: mesh.origin,
            bounds: mesh.bounds(),
            vertices: mesh.vertices,
            triangles: mesh.indices.len(),
            unusable: Vec::new(),
        }
    }

    /// The facts after a refit.
    pub(in crate::bvh) fn of_refitted(mesh: Triangles<'_>) -> SliceFacts {
        let unusable = (0..mesh.indices.len()).filter(|&i| !mesh.is_renderable(i));
        SliceFacts { unusable: unusable.map(|i| i as u32).collect(), ..SliceFacts::of(mesh) }
    }

    /// Number of vertices in the slices.
    pub fn num_vertices(&self) -> usize {
        self.vertices
    }

    /// Number of triangles in the slices.
    pub fn num_triangles(&self) -> usize {
        self.triangles
    }

    pub(super) fn extent(&self) -> MeshExtent {
        MeshExtent { origin: self.origin, bounds: self.bounds, triangles: self.triangles }
    }

    /// Whether a triangle in a leaf is one, and not a point in the place of one.
    pub(in crate::bvh) fn is_present(&self, triangle: u32) -> bool {
        self.unusable.binary_search(&triangle).is_err()
    }
}

/// Where builders read from: geometries, and the arrays of those that are slices.
#[derive(Clone, Copy)]
pub(in crate::bvh) struct Sources<'a> {
    pub(in crate::bvh) geometries: &'a [Geometry],
    /// One for each geometry, or none at all.
    pub(in crate::bvh) slices: &'a [MeshSlices<'a>],
}

impl<'a> Sources<'a> {
    /// Whether geometry `index` can be built.
    pub(in crate::bvh) fn check(&self, index: usize) -> Result<(), BuildError> {
        let Some(mesh) = self.slices.get(index) else { return self.geometries[index].check(index) };
        let error = |source| BuildError::Mesh { geometry: index, source };
        mesh.check().and_then(|()| check_triangles(mesh.num_triangles())).map_err(error)
    }

    /// The triangles of geometry `index`, which was checked and is no shape.
    pub(in crate::bvh) fn triangles(&self, index: usize) -> Triangles<'a> {
        match (&self.geometries[index], self.slices.get(index)) {
            (Geometry::Mesh(mesh), _) => mesh.triangles(),
            (Geometry::Slices(_), Some(slices)) => slices.triangles(),
            _ => unreachable!("only meshes with arrays are built as meshes"),
        }
    }
}
