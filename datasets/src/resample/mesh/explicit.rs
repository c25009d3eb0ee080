//! The corners of cells with explicit lists.

use super::{Corners, Explicit, Shape};
use crate::model::CellType;
use smallvec::SmallVec;

impl Explicit {
    /// The corners of a cell, whose points count from `first` on.
    pub(super) fn corners(&self, local: usize, first: u32) -> Corners {
        let c = self.cell[local] as usize;
        let ids = self.grid.cells.get(c);
        let pick =
            |order: &[usize]| order.iter().map(|&i| ids[i] + first).collect::<SmallVec<[u32; 8]>>();
        // Higher-order cells store their corners first.
        match (self.grid.types[c], CellType::of(self.grid.types[c])) {
            (11, _) => Corners { ids: pick(&[0, 1, 3, 2, 4, 5, 7, 6]), shape: Shape::Hexa },
            (10 | 24 | 71 | 78, _) => Corners { ids: pick(&[0, 1, 2, 3]), shape: Shape::Tetra },
            (12 | 25 | 29 | 33 | 72 | 79, _) => {
                Corners { ids: pick(&[0, 1, 2, 3, 4, 5, 6, 7]), shape: Shape::Hexa }
            }
            (13 | 26 | 31 | 32 | 73 | 80, _) => {
                Corners { ids: pick(&[0, 1, 2, 3, 4, 5]), shape: Shape::Wedge }
            }
            (14 | 27 | 37 | 74 | 81, _) => {
                Corners { ids: pick(&[0, 1, 2, 3, 4]), shape: Shape::Pyramid }
            }
            (_, CellType::Solid(faces)) => {
                let corners =
                    1 + faces.iter().flat_map(|f| f.iter()).copied().max().unwrap_or(0) as usize;
                let faces =
                    faces.iter().map(|f| f.iter().map(|&i| u32::from(i)).collect()).collect();
                Corners {
                    ids: ids[..corners].iter().map(|i| i + first).collect(),
                    shape: Shape::Faces(faces),
                }
            }
            _ => {
                let mut own: Vec<u32> = Vec::new();
                let mut faces = Vec::new();
                for f in self.grid.faces_of_cell.get(c).cloned().unwrap_or(0..0) {
                    let face = self.grid.polyhedron_faces.get(f).iter().map(|id| {
                        own.iter().position(|o| o == id).unwrap_or_else(|| {
                            own.push(*id);
                            own.len() - 1
                        }) as u32
                    });
                    faces.push(face.collect());
                }
                Corners {
                    ids: own.into_iter().map(|i| i + first).collect(),
                    shape: Shape::Faces(faces),
                }
            }
        }
    }
}
