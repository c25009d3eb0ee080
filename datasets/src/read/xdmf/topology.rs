//! `Topology`: which points make cells.

use super::data_item::{Items, all, numbers};
use super::{child, fault, place};
use crate::model::{Cells, Dataset, Points, UnstructuredGrid};
use crate::read::error::Fault;
use crate::read::vtk_xml::pieces::integers;
use roxmltree::Node;

/// Kinds of lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lattice {
    Uniform,
    Rectilinear,
    Curvilinear,
}

/// Name, number in mixed topologies, points, VTK's number.
///
/// The nodes of quadratic cells are in VTK's order: the Xdmf reader in VTK passes them on as they
/// are.
const CELLS: [(&str, i64, usize, u8); 19] = [
    ("triangle", 4, 3, 5),
    ("quadrilateral", 5, 4, 9),
    ("tetrahedron", 6, 4, 10),
    ("pyramid", 7, 5, 14),
    ("wedge", 8, 6, 13),
    ("hexahedron", 9, 8, 12),
    ("edge_3", 34, 3, 21),
    ("quadrilateral_9", 35, 9, 28),
    ("triangle_6", 36, 6, 22),
    ("quadrilateral_8", 37, 8, 23),
    ("tetrahedron_10", 38, 10, 24),
    ("pyramid_13", 39, 13, 27),
    ("wedge_15", 40, 15, 26),
    ("wedge_18", 41, 18, 32),
    ("hexahedron_20", 48, 20, 25),
    ("hexahedron_24", 49, 24, 33),
    ("hexahedron_27", 50, 27, 29),
    ("tri_6", 36, 6, 22),
    ("tet_10", 38, 10, 24),
];
/// Those with any number of points: name, number, VTK's number.
const CHAINS: [(&str, i64, u8); 3] = [("polyvertex", 1, 2), ("polyline", 2, 4), ("polygon", 3, 7)];

fn kind(node: Node<'_, '_>) -> String {
    let name = node.attribute("TopologyType").or(node.attribute("Type")).unwrap_or("");
    name.to_ascii_lowercase()
}

/// Points along x, y, z of a lattice, and its kind; `None` for other topologies.
pub(super) fn lattice(node: Node<'_, '_>) -> Result<Option<([u64; 3], Lattice)>, Fault> {
    let lattice = match kind(node).as_str() {
        "2dcorectmesh" | "3dcorectmesh" => Lattice::Uniform,
        "2drectmesh" | "3drectmesh" => Lattice::Rectilinear,
        "2dsmesh" | "3dsmesh" => Lattice::Curvilinear,
        _ => return Ok(None),
    };
    let text = node.attribute("Dimensions").or(node.attribute("NumberOfElements")).unwrap_or("");
    let found = numbers(node, text)?;
    let is_long = |d: &u64| !(1..=i32::MAX as u64).contains(d);
    if !(2..=3).contains(&found.len()) || found.iter().any(is_long) {
        return Err(fault(node, format!("`{text}` instead of two or three numbers of points")));
    }
    let mut dims = [1; 3];
    dims.iter_mut().zip(found.iter().rev()).for_each(|(d, f)| *d = *f);
    Ok(Some((dims, lattice)))
}

/// Points with cells.
pub(super) fn cells(
    items: &Items<'_>,
    node: Node<'_, '_>,
    points: Points,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let name = kind(node);
    let mut grid = UnstructuredGrid { points, ..Default::default() };
    let count = grid.points.len() as u64;
    if name == "polyvertex" && child(node, "DataItem").is_none() {
        grid.cells =
            Cells::uniform(1, (0..grid.points.len()).map(|i| Cells::id(i as i64)).collect());
        grid.types = vec![1; grid.points.len()];
        return Ok(Dataset::UnstructuredGrid(grid));
    }
    let list: Vec<i64> =
        all(items, node)?.iter().flat_map(|v| integers(v).collect::<Vec<_>>()).collect();
    if name == "mixed" {
        mixed(node, &list, &mut grid)?;
    } else {
        let (points, vtk) = match CELLS.iter().find(|c| c.0 == name) {
            Some(c) => (c.2, c.3),
            None => {
                let Some(chain) = CHAINS.iter().find(|c| c.0 == name) else {
                    let cure = "write the cells as one of XDMF's types, or as Mixed";
                    let what = format!("TopologyType `{name}`");
                    return Err(Fault::unsupported(place(node), what, cure));
                };
                let points = node.attribute("NodesPerElement").unwrap_or("1").trim().parse();
                let points = points.ok().filter(|&n| n > 0);
                let none = || fault(node, "`NodesPerElement` is not a number of points");
                (points.ok_or_else(none)?, chain.2)
            }
        };
        if !list.len().is_multiple_of(points) {
            return Err(fault(node, format!("{} ids for cells of {points} points", list.len())));
        }
        grid.cells = Cells::uniform(points, list.into_iter().map(Cells::id).collect());
        grid.types = vec![vtk; grid.cells.len()];
    }
    let wrong = grid.cells.connectivity().iter().filter(|&&k| u64::from(k) >= count).count();
    if wrong > 0 {
        warnings.push(format!("{wrong} point ids do not exist; their cells will be left out"));
    }
    Ok(Dataset::UnstructuredGrid(grid))
}

/// Each cell begins with the number of its type; chains give their number of points next.
fn mixed(node: Node<'_, '_>, list: &[i64], grid: &mut UnstructuredGrid) -> Result<(), Fault> {
    let mut rest = list;
    while let [number, after @ ..] = rest {
        let (count, vtk, ids);
        if let Some(c) = CELLS.iter().find(|c| c.1 == *number) {
            (count, vtk, ids) = (c.2, c.3, after);
        } else if let (Some(chain), [n, after @ ..]) =
            (CHAINS.iter().find(|c| c.1 == *number), after)
        {
            (count, vtk, ids) = (usize::try_from(*n).unwrap_or(usize::MAX), chain.2, after);
        } else {
            let what = format!("cells of type {number} in a mixed topology");
            let cure = "write polyhedra and other cells as .vtu";
            return Err(Fault::unsupported(place(node), what, cure));
        }
        let Some((cell, next)) = ids.split_at_checked(count) else {
            let what = format!("a cell of {count} points, but {} ids left", ids.len());
            return Err(fault(node, what));
        };
        grid.cells.push(cell.iter().map(|&k| Cells::id(k)));
        grid.types.push(vtk);
        rest = next;
    }
    Ok(())
}
