//! Arrays of points, of cells and of the whole.

use super::Step;
use crate::model::{Attributes, DataArray};
use crate::read::error::Fault;
use crate::read::hdf5::{Data, Object};
use std::ops::Range;

/// Which arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Section {
    Points,
    Cells,
}

impl Section {
    fn name(self) -> &'static str {
        match self {
            Section::Points => "PointData",
            Section::Cells => "CellData",
        }
    }
}

fn push(
    what: Section,
    object: &Object<'_>,
    array: DataArray,
    out: &mut Attributes,
) -> Result<(), Fault> {
    let name = array.name.clone();
    let marked = object.text("Attribute")?;
    let list = match what {
        Section::Points => &mut out.point,
        Section::Cells => &mut out.cell,
    };
    list.push(array);
    match (what, marked.as_deref()) {
        (Section::Points, Some("Scalars")) => out.point_scalars = Some(name),
        (Section::Points, Some("Normals")) => out.point_normals = Some(name),
        (Section::Points, Some("TCoords")) => out.point_texcoords = Some(name),
        (Section::Cells, Some("Scalars")) => out.cell_scalars = Some(name),
        (Section::Cells, Some("Normals")) => out.cell_normals = Some(name),
        _ => {}
    }
    Ok(())
}

/// Texts and other arrays without numbers are named and left out.
fn numbers(
    object: &Object<'_>,
    data: Data,
    warnings: &mut Vec<String>,
) -> Option<crate::model::Values> {
    let found = match data {
        Data::Numbers(v) => return Some(v),
        Data::Texts(_) => "texts".to_string(),
        Data::References(_) => "references".to_string(),
        Data::Other(name) => name,
    };
    warnings.push(format!("array `{}` left out: it holds {found}", object.path));
    None
}

/// Arrays whose first axis counts points or cells: those in `range`, which begins `range.start`
/// behind the beginning of the time. `start` is that beginning, for arrays that do not have one of
/// their own.
pub(super) fn section(
    group: &Object<'_>,
    what: Section,
    range: Range<u64>,
    start: u64,
    step: &Step<'_>,
    out: &mut Attributes,
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    let Some(arrays) = group.find(what.name())? else { return Ok(()) };
    for (name, object) in arrays.children(warnings)? {
        let shape = object.shape()?;
        let components = match shape[..] {
            [_] => 1,
            [_, components] if components > 0 => components,
            _ => {
                let what = format!("{shape:?} instead of one or two axes");
                return Err(Fault::field(format!("`{}`", object.path), what));
            }
        };
        let begin = step.offset(&format!("{}Offsets/{name}", what.name()), 0)?.unwrap_or(start);
        let mut from = vec![0; shape.len()];
        let mut count = shape.clone();
        from[0] = begin.saturating_add(range.start);
        count[0] = range.end - range.start;
        let data = object.read_box(&from, &count)?;
        if let Some(values) = numbers(&object, data, warnings) {
            push(what, &object, DataArray::new(name, components as usize, values), out)?;
        }
    }
    Ok(())
}

/// Arrays with an axis for each of the lattice, z first; those of several times have one more.
pub(super) fn on_lattice(
    group: &Object<'_>,
    what: Section,
    dims: [u64; 3],
    step: &Step<'_>,
    out: &mut Attributes,
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    let Some(arrays) = group.find(what.name())? else { return Ok(()) };
    let lattice = [dims[2], dims[1], dims[0]];
    for (name, object) in arrays.children(warnings)? {
        let shape = object.shape()?;
        let mut rest = &shape[..];
        let mut from = vec![0; shape.len()];
        let mut count = shape.clone();
        if let Some((_, number)) = &step.group
            && let [times, of_time @ ..] = rest
        {
            let own = step.offset(&format!("{}Offsets/{name}", what.name()), 0)?;
            // A static array has one entry; without offsets, entry and time agree.
            from[0] = own.unwrap_or(if *times == 1 { 0 } else { *number });
            count[0] = 1;
            rest = of_time;
        }
        // Programs that write planes leave out axes of one point.
        let flat: Vec<u64> = lattice.into_iter().filter(|&d| d != 1).collect();
        let components = [&lattice[..], &flat[..]].into_iter().find_map(|axes| {
            match rest.strip_prefix(axes)? {
                [] => Some(1),
                [n] if *n > 0 => Some(*n),
                _ => None,
            }
        });
        let Some(components) = components else {
            let what = format!("{rest:?} values on a lattice of {lattice:?}");
            return Err(Fault::field(format!("`{}`", object.path), what));
        };
        let data = object.read_box(&from, &count)?;
        if let Some(values) = numbers(&object, data, warnings) {
            push(what, &object, DataArray::new(name, components as usize, values), out)?;
        }
    }
    Ok(())
}

/// Arrays and texts of the data set as a whole.
pub(super) fn field_data(
    group: &Object<'_>,
    step: &Step<'_>,
    out: &mut Attributes,
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    let Some(arrays) = group.find("FieldData")? else { return Ok(()) };
    for (name, object) in arrays.children(warnings)? {
        if step.group.is_some() && step.offset(&format!("FieldDataOffsets/{name}"), 0)?.is_some() {
            warnings.push(format!("field data `{name}` of several times left out"));
            continue;
        }
        let components = match object.shape()?[..] {
            [_, components] => components as usize,
            _ => 1,
        };
        match object.read()? {
            Data::Texts(texts) => out.text.push((name, texts)),
            data => {
                if let Some(values) = numbers(&object, data, warnings) {
                    out.field.push(DataArray::new(name, components, values));
                }
            }
        }
    }
    Ok(())
}
