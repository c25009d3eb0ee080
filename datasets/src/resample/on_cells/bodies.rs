//! Says whether a line outside the cells of a mesh passes through a body.
//!
//! A place outside the mesh is in a body if the nearest face of the border is a wall, as nodes of a
//! lattice are (`beyond_border`). A line along the span of a flow meets no face at all.
//!
//! The line is searched as in sphere tracing (J. C. Hart, 1996): a distance to faces changes by no
//! more than the way, so that far from a body a step is half of the difference of the two
//! distances.

use super::border::each_triangle;
use crate::resample::face_tree::FaceTree;
use crate::resample::mesh::Mesh;
use crate::resample::walls::Walls;
use glam::DVec3;
use rt_core::math::nearest_of_triangle;

/// Steps along a line, at most; a body that is shorter along it may be missed.
const MOST_STEPS: f64 = 256.0;

/// The faces of the border of a mesh that do not lie in the sides of its box.
pub(super) struct Bodies {
    walls: Faces,
    open: Faces,
}

#[derive(Default)]
struct Faces {
    tree: FaceTree,
    /// Points of the faces, one after the other.
    rings: Vec<u32>,
    /// End of each face in them.
    ends: Vec<usize>,
}

impl Bodies {
    /// `None` where there is no wall.
    pub(super) fn of(mesh: &Mesh, walls: &Walls) -> Option<Bodies> {
        let mut bodies = Bodies { walls: Faces::default(), open: Faces::default() };
        walls.each_face(|ring, is_wall| {
            let of = if is_wall { &mut bodies.walls } else { &mut bodies.open };
            of.rings.extend(ring);
            of.ends.push(of.rings.len());
        });
        let known = |of: &Faces| of.rings.iter().all(|&i| (i as usize) < mesh.num_points());
        if bodies.walls.ends.is_empty() || !known(&bodies.walls) || !known(&bodies.open) {
            return None;
        }
        bodies.walls.build(mesh);
        bodies.open.build(mesh);
        Some(bodies)
    }

    /// Whether the line from `at` in `direction`, of length one, is in a body within `most`.
    pub(super) fn meet(&self, mesh: &Mesh, at: DVec3, direction: DVec3, most: f64) -> bool {
        let mut along = 0.0;
        while along < most {
            let place = at + direction * along;
            let nearer = self.open.distance(mesh, place) - self.walls.distance(mesh, place);
            // At equal distances the wall counts, as on a lattice.
            if nearer >= 0.0 {
                return true;
            }
            along += (-0.5 * nearer).max(most / MOST_STEPS);
        }
        false
    }
}

impl Faces {
    fn ring(&self, face: usize) -> &[u32] {
        let first = face.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.rings[first..self.ends[face]]
    }

    fn build(&mut self, mesh: &Mesh) {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let box_of = |face: usize| {
            let places = self.ring(face).iter().map(|&i| mesh.point(i as usize));
            places.fold(nothing, |(l, h), p| (l.min(p), h.max(p)))
        };
        let boxes: Vec<(DVec3, DVec3)> = (0..self.ends.len()).map(box_of).collect();
        self.tree = FaceTree::of(&boxes);
    }

    /// Distance of the nearest face; infinite without faces.
    fn distance(&self, mesh: &Mesh, at: DVec3) -> f64 {
        let of_face = |face: u32| {
            let ring = self.ring(face as usize);
            let place = |i: usize| mesh.point(ring[i] as usize) - at;
            let middle = (0..ring.len()).map(place).sum::<DVec3>() / ring.len() as f64;
            let mut best = f64::INFINITY;
            each_triangle(ring.len(), middle, place, |triangle| {
                best = best.min(nearest_of_triangle(triangle).distance2);
            });
            best
        };
        self.tree.nearest2(at, of_face).sqrt()
    }
}
