//! Walls without thickness, between two cells that would be neighbours.

use super::{Mesh, PartKind};
use crate::model::{BAFFLES, Dataset};
use std::collections::HashMap;

impl Mesh {
    /// Adds the baffles that a leaf lists, whose cells are those of the parts from `first` on.
    pub(super) fn add_baffles(&mut self, leaf: &Dataset, first: usize) {
        let list = leaf.attributes().and_then(|a| a.field_array(BAFFLES));
        let Some(list) = list.filter(|l| l.components == 2) else { return };
        let of_leaf = |i: usize, side: usize| list.get(i, side) as u32;
        let mut cells: HashMap<u32, Option<u32>> = HashMap::new();
        for i in 0..list.tuples() {
            cells.extend([0, 1].map(|side| (of_leaf(i, side), None)));
        }
        for part in &self.parts[first..] {
            for local in 0..part.cells.len() {
                let of_part = match &part.kind {
                    PartKind::Lattice(_) => local,
                    PartKind::Cells(e) => {
                        let cell = e.cell[local] as usize;
                        e.source.get(cell).map_or(cell, |c| *c as usize)
                    }
                };
                if let Some(cell) = cells.get_mut(&(of_part as u32)) {
                    *cell = Some((part.cells.start + local) as u32);
                }
            }
        }
        // Cells that the mesh leaves out have no walls.
        let of_mesh = |i: usize, side: usize| cells.get(&of_leaf(i, side)).copied().flatten();
        let pairs = (0..list.tuples()).filter_map(|i| Some([of_mesh(i, 0)?, of_mesh(i, 1)?]));
        self.insert_baffles(&pairs.collect::<Vec<_>>());
    }

    /// Adds pairs of cells of the mesh.
    pub(in crate::resample) fn insert_baffles(&mut self, pairs: &[[u32; 2]]) {
        self.baffles.extend(pairs.iter().map(|&[a, b]| [a.min(b), a.max(b)]));
        self.baffles.sort_unstable();
        self.baffles.dedup();
    }

    /// Whether a wall without thickness is between two cells.
    pub(in crate::resample) fn has_baffle(&self, a: u32, b: u32) -> bool {
        !self.baffles.is_empty() && self.baffles.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }
}
