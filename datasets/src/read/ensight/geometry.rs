//! The geometry file: parts with elements or a lattice.

use super::case_file::short;
use super::source::Source;
use crate::model::{
    Attributes, Cells, DataArray, Dataset, ImageData, Points, RectilinearGrid, StructuredGrid,
    UnstructuredGrid, Values, extent_dims,
};
use crate::read::error::{At, BROKEN, Fault};
use crate::read::wedge::{TURNED, is_turned};
use glam::DVec3;

/// A part, and how many elements of each type it has, in the order of the file.
pub(super) struct Part {
    pub(super) number: i32,
    pub(super) name: String,
    pub(super) data: Dataset,
    pub(super) elements: Vec<(String, usize)>,
}

/// VTK's type of an element, and its number of corners.
fn element(name: &str) -> Option<(u8, usize)> {
    Some(match name {
        "point" => (1, 1),
        "bar2" => (3, 2),
        "bar3" => (21, 3),
        "tria3" => (5, 3),
        "tria6" => (22, 6),
        "quad4" => (9, 4),
        "quad8" => (23, 8),
        "tetra4" => (10, 4),
        "tetra10" => (24, 10),
        "pyramid5" => (14, 5),
        "pyramid13" => (27, 13),
        "penta6" => (WEDGE, 6),
        "penta15" => (QUADRATIC_WEDGE, 15),
        "hexa8" => (12, 8),
        "hexa20" => (25, 20),
        _ => return None,
    })
}

const WEDGE: u8 = 13;
const QUADRATIC_WEDGE: u8 = 26;
const POLYGON: u8 = 7;
const POLYHEDRON: u8 = 42;

/// Reads the parts.
pub(super) fn read(s: &mut Source<'_>) -> Result<Vec<Part>, Fault> {
    s.need_text("the description")?;
    s.need_text("the description")?;
    let ids = |line: String| {
        let last = line.split_whitespace().next_back().unwrap_or_default().to_lowercase();
        last == "given" || last == "ignore"
    };
    let node_ids = ids(s.need_text("`node id`")?);
    let element_ids = ids(s.need_text("`element id`")?);
    if s.peek().is_some_and(|t| t.starts_with("extents")) {
        s.keyword()?;
        s.skip_reals(6, "extents")?;
    }
    let mut parts: Vec<Part> = Vec::new();
    while let Some(word) = s.keyword()? {
        if word != "part" {
            return Err(s.fault(format!("`{}` instead of a part", short(&word))));
        }
        let number = s.ints(1, "the number of a part")?.first().copied().unwrap_or(0);
        if parts.iter().any(|p| p.number == number) {
            return Err(s.fault(format!("part {number} comes twice")));
        }
        let name = s.need_text("the name of a part")?;
        let name = if name.is_empty() { number.to_string() } else { name };
        let mut elements = Vec::new();
        let kind = s.peek().unwrap_or_default();
        let data = if kind.starts_with("block") {
            s.keyword()?;
            Dataset::from(block(s, &kind, node_ids, element_ids)?)
        } else {
            Dataset::UnstructuredGrid(mesh(s, node_ids, element_ids, &mut elements)?)
        };
        data.check()?;
        parts.push(Part { number, name, data, elements });
    }
    Ok(parts)
}

fn mesh(
    s: &mut Source<'_>,
    node_ids: bool,
    element_ids: bool,
    elements: &mut Vec<(String, usize)>,
) -> Result<UnstructuredGrid, Fault> {
    let mut grid = UnstructuredGrid::default();
    let mut ghosts: Vec<u8> = Vec::new();
    while let Some(word) = s.peek().filter(|w| w != "part") {
        s.keyword()?;
        if word == "coordinates" {
            let [n] = s.counts("the number of points")?;
            if node_ids {
                s.ints(n, "ids of points")?;
            }
            let axes = [
                s.reals(n, "x of points")?,
                s.reals(n, "y of points")?,
                s.reals(n, "z of points")?,
            ];
            let point = |i: usize| [axes[0][i], axes[1][i], axes[2][i]];
            grid.points = Points::F32((0..axes[0].len()).map(point).collect());
            continue;
        }
        let [n] = s.counts("the number of elements")?;
        if element_ids {
            s.ints(n, "ids of elements")?;
        }
        let ghost = word.strip_prefix("g_");
        let before = grid.types.len();
        match ghost.unwrap_or(&word) {
            "nsided" => {
                let corners = s.ints(n, "numbers of corners")?;
                let lists = lists(s, &corners, grid.points.len())?;
                lists.iter().for_each(|c| grid.cells.push(c.iter().copied()));
                grid.types.extend(corners.iter().map(|_| POLYGON));
            }
            "nfaced" => polyhedra(s, n, &mut grid)?,
            name => {
                let Some((kind, corners)) = element(name) else {
                    let at = s.at();
                    let cure = "EnSight Gold's elements are point, bar, tria, quad, tetra, \
                                pyramid, penta, hexa, nsided and nfaced";
                    let what = format!("elements of type `{}`", short(name));
                    return Err(Fault::unsupported(at, what, cure));
                };
                let total = n.saturating_mul(corners as u64);
                let ids = indices(s, total, grid.points.len())?;
                for e in ids.chunks_exact(corners) {
                    let wedge = kind == WEDGE || kind == QUADRATIC_WEDGE;
                    if wedge && is_turned(e, &grid.points) {
                        grid.cells.push(TURNED[..corners].iter().map(|&k| e[k]));
                    } else {
                        grid.cells.push(e.iter().copied());
                    }
                    grid.types.push(kind);
                }
            }
        }
        let added = grid.types.len() - before;
        ghosts.resize(before, 0);
        ghosts.resize(before + added, u8::from(ghost.is_some()));
        elements.push((word, added));
    }
    if !grid.polyhedron_faces.is_empty() {
        // Cells after the last polyhedra have no faces in the list.
        let end = grid.polyhedron_faces.len();
        grid.faces_of_cell.resize(grid.types.len(), end..end);
    }
    if ghosts.contains(&1) {
        grid.attributes.cell.push(DataArray::new("vtkGhostType", 1, Values::U8(ghosts)));
    }
    Ok(grid)
}

/// Points of elements, from 0; the file counts from 1.
fn indices(s: &mut Source<'_>, count: u64, points: usize) -> Result<Vec<u32>, Fault> {
    let at = s.at();
    let ids = s.ints(count, "corners of elements")?;
    let index = |id: i32| u32::try_from(id).ok()?.checked_sub(1).filter(|i| (*i as usize) < points);
    let fault = |id: i32| {
        let what = format!("an element has point {id}, of {points}");
        Fault::new(at.clone(), what, BROKEN)
    };
    ids.into_iter().map(|id| index(id).ok_or_else(|| fault(id))).collect()
}

/// Lists of points with these lengths.
fn lists(s: &mut Source<'_>, lengths: &[i32], points: usize) -> Result<Cells, Fault> {
    let mut total = 0i64;
    let ends = lengths.iter().map(|&n| {
        total = total.saturating_add(i64::from(n.max(0)));
        total
    });
    let ends: Vec<i64> = ends.collect();
    let ids = indices(s, total as u64, points)?;
    Cells::from_ends(ends.into_iter(), ids).map_err(|e| s.fault(format!("lists of corners: {e:?}")))
}

fn polyhedra(s: &mut Source<'_>, n: u64, grid: &mut UnstructuredGrid) -> Result<(), Fault> {
    let faces_of = s.ints(n, "numbers of faces")?;
    let total: u64 = faces_of.iter().map(|&f| u64::try_from(f).unwrap_or(0)).sum();
    let corners = s.ints(total, "corners of faces")?;
    let faces = lists(s, &corners, grid.points.len())?;
    let end = grid.polyhedron_faces.len();
    grid.faces_of_cell.resize(grid.types.len(), end..end);
    let mut next = 0;
    for &count in &faces_of {
        let count = usize::try_from(count).unwrap_or(0);
        let mut ids: Vec<u32> = Vec::new();
        let first = grid.polyhedron_faces.len();
        for face in next..next + count {
            ids.extend_from_slice(faces.get(face));
            grid.polyhedron_faces.push(faces.get(face).iter().copied());
        }
        next += count;
        ids.sort_unstable();
        ids.dedup();
        grid.cells.push(ids);
        grid.types.push(POLYHEDRON);
        grid.faces_of_cell.push(first..grid.polyhedron_faces.len());
    }
    Ok(())
}

/// A structured part.
enum Lattice {
    Uniform(ImageData),
    Rectilinear(RectilinearGrid),
    Curvilinear(StructuredGrid),
}

impl From<Lattice> for Dataset {
    fn from(lattice: Lattice) -> Dataset {
        match lattice {
            Lattice::Uniform(g) => Dataset::ImageData(g),
            Lattice::Rectilinear(g) => Dataset::RectilinearGrid(g),
            Lattice::Curvilinear(g) => Dataset::StructuredGrid(g),
        }
    }
}

fn block(
    s: &mut Source<'_>,
    kind: &str,
    node_ids: bool,
    element_ids: bool,
) -> Result<Lattice, Fault> {
    let has = |word: &str| kind.split_whitespace().any(|w| w == word);
    if has("range") {
        let cure = "write the block without a range";
        return Err(Fault::unsupported(s.at(), "a block with a range", cure));
    }
    let at = s.at();
    let dims: [u64; 3] = s.counts("points along an axis")?;
    if dims.contains(&0) || dims.iter().any(|&d| d > i32::MAX as u64) {
        return Err(Fault::new(at, format!("a block of {dims:?} points"), BROKEN));
    }
    let extent: [i32; 6] =
        std::array::from_fn(|i| if i % 2 == 0 { 0 } else { dims[i / 2] as i32 - 1 });
    let many = |at: At| Fault::new(at, format!("a block of {dims:?} points is too large"), BROKEN);
    let n = dims.iter().try_fold(1u64, |n, &d| n.checked_mul(d)).ok_or_else(|| many(s.at()))?;
    let cells = crate::model::lattice_counts(extent_dims(extent)).map_or(u64::MAX, |c| c.1);
    let mut lattice = if has("uniform") {
        let origin = s.reals(3, "the origin")?;
        let delta = s.reals(3, "distances of points")?;
        let [origin, spacing] =
            [&origin, &delta].map(|v| DVec3::from([0, 1, 2].map(|a| f64::from(v[a]))));
        Lattice::Uniform(ImageData { extent, ..ImageData::new([1; 3], origin, spacing) })
    } else if has("rectilinear") {
        let mut coordinates: [Vec<f64>; 3] = Default::default();
        for (axis, &d) in coordinates.iter_mut().zip(&dims) {
            *axis = s.reals(d, "coordinates")?.into_iter().map(f64::from).collect();
        }
        let attributes = Attributes::default();
        Lattice::Rectilinear(RectilinearGrid { extent, coordinates, attributes })
    } else {
        let axes = [s.reals(n, "x")?, s.reals(n, "y")?, s.reals(n, "z")?];
        let points = (0..axes[0].len()).map(|i| [axes[0][i], axes[1][i], axes[2][i]]).collect();
        let (points, attributes) = (Points::F32(points), Attributes::default());
        Lattice::Curvilinear(StructuredGrid { extent, points, attributes })
    };
    let attributes = match &mut lattice {
        Lattice::Uniform(g) => &mut g.attributes,
        Lattice::Rectilinear(g) => &mut g.attributes,
        Lattice::Curvilinear(g) => &mut g.attributes,
    };
    if has("iblanked") {
        let iblank = s.ints(n, "iblank")?;
        // Points with iblank 0 are outside the flow: VTK's bit for hidden points.
        let hidden = iblank.iter().map(|&i| if i == 0 { 2 } else { 0 }).collect();
        attributes.point.push(DataArray::new("iblank", 1, Values::I32(iblank)));
        attributes.point.push(DataArray::new("vtkGhostType", 1, Values::U8(hidden)));
    }
    if has("with_ghost") {
        if s.peek().is_some_and(|t| t == "ghost_flags") {
            s.keyword()?;
        }
        let flags = s.ints(cells, "ghost flags")?;
        let ghost = flags.iter().map(|&f| u8::from(f != 0)).collect();
        attributes.cell.push(DataArray::new("vtkGhostType", 1, Values::U8(ghost)));
    }
    if node_ids && s.peek().is_some_and(|t| t == "node_ids") {
        s.keyword()?;
        s.ints(n, "ids of points")?;
    }
    if element_ids && s.peek().is_some_and(|t| t == "element_ids") {
        s.keyword()?;
        s.ints(cells, "ids of elements")?;
    }
    Ok(lattice)
}
