//! Cells with the shapes that have a name: tetrahedra, hexahedra, wedges and pyramids are found by
//! their faces; the others stay polyhedra.

use super::poly_mesh::{PolyMesh, wall_points};
use crate::model::shape_of_faces::{POLYHEDRON, distinct, named};
use crate::model::{Cells, Points, UnstructuredGrid};

/// The mesh as VTK has it. Cells keep their numbers.
pub(super) fn solid_cells(mesh: PolyMesh) -> UnstructuredGrid {
    let faces_of_cells = mesh.faces_of_cells();
    let mut grid = UnstructuredGrid::default();
    let mut faces = Cells::new();
    let mut corners = Vec::new();
    for cell in 0..mesh.cells {
        faces.clear();
        for &face in faces_of_cells.get(cell) {
            corners.clear();
            mesh.outward(face as usize, cell as u32, &mut corners);
            faces.push(corners.iter().copied());
        }
        let first = grid.polyhedron_faces.len();
        match named(&faces) {
            Some((kind, ids)) => {
                grid.types.push(kind);
                grid.cells.push(ids);
            }
            None => {
                grid.types.push(POLYHEDRON);
                grid.cells.push(distinct(&faces));
                faces.iter().for_each(|f| grid.polyhedron_faces.push(f.iter().copied()));
            }
        }
        grid.faces_of_cell.push(first..grid.polyhedron_faces.len());
    }
    if grid.polyhedron_faces.is_empty() {
        grid.faces_of_cell.clear();
    }
    let walls = mesh.wall_points().into_iter().enumerate().filter(|w| w.1);
    grid.attributes.field.push(wall_points(walls.map(|(id, _)| id as u32)));
    grid.points = Points::F64(mesh.points);
    grid
}
