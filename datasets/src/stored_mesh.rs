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

use crate::atomic_file::PartialFile;
use glam::DVec3;
use rt_core::bvh::{
    PageSink, PageSource, StoredMesh, StoredMeshError, StoredMeshReport, StoredMeshWriter,
};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Opens a file. Parts of it that are in memory take at most `budget` bytes: see
/// [`StoredMesh::open`].
///
/// # Errors
/// When the file cannot be read, is no stored mesh, has another version, was cut, or is damaged.
pub fn open(path: &Path, budget: usize) -> Result<StoredMesh, StoredMeshError> {
    let file = File::open(path).map_err(|e| error(path, "cannot open it", &e))?;
    StoredMesh::open(OpenFile { file, path: path.to_path_buf() }, budget)
}

/// Starts a file, whose positions are relative to `origin`. It has another name, which ends in
/// `.partial`, until [`finish`], and is removed when that never comes.
///
/// # Errors
/// When the file cannot be created.
pub fn create(
    path: &Path,
    origin: DVec3,
) -> Result<StoredMeshWriter<StoredMeshFile>, StoredMeshError> {
    let file = PartialFile::create(path).map_err(|e| error(path, "cannot create it", &e))?;
    StoredMeshWriter::new(StoredMeshFile { file, written: 0 }, origin)
}

/// Completes a file and gives it its name.
///
/// # Errors
/// When the file cannot be written or renamed, or the mesh cannot be stored.
pub fn finish(
    writer: StoredMeshWriter<StoredMeshFile>,
) -> Result<StoredMeshReport, StoredMeshError> {
    let (mut sink, report) = writer.finish()?;
    sink.file.complete().map_err(|e| {
        let (name, reason) = (sink.name(), sink.unwritable(sink.written, &e));
        StoredMeshError::Io { name, reason }
    })?;
    Ok(report)
}

fn error(path: &Path, action: &str, source: &io::Error) -> StoredMeshError {
    let name = path.display().to_string();
    StoredMeshError::Io { name, reason: format!("{action}: {source}") }
}

/// A file that is read at any place by several threads.
struct OpenFile {
    file: File,
    path: PathBuf,
}

impl PageSource for OpenFile {
    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn length(&self) -> Result<u64, String> {
        self.file.metadata().map(|m| m.len()).map_err(|e| format!("cannot look at it: {e}"))
    }

    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), String> {
        let length = bytes.len();
        read_at(&self.file, bytes, offset)
            .map_err(|e| format!("cannot read {length} bytes from byte {offset} on: {e}"))
    }
}

/// Reads all of `bytes` from `offset` on, without a position that threads would share.
#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

/// Reads all of `bytes` from `offset` on, without a position that threads would share.
#[cfg(windows)]
fn read_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        bytes = &mut bytes[read..];
        offset += read as u64;
    }
    Ok(())
}

/// A file that gets its name when it is complete.
pub struct StoredMeshFile {
    file: PartialFile,
    /// Bytes given so far.
    written: u64,
}

impl StoredMeshFile {
    /// Why bytes from `offset` on could not be written.
    fn unwritable(&self, offset: u64, source: &io::Error) -> String {
        let cure = match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "; make room, or write to another disk"
            }
            _ => "",
        };
        format!("cannot write it from byte {offset} on: {source}{cure}")
    }
}

impl PageSink for StoredMeshFile {
    fn name(&self) -> String {
        self.file.path.display().to_string()
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), String> {
        let offset = self.written;
        self.file.writer.write_all(bytes).map_err(|e| self.unwritable(offset, &e))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    fn replace_start(&mut self, bytes: &[u8]) -> Result<(), String> {
        // What is still in the buffer is written first.
        let flushed = self.file.writer.flush();
        flushed.map_err(|e| self.unwritable(self.written, &e))?;
        let writer = &mut self.file.writer;
        let replaced = writer.seek(SeekFrom::Start(0)).and_then(|_| writer.write_all(bytes));
        replaced.map_err(|e| self.unwritable(0, &e))
    }
}
