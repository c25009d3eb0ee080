//! The cells of a data set that have a volume.

use super::ContourReport;
use crate::model::surface::GhostFlags;
use crate::model::{CellType, Dataset, UnstructuredGrid, extent_dims};
use glam::DVec3;

/// A cell with a volume.
pub(super) struct Cell<'a> {
    /// Numbers of its corners, each once.
    pub(super) corners: &'a [u32],
    faces: Faces<'a>,
}

enum Faces<'a> {
    /// Places in the list of corners.
    Table(&'static [&'static [u8]]),
    /// Numbers of points.
    Listed { grid: &'a UnstructuredGrid, cell: usize },
}

impl Cell<'_> {
    pub(super) fn num_faces(&self) -> usize {
        match &self.faces {
            Faces::Table(table) => table.len(),
            Faces::Listed { grid, cell } => grid.faces_of_cell[*cell].len(),
        }
    }

    /// Replaces `face` by the corners of face `k`: places in the list of corners.
    pub(super) fn face(&self, k: usize, face: &mut Vec<usize>) {
        face.clear();
        match &self.faces {
            Faces::Table(table) => face.extend(table[k].iter().map(|&c| usize::from(c))),
            Faces::Listed { grid, cell } => {
                let ids = grid.polyhedron_faces.get(grid.faces_of_cell[*cell].start + k);
                let place = |id: &u32| self.corners.iter().position(|c| c == id);
                face.extend(ids.iter().filter_map(place));
            }
        }
    }
}

/// What becomes of copies of other processes' cells.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Copies {
    LeftOut,
    Visited,
}

impl Copies {
    fn hide(self, flags: &GhostFlags<'_>, cell: usize) -> bool {
        match self {
            Copies::LeftOut => flags.cell(cell),
            Copies::Visited => flags.is_blanked(cell),
        }
    }
}

pub(super) fn number_of_points(leaf: &Dataset) -> usize {
    usize::try_from(leaf.counts().0).unwrap_or(usize::MAX)
}

/// The position of a point.
#[inline]
pub(super) fn point_of(leaf: &Dataset, id: usize) -> DVec3 {
    let index = |dims: [usize; 3]| {
        [id % dims[0].max(1), id / dims[0].max(1) % dims[1].max(1), id / (dims[0] * dims[1]).max(1)]
    };
    match leaf {
        Dataset::PolyData(d) => d.points.get(id),
        Dataset::UnstructuredGrid(d) => d.points.get(id),
        Dataset::StructuredGrid(d) => d.points.get(id),
        Dataset::ImageData(d) => {
            let [i, j, k] = index(d.dims());
            d.point(i, j, k)
        }
        Dataset::RectilinearGrid(d) => {
            let [i, j, k] = index(extent_dims(d.extent));
            DVec3::new(d.coordinates[0][i], d.coordinates[1][j], d.coordinates[2][k])
        }
        Dataset::MultiBlock(_) => DVec3::NAN,
    }
}

/// Calls `visit` with the number of each cell that has a volume, and the cell; it returns whether
/// its numbers are finite. Others are counted in `report`.
pub(super) fn each_solid(
    leaf: &Dataset,
    copies: Copies,
    report: &mut ContourReport,
    mut visit: impl FnMut(usize, Cell<'_>) -> bool,
) {
    match leaf {
        Dataset::PolyData(d) => {
            report.flat_cells += d.verts.len() + d.lines.len() + d.polys.len() + d.strips.len();
        }
        Dataset::UnstructuredGrid(d) => unstructured(d, copies, report, &mut visit),
        Dataset::ImageData(_) | Dataset::RectilinearGrid(_) | Dataset::StructuredGrid(_) => {
            lattice(leaf, copies, report, &mut visit);
        }
        Dataset::MultiBlock(_) => {}
    }
}

fn unstructured(
    grid: &UnstructuredGrid,
    copies: Copies,
    report: &mut ContourReport,
    visit: &mut impl FnMut(usize, Cell<'_>) -> bool,
) {
    let flags = GhostFlags::new(&grid.attributes);
    let points = grid.points.len();
    for (number, ids) in grid.cells.iter().enumerate() {
        if copies.hide(&flags, number) {
            report.ghost_cells += 1;
            continue;
        }
        let (faces, corners) = match CellType::of(grid.types[number]) {
            CellType::Solid(table) => {
                let corners =
                    table.iter().flat_map(|f| f.iter()).map(|c| usize::from(*c) + 1).max();
                (Faces::Table(table), corners.unwrap_or(0))
            }
            CellType::Polyhedron if number < grid.faces_of_cell.len() => {
                (Faces::Listed { grid, cell: number }, ids.len())
            }
            CellType::Polyhedron | CellType::Unknown => {
                report.unknown_type += 1;
                continue;
            }
            _ => {
                report.flat_cells += 1;
                continue;
            }
        };
        let Some(corners) = ids.get(..corners).filter(|c| c.len() >= 4) else {
            report.bad_cells += 1;
            continue;
        };
        if corners.iter().any(|&id| id as usize >= points) {
            report.bad_cells += 1;
            continue;
        }
        report.solids += 1;
        report.not_finite += usize::from(!visit(number, Cell { corners, faces }));
    }
}

/// The hexahedra of a lattice.
fn lattice(
    leaf: &Dataset,
    copies: Copies,
    report: &mut ContourReport,
    visit: &mut impl FnMut(usize, Cell<'_>) -> bool,
) {
    let extent = match leaf {
        Dataset::ImageData(d) => d.extent,
        Dataset::RectilinearGrid(d) => d.extent,
        Dataset::StructuredGrid(d) => d.extent,
        _ => return,
    };
    let dims = extent_dims(extent);
    let [nx, ny, nz] = dims.map(|n| n.saturating_sub(1));
    let CellType::Solid(table) = CellType::of(12) else { return };
    if nx == 0 || ny == 0 || nz == 0 {
        report.flat_cells += usize::try_from(leaf.counts().1).unwrap_or(usize::MAX);
        return;
    }
    let Some(attributes) = leaf.attributes() else { return };
    let flags = GhostFlags::new(attributes);
    let (row, plane) = (dims[0], dims[0] * dims[1]);
    for number in 0..nx * ny * nz {
        if copies.hide(&flags, number) {
            report.ghost_cells += 1;
            continue;
        }
        let first = number % nx + row * (number / nx % ny) + plane * (number / nx / ny);
        let eight = [0, 1, 1 + row, row, plane, plane + 1, plane + 1 + row, plane + row];
        let corners = eight.map(|step| (first + step) as u32);
        report.solids += 1;
        let cell = Cell { corners: &corners, faces: Faces::Table(table) };
        report.not_finite += usize::from(!visit(number, cell));
    }
}
