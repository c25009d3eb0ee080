//! A zone: its sizes and its points.

use super::Notes;
use super::times::Pointers;
use super::tree::{Node, Tree};
use super::units::Units;
use crate::model::{Points, Values};
use crate::read::error::Fault;

/// Lengths of the axes of values, the first axis first.
pub(super) type Lengths = Vec<u64>;

/// A zone with what its nodes say about its form.
pub(super) struct Zone<'t> {
    pub(super) tree: &'t Tree,
    pub(super) node: &'t Node,
    pub(super) children: Vec<Node>,
    pub(super) units: Units,
    /// Points along each axis; their number, if the zone has elements.
    pub(super) points: Lengths,
    /// Cells along each axis; their number, if the zone has elements.
    pub(super) cells: Lengths,
    /// Axes of a cell: 3 for solids, 2 for surfaces.
    pub(super) cell_axes: usize,
    pub(super) is_structured: bool,
}

impl<'t> Zone<'t> {
    pub(super) fn new(
        tree: &'t Tree,
        node: &'t Node,
        cell_axes: usize,
        units: &Units,
    ) -> Result<Zone<'t>, Fault> {
        let children = tree.children(node)?;
        let units = units.at(&children)?;
        let kind = children.iter().find(|c| c.label == "ZoneType_t");
        let kind = kind.map_or(Ok("Structured".to_string()), Node::text)?;
        let is_structured = match kind.as_str() {
            "Structured" => true,
            "Unstructured" => false,
            other => {
                let cure = "write it as Structured or Unstructured";
                return Err(node.unsupported(format!("zones of type `{other}`"), cure));
            }
        };
        let sizes = node.integers()?;
        let axes = if is_structured { cell_axes } else { 1 };
        let whole: Option<Vec<u64>> = sizes.iter().map(|&s| u64::try_from(s).ok()).collect();
        let whole = whole.filter(|w| w.len() >= 2 * axes);
        let Some(whole) = whole else {
            return Err(node.fault(format!("sizes {sizes:?} of a zone with {axes} axes")));
        };
        let (points, cells) = (whole[..axes].to_vec(), whole[axes..2 * axes].to_vec());
        let differ = |(p, c): (&u64, &u64)| *p == 0 || *c != p - 1;
        if is_structured && points.iter().zip(&cells).any(differ) {
            return Err(node.fault(format!("{points:?} points with {cells:?} cells between them")));
        }
        Ok(Zone { tree, node, children, units, points, cells, cell_axes, is_structured })
    }

    /// The points at the step that has these names.
    pub(super) fn coordinates(
        &self,
        pointers: &Pointers,
        notes: &mut Notes,
    ) -> Result<Points, Fault> {
        let grids = || self.children.iter().filter(|c| c.label == "GridCoordinates_t");
        let name = pointers.grid.as_deref();
        let found = match name {
            Some(name) => grids().find(|g| g.name == name),
            // The original one has this name.
            None => grids().find(|g| g.name == "GridCoordinates").or_else(|| grids().next()),
        };
        let Some(grid) = found else {
            let name = name.unwrap_or("GridCoordinates");
            return Err(self.node.fault(format!("it has no coordinates `{name}`")));
        };
        let children = self.tree.children(grid)?;
        let units = self.units.at(&children)?;
        let rind = rind(&children, self.points.len())?;
        if !self.is_structured && rind[0][0] > 0 {
            let cure = "write it without Rind, or with rind points behind the others";
            return Err(grid.unsupported("rind points before the others", cure));
        }
        notes.rind += usize::from(rind.iter().any(|r| *r != [0, 0]));
        let mut axes: [Option<Values>; 3] = [None, None, None];
        for array in children.iter().filter(|c| c.label == "DataArray_t") {
            let axis = match array.name.as_str() {
                "CoordinateX" => 0,
                "CoordinateY" => 1,
                "CoordinateZ" => 2,
                _ => continue,
            };
            let values = core(array, &self.points, &rind)?;
            axes[axis] = Some(match units.conversion(self.tree, array, &mut notes.units)? {
                Some(conversion) => conversion.of(values),
                None => values,
            });
        }
        let Some(first) = &axes[0] else {
            let names: Vec<&str> = children.iter().map(|c| c.name.as_str()).collect();
            let what = format!("no CoordinateX among {}", names.join(", "));
            let cure = "write Cartesian coordinates: CoordinateX, CoordinateY, CoordinateZ";
            return Err(grid.unsupported(what, cure));
        };
        let n = first.len();
        let single = axes.iter().flatten().all(|a| matches!(a, Values::F32(_)));
        let at = |axis: usize, i: usize| axes[axis].as_ref().map_or(0.0, |v| v.get_f64(i));
        let point = |i: usize| [at(0, i), at(1, i), at(2, i)];
        Ok(if single {
            Points::F32((0..n).map(|i| point(i).map(|x| x as f32)).collect())
        } else {
            Points::F64((0..n).map(point).collect())
        })
    }
}

/// Planes before and behind each axis, by `Rind_t`.
pub(super) fn rind(children: &[Node], axes: usize) -> Result<Vec<[u64; 2]>, Fault> {
    let Some(node) = children.iter().find(|c| c.label == "Rind_t") else {
        return Ok(vec![[0, 0]; axes]);
    };
    let planes = node.integers()?;
    let whole: Option<Vec<u64>> = planes.iter().map(|&p| u64::try_from(p).ok()).collect();
    match whole.filter(|w| w.len() == 2 * axes) {
        Some(w) => Ok(w.chunks_exact(2).map(|p| [p[0], p[1]]).collect()),
        None => Err(node.fault(format!("{planes:?} planes for {axes} axes"))),
    }
}

/// The values of an array without those of the rind planes.
pub(super) fn core(array: &Node, lengths: &[u64], rind: &[[u64; 2]]) -> Result<Values, Fault> {
    let shape = array.shape()?.unwrap_or_default();
    // HDF5 has the slowest axis first.
    let with_rind = |(n, r): (&u64, &[u64; 2])| n.saturating_add(r[0]).saturating_add(r[1]);
    let expected: Vec<u64> = lengths.iter().zip(rind).map(with_rind).rev().collect();
    if shape != expected {
        let what = format!("{shape:?} values where the zone has {expected:?}");
        return Err(array.fault(what));
    }
    let start: Vec<u64> = rind.iter().rev().map(|r| r[0]).collect();
    let count: Vec<u64> = lengths.iter().rev().copied().collect();
    array.values_in(&start, &count)
}
