//! Exports the captured scene to a file, so that other programs can read what the library captured.
//!
//! ```text
//!   library ── [`write_scene`] ── .gluray file ([format]) ── `gluray export` ── [convert] ── PLY, GLB, VTP (datasets' writers)
//! ```
//! The library writes the plain file on request of the panel or of `GLURAY_DUMP`. It makes one pass
//! over its arrays and converts nothing inside the program's process.

pub mod convert;
pub mod format;

pub use convert::{ConvertReport, to_mesh, to_poly_data};
pub use format::{Object, Scene, SceneError, read_scene, write_scene};

/// Where the library puts scenes that the panel asks for: `scenes` in the folder for state.
pub fn scenes_folder(variable: impl Fn(&str) -> Option<String>) -> Option<std::path::PathBuf> {
    crate::host::folders::state(variable).map(|f| f.join("scenes"))
}
