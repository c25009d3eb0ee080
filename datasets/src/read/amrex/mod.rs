//! Plotfiles of AMReX: a folder with `Header` and, for each level, boxes of cells.
//!
//! Each box becomes a block of image data with values of cells. Cells that a finer level covers
//! are marked as refined in `vtkGhostType`, so that each place is drawn once, by its finest cells.
//!
//! Source: AMReX User's Guide, "I/O", and what `WriteMultiLevelPlotfile` and `FABio` write.

mod fab;
mod header;

use super::error::{At, BROKEN, Fault, read_bytes};
use super::refinement::{BoxTree, IndexBox, mark_refined};
use super::{Content, LoadedFile, OpenOptions, ReadError};
use crate::model::{Attributes, Block, DataArray, Dataset, ImageData, Values};
use glam::DVec3;
use header::{Header, boxes_of_level};
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "AMReX plotfile";

/// The header of the plotfile that a path means: a folder, or the header itself.
pub(crate) fn header_of(path: &Path) -> Option<PathBuf> {
    let header = if path.is_dir() { path.join("Header") } else { path.to_path_buf() };
    if header.file_name()? != "Header" || !header.is_file() {
        return None;
    }
    let parent = header.parent()?;
    parent.join("Level_0").is_dir().then_some(header)
}

/// Reads all levels of a plotfile.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    options.refuse_lattice().map_err(fault)?;
    options.refuse_time().map_err(fault)?;
    let header = if path.is_dir() { path.join("Header") } else { path.to_path_buf() };
    let root = header.parent().unwrap_or(Path::new("")).to_path_buf();
    let bytes = read_bytes(&header)?;
    let h =
        header::parse(&String::from_utf8_lossy(&bytes)).map_err(|f| f.in_file(&header, FORMAT))?;

    let mut levels = Vec::new();
    for level in &h.levels {
        let list = root.join(format!("{}_H", level.path));
        let bytes = read_bytes(&list)?;
        let boxes = boxes_of_level(&String::from_utf8_lossy(&bytes), h.axes)
            .map_err(|f| f.in_file(&list, FORMAT))?;
        levels.push((list, boxes));
    }
    let mut blocks = Vec::new();
    for (l, (list, boxes)) in levels.iter().enumerate() {
        let finer = levels.get(l + 1).map(|(_, finer)| {
            let ratio = h.levels[l].ratio;
            BoxTree::new(finer.iter().map(|f| f.cells.coarsened(ratio)))
        });
        // Boxes of ranks take turns in the list, and each rank has a file: file by file, each is
        // read once.
        let mut by_file: Vec<usize> = (0..boxes.len()).collect();
        by_file.sort_by_key(|&i| &boxes[i].file);
        let mut file: Option<(PathBuf, Vec<u8>)> = None;
        let mut of_level = Vec::with_capacity(boxes.len());
        for i in by_file {
            let b = &boxes[i];
            let name = list.with_file_name(&b.file);
            if file.as_ref().is_none_or(|f| f.0 != name) {
                file = Some((name.clone(), read_bytes(&name)?));
            }
            let bytes = file.as_ref().map_or(&[][..], |f| &f.1);
            let in_file = |f: Fault| f.in_file(&name, FORMAT);
            let columns =
                fab::read(bytes, b.offset, &b.cells, h.variables.len(), h.axes).map_err(in_file)?;
            let mut data = image(&h, l, &b.cells, columns).map_err(in_file)?;
            if let Some(finer) = &finer {
                mark_refined(&mut data, &b.cells, finer);
            }
            let data = Dataset::ImageData(data);
            data.check().map_err(|e| in_file(e.into()))?;
            of_level.push((i, Block { name: format!("level {l} box {i}"), data }));
        }
        of_level.sort_by_key(|(i, _)| *i);
        blocks.extend(of_level.into_iter().map(|(_, block)| block));
    }
    let mut warnings = h.warnings.clone();
    if blocks.is_empty() {
        let at = At::Field("the levels".into());
        return Err(fault(Fault::new(at, "they have no boxes", BROKEN)));
    }
    if levels.len() > 1 {
        warnings.push(format!(
            "{} levels: cells that a finer level covers are marked as refined",
            levels.len()
        ));
    }
    let data = match blocks.len() {
        1 => blocks.remove(0).data,
        _ => Dataset::MultiBlock(blocks),
    };
    let (content, time_steps) = (Content::Data(data), Vec::new());
    Ok(LoadedFile { format: FORMAT, content, warnings, time_steps })
}

/// A box as image data.
fn image(
    h: &Header,
    level: usize,
    cells: &IndexBox,
    columns: Vec<Values>,
) -> Result<ImageData, Fault> {
    let l = &h.levels[level];
    let mut extent = [0i32; 6];
    let mut origin = DVec3::ZERO;
    let mut spacing = DVec3::ONE;
    for a in 0..h.axes {
        let first = cells.low[a] - l.domain.low[a];
        let n = cells.high[a] - cells.low[a] + 1;
        extent[2 * a + 1] = i32::try_from(n)
            .map_err(|_| Fault::field("a box", format!("{n} cells along an axis")))?;
        origin[a] = h.low[a] + l.spacing[a] * first as f64;
        spacing[a] = l.spacing[a];
    }
    let mut attributes = Attributes::default();
    for (name, values) in h.variables.iter().zip(columns) {
        attributes.cell.push(DataArray::new(name.clone(), 1, values));
    }
    attributes.field.push(DataArray::new("TimeValue", 1, Values::F64(vec![h.time])));
    Ok(ImageData { extent, attributes, ..ImageData::new([1; 3], origin, spacing) })
}
