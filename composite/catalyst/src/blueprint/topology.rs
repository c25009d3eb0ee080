//! Cells: those of lattices, and lists of them.

use super::{BlueprintError, Domain, coordset};
use crate::node::{Node, Numbers};
use datasets::model::{
    Attributes, Cells, Dataset, ImageData, Points, PolyData, RectilinearGrid, StructuredGrid,
    UnstructuredGrid,
};

/// Shapes of Blueprint: the name, VTK's type, and the corners (0 for any number). The order of
/// corners is VTK's.
const SHAPES: &[(&str, u8, usize)] = &[
    ("point", 1, 1),
    ("line", 3, 2),
    ("tri", 5, 3),
    ("quad", 9, 4),
    ("polygonal", 7, 0),
    ("tet", 10, 4),
    ("hex", 12, 8),
    ("wedge", 13, 6),
    ("pyramid", 14, 5),
    ("polyhedral", POLYHEDRON, 0),
];
/// VTK's type of cells whose faces are listed.
const POLYHEDRON: u8 = 42;

/// The cells of a topology over a coordset, without arrays.
pub(super) fn dataset<'n, 'a>(
    domain: &Domain<'n, 'a>,
    (name, node): (&str, &'n Node<'a>),
    (coordset_path, coordset): (String, &'n Node<'a>),
) -> Result<Dataset, BlueprintError> {
    let path = format!("{}/topologies/{name}", domain.path);
    let coordinates = coordset::kind(&coordset_path, coordset)?;
    let lattice = |dims: [usize; 3]| std::array::from_fn(|i| last_index(dims, i));
    let Some(kind) = node.text_at("type") else {
        return Err(BlueprintError::missing(&format!("{path}/type"), "the type of the topology"));
    };
    match (kind, coordinates) {
        ("uniform" | "points", "uniform") => {
            let c = coordset::uniform(&coordset_path, coordset)?;
            let image = ImageData {
                extent: lattice(c.dims),
                ..ImageData::new([1; 3], c.origin, c.spacing)
            };
            Ok(Dataset::ImageData(image))
        }
        ("rectilinear" | "points", "rectilinear") => {
            let coordinates = coordset::rectilinear(&coordset_path, coordset)?;
            let extent = lattice(coordinates.each_ref().map(Vec::len));
            let attributes = Attributes::default();
            Ok(Dataset::RectilinearGrid(RectilinearGrid { extent, coordinates, attributes }))
        }
        ("structured", "explicit") => {
            let at = format!("{path}/elements/dims");
            let dims = node.get("elements/dims");
            let dims = dims.ok_or_else(|| BlueprintError::missing(&at, "the numbers of cells"))?;
            let cells = coordset::counts(&at, dims, ["i", "j", "k"])?;
            // Points along an axis: one more than cells, or one where the axis is not there.
            let dims = cells.map(|n| n.map_or(1, |n| n + 1));
            let points = coordset::explicit(&coordset_path, coordset)?;
            let (extent, attributes) = (lattice(dims), Attributes::default());
            Ok(Dataset::StructuredGrid(StructuredGrid { extent, points, attributes }))
        }
        ("points", "explicit") => {
            let points = coordset::explicit(&coordset_path, coordset)?;
            let verts = Cells::uniform(1, (0..points.len() as u32).collect());
            Ok(Dataset::PolyData(PolyData { points, verts, ..PolyData::default() }))
        }
        ("unstructured", "explicit") => {
            let points = coordset::explicit(&coordset_path, coordset)?;
            unstructured(&path, node, points).map(Dataset::UnstructuredGrid)
        }
        ("uniform" | "rectilinear" | "structured" | "points" | "unstructured", other) => {
            let reason = format!("a topology of type `{kind}` over a coordset of type `{other}`");
            Err(BlueprintError::inconsistent(&path, reason))
        }
        (other, _) => Err(BlueprintError::unsupported(
            &format!("{path}/type"),
            other,
            "give points, uniform, rectilinear, structured or unstructured",
        )),
    }
}

/// Entry `i` of VTK's extent of a lattice: first and last index along x, y and z.
fn last_index(dims: [usize; 3], i: usize) -> i32 {
    match i % 2 {
        0 => 0,
        _ => i32::try_from(dims[i / 2]).unwrap_or(i32::MAX) - 1,
    }
}

fn unstructured(
    path: &str,
    node: &Node<'_>,
    points: Points,
) -> Result<UnstructuredGrid, BlueprintError> {
    let mut grid = UnstructuredGrid { points, ..UnstructuredGrid::default() };
    let at = format!("{path}/elements");
    let Some(elements) = node.get("elements") else {
        return Err(BlueprintError::missing(&at, "cells"));
    };
    match elements.text_at("shape") {
        Some("polyhedral") => {
            let faces_at = format!("{path}/subelements");
            let Some(faces) = node.get("subelements") else {
                return Err(BlueprintError::missing(&faces_at, "the faces of the polyhedra"));
            };
            polyhedra(&at, elements, &faces_at, faces, &mut grid)?;
        }
        Some("mixed") => mixed(&at, elements, &mut grid)?,
        Some(shape) => one_shape(&at, elements, shape, &mut grid)?,
        // Several lists of cells, each of one shape.
        None => {
            for (name, list) in elements.children() {
                let at = format!("{at}/{name}");
                let shape = list.text_at("shape").ok_or_else(|| {
                    BlueprintError::missing(&format!("{at}/shape"), "the name of a shape")
                })?;
                one_shape(&at, list, shape, &mut grid)?;
            }
        }
    }
    Ok(grid)
}

fn shape_of(path: &str, name: &str) -> Result<(u8, usize), BlueprintError> {
    let found = SHAPES.iter().find(|(n, ..)| *n == name);
    found.map(|&(_, kind, corners)| (kind, corners)).ok_or_else(|| {
        let names: Vec<&str> = SHAPES.iter().map(|(n, ..)| *n).collect();
        let cure = format!("give {} or mixed", names.join(", "));
        BlueprintError::unsupported(&format!("{path}/shape"), name, &cure)
    })
}

/// An array of integers.
fn integers<'a>(
    path: &str,
    node: &Node<'a>,
    name: &str,
) -> Result<Option<Numbers<'a>>, BlueprintError> {
    let Some(child) = node.get(name) else { return Ok(None) };
    match child.numbers() {
        Some(numbers) => Ok(Some(numbers)),
        // Lists without cells are often left empty.
        None if matches!(child, Node::Empty) => Ok(None),
        None => {
            Err(BlueprintError::missing(&format!("{path}/{name}"), "an array of whole numbers"))
        }
    }
}

/// Number `i` of an array as the id of a point; one that cannot be marks its cell as unusable.
fn id(numbers: &Numbers<'_>, i: usize) -> u32 {
    numbers.get_i64(i).map_or(Cells::NO_POINT, Cells::id)
}

/// Cells whose corners are ranges of a list of ids.
struct Ranges<'a> {
    path: String,
    ids: Numbers<'a>,
    sizes: Numbers<'a>,
    offsets: Option<Numbers<'a>>,
}

impl<'a> Ranges<'a> {
    /// Reads `connectivity`, `sizes` and `offsets`, which may be missing where cells follow one
    /// another. `None` for no cells.
    fn of(path: &str, node: &Node<'a>) -> Result<Option<Ranges<'a>>, BlueprintError> {
        let Some(sizes) = integers(path, node, "sizes")? else {
            let at = format!("{path}/sizes");
            return match integers(path, node, "connectivity")?.is_some_and(|c| !c.is_empty()) {
                true => Err(BlueprintError::missing(&at, "the numbers of corners")),
                false => Ok(None),
            };
        };
        let ids = integers(path, node, "connectivity")?.unwrap_or(Numbers::of::<u32>(&[]));
        let offsets = integers(path, node, "offsets")?;
        if let Some(offsets) = offsets.filter(|o| o.len() != sizes.len()) {
            let reason = format!("{} offsets, but {} sizes", offsets.len(), sizes.len());
            return Err(BlueprintError::inconsistent(&format!("{path}/offsets"), reason));
        }
        Ok(Some(Ranges { path: path.to_owned(), ids, sizes, offsets }))
    }

    fn len(&self) -> usize {
        self.sizes.len()
    }

    /// Calls `cell` with the number and the ids of each cell.
    fn each(
        &self,
        mut cell: impl FnMut(usize, &[u32]) -> Result<(), BlueprintError>,
    ) -> Result<(), BlueprintError> {
        let (mut next, mut corners) = (0_usize, Vec::new());
        for k in 0..self.len() {
            let number =
                |numbers: &Numbers<'_>| numbers.get_i64(k).and_then(|n| usize::try_from(n).ok());
            let size = number(&self.sizes);
            let first = self.offsets.as_ref().map_or(Some(next), number);
            let range = first.zip(size).and_then(|(f, n)| Some(f..f.checked_add(n)?));
            let Some(range) = range.filter(|r| r.end <= self.ids.len()) else {
                let reason = format!(
                    "cell {k} has {} corners from number {} on, but there are {}",
                    self.sizes.get_f64(k),
                    first.map_or(-1.0, |f| f as f64),
                    self.ids.len()
                );
                return Err(BlueprintError::inconsistent(&self.path, reason));
            };
            next = range.end;
            corners.clear();
            corners.extend(range.map(|i| id(&self.ids, i)));
            cell(k, &corners)?;
        }
        Ok(())
    }
}

fn one_shape(
    path: &str,
    node: &Node<'_>,
    shape: &str,
    grid: &mut UnstructuredGrid,
) -> Result<(), BlueprintError> {
    let (kind, corners) = shape_of(path, shape)?;
    if kind == POLYHEDRON {
        let cure = "give polyhedra as the only shape of a topology";
        return Err(BlueprintError::unsupported(&format!("{path}/shape"), shape, cure));
    }
    if corners == 0 {
        let Some(ranges) = Ranges::of(path, node)? else { return Ok(()) };
        return ranges.each(|_, ids| {
            push(grid, kind, ids);
            Ok(())
        });
    }
    let Some(ids) = integers(path, node, "connectivity")? else { return Ok(()) };
    if !ids.len().is_multiple_of(corners) {
        let reason = format!("{} ids, which is no multiple of {corners} for `{shape}`", ids.len());
        return Err(BlueprintError::inconsistent(&format!("{path}/connectivity"), reason));
    }
    let mut cell = Vec::with_capacity(corners);
    for first in (0..ids.len()).step_by(corners) {
        cell.clear();
        cell.extend((first..first + corners).map(|i| id(&ids, i)));
        push(grid, kind, &cell);
    }
    Ok(())
}

fn push(grid: &mut UnstructuredGrid, kind: u8, ids: &[u32]) {
    grid.cells.push(ids.iter().copied());
    grid.types.push(kind);
}

/// Cells of several shapes: `shapes` has a number for each, which `shape_map` gives a name.
fn mixed(path: &str, node: &Node<'_>, grid: &mut UnstructuredGrid) -> Result<(), BlueprintError> {
    let Some(ranges) = Ranges::of(path, node)? else { return Ok(()) };
    let at = format!("{path}/shapes");
    let shapes = integers(path, node, "shapes")?;
    let shapes = shapes.ok_or_else(|| BlueprintError::missing(&at, "a number for each cell"))?;
    if shapes.len() != ranges.len() {
        let reason = format!("{} shapes, but {} sizes", shapes.len(), ranges.len());
        return Err(BlueprintError::inconsistent(&at, reason));
    }
    let mut map = Vec::new();
    for (name, number) in node.get("shape_map").map_or(&[][..], Node::children) {
        let (kind, corners) = shape_of(path, name)?;
        if kind == POLYHEDRON {
            let cure = "give polyhedra as the only shape of a topology";
            return Err(BlueprintError::unsupported(&format!("{path}/shape_map"), name, cure));
        }
        let number = number.i64().ok_or_else(|| {
            BlueprintError::missing(&format!("{path}/shape_map/{name}"), "a whole number")
        })?;
        map.push((number, kind, corners));
    }
    ranges.each(|k, ids| {
        let number = shapes.get_i64(k);
        let found = map.iter().find(|(n, ..)| Some(*n) == number);
        match found {
            Some(&(_, kind, corners)) if corners == 0 || corners == ids.len() => {
                push(grid, kind, ids);
                Ok(())
            }
            Some(&(_, _, corners)) => {
                let found = ids.len();
                let reason = format!("cell {k} has {found} corners, but its shape has {corners}");
                Err(BlueprintError::inconsistent(path, reason))
            }
            None => {
                let reason = format!(
                    "cell {k} has shape {}, which shape_map does not name",
                    shapes.get_f64(k)
                );
                Err(BlueprintError::inconsistent(path, reason))
            }
        }
    })
}

/// Polyhedra: ids are those of faces, which `subelements` lists.
fn polyhedra(
    path: &str,
    node: &Node<'_>,
    faces_path: &str,
    faces: &Node<'_>,
    grid: &mut UnstructuredGrid,
) -> Result<(), BlueprintError> {
    let Some(ranges) = Ranges::of(path, node)? else { return Ok(()) };
    let mut list = Cells::new();
    if let Some(faces) = Ranges::of(faces_path, faces)? {
        faces.each(|_, ids| {
            list.push(ids.iter().copied());
            Ok(())
        })?;
    }
    ranges.each(|k, ids| {
        let first = grid.polyhedron_faces.len();
        let mut corners: Vec<u32> = Vec::new();
        for &face in ids {
            if face as usize >= list.len() {
                let reason = format!("cell {k} has face {face}, but there are {}", list.len());
                return Err(BlueprintError::inconsistent(path, reason));
            }
            let face = list.get(face as usize);
            grid.polyhedron_faces.push(face.iter().copied());
            corners.extend(
                face.iter().filter(|id| !corners.contains(id)).copied().collect::<Vec<_>>(),
            );
        }
        push(grid, POLYHEDRON, &corners);
        grid.faces_of_cell.push(first..grid.polyhedron_faces.len());
        Ok(())
    })
}
