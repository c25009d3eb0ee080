//! Which points of a mesh are at one place: those of blocks that touch, and of the two sides of a
//! seam.
//!
//! A grid around a body closes on itself, and its files have the points of that seam twice. The two
//! differ by rounding: sin 2π is not zero. Taken as two, they would be a border of the flow through
//! all of it, from the body to the outer border.

use super::{Mesh, PartKind};
use glam::DVec3;
use rt_core::math::mix64;
use std::collections::HashMap;

/// Points of different cells that are nearer than these parts of the shortest and of the longest
/// edge at them are at one place. Cells at a wall may be 1e5 times as wide as high, and a file in
/// single precision has places to 1e-7 of a body's size.
const NEAR: [f64; 2] = [1e-3, 1e-5];

/// For each point the first of those at the same place.
pub(super) fn first_at_place(mesh: &Mesh) -> Vec<u32> {
    let border = on_border(mesh);
    let mut first: HashMap<[u64; 3], u32> = HashMap::new();
    let mut same: Vec<u32> = (0..mesh.num_points() as u32).collect();
    for i in (0..same.len()).filter(|i| border[*i]) {
        // Adding zero makes -0 the same place as 0.
        let place = mesh.point(i).to_array().map(|x| (x + 0.0).to_bits());
        same[i] = *first.entry(place).or_insert(i as u32);
    }
    drop(first);
    join_near(mesh, &reaches(mesh, &border), &mut same);
    same
}

/// Which points may have another one at their place: those of faces that no two cells have by the
/// same points. A point that a file has twice is one, for the cells on either side of it have
/// different points. Of several lattices every point is one, since a finer lattice may begin within
/// a coarser one.
fn on_border(mesh: &Mesh) -> Vec<bool> {
    // Each face adds a hash, without carry, to its points. That of a face between two cells cancels
    // itself, and no table of faces is needed.
    let mut hashes = vec![0u64; mesh.num_points()];
    for part in &mesh.parts {
        match &part.kind {
            PartKind::Lattice(dims) if mesh.parts.len() == 1 => {
                each_at_sides(*dims, |_, point| hashes[part.points.start + point] = 1);
            }
            PartKind::Lattice(_) => hashes[part.points.clone()].fill(1),
            PartKind::Cells(_) => {
                for cell in part.cells.clone() {
                    let corners = mesh.corners(cell);
                    corners.shape.each_face(|ring| {
                        let ids = || ring.iter().map(|i| corners.ids[*i as usize]);
                        let sum = ids().fold(0u64, |s, id| s.wrapping_add(mix64(u64::from(id))));
                        let hash = mix64(sum);
                        ids().for_each(|id| hashes[id as usize] ^= hash);
                    });
                }
            }
        }
    }
    hashes.into_iter().map(|hash| hash != 0).collect()
}

/// How far from each point of the border another one is at its place. Zero for all others, and
/// within lattices, which have no seam there.
fn reaches(mesh: &Mesh, border: &[bool]) -> Vec<f64> {
    // The shortest and the longest edge.
    let mut edges = vec![[f64::INFINITY, 0.0f64]; mesh.num_points()];
    let mut add = |a: usize, b: usize| {
        if !(border[a] || border[b]) {
            return;
        }
        let length = mesh.point(a).distance(mesh.point(b));
        // Sides that collapsed have edges without length.
        if length > 0.0 {
            for i in [a, b].into_iter().filter(|i| border[*i]) {
                edges[i] = [edges[i][0].min(length), edges[i][1].max(length)];
            }
        }
    };
    for part in &mesh.parts {
        match &part.kind {
            PartKind::Lattice(dims) => edges_at_sides(*dims, part.points.start, &mut add),
            PartKind::Cells(_) => {
                for cell in part.cells.clone() {
                    let corners = mesh.corners(cell);
                    corners.shape.each_face(|ring| {
                        let id = |i: usize| corners.ids[ring[i % ring.len()] as usize] as usize;
                        (0..ring.len()).for_each(|i| add(id(i), id(i + 1)));
                    });
                }
            }
        }
    }
    let reach = |[shortest, longest]: [f64; 2]| {
        let reach = (NEAR[0] * shortest).min(NEAR[1] * longest);
        if reach.is_finite() { reach } else { 0.0 }
    };
    edges.into_iter().map(reach).collect()
}

/// The edges of a lattice that end in its sides.
fn edges_at_sides(dims: [usize; 3], first: usize, mut add: impl FnMut(usize, usize)) {
    let step = [1, dims[0], dims[0] * dims[1]];
    each_at_sides(dims, |at, point| {
        let point = first + point;
        for axis in 0..3 {
            if at[axis] + 1 < dims[axis] {
                add(point, point + step[axis]);
            }
            if at[axis] > 0 {
                add(point - step[axis], point);
            }
        }
    });
}

/// Calls `f` with the place in the lattice, and the number, of each point of its sides.
fn each_at_sides([nx, ny, nz]: [usize; 3], mut f: impl FnMut([usize; 3], usize)) {
    let inside = |at: usize, n: usize| at > 0 && at + 1 < n;
    for k in 0..nz {
        for j in 0..ny {
            let whole_row = !inside(j, ny) || !inside(k, nz);
            let mut i = 0;
            while i < nx {
                f([i, j, k], i + nx * (j + ny * k));
                i += if whole_row || i + 1 == nx { 1 } else { nx - 1 };
            }
        }
    }
}

/// The first point so far in each box of a grid of boxes, and the next one in the same box.
///
/// Grids are finer where the mesh is: one for each power of two of the reach.
struct Grids {
    first: HashMap<(i32, [u64; 3]), u32>,
    next: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// Makes points that are near another one the same as the first of these.
fn join_near(mesh: &Mesh, reaches: &[f64], same: &mut [u32]) {
    let mut grids = Grids { first: HashMap::new(), next: vec![NONE; same.len()] };
    for i in 0..same.len() {
        let (place, reach) = (mesh.point(i), reaches[i]);
        if same[i] as usize != i || reach <= 0.0 {
            // The first of its place may have been joined.
            same[i] = same[same[i] as usize];
            continue;
        }
        let mut best = NONE;
        // The edges at points of one place have about the same lengths.
        for level in power_of_two(reach) - 1..=power_of_two(reach) + 1 {
            grids.near(level, place, reach, |other| {
                let j = other as usize;
                let near = reach.min(reaches[j]);
                if mesh.point(j).distance_squared(place) <= near * near {
                    best = best.min(other);
                }
            });
        }
        if best == NONE {
            grids.insert(power_of_two(reach), place, i as u32);
        } else {
            same[i] = best;
        }
    }
}

/// The largest power of two that is not above `x`.
fn power_of_two(x: f64) -> i32 {
    (x.to_bits() >> 52 & 0x7ff) as i32 - 1023
}

/// The number of a box along an axis, as a key.
fn number(x: f64, side: f64) -> u64 {
    // Adding zero makes -0 the same box as 0.
    ((x / side).floor() + 0.0).to_bits()
}

impl Grids {
    /// The side of a box: at least twice the reaches of its level and the next.
    fn side(level: i32) -> f64 {
        2f64.powi(level + 3)
    }

    fn insert(&mut self, level: i32, place: DVec3, point: u32) {
        let side = Grids::side(level);
        let key = (level, place.to_array().map(|x| number(x, side)));
        if let Some(head) = self.first.insert(key, point) {
            self.next[point as usize] = head;
        }
    }

    /// Calls `look` with each point of the boxes of a level that a ball touches.
    fn near(&self, level: i32, place: DVec3, reach: f64, mut look: impl FnMut(u32)) {
        let side = Grids::side(level);
        let low = (place - reach).to_array().map(|x| number(x, side));
        let high = (place + reach).to_array().map(|x| number(x, side));
        for corner in 0..8 {
            let upper = [0, 1, 2].map(|axis| corner >> axis & 1 == 1);
            // A box that is the same for both ends is looked at once.
            if (0..3).any(|axis| upper[axis] && low[axis] == high[axis]) {
                continue;
            }
            let key = [0, 1, 2].map(|axis| if upper[axis] { high[axis] } else { low[axis] });
            let mut point = self.first.get(&(level, key)).copied().unwrap_or(NONE);
            while point != NONE {
                look(point);
                point = self.next[point as usize];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Attributes, Dataset, Points, StructuredGrid, UnstructuredGrid};

    /// A ring of hexahedra around an axis, with the points of its seam twice.
    fn ring(cells: usize, round: impl Fn(f64) -> f64) -> Dataset {
        let mut points = Vec::new();
        for z in [0.0, 0.5] {
            for r in [1.0, 1.00002, 2.0] {
                for i in 0..=cells {
                    let angle = std::f64::consts::TAU * i as f64 / cells as f64;
                    points.push([r * angle.cos(), r * angle.sin(), z].map(&round));
                }
            }
        }
        let extent = [0, cells as i32, 0, 2, 0, 1];
        let points = Points::F64(points);
        Dataset::StructuredGrid(StructuredGrid {
            extent,
            points,
            attributes: Attributes::default(),
        })
    }

    #[test]
    fn a_seam_that_rounding_opens_is_none() {
        for round in [|x: f64| x, |x: f64| f64::from(x as f32)] {
            let mesh = Mesh::new(&ring(24, round)).unwrap();
            let same = first_at_place(&mesh);
            for row in 0..6 {
                assert_eq!(same[25 * row + 24] as usize, 25 * row);
            }
            assert_eq!((0..same.len()).filter(|i| same[*i] as usize != *i).count(), 6);
        }
    }

    #[test]
    fn points_of_one_cell_and_of_a_thin_gap_stay_apart() {
        // Two cubes with a gap of a thousandth of their side, and cells 1e5 times as wide as high.
        for (height, gap) in [(1.0, 1e-3), (1e-5, 1e-6)] {
            let mut grid = UnstructuredGrid::default();
            let mut points = Vec::new();
            for low in [0.0, height + gap] {
                let first = points.len() as u32;
                for z in [low, low + height] {
                    points.extend([[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]]);
                }
                grid.types.push(12);
                grid.cells.push([0, 1, 2, 3, 4, 5, 6, 7].map(|i| first + i));
            }
            grid.points = Points::F64(points);
            let mesh = Mesh::new(&Dataset::UnstructuredGrid(grid)).unwrap();
            let same = first_at_place(&mesh);
            assert!((0..16).all(|i| same[i] as usize == i), "{height} {gap}: {same:?}");
        }
    }

    #[test]
    fn near_points_are_found_over_the_sides_of_boxes_and_far_from_the_origin() {
        for shift in [0.0, -1e5, 3.7e6] {
            for axis in 0..3 {
                let at = |x: f64| {
                    let mut p = [shift; 3];
                    p[axis] += x;
                    p
                };
                let mut grid = UnstructuredGrid::default();
                let mut points = Vec::new();
                // The second tetrahedron has the first point of the first again, a little off.
                for off in [0.0, 8e-6] {
                    let first = points.len() as u32;
                    let away = if off > 0.0 { -1.0 } else { 1.0 };
                    points.push(at(-off));
                    for other in 0..3 {
                        let mut p = at(away);
                        p[other] += away * if other == axis { 0.5 } else { 1.0 };
                        points.push(p);
                    }
                    grid.types.push(10);
                    grid.cells.push([0, 1, 2, 3].map(|i| first + i));
                }
                grid.points = Points::F64(points);
                let mesh = Mesh::new(&Dataset::UnstructuredGrid(grid)).unwrap();
                let same = first_at_place(&mesh);
                assert_eq!(same, [0, 1, 2, 3, 0, 5, 6, 7], "{shift} {axis}");
            }
        }
    }
}
