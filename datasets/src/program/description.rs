//! What `datasets info` prints of a file.

use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
pub(super) struct Info {
    pub(super) file: String,
    pub(super) format: &'static str,
    pub(super) kind: &'static str,
    /// `None` where the file does not count them.
    pub(super) points: Option<u64>,
    pub(super) cells: u64,
    pub(super) materials: usize,
    pub(super) textures: usize,
    /// Blocks of a collection, meshes of a scene, or the one data set.
    pub(super) parts: Vec<Part>,
    /// Times of a series or case; the other fields describe the one that was read.
    pub(super) times: Vec<f64>,
    /// Of files that are larger than memory.
    pub(super) stored: Option<Stored>,
    pub(super) warnings: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) kind: &'static str,
    pub(super) points: Option<u64>,
    pub(super) cells: u64,
    pub(super) arrays: Vec<Array>,
}

#[derive(Serialize)]
pub(super) struct Array {
    pub(super) name: String,
    /// `point`, `cell` or `field`.
    pub(super) of: &'static str,
    #[serde(rename = "type")]
    pub(super) scalar_type: &'static str,
    pub(super) components: usize,
    pub(super) tuples: Option<u64>,
    /// Smallest and largest finite value; for a vector, those of its magnitude.
    pub(super) range: Option<(f64, f64)>,
}

impl Info {
    /// Without parts.
    pub(super) fn new(file: &Path, format: &'static str, kind: &'static str) -> Info {
        Info {
            file: file.display().to_string(),
            format,
            kind,
            points: None,
            cells: 0,
            materials: 0,
            textures: 0,
            parts: vec![],
            times: vec![],
            stored: None,
            warnings: vec![],
        }
    }
}

/// How a file is divided.
#[derive(Serialize)]
pub(super) struct Stored {
    /// Pages of a mesh, or bricks of a volume.
    pub(super) pages: u64,
    /// Bytes of the file.
    pub(super) bytes: u64,
}
