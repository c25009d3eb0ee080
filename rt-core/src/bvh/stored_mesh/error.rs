//! Errors of stored meshes.

use crate::mesh::MeshError;
use glam::DVec3;

/// Why a mesh could not be stored, or a stored one not be opened.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StoredMeshError {
    /// The bytes could not be read or written.
    #[error("{name}: {reason}")]
    Io {
        /// The file, or what else the bytes are in.
        name: String,
        /// What was tried, and why it failed.
        reason: String,
    },
    /// The bytes are something else.
    #[error(
        "{name}: this is not a stored mesh (it does not start with RTSVMESH), or one that was \
         never finished; `bench store` makes one"
    )]
    NotAStoredMesh {
        /// The file.
        name: String,
    },
    /// Another version of the format.
    #[error(
        "{name}: version {found} of the format; this program reads version {expected}: store the \
         mesh again"
    )]
    Version {
        /// The file.
        name: String,
        /// Its version.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// More or fewer bytes than the header says.
    #[error(
        "{name}: {found} bytes, but the header says {expected}: the file was cut, or is still \
         being copied; copy it or store the mesh again"
    )]
    Length {
        /// The file.
        name: String,
        /// Bytes there.
        found: u64,
        /// Bytes that the header names.
        expected: u64,
    },
    /// The bytes of the header, of the table of pages or of a page are not those that were written.
    #[error("{name}: {part} at byte {offset} is damaged: {reason}; store the mesh again")]
    Damaged {
        /// The file.
        name: String,
        /// The part of the file.
        part: String,
        /// Where the part starts.
        offset: u64,
        /// What is wrong.
        reason: String,
    },
    /// A piece of the mesh is invalid.
    #[error("piece {piece} (counted from 0): {source}")]
    Mesh {
        /// Number of the piece.
        piece: u64,
        /// What is wrong with it.
        source: MeshError,
    },
    /// A piece has another origin.
    #[error(
        "piece {piece} (counted from 0) has the origin {found}, but the file has {expected}: give \
         all pieces positions relative to one origin"
    )]
    Origin {
        /// Number of the piece.
        piece: u64,
        /// Its origin.
        found: DVec3,
        /// The origin given to [`super::StoredMeshWriter::new`].
        expected: DVec3,
    },
    /// Coordinates are too large or too small for the triangle test.
    #[error(
        "the largest coordinate is {reach:e}; it must be from 1e-6 to 1e9: scale the positions by \
         a power of two, and the instance by its inverse"
    )]
    Reach {
        /// The largest absolute value of a coordinate.
        reach: f32,
    },
    /// There are more pages than 32-bit numbers can count.
    #[error("{found} pages; a file has at most {most}: divide the mesh among several files")]
    TooManyPages {
        /// Pages of the mesh.
        found: u64,
        /// The limit.
        most: u64,
    },
    /// The machine stores numbers with the highest byte first.
    #[error("stored meshes can be used on little-endian machines only")]
    BigEndian,
}
