//! Files that name other files: parallel pieces (`.pvti` and so on), time series (`.pvd`), blocks
//! (`.vtm`).

use super::file::bad_attribute;
use super::{FORMAT, merged, read_nested};
use crate::model::{Block, Dataset, extent_dims};
use crate::read::error::{BROKEN, Fault, sibling_path};
use crate::read::options::step_at;
use crate::read::{Content, ReadError, TimeStep};
use roxmltree::Node;
use std::path::Path;

/// All pieces of a parallel file as one data set of kind `serial`.
pub(super) fn pieces(
    path: &Path,
    set: Node<'_, '_>,
    serial: &str,
    depth: usize,
    warnings: &mut Vec<String>,
) -> Result<Dataset, ReadError> {
    let mut list = Vec::new();
    for piece in set.children().filter(|n| n.has_tag_name("Piece")) {
        let Some(source) = piece.attribute("Source") else {
            return Err(Fault::field("Piece", "it has no Source").in_file(path, FORMAT));
        };
        let data = nested(path, &sibling_path(path, source), depth, warnings)?;
        if data.kind() != serial {
            let what = format!("piece {source} is {}, not {serial}", data.kind());
            return Err(Fault::field("Piece", what).in_file(path, FORMAT));
        }
        list.push(data);
    }
    // Lattice pieces with ghost layers overlap. The overlaps agree, so copying them over each other
    // is correct. Ghost cells of other kinds carry `vtkGhostType` and are left out when a surface
    // is made.
    let data = merged(serial, list, warnings).map_err(|f| f.in_file(path, FORMAT))?;
    if let Some(whole) = super::file::attribute_numbers::<i32, 6>(set, "WholeExtent")
        .map_err(|f| f.in_file(path, FORMAT))?
    {
        let found = match &data {
            Dataset::ImageData(d) => d.extent,
            Dataset::RectilinearGrid(d) => d.extent,
            Dataset::StructuredGrid(d) => d.extent,
            _ => whole,
        };
        if extent_dims(found) != extent_dims(whole) {
            warnings.push(format!("the pieces cover the extent {found:?} of the whole {whole:?}"));
        }
    }
    Ok(data)
}

/// Reads the data set in `file`, which `path` names.
pub(super) fn nested(
    path: &Path,
    file: &Path,
    depth: usize,
    warnings: &mut Vec<String>,
) -> Result<Dataset, ReadError> {
    let is_legacy = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("vtk"));
    let opened = if is_legacy {
        crate::read::vtk_legacy::read(file)?
    } else {
        read_nested(file, depth + 1)?
    };
    // Pieces repeat each other's warnings; each is kept once.
    for w in opened.warnings {
        if !warnings.contains(&w) {
            warnings.push(w);
        }
    }
    match opened.content {
        Content::Data(d) => Ok(d),
        Content::Scene(_) => {
            Err(Fault::field("Piece", "it names a scene, not a data set").in_file(path, FORMAT))
        }
    }
}

/// The entries of a `.pvd` file in order of time, then part.
pub(super) fn time_steps(path: &Path, set: Node<'_, '_>) -> Result<Vec<TimeStep>, Fault> {
    let mut steps = Vec::new();
    for node in set.children().filter(|n| n.has_tag_name("DataSet")) {
        let text = node.attribute("timestep").unwrap_or("0");
        let Ok(time) = text.trim().parse::<f64>() else {
            return Err(bad_attribute(node, "timestep", text, "a number"));
        };
        let Some(name) = node.attribute("file") else {
            return Err(Fault::new(
                crate::read::error::At::Field("DataSet".into()),
                "it has no `file`",
                BROKEN,
            ));
        };
        let part = node.attribute("part").and_then(|p| p.trim().parse().ok()).unwrap_or(0);
        steps.push(TimeStep { time, part, path: sibling_path(path, name) });
    }
    steps.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.part.cmp(&b.part)));
    Ok(steps)
}

/// All parts of one time of a series, by default of the first.
pub(super) fn at_time(
    path: &Path,
    steps: &[TimeStep],
    time: Option<f64>,
    depth: usize,
    warnings: &mut Vec<String>,
) -> Result<Dataset, ReadError> {
    let Some(first) = steps.first() else {
        return Err(Fault::field("Collection", "it names no files").in_file(path, FORMAT));
    };
    let first = match time {
        Some(t) => step_at(steps, t).map_err(|f| f.in_file(path, FORMAT))?,
        None => first,
    };
    let mut blocks = Vec::new();
    for step in steps.iter().filter(|s| s.time == first.time) {
        let data = nested(path, &step.path, depth, warnings)?;
        blocks.push(Block { name: step.part.to_string(), data });
    }
    let times = 1 + steps.windows(2).filter(|w| w[0].time != w[1].time).count();
    if times > 1 && time.is_none() {
        warnings.push(format!("a series of {times} times; this is the first, t = {}", first.time));
    }
    Ok(if blocks.len() == 1 { blocks.remove(0).data } else { Dataset::MultiBlock(blocks) })
}

/// The blocks of a `.vtm` file (or the partitions of a `.vtpd` or `.vtpc`); blocks nest.
pub(super) fn multi_block(
    path: &Path,
    set: Node<'_, '_>,
    depth: usize,
    level: usize,
    warnings: &mut Vec<String>,
) -> Result<Dataset, ReadError> {
    if level > 64 {
        return Err(Fault::field("Block", "blocks nest more than 64 deep").in_file(path, FORMAT));
    }
    let mut blocks = Vec::new();
    for node in set.children().filter(|n| n.is_element()) {
        let number =
            || node.attribute("index").map_or_else(|| blocks.len().to_string(), str::to_string);
        let name = node.attribute("name").map_or_else(number, str::to_string);
        let data = match node.tag_name().name() {
            "DataSet" | "Piece" if node.has_attribute("file") => {
                let file = node.attribute("file").unwrap_or_default();
                nested(path, &sibling_path(path, file), depth, warnings)?
            }
            // One without a file is an empty slot, but a piece may hold others.
            "DataSet" => continue,
            "Piece" if !node.children().any(|n| n.is_element()) => continue,
            "Block" | "Partitions" | "Piece" => {
                multi_block(path, node, depth, level + 1, warnings)?
            }
            _ => continue,
        };
        blocks.push(Block { name, data });
    }
    Ok(Dataset::MultiBlock(blocks))
}
