//! Finds which parts of a mesh's border are walls, so that a body can be told from an open border.
//!
//! Files say it in different ways, or not at all. Sources of evidence, the strongest first:
//!
//! 1. Points that the reader lists as those of walls ([`WALL_POINTS`]): patches of OpenFOAM.
//! 2. Blocks of surfaces or lines with the name of a body, such as `wall` or `cylinder`. Their
//!    points are points of the mesh.
//! 3. A velocity of exactly zero at points whose cells have gas in motion: a wall without slip.
//! 4. The shape of the border (`parts`): a hole in the flow, or a hollow in one side of its box.
//! 5. A velocity that follows a border which the flow as a whole would cross (`velocity`): a wall
//!    with slip. Gas that crosses a border rules out that it is one, a hole within the box apart.
//!
//! A list has all walls but holes. What is left is taken as open, and its share is reported: a
//! slanting border of still gas and one of a ramp look alike.
//!
//! Faces in the sides of the box are windows, whatever they are of: nothing is behind them. Those
//! around the axis of a revolved flow are none: there are the corners of its box, and its middle.
//!
//! [`WALL_POINTS`]: crate::model::WALL_POINTS

mod baffles;
mod known;
mod parts;
mod sides;
#[cfg(test)]
mod tests;
mod velocity;
mod velocity_arrays;

use super::mesh::{Mesh, OUTSIDE};
use crate::model::Dataset;
use parts::{Outline, Parts};
use sides::{Sides, is_face_of_plane};
use velocity::{Motion, Velocity};

/// The border of a mesh, with its walls.
#[derive(Debug, Clone, Default)]
pub struct Walls {
    /// Flag per point of the mesh.
    of_points: Vec<bool>,
    /// Corners of the faces of the border, one after the other.
    rings: Vec<u32>,
    faces: Vec<BorderFace>,
    evidence: Vec<String>,
    /// Cells with a wall without thickness between them.
    baffles: Vec<[u32; 2]>,
    /// Part of the area of these faces of which nothing tells what is behind them.
    undecided: f64,
}

/// A face of the border behind which is something: it does not lie in a side of the mesh's box, or
/// lies around the axis of a revolved flow.
#[derive(Debug, Clone, Copy)]
struct BorderFace {
    /// End of its corners.
    end: usize,
    cell: u32,
    /// Its number among the faces of the cell.
    number: u32,
    is_wall: bool,
}

impl Walls {
    /// Finds the walls of a mesh made of `data`. `revolved`: the plane will be revolved about the x
    /// axis, so that a hole may end at the axis.
    pub fn find(mesh: &Mesh, data: &Dataset, revolved: bool) -> Walls {
        let neighbours = &mesh.topology().neighbours;
        let mut walls = Walls { of_points: vec![false; mesh.num_points()], ..Walls::default() };
        let listed = walls.add_listed(mesh, data);
        if !listed {
            walls.add_blocks(mesh, data);
            walls.add_without_slip(mesh, data);
            walls.add_baffles(mesh);
        }
        let sides = Sides::of(mesh, revolved);
        let velocity = if listed { None } else { Velocity::of(mesh, data) };
        let mut around = Vec::new();
        for cell in 0..mesh.num_cells() {
            let beyond = neighbours.of_cell(cell);
            if !beyond.contains(&OUTSIDE) {
                continue;
            }
            let corners = mesh.corners(cell);
            let mut next = 0;
            corners.shape.each_face(|ring| {
                let number = next;
                next += 1;
                let ids = || ring.iter().map(|&i| corners.ids[i as usize]);
                if beyond[number] != OUTSIDE || is_face_of_plane(mesh, ids()) {
                    return;
                }
                let is_wall = mesh.is_hidden(cell) || ids().all(|i| walls.of_points[i as usize]);
                if sides.hold(mesh, ids()) {
                    if sides.hold_around_axis(mesh, ids()) {
                        around.push((ids().collect::<Vec<u32>>(), cell, number, is_wall));
                    }
                    return;
                }
                walls.rings.extend(ids());
                let (end, cell, number) = (walls.rings.len(), cell as u32, number as u32);
                walls.faces.push(BorderFace { end, cell, number, is_wall });
            });
        }
        walls.add_parts(&Parts::of(mesh, &walls, &sides, velocity.as_ref()), listed);
        for (ring, cell, number, is_wall) in around {
            walls.rings.extend(ring);
            let (end, cell, number) = (walls.rings.len(), cell as u32, number as u32);
            walls.faces.push(BorderFace { end, cell, number, is_wall });
        }
        walls
    }

    /// Parts of the border that are walls by their shape or by the gas beside them.
    fn add_parts(&mut self, parts: &Parts<'_>, listed: bool) {
        let mut found = [false; 3];
        let (mut undecided, mut area) = (0.0, 0.0);
        for (face, &of) in self.faces.iter_mut().zip(&parts.of_faces) {
            let part = &parts.all[of as usize];
            let by = match (part.outline, part.motion) {
                (Outline::Hole { through: false }, _) => Some(0),
                _ if listed => None,
                (Outline::Hole { .. }, m) if m != Motion::Across => Some(0),
                (Outline::Hollow, m) if m != Motion::Across => Some(1),
                (Outline::Unknown, Motion::Along) => Some(2),
                (Outline::Unknown, Motion::Unknown) if !face.is_wall => {
                    undecided += part.mean_area;
                    None
                }
                _ => None,
            };
            area += part.mean_area;
            if let Some(by) = by {
                found[by] |= !face.is_wall;
                face.is_wall = true;
            }
        }
        self.undecided = if area > 0.0 { undecided / area } else { 0.0 };
        let name = parts.velocity.map_or("", |v| &v.name);
        let words = [
            "holes that the mesh encloses".into(),
            "hollows of the mesh in one side of its box".into(),
            format!("`{name}` following the border, as at a wall with slip"),
        ];
        self.evidence.extend(words.into_iter().zip(found).filter(|w| w.1).map(|w| w.0));
    }

    /// What the walls were found by, in words; empty if there are none.
    pub fn evidence(&self) -> &[String] {
        &self.evidence
    }

    /// Part of the area of the border of which nothing tells whether it is a wall. It is taken as
    /// open. Faces in the sides of the mesh's box do not count.
    pub fn undecided(&self) -> f64 {
        self.undecided
    }

    /// Calls `f` with the corners of each face of the border that does not lie in a side of the
    /// mesh's box, and whether it is a wall.
    pub(super) fn each_face(&self, mut f: impl FnMut(&[u32], bool)) {
        let mut first = 0;
        for face in &self.faces {
            f(&self.rings[first..face.end], face.is_wall);
            first = face.end;
        }
    }

    /// The walls: cells, and numbers of faces among those of the cell.
    pub(super) fn of_cells(&self) -> impl Iterator<Item = (u32, u32)> {
        self.faces.iter().filter(|f| f.is_wall).map(|f| (f.cell, f.number))
    }
}
