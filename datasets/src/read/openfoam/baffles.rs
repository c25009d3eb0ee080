//! Walls without thickness within a flow: two faces of the boundary at one place, one for the cell
//! on either side, as createBaffles and splitBaffles make them.

use super::poly_mesh::PolyMesh;
use crate::model::{BAFFLES, DataArray, Values};
use std::collections::HashMap;

/// The baffles of a case.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Baffles {
    /// The cells on both sides of each face.
    pub(super) pairs: Vec<[u32; 2]>,
    /// The patches that they are of.
    pub(super) patches: Vec<String>,
}

impl Baffles {
    /// Faces of patches of walls that have the same corners, with the same points or with others at
    /// their places.
    pub(super) fn of(mesh: &PolyMesh) -> Baffles {
        let mut first: HashMap<[u64; 3], u32> = HashMap::new();
        // The cell of a face so far without another, and its patch.
        let mut open: HashMap<Vec<u32>, (u32, usize)> = HashMap::new();
        let mut found = Baffles::default();
        let mut has_baffle = vec![false; mesh.patches.len()];
        for (number, patch) in mesh.patches.iter().enumerate().filter(|(_, p)| p.is_wall()) {
            for face in patch.faces.clone() {
                let mut key: Vec<u32> = Vec::new();
                for &id in mesh.faces.get(face) {
                    // Adding zero makes -0 the same place as 0.
                    let place = mesh.points[id as usize].map(|x| (x + 0.0).to_bits());
                    key.push(*first.entry(place).or_insert(id));
                }
                key.sort_unstable();
                let cell = mesh.owner[face];
                match open.remove(&key) {
                    Some((other, of)) if other != cell => {
                        found.pairs.push([other, cell]);
                        (has_baffle[of], has_baffle[number]) = (true, true);
                    }
                    _ => {
                        open.insert(key, (cell, number));
                    }
                }
            }
        }
        let names = mesh.patches.iter().zip(has_baffle).filter(|p| p.1);
        found.patches = names.map(|(patch, _)| patch.name.clone()).collect();
        found.patches.dedup();
        found
    }

    /// The field data that lists them; `None` without any.
    pub(super) fn array(&self) -> Option<DataArray> {
        let cells = || self.pairs.as_flattened().to_vec();
        (!self.pairs.is_empty()).then(|| DataArray::new(BAFFLES, 2, Values::U32(cells())))
    }

    /// How many there are, of which patches, in words.
    pub(super) fn warning(&self) -> Option<String> {
        let names: Vec<String> = self.patches.iter().map(|n| format!("`{n}`")).collect();
        (!self.pairs.is_empty()).then(|| {
            format!(
                "{} faces of the patches {} are walls without thickness within the flow (baffles): \
                 light that is traced through the cells (schlieren --on-cells) is stopped by them, \
                 light through a lattice is not",
                self.pairs.len(),
                names.join(", ")
            )
        })
    }
}
