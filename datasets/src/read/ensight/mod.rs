//! EnSight Gold: a case file (`.case`), a geometry, and a file for each variable and time. Text, C
//! binary and Fortran binary, in both byte orders; each part becomes a block.
//!
//! Source: EnSight User Manual, chapter "EnSight Gold Casefile Format".

mod case_file;
mod geometry;
mod source;
mod variables;

use super::error::{At, Fault, read_bytes, sibling_path};
use super::options::step_at;
use super::{Content, LoadedFile, OpenOptions, ReadError, TimeStep, time_axis};
use crate::model::{Block, DataArray, Dataset, Endian, Values};
use source::Source;
use std::path::Path;

pub(crate) const FORMAT: &str = "EnSight Gold";

/// Whether the first bytes are those of a case file.
pub(crate) fn begins_as_case(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    let mut lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    lines.next() == Some("FORMAT") && lines.next().is_some_and(|l| l.starts_with("type:"))
}

/// Reads a case at its first time, or that of the options.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let bytes = read_bytes(path)?;
    let case = case_file::parse(&String::from_utf8_lossy(&bytes)).map_err(fault)?;
    let mut warnings = case.warnings.clone();
    let times = case.times();
    let steps: Vec<TimeStep> = times.iter().map(|&time| time_axis::step(path, time)).collect();
    let time = match options.time {
        Some(t) => Some(step_at(&steps, t).map_err(fault)?.time),
        None => times.first().copied(),
    };
    if times.len() > 1 {
        let of = time.unwrap_or_default();
        warnings.push(format!("a case with {} times; this is t = {of}", times.len()));
    }
    let Some(model) = &case.model else {
        let at = At::Field("GEOMETRY".into());
        return Err(fault(Fault::new(at, "there is no model", "add `model: NAME`")));
    };

    let geometry = sibling_path(path, &case.file_at(model, time).map_err(fault)?);
    let content = read_bytes(&geometry)?;
    let in_geometry = |f: Fault| f.in_file(&geometry, FORMAT);
    let (plain, order) = source::without_records(&content).map_err(in_geometry)?;
    let head = String::from_utf8_lossy(&plain[..plain.len().min(80)]).to_ascii_lowercase();
    let binary = head.trim_start().starts_with("c binary")
        || head.trim_start().starts_with("fortran binary");
    let mut s = Source::new(&plain, binary, order);
    if binary {
        s.need_text("the kind of the file").map_err(in_geometry)?;
    }
    if let Some(step) = case.step_in_file(model, time) {
        s.go_to_step(step).map_err(in_geometry)?;
    }
    let mut parts = geometry::read(&mut s).map_err(in_geometry)?;
    if parts.is_empty() {
        return Err(in_geometry(Fault::field("the geometry", "it has no parts")));
    }
    for v in &case.variables {
        let file = sibling_path(path, &case.file_at(&v.file, time).map_err(fault)?);
        let content = read_bytes(&file)?;
        let in_file = |f: Fault| f.in_file(&file, FORMAT);
        let stripped =
            if binary { source::without_records(&content) } else { plain_text(&content) };
        let (plain, order) = stripped.map_err(in_file)?;
        let mut s = Source::new(&plain, binary, order);
        if let Some(step) = case.step_in_file(&v.file, time) {
            s.go_to_step(step).map_err(in_file)?;
        }
        variables::read(&mut s, v, &mut parts, &mut warnings).map_err(in_file)?;
    }
    let mut blocks: Vec<Block> =
        parts.into_iter().map(|p| Block { name: p.name, data: p.data }).collect();
    for block in &mut blocks {
        let Some(a) = block.data.attributes_mut() else { continue };
        for (name, numbers) in &case.constants {
            a.field.push(DataArray::new(name.clone(), 1, Values::F64(numbers.clone())));
        }
        if let Some(t) = time {
            a.field.push(DataArray::new("TimeValue", 1, Values::F64(vec![t])));
        }
    }
    let data = match blocks.len() {
        1 => blocks.remove(0).data,
        _ => Dataset::MultiBlock(blocks),
    };
    let time_steps = if times.len() > 1 { steps } else { Vec::new() };
    Ok(LoadedFile { format: FORMAT, content: Content::Data(data), warnings, time_steps })
}

type Plain<'a> = (std::borrow::Cow<'a, [u8]>, Option<Endian>);

fn plain_text(content: &[u8]) -> Result<Plain<'_>, Fault> {
    Ok((content.into(), None))
}
