//! Walls that files name: lists of points, and blocks of surfaces.

use super::Walls;
use crate::model::{Dataset, WALL_POINTS, extent_dims, is_name_of_body};
use crate::resample::extrude;
use crate::resample::mesh::Mesh;
use glam::DVec3;
use std::collections::HashSet;

impl Walls {
    /// The points that a reader lists. Returns whether there is a list, which may be empty.
    pub(super) fn add_listed(&mut self, mesh: &Mesh, data: &Dataset) -> bool {
        let leaves = data.leaves();
        let list = |leaf: usize| leaves.get(leaf)?.attributes()?.field_array(WALL_POINTS);
        let (mut any, mut found) = (false, 0);
        mesh.each_leaf(|leaf, points| {
            let Some(ids) = list(leaf) else { return };
            any = true;
            let layers = mesh.copies(points.start);
            let count = points.len() / layers;
            for id in (0..ids.tuples()).map(|i| ids.get(i, 0) as usize).filter(|i| *i < count) {
                (0..layers).for_each(|l| self.of_points[points.start + l * count + id] = true);
                found += 1;
            }
        });
        if found > 0 {
            self.evidence.push("the boundary's patches that are walls".into());
        }
        any
    }

    /// The points of blocks with the name of a body. Places are compared as the file has them: a
    /// plane that got depth, or was turned onto two axes, has none of its points where they were.
    pub(super) fn add_blocks(&mut self, mesh: &Mesh, data: &Dataset) {
        let mut names = Vec::new();
        let mut places: HashSet<[u64; 3]> = HashSet::new();
        let place = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        each_named(data, false, &mut |name, leaf| {
            let points = match leaf {
                Dataset::PolyData(d) => &d.points,
                Dataset::UnstructuredGrid(d) if extrude::has_no_solids(d) => &d.points,
                _ => return,
            };
            names.push(format!("`{name}`"));
            places.extend((0..points.len()).map(|i| place(points.get(i))));
        });
        if places.is_empty() {
            return;
        }
        let leaves = data.leaves();
        let mut found = 0;
        mesh.each_source(|leaf, point, source| {
            let at = leaves.get(leaf).and_then(|leaf| point_of(leaf, source));
            if at.is_some_and(|at| places.contains(&place(at))) {
                self.of_points[point] = true;
                found += 1;
            }
        });
        if found > 0 {
            self.evidence.push(format!("the surfaces {}", names.join(", ")));
        }
    }
}

/// A point of a leaf, as the file has it.
fn point_of(leaf: &Dataset, i: usize) -> Option<DVec3> {
    let in_lattice = |n: [usize; 3]| [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
    match leaf {
        Dataset::ImageData(d) => {
            let [x, y, z] = in_lattice(d.dims());
            Some(d.point(x, y, z))
        }
        Dataset::RectilinearGrid(d) => {
            let at = in_lattice(extent_dims(d.extent));
            let [x, y, z] = [0, 1, 2].map(|a| d.coordinates[a][at[a]]);
            Some(DVec3::new(x, y, z))
        }
        Dataset::StructuredGrid(d) => Some(d.points.get(i)),
        Dataset::UnstructuredGrid(d) => Some(d.points.get(i)),
        Dataset::PolyData(d) => Some(d.points.get(i)),
        Dataset::MultiBlock(_) => None,
    }
}

/// Calls `f` with each leaf below a block with the name of a body.
fn each_named(data: &Dataset, below: bool, f: &mut dyn FnMut(&str, &Dataset)) {
    let Dataset::MultiBlock(blocks) = data else { return };
    for block in blocks {
        let named = below || is_name_of_body(&block.name);
        match &block.data {
            Dataset::MultiBlock(_) => each_named(&block.data, named, f),
            leaf if named => f(&block.name, leaf),
            _ => {}
        }
    }
}
