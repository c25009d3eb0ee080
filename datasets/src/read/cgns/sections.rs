//! The elements of an unstructured zone: its sections, in the order of their numbers.

use super::connectivity::Section;
use super::element::{Element, MIXED, NFACE, NGON};
use super::polyhedra;
use super::zone::Zone;
use crate::model::{Cells, Points, UnstructuredGrid};
use crate::read::error::Fault;
use std::collections::BTreeMap;

const POLYGON: u8 = 7;
/// Number of names that a warning lists.
const SHOWN: usize = 6;

/// The cells of a zone: the elements with as many axes as its cells.
pub(super) fn grid(
    zone: &Zone<'_>,
    points: Points,
    warnings: &mut Vec<String>,
) -> Result<UnstructuredGrid, Fault> {
    let nodes = zone.children.iter().filter(|c| c.label == "Elements_t");
    let mut sections = nodes.map(|n| Section::new(zone.tree, n)).collect::<Result<Vec<_>, _>>()?;
    sections.sort_by_key(|s| s.range[0]);
    let mut grid = UnstructuredGrid { points, ..Default::default() };
    let axes = axes(zone, &sections, warnings)?;
    let mut boundary = Vec::new();
    let mut by_corners: BTreeMap<&str, usize> = BTreeMap::new();
    let mut of_other_axes = 0usize;
    let has = |kind: i64| sections.iter().any(|s| s.kind == kind);
    let mut faces = match axes == 3 && (has(NGON) || has(NFACE)) {
        true => polyhedra::Faces::new(&sections, grid.points.len())?,
        false => polyhedra::Faces::default(),
    };
    for section in &sections {
        let of_cells = section.axes().is_none_or(|a| a == axes);
        match section.kind {
            MIXED => {
                mixed(section, axes, &mut grid, &mut by_corners, &mut of_other_axes)?;
            }
            NGON if axes == 2 => polygons(section, &mut grid)?,
            NGON => {}
            NFACE if axes == 3 => {
                let cells = faces.of_section(section)?;
                polyhedra::push(&faces, &cells, section, &mut grid, warnings)?;
            }
            _ if !of_cells => {
                boundary.push(format!(
                    "{} ({} {})",
                    section.node.name,
                    section.len(),
                    section.kind_name()
                ));
            }
            kind => {
                let Some(element) = Element::of(kind) else {
                    let what = format!("elements of {}", section.kind_name());
                    let cure = "write them as one of the elements that the SIDS names";
                    return Err(section.node.unsupported(what, cure));
                };
                fixed(section, element, &mut grid)?;
                if element.kept < element.nodes {
                    *by_corners.entry(element.name).or_default() += section.own().len();
                }
            }
        }
    }
    if axes == 3
        && !has(NFACE)
        && let Some(section) = sections.iter().find(|s| s.kind == NGON)
        && let Some(cells) = faces.of_parents(&sections)?
    {
        polyhedra::push(&faces, &cells, section, &mut grid, warnings)?;
    }
    if !grid.polyhedron_faces.is_empty() {
        // Cells after the last polyhedra have no faces in the list.
        let end = grid.polyhedron_faces.len();
        grid.faces_of_cell.resize(grid.types.len(), end..end);
    }
    warn(zone, &grid, &boundary, &by_corners, of_other_axes, warnings);
    Ok(grid)
}

/// The axes of the elements that are the cells: as the base says, or fewer if it has none such.
fn axes(zone: &Zone<'_>, sections: &[Section], warnings: &mut Vec<String>) -> Result<usize, Fault> {
    let wanted = zone.cell_axes;
    let mut most = None;
    for s in sections {
        let axes = match s.kind {
            MIXED => Some(wanted),
            NGON if wanted == 3 && s.parents()?.is_some() => Some(3),
            _ => s.axes(),
        };
        most = most.max(axes.filter(|a| *a <= wanted));
    }
    let Some(most) = most else {
        if sections.is_empty() {
            return Err(zone.node.fault("it has no Elements_t, so no cells"));
        }
        let kinds: Vec<String> = sections.iter().map(Section::kind_name).collect();
        let what = format!("it has no cells of {wanted} axes, but {}", kinds.join(", "));
        return Err(zone.node.unsupported(what, "write its cells as elements of the SIDS"));
    };
    if most < wanted {
        let path = &zone.node.path;
        warnings
            .push(format!("`{path}` has no elements of {wanted} axes: those of {most} are read"));
    }
    Ok(most)
}

fn fixed(section: &Section, element: Element, grid: &mut UnstructuredGrid) -> Result<(), Fault> {
    let list = section.connectivity()?;
    if Some(list.len()) != section.len().checked_mul(element.nodes) {
        let what = format!("{} nodes of {} {}", list.len(), section.len(), element.name);
        return Err(section.node.fault(what));
    }
    let own = section.own();
    for nodes in list.chunks_exact(element.nodes).skip(own.start).take(own.len()) {
        element.push(nodes, &grid.points, &mut grid.cells, &mut grid.types);
    }
    Ok(())
}

/// Elements of several kinds: each begins with the number of its kind.
fn mixed(
    section: &Section,
    axes: usize,
    grid: &mut UnstructuredGrid,
    by_corners: &mut BTreeMap<&str, usize>,
    of_other_axes: &mut usize,
) -> Result<(), Fault> {
    let list = section.connectivity()?;
    let own = section.own();
    let mut rest = &list[..];
    let mut count = 0;
    while let [kind, after @ ..] = rest {
        let Some(element) = Element::of(*kind) else {
            let what = format!("an element of type {kind} in a MIXED section");
            return Err(section.node.unsupported(what, "write such elements in their own section"));
        };
        let Some((nodes, next)) = after.split_at_checked(element.nodes) else {
            let what = format!("{} nodes of a {} left", after.len(), element.name);
            return Err(section.node.fault(what));
        };
        if own.contains(&count) && element.axes == axes {
            element.push(nodes, &grid.points, &mut grid.cells, &mut grid.types);
            if element.kept < element.nodes {
                *by_corners.entry(element.name).or_default() += 1;
            }
        } else {
            *of_other_axes += usize::from(own.contains(&count));
        }
        count += 1;
        rest = next;
    }
    if count != section.len() {
        return Err(section
            .node
            .fault(format!("{count} elements in a range of {}", section.len())));
    }
    Ok(())
}

fn polygons(section: &Section, grid: &mut UnstructuredGrid) -> Result<(), Fault> {
    let lists = section.lists()?;
    let own = section.own();
    for nodes in lists.iter().skip(own.start).take(own.len()) {
        grid.cells.push(nodes.iter().map(|n| Cells::id(n.saturating_sub(1))));
        grid.types.push(POLYGON);
    }
    Ok(())
}

fn warn(
    zone: &Zone<'_>,
    grid: &UnstructuredGrid,
    boundary: &[String],
    by_corners: &BTreeMap<&str, usize>,
    of_other_axes: usize,
    warnings: &mut Vec<String>,
) {
    let path = &zone.node.path;
    let points = grid.points.len();
    let wrong = grid.cells.connectivity().iter().filter(|&&k| k as usize >= points).count();
    if wrong > 0 {
        warnings.push(format!("{wrong} point ids do not exist; their cells will be left out"));
    }
    if !boundary.is_empty() {
        let more = boundary.len().saturating_sub(SHOWN);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let shown = boundary[..boundary.len().min(SHOWN)].join(", ");
        warnings.push(format!("`{path}`: sections of the boundary left out: {shown}{more}"));
    }
    if of_other_axes > 0 {
        warnings.push(format!("`{path}`: {of_other_axes} elements of the boundary left out"));
    }
    for (name, count) in by_corners {
        let what = "are used by their corners, without the nodes between";
        warnings.push(format!("`{path}`: {count} elements {name} {what}"));
    }
    if zone.cells[0] != grid.types.len() as u64 {
        let (said, found) = (zone.cells[0], grid.types.len());
        warnings.push(format!("`{path}` says {said} cells, its sections have {found}"));
    }
}
