//! Why a world cannot be built.

use super::build::Stopped;
use crate::mesh::MeshError;
use crate::simd::UnavailableLevel;

/// Why a world could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A mesh is unusable.
    #[error("geometry {geometry}: {source}")]
    Mesh {
        /// Index of the geometry.
        geometry: usize,
        /// What is wrong with it.
        source: MeshError,
    },
    /// The index of an instance's geometry is out of range.
    #[error("instance {instance} uses geometry {geometry}, but there are only {count}")]
    NoSuchGeometry {
        /// Index of the instance.
        instance: usize,
        /// Index of the geometry.
        geometry: usize,
        /// Number of geometries.
        count: usize,
    },
    /// A part does not match the whole scene.
    #[error(
        "a part has {found} geometries, the whole {expected}: give the part one for each, with no \
         primitives where it has none"
    )]
    NotAPart {
        /// Geometries of the whole scene.
        expected: usize,
        /// Geometries given.
        found: usize,
    },
    /// An instance of a part differs from the same instance of the whole scene.
    #[error(
        "instance {instance} is a mesh without a transform in the whole scene, and something else \
         in this part: give the part the instances of the whole, and meshes where the whole has \
         meshes"
    )]
    NotAMember {
        /// Index of the instance.
        instance: usize,
    },
    /// The machine lacks the requested instruction set.
    #[error(transparent)]
    Level(#[from] UnavailableLevel),
    /// The caller stopped the build: see [`super::World::build_watched`].
    #[error("the build was stopped by its caller; build again for a world")]
    Cancelled,
    /// A geometry that was built from slices is given without them.
    #[error(
        "geometry {geometry} was built from borrowed slices, which its world does not keep; give \
         the slices again to World::from_slices, or build from a TriMesh"
    )]
    WithoutArrays {
        /// Index of the geometry.
        geometry: usize,
    },
    /// An instance's transform cannot be inverted.
    #[error(
        "instance {instance}: its transform has determinant {determinant}; give one that is finite \
         and not singular, or leave the instance out"
    )]
    SingularTransform {
        /// Index of the instance.
        instance: usize,
        /// The determinant.
        determinant: f64,
    },
}

impl From<Stopped> for BuildError {
    fn from(Stopped: Stopped) -> Self {
        BuildError::Cancelled
    }
}
