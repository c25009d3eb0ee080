//! Says whether a line outside the cells of a mesh passes through a body.
//!
//! A place outside the mesh is in a body if the nearest face of the border is a wall, as nodes of a
//! lattice are (`beyond_border`). A line along the span of a flow meets no face at all.
//!
//! The line is searched as in sphere tracing (J. C. Hart, 1996): a distance to faces changes by no
//! more than the way, so that far from a body a step is half of the difference of the two
//! distances.

use super::border::{each_triangle, normal_and_middle};
use crate::resample::face_tree::FaceTree;
use crate::resample::mesh::Mesh;
use crate::resample::walls::Walls;
use glam::DVec3;

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
            let places: Vec<DVec3> = ring.iter().map(|&i| mesh.point(i as usize) - at).collect();
            let (_, middle) = normal_and_middle(&places);
            let mut best = f64::INFINITY;
            each_triangle(
                places.len(),
                middle,
                |i| places[i],
                |triangle| best = best.min(distance2(triangle)),
            );
            best
        };
        self.tree.nearest2(at, of_face).sqrt()
    }
}

/// Square of the distance of a triangle from the origin, by the part of its plane in which the
/// origin lies (C. Ericson, Real-Time Collision Detection, 5.1.5). NaN where two corners are at one
/// place and the third edge is nearest; its neighbours have that edge too.
fn distance2([a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, ac) = (b - a, c - a);
    let [d1, d2] = [-ab.dot(a), -ac.dot(a)];
    if d1 <= 0.0 && d2 <= 0.0 {
        return a.length_squared();
    }
    let [d3, d4] = [-ab.dot(b), -ac.dot(b)];
    if d3 >= 0.0 && d4 <= d3 {
        return b.length_squared();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3))).length_squared();
    }
    let [d5, d6] = [-ab.dot(c), -ac.dot(c)];
    if d6 >= 0.0 && d5 <= d6 {
        return c.length_squared();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6))).length_squared();
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let along = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (b + (c - b) * along).length_squared();
    }
    let sum = va + vb + vc;
    (a + ab * (vb / sum) + ac * (vc / sum)).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_of_a_triangle_is_that_of_its_nearest_place() {
        let triangle = [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.5), DVec3::new(0.3, 1.0, -0.2)];
        let [a, b, c] = triangle;
        for k in 0..343 {
            let at = DVec3::new(f64::from(k % 7), f64::from(k / 7 % 7), f64::from(k / 49)) - 3.0;
            let mut dense = f64::INFINITY;
            for i in 0..=200 {
                for j in 0..=200 - i {
                    let place =
                        a + (b - a) * (f64::from(i) / 200.0) + (c - a) * (f64::from(j) / 200.0);
                    dense = dense.min(place.distance(at));
                }
            }
            let exact = distance2(triangle.map(|p| p - at)).sqrt();
            assert!(exact <= dense + 1e-12 && dense - exact < 0.02, "{at}: {exact} {dense}");
        }
    }
}
