//! Walls without thickness that no list names: faces between two cells that have points of their
//! own there, with gas at rest on both sides.
//!
//! Points that a file has twice are as often a seam, or the border of two blocks. There, gas is at
//! rest at no more than an edge of a face.

use super::Walls;
use crate::resample::mesh::Mesh;

impl Walls {
    /// Adds the faces between cells whose points are twice, and of which all are walls' by now.
    pub(super) fn add_baffles(&mut self, mesh: &Mesh) {
        let mut is_twice = vec![false; mesh.num_points()];
        for (i, &first) in mesh.first_at_place().iter().enumerate() {
            if first as usize != i {
                (is_twice[i], is_twice[first as usize]) = (true, true);
            }
        }
        if !is_twice.contains(&true) || !self.of_points.contains(&true) {
            return;
        }
        let neighbours = &mesh.topology().neighbours;
        let is_wall = |ids: &[u32]| ids.iter().all(|&i| self.of_points[i as usize]);
        let mut found = Vec::new();
        for cell in 0..mesh.num_cells() {
            if !mesh.corners(cell).ids.iter().any(|&i| is_twice[i as usize]) {
                continue;
            }
            for (number, &other) in neighbours.of_cell(cell).iter().enumerate() {
                // Each pair once; above the cells are the constants of what is no cell.
                if (other as usize) <= cell || other as usize >= mesh.num_cells() {
                    continue;
                }
                let back = neighbours.of_cell(other as usize).iter();
                let Some(opposite) = back.clone().position(|c| *c as usize == cell) else {
                    continue;
                };
                let [a, b] = [(cell, number), (other as usize, opposite)]
                    .map(|(cell, number)| corners_of_face(mesh, cell, number));
                if a != b && is_wall(&a) && is_wall(&b) {
                    found.push([cell as u32, other]);
                }
            }
        }
        self.baffles = found;
    }

    /// Number of faces between cells that are walls without thickness, by gas at rest on both their
    /// sides. Those that the file lists ([`crate::model::BAFFLES`]) do not count.
    pub fn baffles(&self) -> usize {
        self.baffles.len()
    }

    /// The cells on both sides of each.
    pub(in crate::resample) fn cells_at_baffles(&self) -> &[[u32; 2]] {
        &self.baffles
    }
}

/// The corners of a face of a cell, in order of their numbers.
fn corners_of_face(mesh: &Mesh, cell: usize, number: usize) -> Vec<u32> {
    let corners = mesh.corners(cell);
    let (mut next, mut ids) = (0, Vec::new());
    corners.shape.each_face(|ring| {
        if next == number {
            ids.extend(ring.iter().map(|&i| corners.ids[i as usize]));
        }
        next += 1;
    });
    ids.sort_unstable();
    ids
}
