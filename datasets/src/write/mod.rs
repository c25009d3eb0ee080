//! Writers: VTK's XML files for ParaView, PLY, OBJ and GLB for mesh programs.

pub mod gltf;
pub mod obj;
pub mod ply;
pub mod vtk_xml;

pub use gltf::write_glb;
pub use obj::write_obj;
pub use ply::write_ply;
pub use vtk_xml::{Encoding, VtkOptions, write_pvd, write_vtk};

use std::path::{Path, PathBuf};

/// Why a file cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The operating system reports an error.
    #[error("{}: cannot be written; check that the directory exists, may be written and has \
             room", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The data or the name does not fit the format.
    #[error("{}: cannot be written: {what}; {cure}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What to do.
        cure: String,
    },
}

impl WriteError {
    pub(crate) fn refused(path: &Path, what: impl Into<String>, cure: impl Into<String>) -> Self {
        WriteError::Refused { path: path.to_path_buf(), what: what.into(), cure: cure.into() }
    }
}

/// Writes a file with `body`. An unfinished file is removed.
pub(crate) fn write_file(
    path: &Path,
    body: impl FnOnce(&mut dyn std::io::Write) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    let io = |source| WriteError::Io { path: path.to_path_buf(), source };
    let mut out = std::io::BufWriter::new(std::fs::File::create(path).map_err(io)?);
    let written = body(&mut out).and_then(|()| std::io::Write::flush(&mut out));
    written.map_err(|source| {
        // Report the write error; a failure to remove the file does not change it.
        let _ = std::fs::remove_file(path);
        io(source)
    })
}
