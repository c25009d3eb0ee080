//! The faces at the border of a mesh, for the place where a line enters it.

use super::Kind;
use crate::resample::face_tree::FaceTree;
use crate::resample::mesh::{HIDDEN, Mesh, Neighbours, OUTSIDE, WALL};
use glam::DVec3;

/// Faces of cells with others, or none, behind them.
pub(super) struct Border {
    faces: Vec<Face>,
    /// Points of the faces, one after the other, as in the mesh.
    rings: Vec<u32>,
    tree: FaceTree,
}

#[derive(Debug, Clone, Copy)]
struct Face {
    cell: u32,
    first: usize,
    count: u32,
    /// What lies behind it: OUTSIDE, WALL or HIDDEN.
    beyond: u32,
    /// Whether the ring runs clockwise, seen from outside the cell.
    clockwise: bool,
}

/// Where a line passes a face of the border.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passage {
    pub(super) distance: f64,
    pub(super) cell: u32,
    /// Whether the line enters the cell, or leaves it.
    pub(super) inwards: bool,
    /// What lies on the other side: OUTSIDE, WALL or HIDDEN.
    pub(super) beyond: u32,
}

impl Border {
    /// The faces of the gas with no cell, or a hidden one, behind them.
    pub(super) fn of_gas(mesh: &Mesh, neighbours: &Neighbours, kinds: &[Kind]) -> Border {
        let is_gas = |cell: usize| !matches!(kinds[cell], Kind::Hidden | Kind::LeftOut);
        let cells = (0..kinds.len()).filter(|c| is_gas(*c));
        Border::of(mesh, neighbours, cells, &[OUTSIDE, WALL, HIDDEN])
    }

    /// The faces of hidden cells with no cell behind them.
    pub(super) fn of_hidden(mesh: &Mesh, neighbours: &Neighbours, kinds: &[Kind]) -> Border {
        let hidden = (0..kinds.len()).filter(|c| kinds[*c] == Kind::Hidden);
        Border::of(mesh, neighbours, hidden, &[OUTSIDE, WALL])
    }

    /// The faces of cells behind which is one of `ends`.
    fn of(
        mesh: &Mesh,
        neighbours: &Neighbours,
        cells: impl Iterator<Item = usize>,
        ends: &[u32],
    ) -> Border {
        let (mut faces, mut rings): (Vec<Face>, Vec<u32>) = (Vec::new(), Vec::new());
        let open = |b: &u32| ends.contains(b);
        for cell in cells {
            let beyond = neighbours.of_cell(cell);
            if !beyond.iter().any(open) {
                continue;
            }
            let corners = mesh.corners(cell);
            let middle = mesh.cell_centre(cell);
            let mut number = 0;
            corners.shape.each_face(|ring| {
                if open(&beyond[number]) {
                    let first = rings.len();
                    rings.extend(ring.iter().map(|&i| corners.ids[i as usize]));
                    let places: Vec<DVec3> =
                        rings[first..].iter().map(|&i| mesh.point(i as usize) - middle).collect();
                    let (normal, centre) = normal_and_middle(&places);
                    faces.push(Face {
                        cell: cell as u32,
                        first,
                        count: ring.len() as u32,
                        beyond: beyond[number],
                        clockwise: normal.dot(centre) < 0.0,
                    });
                }
                number += 1;
            });
        }
        let box_of = |f: &Face| {
            let ring = rings[f.first..f.first + f.count as usize].iter();
            let places = ring.map(|&i| mesh.point(i as usize));
            places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)))
        };
        let boxes: Vec<(DVec3, DVec3)> = faces.iter().map(box_of).collect();
        Border { tree: FaceTree::of(&boxes), faces, rings }
    }

    pub(super) fn len(&self) -> usize {
        self.faces.len()
    }

    /// The cell and the points of a face.
    pub(super) fn face(&self, face: usize) -> (u32, &[u32]) {
        let f = self.faces[face];
        (f.cell, &self.rings[f.first..f.first + f.count as usize])
    }

    /// The first passage of the line from `at` in `direction` within `most`, inwards from `-slack`
    /// on, or outwards beyond `slack`: the face that the line just left through counts no more.
    pub(super) fn first_passage(
        &self,
        mesh: &Mesh,
        at: DVec3,
        direction: DVec3,
        most: f64,
        slack: f64,
    ) -> Option<Passage> {
        let mut best: Option<Passage> = None;
        self.tree.on_line(at, direction, [-slack, most], |face| {
            self.each_passage(mesh, face, at, direction, |new| {
                let from = if new.inwards { -slack } else { slack };
                let counts =
                    (from..=most).contains(&new.distance) && (new.inwards || new.distance > from);
                // At the same place, entering comes before leaving, and a cell before those after
                // it.
                let key = |p: &Passage| (!p.inwards, p.cell);
                let better = best.is_none_or(|old| {
                    new.distance < old.distance
                        || new.distance == old.distance && key(&new) < key(&old)
                });
                if counts && better {
                    best = Some(new);
                }
            });
            best.map_or(most, |b| b.distance)
        });
        best
    }

    /// All passages of the line from `at` in `direction` between two distances, in the order of
    /// these. One through an edge comes once for each of the edge's faces.
    pub(super) fn passages(
        &self,
        mesh: &Mesh,
        at: DVec3,
        direction: DVec3,
        [from, to]: [f64; 2],
    ) -> Vec<Passage> {
        let mut all = Vec::new();
        self.tree.on_line(at, direction, [from, to], |face| {
            self.each_passage(mesh, face, at, direction, |new| {
                all.extend((from..=to).contains(&new.distance).then_some(new));
            });
            to
        });
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.cell.cmp(&b.cell)));
        all
    }

    /// Passages of one face.
    fn each_passage(
        &self,
        mesh: &Mesh,
        face: u32,
        at: DVec3,
        direction: DVec3,
        mut f: impl FnMut(Passage),
    ) {
        let Face { cell, first, count, beyond, clockwise } = self.faces[face as usize];
        let ring = &self.rings[first..first + count as usize];
        let place = |i: usize| mesh.point(ring[i] as usize) - at;
        let count = ring.len();
        let sum: DVec3 = (0..count).map(place).sum();
        let middle = sum / count as f64;
        each_triangle(count, middle, place, |triangle| {
            if let Some((distance, along)) = line_through(triangle, direction) {
                f(Passage { distance, cell, inwards: along == clockwise, beyond });
            }
        });
    }
}

/// The sum of the normals of a ring's triangles, each as long as twice the area (Newell), and its
/// middle.
pub(super) fn normal_and_middle(ring: &[DVec3]) -> (DVec3, DVec3) {
    let middle = ring.iter().sum::<DVec3>() / ring.len() as f64;
    let normal = match *ring {
        [a, b, c] => (b - a).cross(c - a),
        // The sum is the product of the diagonals.
        [a, b, c, d] => (c - a).cross(d - b),
        _ => {
            let next = ring.iter().cycle().skip(1);
            ring.iter().zip(next).map(|(a, b)| (a - middle).cross(b - middle)).sum()
        }
    };
    (normal, middle)
}

/// Calls `f` with the triangles of a face: itself, or those between its edges and its middle.
pub(super) fn each_triangle(
    count: usize,
    middle: DVec3,
    place: impl Fn(usize) -> DVec3,
    mut f: impl FnMut([DVec3; 3]),
) {
    if count == 3 {
        return f([place(0), place(1), place(2)]);
    }
    for i in 0..count {
        f([middle, place(i), place((i + 1) % count)]);
    }
}

/// The distance at which a line from the origin passes a triangle, its edges included, and whether
/// it does so along the normal of its corners' order. `None` when it misses it or runs in its
/// plane.
///
/// Signed volumes with the edges, as with Plücker coordinates: two triangles with a common edge
/// compute the same number for it with opposite signs, so that no line passes between them.
fn line_through([a, b, c]: [DVec3; 3], direction: DVec3) -> Option<(f64, bool)> {
    let edges = [b.cross(c), c.cross(a), a.cross(b)].map(|n| n.dot(direction));
    let [x, y, z] = edges;
    let inside = x >= 0.0 && y >= 0.0 && z >= 0.0 || x <= 0.0 && y <= 0.0 && z <= 0.0;
    if !inside || x == 0.0 && y == 0.0 && z == 0.0 {
        return None;
    }
    let normal = (b - a).cross(c - a);
    let speed = normal.dot(direction);
    if speed == 0.0 {
        return None;
    }
    Some((normal.dot(a) / speed, x + y + z > 0.0))
}
