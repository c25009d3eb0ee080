//! VTK's XML files: one data set (`.vti .vtp .vtu .vtr .vts`), or a list of other files (`.pvti …
//! .pvd .vtm .vthb`).
//!
//! All encodings (ascii, inline base64, appended base64, appended raw), both header types, both
//! byte orders, ZLib and LZ4 compression. By default, ParaView writes appended raw data without
//! compression, and VTK's writers write base64 with ZLib. LZMA is rejected by name. Source: "VTK
//! File Formats" (Kitware), and what VTK 9.7 and ParaView 5.11 write.

pub(crate) mod blocks;
mod cell_pieces;
mod file;
mod levels;
mod outline;
mod parallel;
mod piece_files;
pub(crate) mod pieces;
pub(crate) mod series;
mod stored_array;

pub use cell_pieces::{CellPiece, CellPieces};
pub use piece_files::{PieceFiles, piece_files};

use super::{Content, LoadedFile, OpenOptions, ReadError, TimeStep};
use crate::model::Dataset;
use crate::read::error::{At, Fault, read_bytes};
use file::{XmlFile, parse_tree, split};
use std::path::Path;

pub(crate) const FORMAT: &str = "VTK XML";

/// Maximum nesting of files that name files; anything deeper is a cycle.
const MAX_NESTING: usize = 8;

/// Reads a VTK XML file of any kind, with the files that it names.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_nested(path, 0)
}

/// As [`read`], and of a collection the given time.
pub fn read_at(path: &Path, time: Option<f64>) -> Result<LoadedFile, ReadError> {
    from_bytes(path, &read_bytes(path)?, 0, time)
}

/// Reads one file's content; other files are resolved relative to `path`.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    from_bytes(path, bytes, 0, None)
}

fn read_nested(path: &Path, depth: usize) -> Result<LoadedFile, ReadError> {
    from_bytes(path, &read_bytes(path)?, depth, None)
}

fn from_bytes(
    path: &Path,
    bytes: &[u8],
    depth: usize,
    time: Option<f64>,
) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    if depth > MAX_NESTING {
        let what = format!("files name each other more than {MAX_NESTING} deep");
        let cure = "look for a file that names itself".to_string();
        return Err(fault(Fault::new(At::Field("the chain of files".into()), what, cure)));
    }
    let parts = split(bytes).map_err(fault)?;
    let tree = parse_tree(&parts.head).map_err(fault)?;
    let file = XmlFile::new(&tree, parts.appended).map_err(fault)?;
    let mut warnings = Vec::new();
    let mut steps: Vec<TimeStep> = Vec::new();
    let kind = file.root.attribute("type").unwrap_or("").to_string();
    let set = file.root.children().find(|n| n.is_element() && n.tag_name().name() == kind);
    let Some(set) = set else {
        return Err(fault(Fault::field(
            "VTKFile",
            format!("it has no element `{kind}`, its own type"),
        )));
    };
    if kind != "Collection" {
        OpenOptions { time, ..OpenOptions::default() }.refuse_time().map_err(fault)?;
    }
    let data = if pieces::KINDS.contains(&kind.as_str()) {
        let pieces = pieces::pieces(&file, set, &mut warnings).map_err(fault)?;
        merged(&kind, pieces, &mut warnings).map_err(fault)?
    } else if let Some(serial) = kind.strip_prefix('P').filter(|k| pieces::KINDS.contains(k)) {
        parallel::pieces(path, set, serial, depth, &mut warnings)?
    } else if kind == "Collection" {
        steps = parallel::time_steps(path, set).map_err(fault)?;
        parallel::at_time(path, &steps, time, depth, &mut warnings)?
    } else if kind == "vtkMultiBlockDataSet"
        || kind == "vtkPartitionedDataSetCollection"
        || kind == "vtkPartitionedDataSet"
    {
        parallel::multi_block(path, set, depth, 0, &mut warnings)?
    } else if levels::KINDS.contains(&kind.as_str()) {
        levels::read(path, set, depth, &mut warnings)?
    } else {
        let known = "PolyData, UnstructuredGrid, ImageData, RectilinearGrid, StructuredGrid, their \
                     parallel forms, Collection, vtkMultiBlockDataSet and vtkOverlappingAMR are";
        let at = At::Field("attribute `type` of VTKFile".into());
        return Err(fault(Fault::unsupported(
            at,
            format!("`{kind}`"),
            format!("{known}; convert it to one of them"),
        )));
    };
    Ok(LoadedFile { format: FORMAT, content: Content::Data(data), warnings, time_steps: steps })
}

/// Combines pieces to one data set of kind `kind`, even if there are none.
fn merged(kind: &str, pieces: Vec<Dataset>, warnings: &mut Vec<String>) -> Result<Dataset, Fault> {
    if pieces.is_empty() {
        warnings.push(format!("the {kind} is empty: it has no pieces"));
        if kind == "UnstructuredGrid" {
            return Ok(Dataset::UnstructuredGrid(Default::default()));
        }
    }
    Ok(Dataset::merge(pieces, warnings)?)
}
