//! What a world is made of: geometries, and instances that place them.

use super::build::MAX_PRIMS;
use super::error::BuildError;
use crate::mesh::{MeshError, TriMesh};
use crate::shapes::Shape;
use glam::DAffine3;
use std::sync::Arc;

/// Geometry that rays can hit, shared between instances.
#[derive(Clone)]
pub enum Geometry {
    /// Triangles.
    Mesh(Arc<TriMesh>),
    /// Spheres, tubes, isosurfaces, user-defined geometry.
    Shape(Arc<dyn Shape>),
}

impl Geometry {
    /// Address of the shared data. It is the same for two clones of one geometry and for two
    /// appearances of one shape, and different for any two others that are both alive.
    pub(super) fn address(&self) -> usize {
        let of_shape = |s: &Arc<dyn Shape>| Arc::as_ptr(s) as *const () as usize;
        match self {
            Geometry::Mesh(m) => Arc::as_ptr(m) as usize,
            Geometry::Shape(s) => s.tree_of().as_ref().map_or_else(|| of_shape(s), of_shape),
        }
    }

    /// Number of triangles of a mesh, or of primitives of a shape.
    pub fn num_primitives(&self) -> usize {
        match self {
            Geometry::Mesh(m) => m.indices.len(),
            Geometry::Shape(s) => s.num_primitives(),
        }
    }

    /// Whether geometry `index` can be built.
    pub(super) fn check(&self, index: usize) -> Result<(), BuildError> {
        let Geometry::Mesh(mesh) = self else { return Ok(()) };
        let error = |source| BuildError::Mesh { geometry: index, source };
        mesh.check().map_err(error)?;
        if mesh.indices.len() >= MAX_PRIMS {
            let found = mesh.indices.len();
            return Err(error(MeshError::TooLarge {
                what: "triangles",
                found,
                limit: MAX_PRIMS - 1,
            }));
        }
        Ok(())
    }
}

/// A geometry placed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instance {
    /// Index of the geometry.
    pub geometry: usize,
    /// Object to world; may mirror and scale unevenly, must be invertible.
    pub world_from_object: DAffine3,
}
