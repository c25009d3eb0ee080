//! Extracts polylines for tubes and points for spheres.

use super::surface::GhostFlags;
use super::{Attributes, CellType, ColorBy, Dataset, ModelError, Points};
use glam::DVec3;

/// A chain of points with optional scalars.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    /// At least two points, in world coordinates.
    pub points: Vec<DVec3>,
    /// One value per point when an array was requested. A cell array gives every point of the line
    /// the value of its cell.
    pub scalars: Option<Vec<f32>>,
}

/// Points with optional scalars.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointSet {
    /// World coordinates.
    pub points: Vec<DVec3>,
    /// One value per point when an array was requested; NaN in blocks that lack the array.
    pub scalars: Option<Vec<f32>>,
}

impl Dataset {
    /// All line cells, and the number of line cells that were left out because they have fewer than
    /// two points or refer to points that do not exist. Lattices have no lines.
    pub fn to_lines(&self, color_by: Option<&str>) -> Result<(Vec<Polyline>, usize), ModelError> {
        self.check()?;
        let color = color_by.map(|name| ColorBy::find(self, name)).transpose()?;
        let (mut lines, mut dropped) = (Vec::new(), 0);
        for leaf in self.leaves() {
            let mut add = |points: &Points, attributes: &Attributes, cell: usize, ids: &[u32]| {
                if GhostFlags::new(attributes).cell(cell) {
                    return;
                }
                if ids.len() < 2 || ids.iter().any(|&k| k as usize >= points.len()) {
                    dropped += 1;
                    return;
                }
                let scalars = color.as_ref().map(|c| match c.array(attributes) {
                    Some(a) if c.per_point => ids.iter().map(|&k| c.value(a, k as usize)).collect(),
                    Some(a) => vec![c.value(a, cell); ids.len()],
                    None => vec![f32::NAN; ids.len()],
                });
                lines.push(Polyline {
                    points: ids.iter().map(|&k| points.get(k as usize)).collect(),
                    scalars,
                });
            };
            match leaf {
                Dataset::PolyData(d) => {
                    for (i, ids) in d.lines.iter().enumerate() {
                        add(&d.points, &d.attributes, d.verts.len() + i, ids);
                    }
                }
                Dataset::UnstructuredGrid(d) => {
                    for (i, ids) in d.cells.iter().enumerate() {
                        if let CellType::Line(n) = CellType::of(d.types[i]) {
                            let ends = if n == 0 { ids } else { &ids[..ids.len().min(n)] };
                            add(&d.points, &d.attributes, i, ends);
                        }
                    }
                }
                _ => {}
            }
        }
        Ok((lines, dropped))
    }

    /// All points, including those that no cell uses (particles often come without cells). Cell
    /// arrays cannot colour points.
    pub fn to_points(&self, color_by: Option<&str>) -> Result<PointSet, ModelError> {
        self.check()?;
        let color = color_by.map(|name| ColorBy::find(self, name)).transpose()?;
        if let Some(c) = color.as_ref().filter(|c| !c.per_point) {
            let reason =
                format!("`{}` has one value per cell; choose an array with one per point", c.name);
            return Err(ModelError::NotConvertible {
                kind: self.kind(),
                target: "coloured points",
                reason,
            });
        }
        let mut out = PointSet { points: Vec::new(), scalars: color.is_some().then(Vec::new) };
        for leaf in self.leaves() {
            let before = out.points.len();
            match leaf {
                Dataset::PolyData(d) => {
                    out.points.extend((0..d.points.len()).map(|i| d.points.get(i)))
                }
                Dataset::UnstructuredGrid(d) => {
                    out.points.extend((0..d.points.len()).map(|i| d.points.get(i)))
                }
                Dataset::StructuredGrid(d) => {
                    out.points.extend((0..d.points.len()).map(|i| d.points.get(i)))
                }
                other => {
                    let reason = "its points fill a box; sample or threshold it first".into();
                    return Err(ModelError::NotConvertible {
                        kind: other.kind(),
                        target: "points",
                        reason,
                    });
                }
            }
            if let (Some(c), Some(s), Some(a)) = (&color, &mut out.scalars, leaf.attributes()) {
                match c.array(a) {
                    Some(array) => {
                        s.extend((0..out.points.len() - before).map(|i| c.value(array, i)))
                    }
                    None => s.resize(out.points.len(), f32::NAN),
                }
            }
        }
        Ok(out)
    }
}
