//! Builds and installs the bridge for the VTK installations of this machine, as the program
//! `vtk-bridge` does.
//!
//! ```text
//! PREFIX/autoload/librtv_loader.so        the only library in the folder that VTK_AUTOLOAD_PATH names
//! PREFIX/lib/FLAVOUR/librtv_shim.so       the C++ shim for one VTK: 9.1, pv5.11, …
//! PREFIX/plugins/pv5.11/VtkBridge.so      ParaView's plugin with its panel (`install --plugin`)
//! PREFIX/include/rtv.h                    the C interface
//! ```

pub mod compile;
pub mod doctor;
pub mod environment;
pub mod headers;
pub mod layout;
pub mod plugin;

use std::path::PathBuf;

/// Errors of the set-up, each with its cure.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// A file or folder could not be accessed.
    #[error("{path}: cannot {what}: {source}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The operation.
        what: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A program is missing.
    #[error("`{program}` does not start ({source}); install it: {cure}")]
    NoProgram {
        /// Name of the program.
        program: String,
        /// The system's reason.
        source: std::io::Error,
        /// How to install it.
        cure: &'static str,
    },
    /// A compiler or cmake failed.
    #[error("building {what} failed:\n{output}\ncommand: {command}")]
    Build {
        /// What was built.
        what: String,
        /// The last lines of its output.
        output: String,
        /// How to repeat the command.
        command: String,
    },
    /// The library that VTK loads is not next to the program.
    #[error(
        "libvtk_bridge.so is neither beside {program} nor in its folder `deps`; build it with \
         `cargo build -p vtk-bridge`, or name it in RTV_LIBRARY"
    )]
    NoLibrary {
        /// Folder of the program.
        program: PathBuf,
    },
    /// There is no VTK with headers.
    #[error(
        "no headers of VTK or ParaView were found in {looked}; install them (Debian: `apt-get \
         install libvtk9-dev`, or `paraview-dev libglew-dev`), or name \
         the folder with vtkObjectFactory.h in RTV_VTK_INCLUDE"
    )]
    NoHeaders {
        /// Folders that were searched.
        looked: String,
    },
    /// The requested VTK has no headers here.
    #[error("{asked} is not built, and its headers were not found; {cure}")]
    NotFound {
        /// VTK or ParaView.
        asked: &'static str,
        /// How to install them.
        cure: &'static str,
    },
}

/// Converts an I/O error to [`SetupError::Io`].
pub(crate) fn io<'a>(
    path: &'a std::path::Path,
    what: &'static str,
) -> impl Fn(std::io::Error) -> SetupError + 'a {
    move |source| SetupError::Io { path: path.to_owned(), what, source }
}
