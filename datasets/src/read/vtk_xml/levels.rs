//! Levels of refinement (AMR): `.vth` and `.vthb` files, which name a file for each box of cells.
//!
//! Cells that a box of the next level covers are marked as refined in `vtkGhostType`, as VTK's
//! reader does it. Source: vtkXMLUniformGridAMRReader.cxx (versions 1.0 and 1.1) and
//! vtkXMLHierarchicalBoxDataReader.cxx (version 0.1, in which the boxes are not grouped by levels).

use super::file::attribute_numbers;
use super::parallel::nested;
use super::{FORMAT, file::bad_attribute};
use crate::model::{Block, Dataset, ImageData, extent_dims};
use crate::read::ReadError;
use crate::read::error::{At, BROKEN, Fault, sibling_path};
use crate::read::refinement::{BoxTree, IndexBox, mark_refined};
use roxmltree::Node;
use std::path::Path;

/// Names of such data sets, from the newest on.
pub(super) const KINDS: [&str; 4] =
    ["vtkOverlappingAMR", NOT_OVERLAPPING, "vtkHierarchicalBoxDataSet", "vtkHierarchicalDataSet"];
const NOT_OVERLAPPING: &str = "vtkNonOverlappingAMR";
/// Levels, at most; each halves the cells at least.
const MOST_LEVELS: usize = 64;

/// A box of a level.
struct LevelBox {
    level: usize,
    name: String,
    /// Its cells in the numbers of the level, where the file has them.
    cells: Option<IndexBox>,
    data: Dataset,
}

/// All boxes as blocks, the coarsest level first.
pub(super) fn read(
    path: &Path,
    set: Node<'_, '_>,
    depth: usize,
    warnings: &mut Vec<String>,
) -> Result<Dataset, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let mut boxes: Vec<LevelBox> = Vec::new();
    for node in set.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "Block" => {
                let level = level_of(node, "level").map_err(fault)?;
                for one in node.children().filter(|n| n.has_tag_name("DataSet")) {
                    boxes.extend(level_box(path, one, level, "index", depth, warnings)?);
                }
            }
            "DataSet" => {
                let level = level_of(node, "group").map_err(fault)?;
                boxes.extend(level_box(path, node, level, "dataset", depth, warnings)?);
            }
            _ => {}
        }
    }
    boxes.sort_by_key(|b| b.level);
    let Some(levels) = boxes.last().map(|b| b.level + 1) else {
        return Err(fault(Fault::new(
            At::Field("the levels".into()),
            "they name no files",
            BROKEN,
        )));
    };
    for level in 1..levels {
        let finer = boxes.iter().filter(|b| b.level == level);
        let Some(ratio) = ratio(&boxes, level).map_err(fault)? else { continue };
        let tree = BoxTree::new(finer.filter_map(|b| b.cells).map(|c| c.coarsened(ratio)));
        for coarse in boxes.iter_mut().filter(|b| b.level + 1 == level) {
            if let (Some(cells), Dataset::ImageData(image)) = (coarse.cells, &mut coarse.data) {
                mark_refined(image, &cells, &tree);
            }
        }
    }
    // Boxes that do not overlap have no numbers.
    let unknown = boxes.iter().filter(|b| b.cells.is_none()).count();
    if levels > 1 && unknown < boxes.len() {
        warnings.push(format!(
            "{levels} levels: cells that a finer level covers are marked as refined"
        ));
    }
    if levels > 1 && unknown > 0 && set.tag_name().name() != NOT_OVERLAPPING {
        warnings.push(format!(
            "{unknown} of {} boxes are without an amr_box or no image data: where they overlap \
             those of other levels, nothing is marked as refined",
            boxes.len()
        ));
    }
    let blocks = boxes.into_iter().map(|b| Block { name: b.name, data: b.data });
    Ok(Dataset::MultiBlock(blocks.collect()))
}

fn level_of(node: Node<'_, '_>, name: &str) -> Result<usize, Fault> {
    let text = node.attribute(name).unwrap_or("0");
    let level = text.trim().parse::<usize>().ok().filter(|l| *l < MOST_LEVELS);
    level.ok_or_else(|| bad_attribute(node, name, text, "the number of a level"))
}

/// The box that a node names; `None` where it has no file.
fn level_box(
    path: &Path,
    node: Node<'_, '_>,
    level: usize,
    number: &str,
    depth: usize,
    warnings: &mut Vec<String>,
) -> Result<Option<LevelBox>, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let Some(file) = node.attribute("file") else { return Ok(None) };
    let data = nested(path, &sibling_path(path, file), depth, warnings)?;
    let name = format!("level {level} box {}", node.attribute(number).unwrap_or("?"));
    let numbers = attribute_numbers::<i32, 6>(node, "amr_box").map_err(fault)?;
    let numbers = numbers.map(|n| n.map(i64::from));
    let cells = match (numbers, &data) {
        (Some([x0, x1, y0, y1, z0, z1]), Dataset::ImageData(image)) => {
            let cells = IndexBox { low: [x0, y0, z0], high: [x1, y1, z1] };
            Some(fitted(cells, image).ok_or_else(|| {
                let dims = extent_dims(image.extent);
                let what = format!("its amr_box {cells:?} is not that of {dims:?} points");
                fault(Fault::new(At::Field(format!("`{file}`")), what, BROKEN))
            })?)
        }
        _ => None,
    };
    Ok(Some(LevelBox { level, name, cells, data }))
}

/// Cells of an image without values, at most.
const MOST_EMPTY: u64 = 1 << 24;

/// The box, if the image has its cells, and values for many. Along axes that the data do not have,
/// it is one cell thick whatever the file says.
fn fitted(mut cells: IndexBox, image: &ImageData) -> Option<IndexBox> {
    let dims = extent_dims(image.extent);
    for a in 0..3 {
        match dims[a] {
            0 => return None,
            1 => (cells.low[a], cells.high[a]) = (0, 0),
            n => {
                let count = cells.high[a].checked_sub(cells.low[a])?.checked_add(1)?;
                if count != n as i64 - 1 {
                    return None;
                }
            }
        }
    }
    let a = &image.attributes;
    let values = a.point.iter().chain(&a.cell).map(|a| a.tuples() as u64).max().unwrap_or(0);
    cells.count().filter(|n| *n <= values.max(MOST_EMPTY)).map(|_| cells)
}

/// How many cells of a level are along an axis of one cell of the level before it. `None` where one
/// of them has no boxes with numbers.
fn ratio(boxes: &[LevelBox], level: usize) -> Result<Option<i64>, Fault> {
    let spacing = |level: usize| {
        boxes.iter().filter(|b| b.level == level).find_map(|b| match (&b.cells, &b.data) {
            // An axis that the data do not have has any spacing.
            (Some(_), Dataset::ImageData(image)) => {
                let dims = extent_dims(image.extent);
                (0..3).find(|&a| dims[a] > 1).map(|a| image.spacing[a])
            }
            _ => None,
        })
    };
    let (Some(coarse), Some(fine)) = (spacing(level - 1), spacing(level)) else { return Ok(None) };
    let ratio = coarse / fine;
    let whole = ratio.round();
    if !((ratio - whole).abs() < 1e-3 * ratio && (1.0..=1024.0).contains(&whole)) {
        let what = format!("its cells are {fine} wide, and those of the level before {coarse}");
        return Err(Fault::new(At::Field(format!("level {level}")), what, BROKEN));
    }
    Ok(Some(whole as i64))
}
