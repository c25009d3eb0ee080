//! Finds the faces that pieces of a data set share, where no ghost cells mark them as interior.
//!
//! A face is known by the coordinates of its corners, in any order: processes that divide a mesh
//! write the same numbers for a point that they share. Pieces of one mesh that number its points
//! alike know a face by these numbers instead, as the mesh does. Of each boundary face of a piece,
//! 24 bytes are kept, so the pieces themselves may be read one after the other.

use super::boundary_faces::BoundaryFaces;
use super::surface::GhostFlags;
use super::{CellType, Dataset, Points};
use glam::DVec3;
use rayon::slice::ParallelSliceMut;
use rt_core::math::mix64;
use std::sync::Arc;

/// Identifies a face: a hash of its corners.
type CornerHash = [u64; 2];

/// The boundary faces of pieces. [`PieceBoundaries::shared_faces`] says which of them lie between
/// two.
#[derive(Debug, Default)]
pub struct PieceBoundaries {
    faces: Vec<(CornerHash, u32)>,
    pieces: u32,
}

/// Faces between two pieces, which are no part of the surface of the whole: see
/// [`Dataset::to_trimesh_between`].
#[derive(Debug, Clone, Default)]
pub struct SharedFaces {
    /// In ascending order.
    faces: Arc<[CornerHash]>,
    /// The numbers that one piece's points have in the whole; without them, points are known by
    /// their coordinates.
    numbers: Option<Vec<u64>>,
}

impl PieceBoundaries {
    /// Adds the faces of solid cells that belong to one cell of the piece only. Cells of others
    /// that the piece has copies of (`vtkGhostType`) count as its own, as in
    /// [`Dataset::to_trimesh`].
    pub fn add(&mut self, piece: &Dataset) {
        self.add_known_by(piece, None);
    }

    /// [`Self::add`] for a piece of one mesh: `numbers` says which of the mesh's points each of
    /// its points is.
    pub fn add_numbered(&mut self, piece: &Dataset, numbers: &[u64]) {
        self.add_known_by(piece, Some(numbers));
    }

    fn add_known_by(&mut self, piece: &Dataset, numbers: Option<&[u64]>) {
        self.pieces += 1;
        for leaf in piece.leaves() {
            let Dataset::UnstructuredGrid(d) = leaf else { continue };
            let hidden = GhostFlags::new(&d.attributes);
            let outside = BoundaryFaces::find(d, &hidden);
            let mut faces = Vec::new();
            for cell in 0..d.cells.len() {
                let solid = matches!(
                    CellType::of(d.types[cell]),
                    CellType::Solid(_) | CellType::Polyhedron
                );
                let exist = || d.cells.get(cell).iter().all(|&k| (k as usize) < d.points.len());
                if !solid || hidden.cell(cell) || !exist() {
                    continue;
                }
                outside.of_cell(d, cell, &mut faces);
                for ids in &faces {
                    self.faces.push((face_hash(ids, &d.points, numbers), self.pieces));
                }
            }
        }
    }

    /// The faces that two of the pieces have.
    pub fn shared_faces(mut self) -> SharedFaces {
        self.faces.par_sort_unstable();
        let of_two = |same: &&[(CornerHash, u32)]| same.iter().any(|face| face.1 != same[0].1);
        let same = self.faces.chunk_by(|a, b| a.0 == b.0).filter(of_two);
        SharedFaces { faces: same.map(|same| same[0].0).collect(), numbers: None }
    }
}

impl SharedFaces {
    /// Number of faces.
    pub fn len(&self) -> usize {
        self.faces.len()
    }

    /// Whether no two pieces have a face in common.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The same faces for one piece of those that [`PieceBoundaries::add_numbered`] was told of.
    pub fn of_numbered(&self, numbers: Vec<u64>) -> SharedFaces {
        SharedFaces { faces: Arc::clone(&self.faces), numbers: Some(numbers) }
    }

    /// Whether the face with these corners is one of them.
    pub(super) fn contains(&self, ids: &[u32], points: &Points) -> bool {
        self.faces.binary_search(&face_hash(ids, points, self.numbers.as_deref())).is_ok()
    }
}

fn face_hash(ids: &[u32], points: &Points, numbers: Option<&[u64]>) -> CornerHash {
    let mut all: Vec<[u64; 3]> = match numbers {
        Some(numbers) => {
            ids.iter().map(|&k| [numbers.get(k as usize).map_or(u64::MAX, |&n| n), 0, 0]).collect()
        }
        // -0 and 0 are one place.
        None => ids
            .iter()
            .map(|&k| (points.get(k as usize) + DVec3::ZERO).to_array().map(f64::to_bits))
            .collect(),
    };
    all.sort_unstable();
    [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03]
        .map(|seed| all.iter().flatten().fold(seed, |hash: u64, bits| mix64(hash ^ bits)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Points, UnstructuredGrid};

    /// A cube of the lattice of whole numbers from `x` on, with its points in an order of its own.
    fn cube(x: f64, first: usize) -> Dataset {
        let corner =
            |i: usize| DVec3::new(x + (i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
        let mut points: Vec<_> = (0..8).map(|i| corner((i + first) % 8).to_array()).collect();
        points[0][1] = if points[0][1] == 0.0 { -0.0 } else { points[0][1] };
        let mut d = UnstructuredGrid { points: Points::F64(points), ..UnstructuredGrid::default() };
        d.cells.push([0, 1, 3, 2, 4, 5, 7, 6].map(|i| ((i + 8 - first) % 8) as u32));
        d.types.push(12);
        Dataset::UnstructuredGrid(d)
    }

    #[test]
    fn the_face_between_two_pieces_is_no_part_of_their_surface() {
        let pieces = [cube(0.0, 0), cube(1.0, 3), cube(5.0, 1)];
        let mut boundaries = PieceBoundaries::default();
        pieces.iter().for_each(|piece| boundaries.add(piece));
        let shared = boundaries.shared_faces();
        assert_eq!(shared.len(), 1);
        let triangles = pieces.each_ref().map(|piece| {
            let (mesh, report) = piece.to_trimesh_between(None, None, Some(&shared)).unwrap();
            assert_eq!(report.shared_faces, (12 - mesh.num_triangles()) / 2);
            mesh.num_triangles()
        });
        assert_eq!(triangles, [10, 10, 12]);
    }

    #[test]
    fn a_face_that_one_piece_has_twice_stays() {
        let (Dataset::UnstructuredGrid(mut d), Dataset::UnstructuredGrid(other)) =
            (cube(0.0, 0), cube(1.0, 0))
        else {
            unreachable!("cubes are unstructured grids")
        };
        let (Points::F64(points), Points::F64(more)) = (&mut d.points, other.points) else {
            unreachable!("in double precision")
        };
        points.extend(more);
        d.cells.push([8, 9, 11, 10, 12, 13, 15, 14]);
        d.types.push(12);
        let mut boundaries = PieceBoundaries::default();
        boundaries.add(&Dataset::UnstructuredGrid(d));
        assert!(boundaries.shared_faces().is_empty());
    }
}
