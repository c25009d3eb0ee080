//! Files of stored meshes ([`rt_core::bvh::StoredMesh`]), which may be larger than memory.
//!
//! ```
//! use datasets::stored_mesh;
//! use rt_core::glam::{DVec3, Vec3};
//! use rt_core::mesh::MeshSlices;
//!
//! # let folder = std::env::temp_dir().join(format!("datasets-stored-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! let path = folder.join("plates.rtmesh");
//! let mut writer = stored_mesh::create(&path, DVec3::ZERO)?;
//! for piece in 0..3 {
//!     let z = piece as f32;
//!     writer.add(&MeshSlices::new(&[0., 0., z, 4., 0., z, 0., 4., z], &[0, 1, 2]))?;
//! }
//! assert_eq!(stored_mesh::finish(writer)?.triangles, 3);
//!
//! let budget = 64 << 20;
//! let mesh = stored_mesh::open(&path, budget)?;
//! assert_eq!(mesh.report().pages, 1);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::paged_file::{OpenFile, PagedFile};
use glam::DVec3;
use rt_core::bvh::{StoredMesh, StoredMeshError, StoredMeshReport, StoredMeshWriter};
use rt_core::paging::PageSink as _;
use std::io;
use std::path::Path;

/// Opens a file. Parts of it that are in memory take at most `budget` bytes: see
/// [`StoredMesh::open`].
///
/// # Errors
/// When the file cannot be read, is no stored mesh, has another version, was cut, or is damaged.
pub fn open(path: &Path, budget: usize) -> Result<StoredMesh, StoredMeshError> {
    let file = OpenFile::open(path).map_err(|e| error(path, "cannot open it", &e))?;
    StoredMesh::open(file, budget)
}

/// Starts a file, whose positions are relative to `origin`. It has another name, which ends in
/// `.partial`, until [`finish`], and is removed when that never comes.
///
/// # Errors
/// When the file cannot be created.
pub fn create(path: &Path, origin: DVec3) -> Result<StoredMeshWriter<PagedFile>, StoredMeshError> {
    let file = PagedFile::create(path).map_err(|e| error(path, "cannot create it", &e))?;
    StoredMeshWriter::new(file, origin)
}

/// Completes a file and gives it its name.
///
/// # Errors
/// When the file cannot be written or renamed, or the mesh cannot be stored.
pub fn finish(writer: StoredMeshWriter<PagedFile>) -> Result<StoredMeshReport, StoredMeshError> {
    let (mut sink, report) = writer.finish()?;
    let completed = sink.complete();
    completed.map_err(|reason| StoredMeshError::Io { name: sink.name(), reason })?;
    Ok(report)
}

fn error(path: &Path, action: &str, source: &io::Error) -> StoredMeshError {
    let name = path.display().to_string();
    StoredMeshError::Io { name, reason: format!("{action}: {source}") }
}
