//! Unstructured grids and poly data: partitions, one after the other in each array.

use super::{Step, attributes, unsigned};
use crate::model::{Cells, DataArray, Dataset, Points, PolyData, UnstructuredGrid, Values};
use crate::read::error::{At, Fault};
use crate::read::hdf5::Object;
use crate::read::vtk_xml::pieces::{cells_from_arrays, integers};

/// Numbers of a partition in each array: what lies before it in this time, and how many it has.
#[derive(Debug, Clone, Copy, Default)]
struct Span {
    before: u64,
    count: u64,
}

/// The partitions of a time.
struct Partitions {
    /// The first one in the arrays of counts.
    first: u64,
    count: u64,
}

impl Partitions {
    fn of(group: &Object<'_>, step: &Step<'_>) -> Result<Self, Fault> {
        let all = group.get("NumberOfPoints")?.shape()?.first().copied().unwrap_or(0);
        let first = step.offset("PartOffsets", 0)?.unwrap_or(0);
        let count = match step.offset("NumberOfParts", 0)? {
            Some(n) => n,
            None if step.group.is_some() => 1,
            None => all,
        };
        if first.checked_add(count).is_none_or(|end| end > all) {
            let what = format!("partitions {first} to {first} + {count} of {all}");
            return Err(Fault::field(format!("`{}/Steps`", group.path), what));
        }
        Ok(Partitions { first, count })
    }

    /// The spans of the partitions by an array of counts.
    fn spans(&self, group: &Object<'_>, name: &str) -> Result<Vec<Span>, Fault> {
        let counts = group.get(name)?;
        let values = counts.values_in(&[self.first], &[self.count])?;
        let mut before = 0u64;
        let mut out = Vec::new();
        for i in 0..values.len() {
            let count = unsigned(values.get_f64(i), &counts.path)?;
            out.push(Span { before, count });
            before = before.saturating_add(count);
        }
        Ok(out)
    }
}

/// `count` rows of a dataset from `start`.
fn rows(group: &Object<'_>, name: &str, start: u64, count: u64) -> Result<Values, Fault> {
    let object = group.get(name)?;
    let shape = object.shape()?;
    if shape.is_empty() {
        return Err(Fault::field(format!("`{}`", object.path), "one value, not an array"));
    }
    let mut from = vec![0; shape.len()];
    let mut counts = shape;
    (from[0], counts[0]) = (start, count);
    object.values_in(&from, &counts)
}

fn points(group: &Object<'_>, start: u64, span: Span) -> Result<Points, Fault> {
    if span.count == 0 {
        return Ok(Points::default());
    }
    let values = rows(group, "Points", start.saturating_add(span.before), span.count)?;
    let components = values.len() / span.count as usize;
    Ok(Points::from_array(DataArray::new("Points", components, values))?)
}

/// Cells of one partition. `part` counts partitions in the file: each has one offset more than
/// cells.
fn connectivity(
    group: &Object<'_>,
    [cell_start, id_start]: [u64; 2],
    part: u64,
    cells: Span,
    ids: Span,
    points: usize,
    warnings: &mut Vec<String>,
) -> Result<Cells, Fault> {
    if cells.count == 0 {
        return Ok(Cells::new());
    }
    let start = cell_start.saturating_add(cells.before).saturating_add(part);
    let ends = rows(group, "Offsets", start, cells.count.saturating_add(1))?;
    let ends = ends.slice(1..ends.len());
    let list = rows(group, "Connectivity", id_start.saturating_add(ids.before), ids.count)?;
    cells_from_arrays(&list, &ends, &group.path, points, warnings)
}

pub(super) fn unstructured(
    group: &Object<'_>,
    step: &Step<'_>,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let parts = Partitions::of(group, step)?;
    let of_points = parts.spans(group, "NumberOfPoints")?;
    let of_cells = parts.spans(group, "NumberOfCells")?;
    let of_ids = parts.spans(group, "NumberOfConnectivityIds")?;
    let start = |name: &str| Ok::<u64, Fault>(step.offset(name, 0)?.unwrap_or(0));
    let (point_start, cell_start) = (start("PointOffsets")?, start("CellOffsets")?);
    let id_start = start("ConnectivityIdOffsets")?;
    let mut pieces = Vec::new();
    for i in 0..of_points.len() {
        let (p, c) = (of_points[i], of_cells[i]);
        let points = points(group, point_start, p)?;
        let part = parts.first + i as u64;
        let n = points.len();
        let starts = [cell_start, id_start];
        let cells = connectivity(group, starts, part, c, of_ids[i], n, warnings)?;
        let types = match c.count {
            0 => Vec::new(),
            n => {
                let types = rows(group, "Types", cell_start.saturating_add(c.before), n)?;
                integers(&types).map(|t| u8::try_from(t).unwrap_or(u8::MAX)).collect()
            }
        };
        if types.contains(&42) {
            let at = At::Field(format!("`{}/Types`", group.path));
            let cure = "save it as .vtu, where polyhedra are read";
            return Err(Fault::unsupported(at, "polyhedra (type 42)", cure));
        }
        let range = |s: Span| s.before..s.before.saturating_add(s.count);
        let starts = [point_start, cell_start];
        let attributes = attributes(group, step, range(p), range(c), starts, warnings)?;
        let piece = UnstructuredGrid { points, cells, types, attributes, ..Default::default() };
        pieces.push(Dataset::UnstructuredGrid(piece));
    }
    if pieces.is_empty() {
        return Ok(Dataset::UnstructuredGrid(UnstructuredGrid::default()));
    }
    pieces.iter().try_for_each(Dataset::check)?;
    Ok(Dataset::merge(pieces, warnings)?)
}

/// The groups with cells, in the order of the cell data.
const TOPOLOGIES: [&str; 4] = ["Vertices", "Lines", "Polygons", "Strips"];

pub(super) fn poly_data(
    group: &Object<'_>,
    step: &Step<'_>,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let parts = Partitions::of(group, step)?;
    let of_points = parts.spans(group, "NumberOfPoints")?;
    let point_start = step.offset("PointOffsets", 0)?.unwrap_or(0);
    let mut kinds = Vec::new();
    let mut cell_start = 0u64;
    for (column, name) in TOPOLOGIES.into_iter().enumerate() {
        let kind = group.get(name)?;
        let spans = parts.spans(&kind, "NumberOfCells")?;
        let ids = parts.spans(&kind, "NumberOfConnectivityIds")?;
        let start = |name: &str| Ok::<u64, Fault>(step.offset(name, column as u64)?.unwrap_or(0));
        let starts = [start("CellOffsets")?, start("ConnectivityIdOffsets")?];
        cell_start = cell_start.saturating_add(starts[0]);
        kinds.push((kind, spans, ids, starts));
    }
    let mut before = 0u64;
    let mut pieces = Vec::new();
    for (i, p) in of_points.iter().enumerate() {
        let points = points(group, point_start, *p)?;
        let mut read = Vec::new();
        for (kind, spans, ids, starts) in &kinds {
            let part = parts.first + i as u64;
            let n = points.len();
            read.push(connectivity(kind, *starts, part, spans[i], ids[i], n, warnings)?);
        }
        let count = read.iter().map(|c| c.len() as u64).sum::<u64>();
        let cells = before..before.saturating_add(count);
        before = cells.end;
        let of_points = p.before..p.before.saturating_add(p.count);
        let starts = [point_start, cell_start];
        let attributes = attributes(group, step, of_points, cells, starts, warnings)?;
        let mut next = read.into_iter();
        let mut take = || next.next().unwrap_or_default();
        let (verts, lines, polys, strips) = (take(), take(), take(), take());
        pieces.push(Dataset::PolyData(PolyData {
            points,
            verts,
            lines,
            polys,
            strips,
            attributes,
        }));
    }
    if pieces.is_empty() {
        return Ok(Dataset::PolyData(PolyData::default()));
    }
    pieces.iter().try_for_each(Dataset::check)?;
    Ok(Dataset::merge(pieces, warnings)?)
}
