//! Says of each lattice node outside a mesh whether it lies behind a wall, in a body, or behind an
//! open border, in gas.
//!
//! A node takes the kind of the nearest face of the border. The faces are sampled at half the
//! spacing of the lattice; the nodes beside them get their kind at once, and the others, layer by
//! layer, from their neighbours. This takes time in proportion to nodes and samples.

use super::mesh::Mesh;
use super::walls::Walls;
use super::{Lattice, Mark};
use glam::DVec3;
use std::collections::VecDeque;

/// Distance of samples on a face, in nodes.
const STEP: f64 = 0.5;
/// Nodes up to this distance along each axis are beside a sample: one, and a rounding.
const STEP_BESIDE: f64 = 1.0 + 1e-6;
/// Samples along an edge of a triangle, at most.
const MOST_STEPS: f64 = 4096.0;

/// For each node, whether it is outside the mesh and in a body. With `revolved`, faces are revolved
/// about the x axis first, and nodes beyond the largest radius are gas: the corners of the box.
pub fn in_bodies(
    mesh: &Mesh,
    walls: &Walls,
    lattice: &Lattice,
    marks: &[Mark],
    revolved: bool,
) -> Vec<bool> {
    let mut nearest = Nearest {
        lattice,
        marks,
        distance2: vec![f32::INFINITY; marks.len()],
        is_wall: vec![false; marks.len()],
    };
    walls.each_face(|ring, is_wall| {
        let corners: Vec<DVec3> = ring.iter().map(|&i| mesh.point(i as usize)).collect();
        for k in 2..corners.len() {
            let triangle = [corners[0], corners[k - 1], corners[k]];
            sample(triangle, lattice.spacing, |p| {
                if revolved { nearest.add_circle(p, is_wall) } else { nearest.add(p, is_wall) }
            });
        }
    });
    let Nearest { distance2, mut is_wall, .. } = nearest;
    if revolved {
        let radius = mesh.bounds().1.y;
        let [nx, ny, _] = lattice.dims;
        for (i, wall) in is_wall.iter_mut().enumerate() {
            let p = lattice.node(i % nx, i / nx % ny, i / nx / ny);
            *wall &= p.y.hypot(p.z) <= radius;
        }
    }
    spread(lattice.dims, marks, &distance2, is_wall, mesh.num_hidden() > 0)
}

/// Places on a triangle at distances of at most half a node.
fn sample([a, b, c]: [DVec3; 3], spacing: DVec3, mut f: impl FnMut(DVec3)) {
    let edge = |e: DVec3| (e / spacing).length();
    let longest = edge(b - a).max(edge(c - a)).max(edge(c - b));
    let steps = (longest / STEP).ceil().clamp(1.0, MOST_STEPS);
    if !longest.is_finite() {
        return;
    }
    let count = steps as usize;
    for i in 0..=count {
        for j in 0..=count - i {
            f(a + (b - a) * (i as f64 / steps) + (c - a) * (j as f64 / steps));
        }
    }
}

/// The nearest sample of the border to each node beside one.
struct Nearest<'a> {
    lattice: &'a Lattice,
    marks: &'a [Mark],
    distance2: Vec<f32>,
    is_wall: Vec<bool>,
}

impl Nearest<'_> {
    fn add(&mut self, p: DVec3, is_wall: bool) {
        let dims = self.lattice.dims;
        let at = (p - self.lattice.origin) / self.lattice.spacing;
        if !at.is_finite() {
            return;
        }
        // Nodes at one step too: beside a face through nodes, these are the nearest on either side.
        // A face may be farther from the lattice than integers reach.
        let beside = |a: usize| {
            let first = (at[a] - STEP_BESIDE).ceil().max(0.0);
            let last = (at[a] + STEP_BESIDE).floor().min(dims[a] as f64 - 1.0);
            let some = (first <= last).then_some(first as usize..=last as usize);
            some.into_iter().flatten()
        };
        for (k, j) in beside(2).flat_map(|k| beside(1).map(move |j| (k, j))) {
            for i in beside(0) {
                let node = i + dims[0] * (j + dims[1] * k);
                if self.marks[node] != Mark::Outside {
                    continue;
                }
                let away = at - DVec3::new(i as f64, j as f64, k as f64);
                let d2 = away.length_squared() as f32;
                // At equal distances the wall counts, in whatever order the faces come.
                if d2 < self.distance2[node] || d2 == self.distance2[node] && is_wall {
                    (self.distance2[node], self.is_wall[node]) = (d2, is_wall);
                }
            }
        }
    }

    /// Adds the circle about the x axis of a place in the plane of x and the radius.
    fn add_circle(&mut self, p: DVec3, is_wall: bool) {
        let h = self.lattice.spacing.y.min(self.lattice.spacing.z);
        let steps = (std::f64::consts::TAU * p.y / (STEP * h)).ceil().clamp(1.0, MOST_STEPS);
        for k in 0..steps as usize {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / steps).sin_cos();
            self.add(DVec3::new(p.x, p.y * cos, p.y * sin), is_wall);
        }
    }
}

/// Gives the kind of the nodes beside the border to all others outside, layer by layer. Places that
/// no face borders are behind hidden cells, and bodies; without such cells they are gas, for no
/// wall is known there.
fn spread(
    dims: [usize; 3],
    marks: &[Mark],
    known2: &[f32],
    mut body: Vec<bool>,
    behind_hidden: bool,
) -> Vec<bool> {
    let stride = [1, dims[0], dims[0] * dims[1]];
    let mut known: Vec<bool> = known2.iter().map(|d| d.is_finite()).collect();
    let mut queue: VecDeque<usize> = (0..marks.len()).filter(|&i| known[i]).collect();
    while let Some(i) = queue.pop_front() {
        let at = [i % dims[0], i / dims[0] % dims[1], i / stride[2]];
        for axis in 0..3 {
            let lower = (at[axis] > 0).then(|| i - stride[axis]);
            let upper = (at[axis] + 1 < dims[axis]).then(|| i + stride[axis]);
            for j in [lower, upper].into_iter().flatten() {
                if !known[j] && marks[j] == Mark::Outside {
                    (known[j], body[j]) = (true, body[i]);
                    queue.push_back(j);
                }
            }
        }
    }
    for (i, b) in body.iter_mut().enumerate() {
        *b = marks[i] == Mark::Outside && (*b || (behind_hidden && !known[i]));
    }
    body
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Attributes, Block, DataArray, Dataset, Points, PolyData, StructuredGrid};
    use crate::model::{Values, WALL_POINTS};
    use crate::resample::{Options, Resolution, Samples, resample};

    /// A ring of cells around the y axis, from radius 1 to 2 and from y = -1 to 1, closed at the
    /// seam. It reaches the sides of its box in y only with its ends.
    fn ring(speed: impl Fn(f64) -> f64) -> Dataset {
        let n = [9usize, 49, 9];
        let (mut points, mut values, mut velocity) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    let r = 1.0 + i as f64 / (n[0] - 1) as f64;
                    // The seam's points are at the same places, bit for bit.
                    let angle = std::f64::consts::TAU * (j % (n[1] - 1)) as f64 / (n[1] - 1) as f64;
                    points.push([r * angle.cos(), k as f64 * 0.25 - 1.0, r * angle.sin()]);
                    values.push(r);
                    velocity.extend([speed(r), 0.0, 0.0]);
                }
            }
        }
        let point = vec![
            DataArray::new("rho", 1, Values::F64(values)),
            DataArray::new("U", 3, Values::F64(velocity)),
        ];
        Dataset::StructuredGrid(StructuredGrid {
            extent: [0, 8, 0, 48, 0, 8],
            points: Points::F64(points),
            attributes: Attributes { point, ..Attributes::default() },
        })
    }

    /// Part of the nodes of the axis, and of the corners of the box, that are in bodies.
    fn found(data: &Dataset) -> ([f64; 2], Vec<String>) {
        let mesh = Mesh::new(data).unwrap();
        let (low, high) = mesh.bounds();
        let lattice =
            Lattice::fit(low, high, mesh.typical_cell(), Resolution::Longest(40)).unwrap();
        let values: Vec<f64> = (0..mesh.num_points()).map(|_| 1.0).collect();
        let field =
            resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
        let walls = Walls::find(&mesh, data, false);
        let body = in_bodies(&mesh, &walls, &lattice, &field.marks, false);
        let share = |inside: &dyn Fn(f64) -> bool| {
            let (mut bodies, mut all) = (0.0, 0.0);
            for (i, mark) in field.marks.iter().enumerate() {
                let [nx, ny, _] = lattice.dims;
                let p = lattice.node(i % nx, i / nx % ny, i / nx / ny);
                if *mark == Mark::Outside && inside(p.x.hypot(p.z)) {
                    all += 1.0;
                    bodies += f64::from(u8::from(body[i]));
                }
            }
            assert!(all > 100.0);
            bodies / all
        };
        let shares = [share(&|r| r < 1.0), share(&|r| r > 2.0)];
        (shares, walls.evidence().to_vec())
    }

    #[test]
    fn a_wall_without_slip_is_a_body_and_an_open_border_is_gas() {
        let (shares, by) = found(&ring(|r| if r == 1.0 { 0.0 } else { 30.0 }));
        assert_eq!(shares, [1.0, 0.0]);
        assert!(by.len() == 1 && by[0].contains("`U` being zero"), "{by:?}");
        // Gas at rest around a jet is no wall.
        let (shares, by) = found(&ring(|r| if r < 1.4 { 30.0 } else { 0.0 }));
        assert!(shares == [0.0, 0.0] && by.len() == 1, "{shares:?} {by:?}");
        let (shares, by) = found(&ring(|_| 30.0));
        assert!(shares == [0.0, 0.0] && by.is_empty(), "{shares:?} {by:?}");
    }

    #[test]
    fn a_block_with_the_name_of_a_body_is_one() {
        let volume = ring(|_| 30.0);
        let Dataset::StructuredGrid(grid) = &volume else { unreachable!() };
        let inner = (0..grid.points.len()).filter(|i| i % 9 == 0).map(|i| grid.points.get(i));
        let points = Points::F64(inner.map(|p| p.to_array()).collect());
        let surface = Dataset::PolyData(PolyData { points, ..PolyData::default() });
        for (name, body) in [("cylinder", 1.0), ("farfield", 0.0)] {
            let data = Dataset::MultiBlock(vec![
                Block { name: "internalMesh".into(), data: volume.clone() },
                Block { name: name.into(), data: surface.clone() },
            ]);
            let (shares, by) = found(&data);
            assert_eq!((shares, by.len()), ([body, 0.0], body as usize), "{name} {by:?}");
        }
    }

    #[test]
    fn a_list_of_points_rules_out_other_evidence() {
        let with = |ids: Vec<u32>| {
            let mut data = ring(|r| if r == 1.0 { 0.0 } else { 30.0 });
            let Dataset::StructuredGrid(grid) = &mut data else { unreachable!() };
            grid.attributes.field.push(DataArray::new(WALL_POINTS, 1, Values::U32(ids)));
            found(&data).0
        };
        assert_eq!(with(vec![]), [0.0, 0.0]);
        assert_eq!(with((0..9 * 49 * 9).filter(|i| i % 9 == 8).collect()), [0.0, 1.0]);
        assert_eq!(with(vec![u32::MAX, 3]), [0.0, 0.0]);
    }

    #[test]
    fn a_hole_that_the_mesh_encloses_is_a_body() {
        let n = 9usize;
        let mut hidden = vec![0u8; (n - 1).pow(3)];
        let middle = |i: usize| (3..5).contains(&i);
        for (c, h) in hidden.iter_mut().enumerate() {
            let hole = middle(c % 8) && middle(c / 8 % 8) && middle(c / 64);
            *h = u8::from(hole);
        }
        let points = (0..729).map(|i| [i % 9, i / 9 % 9, i / 81].map(|x| x as f64)).collect();
        let mut grid =
            crate::model::UnstructuredGrid { points: Points::F64(points), ..Default::default() };
        for (c, _) in hidden.iter().enumerate().filter(|h| *h.1 == 0) {
            let first = c % 8 + 9 * (c / 8 % 8) + 81 * (c / 64);
            grid.types.push(12);
            let ids = [0, 1, 10, 9, 81, 82, 91, 90].map(|o| (first + o) as u32);
            grid.cells.push(ids);
        }
        let data = Dataset::UnstructuredGrid(grid);
        let mesh = Mesh::new(&data).unwrap();
        let walls = Walls::find(&mesh, &data, false);
        assert_eq!(walls.evidence(), ["holes that the mesh encloses"]);
        let (low, high) = mesh.bounds();
        let lattice = Lattice::fit(low, high, 1.0, Resolution::Longest(25)).unwrap();
        let field =
            resample(&mesh, Samples::Points(&[1.0; 729]), &lattice, &Options::default()).unwrap();
        let body = in_bodies(&mesh, &walls, &lattice, &field.marks, false);
        let outside = field.marks.iter().filter(|m| **m == Mark::Outside).count();
        assert!(outside > 50 && body.iter().filter(|b| **b).count() == outside, "{outside}");
    }

    #[test]
    fn faces_farther_away_than_integers_reach_are_beside_no_node() {
        let lattice =
            Lattice { dims: [3; 3], origin: DVec3::ZERO, spacing: DVec3::new(1.0, 1.0, 1e-300) };
        let (distance2, is_wall) = (vec![f32::INFINITY; 27], vec![false; 27]);
        let mut nearest =
            Nearest { lattice: &lattice, marks: &[Mark::Outside; 27], distance2, is_wall };
        for x in [1e30, -1e30, f64::MAX, f64::NAN, f64::INFINITY] {
            nearest.add(DVec3::splat(x), true);
        }
        assert!(nearest.is_wall.iter().all(|wall| !wall));
        nearest.add(DVec3::new(1.2, 1.0, 1e-300), true);
        assert_eq!(nearest.is_wall.iter().filter(|wall| **wall).count(), 2 * 3 * 3);
    }

    #[test]
    fn a_wall_through_nodes_of_the_lattice_has_its_body_on_either_side() {
        // Eight cells a side without a quarter, which lies on the low or on the high side.
        let points = (0..729).map(|i| [i % 9, i / 9 % 9, i / 81].map(|x| x as f64)).collect();
        let points = Points::F64(points);
        for low in [true, false] {
            let mut grid =
                crate::model::UnstructuredGrid { points: points.clone(), ..Default::default() };
            for c in 0..512usize {
                let (x, y) = (c % 8, c / 8 % 8);
                if (x < 4) == low && (y < 4) == low {
                    continue;
                }
                let first = x + 9 * y + 81 * (c / 64);
                grid.types.push(12);
                grid.cells.push([0, 1, 10, 9, 81, 82, 91, 90].map(|o| (first + o) as u32));
            }
            let of_wall = |i: &u32| {
                let (x, y) = (i % 9, i / 9 % 9);
                let beside = |other: u32| if low { other <= 4 } else { other >= 4 };
                (x == 4 && beside(y)) || (y == 4 && beside(x))
            };
            let list = Values::U32((0..729).filter(of_wall).collect());
            grid.attributes.field.push(DataArray::new(WALL_POINTS, 1, list));
            let data = Dataset::UnstructuredGrid(grid);
            let mesh = Mesh::new(&data).unwrap();
            let walls = Walls::find(&mesh, &data, false);
            let ends = mesh.bounds();
            let lattice = Lattice::fit(ends.0, ends.1, 1.0, Resolution::Longest(17)).unwrap();
            let samples = Samples::Points(&[1.0; 729]);
            let field = resample(&mesh, samples, &lattice, &Options::default()).unwrap();
            let body = in_bodies(&mesh, &walls, &lattice, &field.marks, false);
            let outside = field.marks.iter().filter(|m| **m == Mark::Outside).count();
            assert_eq!(outside, 8 * 8 * 17, "low: {low}");
            assert_eq!(body.iter().filter(|b| **b).count(), outside, "low: {low}");
        }
    }
}
