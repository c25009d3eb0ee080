//! A zone of a Tecplot file: what its header says, its values, and the data set it becomes.

use super::shapes::{Element, cells_of};
use crate::model::{
    Attributes, DataArray, Dataset, Points, StructuredGrid, UnstructuredGrid, Values,
};
use crate::read::error::{At, BROKEN, Fault};
use std::rc::Rc;

/// The points of a zone and how they are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    /// A lattice of I x J x K points.
    Ordered([u64; 3]),
    /// Finite elements of one kind.
    Elements { kind: Element, points: u64, elements: u64 },
}

impl Shape {
    /// Number of points; `None` if it does not fit.
    pub(super) fn points(self) -> Option<u64> {
        match self {
            Shape::Ordered(d) => d.iter().try_fold(1u64, |n, &d| n.checked_mul(d)),
            Shape::Elements { points, .. } => Some(points),
        }
    }
    /// Number of cells; `None` if it does not fit.
    pub(super) fn cells(self) -> Option<u64> {
        match self {
            Shape::Ordered(d) => d.iter().try_fold(1u64, |n, &d| n.checked_mul(cells_along(d))),
            Shape::Elements { elements, .. } => Some(elements),
        }
    }
}

/// Cells between `points` points; one layer if there is a single point.
pub(super) fn cells_along(points: u64) -> u64 {
    points.saturating_sub(1).max(1)
}

/// What the header of a zone says; the lists have an entry for each variable.
#[derive(Debug, Clone)]
pub(super) struct ZoneHeader {
    pub(super) title: String,
    pub(super) shape: Shape,
    /// The solution time, unless the zone is static.
    pub(super) time: Option<f64>,
    /// Variables with a value for each cell instead of each point.
    pub(super) cell_centred: Vec<bool>,
    /// Variables without values, which count as 0.
    pub(super) passive: Vec<bool>,
    /// Zones, from 0, that have the variables instead.
    pub(super) shared: Vec<Option<usize>>,
    /// The zone, from 0, that has the elements instead.
    pub(super) cells_from: Option<usize>,
    /// Whether all values of a point follow each other.
    pub(super) by_point: bool,
}

impl ZoneHeader {
    pub(super) fn new(variables: usize) -> Self {
        ZoneHeader {
            title: String::new(),
            shape: Shape::Ordered([1; 3]),
            time: None,
            cell_centred: vec![false; variables],
            passive: vec![false; variables],
            shared: vec![None; variables],
            cells_from: None,
            by_point: false,
        }
    }

    /// The variables whose values stand in the zone itself.
    pub(super) fn own(&self) -> Vec<usize> {
        let own = |v: &usize| !self.passive[*v] && self.shared[*v].is_none();
        (0..self.passive.len()).filter(own).collect()
    }

    /// Number of values of a variable.
    pub(super) fn count(&self, variable: usize) -> Result<u64, Fault> {
        let of_cells = self.cell_centred[variable];
        let count = if of_cells { self.shape.cells() } else { self.shape.points() };
        count.ok_or_else(|| self.fault(format!("{:?} points are more than 2^64", self.shape)))
    }

    /// A fault of the zone.
    pub(super) fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::new(At::Field(format!("zone `{}`", self.title)), what, BROKEN)
    }
}

/// A zone with its values; passive variables have none.
#[derive(Debug, Clone)]
pub(super) struct Zone {
    pub(super) header: ZoneHeader,
    pub(super) values: Vec<Option<Rc<Values>>>,
    /// Points of the elements, from 0.
    pub(super) elements: Option<Rc<Vec<u32>>>,
}

impl Zone {
    /// Takes over what a zone shares with earlier ones.
    pub(super) fn share(&mut self, earlier: &[Zone]) -> Result<(), Fault> {
        let h = &self.header;
        let zone = |from: usize| {
            earlier.get(from).ok_or_else(|| {
                h.fault(format!("it shares with zone {}, which does not come before", from + 1))
            })
        };
        for v in 0..self.values.len() {
            let Some(from) = h.shared[v] else { continue };
            let source = zone(from)?;
            let values = source.values[v].clone();
            let (expected, found) = (h.count(v)?, values.as_ref().map(|x| x.len() as u64));
            if found.is_some_and(|n| n != expected)
                || source.header.cell_centred[v] != h.cell_centred[v]
            {
                let of = if h.cell_centred[v] { "cells" } else { "points" };
                return Err(h.fault(format!(
                    "variable {} is that of zone {}, which has {} values for {expected} {of}",
                    v + 1,
                    from + 1,
                    found.unwrap_or(0)
                )));
            }
            self.values[v] = values;
        }
        if let Some(from) = h.cells_from
            && let Shape::Elements { kind, elements, points } = h.shape
        {
            let shared = zone(from)?.elements.clone();
            let expected = elements.checked_mul(kind.corners() as u64);
            let fits = |e: &Rc<Vec<u32>>| {
                Some(e.len() as u64) == expected && e.iter().all(|&p| u64::from(p) < points)
            };
            if !shared.as_ref().is_some_and(fits) {
                let what = format!("the elements of zone {} do not fit it", from + 1);
                return Err(h.fault(what));
            }
            self.elements = shared;
        }
        Ok(())
    }

    /// Number of values that the zone has from others.
    pub(super) fn shared_values(&self) -> u64 {
        let shared = self.header.shared.iter().zip(&self.values).filter(|(s, _)| s.is_some());
        let values: u64 = shared.filter_map(|(_, v)| Some(v.as_ref()?.len() as u64)).sum();
        let from = self.header.cells_from.and(self.elements.as_ref());
        values + from.map_or(0, |e| e.len() as u64)
    }

    /// The data set. `axes` are the variables that are x, y and z.
    pub(super) fn dataset(
        &self,
        names: &[String],
        axes: [Option<usize>; 3],
    ) -> Result<Dataset, Fault> {
        let h = &self.header;
        let points = self.points(names, axes)?;
        let mut attributes = Attributes::default();
        for (v, name) in names.iter().enumerate() {
            let Some(values) = self.values[v].as_ref().filter(|_| !axes.contains(&Some(v))) else {
                continue;
            };
            let array = DataArray::new(name.clone(), 1, Values::clone(values));
            let list = if h.cell_centred[v] { &mut attributes.cell } else { &mut attributes.point };
            list.push(array);
        }
        if let Some(t) = h.time {
            attributes.field.push(DataArray::new("TimeValue", 1, Values::F64(vec![t])));
        }
        let data = match h.shape {
            Shape::Ordered(d) => {
                let mut extent = [0i32; 6];
                for (axis, &n) in d.iter().enumerate() {
                    extent[2 * axis + 1] = i32::try_from(n - 1)
                        .map_err(|_| h.fault(format!("{n} points along an axis are too many")))?;
                }
                Dataset::StructuredGrid(StructuredGrid { extent, points, attributes })
            }
            Shape::Elements { kind, .. } => {
                let ids = self.elements.as_ref().map_or(&[][..], |e| e.as_slice());
                let (cells, types) = cells_of(kind, ids);
                Dataset::UnstructuredGrid(UnstructuredGrid {
                    points,
                    cells,
                    types,
                    attributes,
                    ..UnstructuredGrid::default()
                })
            }
        };
        data.check()?;
        Ok(data)
    }

    fn points(&self, names: &[String], axes: [Option<usize>; 3]) -> Result<Points, Fault> {
        let h = &self.header;
        let n = h.shape.points().unwrap_or(u64::MAX);
        let mut columns: [Option<&Values>; 3] = [None; 3];
        for (axis, variable) in axes.iter().enumerate() {
            let Some(v) = *variable else { continue };
            if h.cell_centred[v] {
                return Err(h.fault(format!("the coordinate `{}` is one of cells", names[v])));
            }
            columns[axis] = self.values[v].as_deref();
        }
        // A coordinate that a zone does not have is 0, as everything passive.
        let Some(first) = columns.iter().flatten().next() else {
            return Err(h.fault("it has no coordinates"));
        };
        if columns.iter().flatten().any(|c| c.len() as u64 != n) {
            return Err(h.fault(format!("{} coordinates for {n} points", first.len())));
        }
        let single = columns.iter().flatten().all(|c| matches!(c, Values::F32(_)));
        let get = |axis: usize, i: usize| columns[axis].map_or(0.0, |c| c.get_f64(i));
        let point = |i: usize| [0, 1, 2].map(|axis| get(axis, i));
        let n = first.len();
        Ok(if single {
            Points::F32((0..n).map(|i| point(i).map(|x| x as f32)).collect())
        } else {
            Points::F64((0..n).map(point).collect())
        })
    }
}
