//! A tree of boxes over the faces at the border of a mesh, for the place where a line enters it.

use super::Kind;
use super::faces::{HIDDEN, Neighbours, OUTSIDE, WALL};
use crate::resample::mesh::Mesh;
use glam::DVec3;

/// Faces in a leaf, at most.
const IN_LEAF: usize = 4;

/// The faces with no cell, or a hidden one, behind them.
pub(super) struct Border {
    faces: Vec<Face>,
    /// Points of the faces, one after the other, as in the mesh.
    rings: Vec<u32>,
    /// The first is the root. Empty for a mesh without a border.
    nodes: Vec<Node>,
    /// Numbers of faces in the order of the leaves.
    order: Vec<u32>,
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

#[derive(Debug, Clone, Copy)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The left child, which the right one follows; or the first face of a leaf.
    first: u32,
    /// Faces of a leaf; 0 for other nodes.
    count: u32,
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
    pub(super) fn of(mesh: &Mesh, neighbours: &Neighbours, kinds: &[Kind]) -> Border {
        let (mut faces, mut rings) = (Vec::new(), Vec::new());
        for (cell, kind) in kinds.iter().enumerate() {
            let beyond = neighbours.of_cell(cell);
            let open = |b: &u32| [OUTSIDE, WALL, HIDDEN].contains(b);
            if matches!(kind, Kind::Hidden | Kind::LeftOut) || !beyond.iter().any(open) {
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
        let mut border =
            Border { order: (0..faces.len() as u32).collect(), faces, rings, nodes: Vec::new() };
        border.build(mesh);
        border
    }

    /// Splits the faces in halves along the longest side of their middles' box.
    fn build(&mut self, mesh: &Mesh) {
        let boxes: Vec<(DVec3, DVec3)> = (0..self.faces.len())
            .map(|face| {
                let ring = self.face(face).1.iter().map(|&i| mesh.point(i as usize));
                ring.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)))
            })
            .collect();
        if boxes.is_empty() {
            return;
        }
        let nothing = Node { low: DVec3::ZERO, high: DVec3::ZERO, first: 0, count: 0 };
        self.nodes.push(nothing);
        let mut open = vec![(0usize, 0usize, self.faces.len())];
        while let Some((node, first, end)) = open.pop() {
            let faces = &mut self.order[first..end];
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (mut low_middle, mut high_middle) = (low, high);
            for &face in faces.iter() {
                let (l, h) = boxes[face as usize];
                (low, high) = (low.min(l), high.max(h));
                (low_middle, high_middle) = (low_middle.min(l + h), high_middle.max(l + h));
            }
            // A box without thickness is a plane; rounding must not let a line pass it.
            let margin = DVec3::splat(1e-9 * (high - low).max_element())
                + 4.0 * f64::EPSILON * low.abs().max(high.abs());
            let (mut of_node, count) = ((first as u32, faces.len() as u32), faces.len());
            if count > IN_LEAF {
                let size = high_middle - low_middle;
                let axis = if size.x >= size.y && size.x >= size.z {
                    0
                } else {
                    1 + usize::from(size.z > size.y)
                };
                let key =
                    |face: &u32| boxes[*face as usize].0[axis] + boxes[*face as usize].1[axis];
                faces.select_nth_unstable_by(count / 2, |a, b| {
                    key(a).total_cmp(&key(b)).then(a.cmp(b))
                });
                of_node = (self.nodes.len() as u32, 0);
                let left = self.nodes.len();
                self.nodes.extend([nothing; 2]);
                open.push((left, first, first + count / 2));
                open.push((left + 1, first + count / 2, end));
            }
            let (low, high) = (low - margin, high + margin);
            self.nodes[node] = Node { low, high, first: of_node.0, count: of_node.1 };
        }
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
        let mut stack = Vec::with_capacity(64);
        stack.extend((!self.nodes.is_empty()).then_some(0u32));
        let inverse = direction.recip();
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number as usize];
            let reach = best.map_or(most, |b| b.distance);
            if !meets(node, at, inverse, -slack, reach) {
                continue;
            }
            if node.count == 0 {
                // The nearer child is looked at first.
                let middle = |n: u32| {
                    let n = &self.nodes[n as usize];
                    (n.low + n.high).dot(direction)
                };
                let (left, right) = (node.first, node.first + 1);
                let near_first = middle(left) <= middle(right);
                stack.extend(if near_first { [right, left] } else { [left, right] });
                continue;
            }
            for &face in &self.order[node.first as usize..(node.first + node.count) as usize] {
                self.pass(mesh, face, at, direction, most, slack, &mut best);
            }
        }
        best
    }

    /// Passages of one face.
    fn pass(
        &self,
        mesh: &Mesh,
        face: u32,
        at: DVec3,
        direction: DVec3,
        most: f64,
        slack: f64,
        best: &mut Option<Passage>,
    ) {
        let f = self.faces[face as usize];
        let ring = &self.rings[f.first..f.first + f.count as usize];
        let place = |i: usize| mesh.point(ring[i] as usize) - at;
        let count = ring.len();
        let sum: DVec3 = (0..count).map(place).sum();
        let middle = sum / count as f64;
        each_triangle(count, middle, place, |triangle| {
            let Some((distance, along)) = line_through(triangle, direction) else { return };
            let inwards = along == f.clockwise;
            let from = if inwards { -slack } else { slack };
            if distance.is_nan()
                || distance < from
                || distance > most
                || !inwards && distance == from
            {
                return;
            }
            // At the same place, entering comes before leaving, and a cell before those after it.
            let new = Passage { distance, cell: f.cell, inwards, beyond: f.beyond };
            let key = |p: &Passage| (!p.inwards, p.cell);
            let better = best.is_none_or(|old| {
                distance < old.distance || distance == old.distance && key(&new) < key(&old)
            });
            if better {
                *best = Some(new);
            }
        });
    }
}

/// Whether a line meets a box between two distances.
fn meets(node: &Node, at: DVec3, inverse: DVec3, from: f64, to: f64) -> bool {
    let (mut near, mut far) = (from, to);
    for a in 0..3 {
        // In the plane of a side, 0 · ∞ is NaN, which `min` and `max` leave out.
        let (s, t) = ((node.low[a] - at[a]) * inverse[a], (node.high[a] - at[a]) * inverse[a]);
        near = near.max(s.min(t));
        far = far.min(s.max(t));
    }
    near <= far
}

/// The sum of the normals of a ring's triangles (Newell), and its middle.
pub(super) fn normal_and_middle(ring: &[DVec3]) -> (DVec3, DVec3) {
    let middle = ring.iter().sum::<DVec3>() / ring.len() as f64;
    let count = ring.len();
    let normal = (0..count).map(|i| (ring[i] - middle).cross(ring[(i + 1) % count] - middle)).sum();
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
pub(super) fn line_through([a, b, c]: [DVec3; 3], direction: DVec3) -> Option<(f64, bool)> {
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
