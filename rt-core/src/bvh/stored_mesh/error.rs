//! Errors of meshes in files.

use crate::mesh::MeshError;
use glam::DVec3;
use std::io;
use std::path::PathBuf;

/// Why a mesh could not be written to a file, or not be read from one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoredMeshError {
    /// The file could not be opened, created, read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is something else.
    #[error(
        "{}: this is not a stored mesh (it does not start with RTSVMESH); make one with \
         StoredMeshWriter, or with `bench store`",
        path.display()
    )]
    NotAStoredMesh {
        /// The file.
        path: PathBuf,
    },
    /// The file has another version of the format.
    #[error(
        "{}: version {found} of the format; this program reads version {expected}: store the mesh \
         again",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// The file is longer or shorter than its header says.
    #[error(
        "{}: {found} bytes, but the header says {expected}: the file was cut, or is still being \
         copied; copy it or store the mesh again",
        path.display()
    )]
    Length {
        /// The file.
        path: PathBuf,
        /// Bytes in the file.
        found: u64,
        /// Bytes that the header names.
        expected: u64,
    },
    /// The bytes of the header, of the table of pages or of a page are not those that were written.
    #[error(
        "{}: {part} at byte {offset} is damaged: {reason}; store the mesh again",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The part of the file.
        part: &'static str,
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
        /// The origin given to [`super::StoredMeshWriter::create`].
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
