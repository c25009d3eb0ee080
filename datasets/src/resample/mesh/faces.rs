//! Finds which cell lies behind each face of a cell.
//!
//! Faces are compared by their points, as in `boundary_faces` of the model. Points of different
//! blocks at the same place are one, so that a face of two blocks is none of the border. A wall
//! without thickness is one for the cells on both its sides.

use super::Mesh;
use rayon::prelude::*;

/// Behind the face is no cell.
pub(in crate::resample) const OUTSIDE: u32 = u32::MAX;
/// Behind the face is a cell that the solver hides.
pub(in crate::resample) const HIDDEN: u32 = u32::MAX - 1;
/// Behind the face is a body.
pub(in crate::resample) const WALL: u32 = u32::MAX - 2;
/// The face has no area: a side that collapsed.
pub(in crate::resample) const NO_FACE: u32 = u32::MAX - 3;

/// The cell behind each face.
#[derive(Debug, Clone)]
pub(in crate::resample) struct Neighbours {
    /// Number of the first face of each cell.
    starts: Vec<usize>,
    /// In the order of `Shape::each_face`.
    beyond: Vec<u32>,
    crowded: usize,
}

/// Identifies a face whatever its orientation and first corner: the number of its different points
/// and the four smallest of them.
type FaceKey = (u32, [u32; 4]);

impl Neighbours {
    /// `same` is the first of the points at the same place. Cells without volume are left out.
    pub(in crate::resample) fn of(mesh: &Mesh, same: &[u32], volumes: &[f64]) -> Neighbours {
        let per_cell: Vec<u32> = (0..mesh.num_cells())
            .into_par_iter()
            .map(|cell| {
                let mut faces = 0;
                mesh.corners(cell).shape.each_face(|_| faces += 1);
                faces
            })
            .collect();
        let mut starts = vec![0];
        starts.extend(per_cell.iter().scan(0, |sum, n| {
            *sum += *n as usize;
            Some(*sum)
        }));
        let keys_of = |cell: usize| {
            let mut keys: Vec<(FaceKey, u32, usize)> = Vec::new();
            if volumes[cell] == 0.0 {
                return keys;
            }
            let corners = mesh.corners(cell);
            let (mut face, mut distinct) = (starts[cell], Vec::new());
            corners.shape.each_face(|ring| {
                distinct.clear();
                distinct.extend(ring.iter().map(|&i| same[corners.ids[i as usize] as usize]));
                distinct.sort_unstable();
                distinct.dedup();
                if distinct.len() > 2 {
                    let smallest =
                        std::array::from_fn(|i| distinct.get(i).copied().unwrap_or(u32::MAX));
                    keys.push(((distinct.len() as u32, smallest), cell as u32, face));
                }
                face += 1;
            });
            keys
        };
        let mut keys: Vec<(FaceKey, u32, usize)> =
            (0..mesh.num_cells()).into_par_iter().flat_map_iter(keys_of).collect();
        keys.par_sort_unstable();
        let mut beyond = vec![NO_FACE; starts[mesh.num_cells()]];
        let mut crowded = 0;
        for shared in keys.chunk_by(|a, b| a.0 == b.0) {
            match shared {
                [(_, a, face_a), (_, b, face_b)] if a != b && !mesh.has_baffle(*a, *b) => {
                    let seen =
                        |cell: u32| if mesh.is_hidden(cell as usize) { HIDDEN } else { cell };
                    (beyond[*face_a], beyond[*face_b]) = (seen(*b), seen(*a));
                }
                all => {
                    crowded += usize::from(all.len() > 2);
                    all.iter().for_each(|(_, _, face)| beyond[*face] = OUTSIDE);
                }
            }
        }
        Neighbours { starts, beyond, crowded }
    }

    /// Takes faces of the border as walls, each the face of this number of this cell. Faces that
    /// are not of the border stay.
    pub(in crate::resample) fn mark_walls(&mut self, walls: impl Iterator<Item = (u32, u32)>) {
        for (cell, number) in walls {
            let first = self.starts.get(cell as usize).copied().unwrap_or(self.beyond.len());
            if let Some(beyond) = self.beyond.get_mut(first + number as usize)
                && *beyond == OUTSIDE
            {
                *beyond = WALL;
            }
        }
    }

    /// Takes the faces between these cells as walls.
    pub(in crate::resample) fn mark_baffles(&mut self, pairs: &[[u32; 2]]) {
        for &[a, b] in pairs {
            for (cell, other) in [(a as usize, b), (b as usize, a)] {
                let Some(&[first, end]) = self.starts.get(cell..cell + 2) else { continue };
                let of_cell = self.beyond[first..end].iter_mut();
                of_cell.filter(|c| **c == other).for_each(|c| *c = WALL);
            }
        }
    }

    /// What lies behind the faces of a cell: a cell, or one of the constants.
    pub(in crate::resample) fn of_cell(&self, cell: usize) -> &[u32] {
        &self.beyond[self.starts[cell]..self.starts[cell + 1]]
    }

    /// Number of faces that more than two cells have.
    pub(in crate::resample) fn crowded(&self) -> usize {
        self.crowded
    }
}
