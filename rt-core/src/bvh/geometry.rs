//! What a world is made of: geometries, and instances that place them.

mod slices;

use super::build::MAX_PRIMS;
use super::error::BuildError;
use crate::math::Aabb;
use crate::mesh::{MeshError, TriMesh};
use crate::shapes::Shape;
use glam::{DAffine3, DVec3};
pub use slices::SliceFacts;
pub(super) use slices::Sources;
use std::sync::Arc;

/// Geometry that rays can hit, shared between instances.
#[derive(Clone)]
pub enum Geometry {
    /// Triangles.
    Mesh(Arc<TriMesh>),
    /// Spheres, tubes, isosurfaces, user-defined geometry.
    Shape(Arc<dyn Shape>),
    /// Triangles in arrays that the caller kept: [`super::World::from_slices`]. The world holds
    /// their corners in its tree and has nothing to shade them with.
    Slices(Arc<SliceFacts>),
}

/// What is known of a mesh without its arrays.
#[derive(Clone, Copy)]
pub(super) struct MeshExtent {
    pub(super) origin: DVec3,
    /// Of the finite vertices, relative to the origin.
    pub(super) bounds: Aabb,
    pub(super) triangles: usize,
}

impl Geometry {
    /// Address of the shared data. It is the same for two clones of one geometry and for two
    /// appearances of one shape, and different for any two others that are both alive.
    pub(super) fn address(&self) -> usize {
        let of_shape = |s: &Arc<dyn Shape>| Arc::as_ptr(s) as *const () as usize;
        match self {
            Geometry::Mesh(m) => Arc::as_ptr(m) as usize,
            Geometry::Slices(s) => Arc::as_ptr(s) as usize,
            Geometry::Shape(s) => s.tree_of().as_ref().map_or_else(|| of_shape(s), of_shape),
        }
    }

    /// Number of triangles of a mesh, or of primitives of a shape.
    pub fn num_primitives(&self) -> usize {
        match self {
            Geometry::Mesh(m) => m.indices.len(),
            Geometry::Slices(s) => s.num_triangles(),
            Geometry::Shape(s) => s.num_primitives(),
        }
    }

    /// The extent of a mesh; `None` for shapes.
    pub(super) fn mesh_extent(&self) -> Option<MeshExtent> {
        match self {
            Geometry::Mesh(mesh) => Some(MeshExtent {
                origin: mesh.origin,
                bounds: mesh.triangles().bounds(),
                triangles: mesh.indices.len(),
            }),
            Geometry::Slices(facts) => Some(facts.extent()),
            Geometry::Shape(_) => None,
        }
    }

    /// Whether it has triangles.
    pub(super) fn is_mesh(&self) -> bool {
        !matches!(self, Geometry::Shape(_))
    }

    /// Whether geometry `index` can be built from its own arrays.
    pub(super) fn check(&self, index: usize) -> Result<(), BuildError> {
        let mesh = match self {
            Geometry::Mesh(mesh) => mesh,
            Geometry::Slices(_) => return Err(BuildError::WithoutArrays { geometry: index }),
            Geometry::Shape(_) => return Ok(()),
        };
        let error = |source| BuildError::Mesh { geometry: index, source };
        mesh.check().map_err(error)?;
        check_triangles(mesh.indices.len()).map_err(error)
    }
}

/// Whether builders can number this many triangles.
fn check_triangles(found: usize) -> Result<(), MeshError> {
    if found >= MAX_PRIMS {
        return Err(MeshError::TooLarge { what: "triangles", found, limit: MAX_PRIMS - 1 });
    }
    Ok(())
}

/// A geometry placed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instance {
    /// Index of the geometry.
    pub geometry: usize,
    /// Object to world; may mirror and scale unevenly, must be invertible.
    pub world_from_object: DAffine3,
}
