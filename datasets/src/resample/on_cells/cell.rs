//! One cell, prepared for lines: where they leave it, and over which face.
//!
//! Lines leave cells with plane faces that do not turn in through planes, and others through the
//! triangles of their faces, as seen along the line.

use super::blend::{Corner, Mean, Polynomials, Share};
use super::border::normal_and_middle;
use super::shares::{Map, shares};
use super::{CellField, Kind};
use crate::resample::mesh::{Corners, Mesh, NO_FACE, Shape};
use crate::resample::shape::{Cell, Shares};
use glam::{DVec2, DVec3};
use smallvec::SmallVec;

/// Corners this far off the plane of a face, as a part of the cell's size, leave it plane, and
/// those this far beyond it leave the cell convex. It is above the rounding of places in f32.
const PLANE: f64 = 1e-6;
/// A line whose faces all lie behind leaves through one that is this far back at most, as a part of
/// the cell's size: a bent ray is that much beside the place where its straight piece entered.
const BACK: f64 = 1e-6;
/// Faces this near, as a part of the cell's size, are passed at once.
const AT_ONCE: f64 = 1e-11;

/// A cell is inside out when a line comes through one of its faces outwards, by more than this
/// cosine: in gas, no ray is bent that much between two cells.
const INSIDE_OUT: f64 = 0.01;

/// How a cell is bent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Form {
    /// Its map folds, or an edge collapsed.
    pub(super) folded: bool,
    /// Lines leave it through planes.
    pub(super) convex: bool,
}

impl Form {
    /// The form of a cell, behind whose faces this lies.
    pub(super) fn of(mesh: &Mesh, corners: &Corners, beyond: &[u32]) -> Form {
        let points: Places = corners.ids.iter().map(|&i| mesh.point(i as usize)).collect();
        let folded = Cell::new(&points, &corners.shape).is_folded();
        if corners.shape == Shape::Tetra {
            return Form { folded, convex: true };
        }
        let origin = points[0];
        let (low, high) = points.iter().fold((origin, origin), |(l, h), p| (l.min(*p), h.max(*p)));
        let (size, middle) = ((high - low).length(), points.iter().sum::<DVec3>());
        let middle = middle / points.len() as f64 - origin;
        let (mut number, mut convex) = (0, true);
        corners.shape.each_face(|ring| {
            if beyond[number] != NO_FACE {
                let ring: Places = ring.iter().map(|&i| points[i as usize] - origin).collect();
                let face = Face::new(&ring, middle, beyond[number], 0);
                let length = face.length();
                let above = |p: &DVec3| (face.normal.dot(*p - origin) - face.offset) / length;
                let farthest = points.iter().map(above).fold(0.0, f64::max);
                convex &= face.thickness(ring.iter().copied()).max(farthest) <= PLANE * size;
            }
            number += 1;
        });
        Form { folded, convex }
    }
}

/// The corners of a face or cell.
type Places = SmallVec<[DVec3; 8]>;

/// A cell with what lines need of it. Places are relative to its first corner.
#[derive(Default)]
pub(super) struct PreparedCell {
    pub(super) origin: DVec3,
    /// Diagonal of its box.
    pub(super) size: f64,
    /// Whether lines leave through planes.
    convex: bool,
    pub(super) corners: Vec<DVec3>,
    faces: Vec<Face>,
    /// Corners of the faces, one face after the other.
    rings: Vec<u32>,
    pub(super) has_values: bool,
    pub(super) map: Map,
    pub(super) polynomials: Polynomials,
}

/// A face of the cell.
#[derive(Debug, Clone, Copy)]
struct Face {
    /// Outwards; its length is twice the area.
    normal: DVec3,
    /// Distance of its plane along the normal, times the normal's length.
    offset: f64,
    beyond: u32,
    first: u32,
    count: u32,
    /// Whether the ring runs clockwise, seen from outside.
    clockwise: bool,
}

/// Ways out of a cell: distance, and what lies beyond.
#[derive(Default)]
struct Ways {
    ahead: Option<(f64, u32)>,
    behind: Option<(f64, u32)>,
    returning: Option<(f64, u32)>,
}

impl PreparedCell {
    /// Prepares a cell in place of another.
    pub(super) fn prepare(&mut self, field: &CellField, cell: usize, mean: Mean) {
        let Corners { ids, shape } = field.mesh.corners(cell);
        let place = |&i: &u32| field.mesh.point(i as usize);
        self.origin = place(&ids[0]);
        self.corners.clear();
        self.corners.extend(ids.iter().map(|i| place(i) - self.origin));
        let (low, high) = self
            .corners
            .iter()
            .fold((DVec3::ZERO, DVec3::ZERO), |(l, h), p| (l.min(*p), h.max(*p)));
        self.size = (high - low).length();
        let Form { folded, convex } = field.forms[cell];
        self.convex = convex;
        self.has_values = field.kinds[cell] == Kind::Gas;
        let is_limited =
            |&id: &u32| field.expansions.get(id as usize).is_some_and(|e| e.is_limited());
        let shares = if ids.iter().any(is_limited) { field.shares } else { Shares::OfElement };
        self.prepare_faces(&shape, field.neighbours.of_cell(cell));
        self.map.prepare(&self.corners, shape, self.size, folded, shares);
        let corner = |(&id, &place): (&u32, &DVec3)| Corner {
            place,
            value: field.values[id as usize],
            expansion: field.expansions.get(id as usize),
        };
        let of_element = shares == Shares::OfElement;
        let corners = ids.iter().zip(&self.corners).map(corner);
        self.polynomials.prepare(corners, of_element, mean);
    }

    fn prepare_faces(&mut self, shape: &Shape, beyond: &[u32]) {
        self.faces.clear();
        self.rings.clear();
        let middle = self.corners.iter().sum::<DVec3>() / self.corners.len() as f64;
        let mut number = 0;
        let mut places = [DVec3::ZERO; 4];
        shape.each_face(|ring| {
            let first = self.rings.len() as u32;
            self.rings.extend_from_slice(ring);
            let beyond = beyond[number];
            number += 1;
            if beyond == NO_FACE {
                return;
            }
            let corner = |&i: &u32| self.corners[i as usize];
            if ring.len() > places.len() {
                let places: Vec<DVec3> = ring.iter().map(corner).collect();
                self.faces.push(Face::new(&places, middle, beyond, first));
                return;
            }
            for (place, i) in places.iter_mut().zip(ring) {
                *place = corner(i);
            }
            self.faces.push(Face::new(&places[..ring.len()], middle, beyond, first));
        });
    }

    /// The distance from `at` along `direction` to where a line leaves the cell, and what lies
    /// beyond. `None` when it passes no face outwards: rounding at an edge, or a cell that folds.
    ///
    /// Meshes whose points were moved too far have convex cells that are inside out, and overlap
    /// their neighbours. Lines go back through these: the distance is negative, and what is counted
    /// twice cancels.
    ///
    /// A line that runs along the ridge of a bent face passes it there and back at one place. It
    /// came `from` there, and does not go back at once.
    pub(super) fn way_out(&self, at: DVec3, direction: DVec3, from: u32) -> Option<(f64, u32)> {
        let at = at - self.origin;
        if self.convex {
            return match self.is_behind(direction, from) {
                true => self.through_planes(at, -direction).map(|(d, beyond)| (-d, beyond)),
                false => self.through_planes(at, direction).map(|(d, beyond)| (d.max(0.0), beyond)),
            };
        }
        let (back, at_once) = (-BACK * self.size, AT_ONCE * self.size);
        let mut ways = Ways::default();
        self.each_passage(at, direction, |distance, face| {
            let way = Some((distance, face.beyond));
            if distance < -at_once {
                let nearer = ways.behind.is_none_or(|w| distance > w.0);
                if distance >= back && nearer {
                    ways.behind = way;
                }
            } else if distance <= at_once && face.beyond == from {
                ways.returning = way;
            } else if ways.ahead.is_none_or(|w| distance < w.0) {
                ways.ahead = way;
            }
        });
        let way = ways.ahead.or(ways.behind).or(ways.returning);
        way.map(|(distance, beyond)| (distance.max(0.0), beyond))
    }

    /// Whether the cell is inside out, and lies on this side of the face that the line comes
    /// through.
    fn is_behind(&self, direction: DVec3, from: u32) -> bool {
        let mut entrances = self.faces.iter().filter(|f| f.beyond == from && from < NO_FACE);
        let outwards = |f: &Face| f.normal.dot(direction) > INSIDE_OUT * f.normal.length();
        entrances.next().is_some_and(outwards) && entrances.all(outwards)
    }

    /// The first plane of a convex cell that a line passes outwards.
    fn through_planes(&self, at: DVec3, direction: DVec3) -> Option<(f64, u32)> {
        let mut best: Option<(f64, u32)> = None;
        for f in &self.faces {
            let speed = f.normal.dot(direction);
            if speed > 0.0 {
                let distance = (f.offset - f.normal.dot(at)) / speed;
                if best.is_none_or(|b| distance < b.0) {
                    best = Some((distance, f.beyond));
                }
            }
        }
        best
    }

    /// Value and gradient at a place; NaN without values. `of_corners` is memory for shares.
    pub(super) fn sample(&self, at: DVec3, of_corners: &mut Vec<Share>) -> (f64, DVec3) {
        let at = at - self.origin;
        let to_space = match self.has_values {
            true => shares(&self.corners, &self.map, at, of_corners),
            false => None,
        };
        match to_space {
            Some(to_space) => self.polynomials.blend(at, of_corners, &to_space),
            None => (f64::NAN, DVec3::NAN),
        }
    }

    /// Whether a place is between the planes of all faces.
    pub(super) fn contains(&self, at: DVec3) -> bool {
        let at = at - self.origin;
        let margin = 1e-9 * self.size;
        let below = |f: &Face| {
            let height = (f.normal.dot(at) - f.offset) / f.length();
            let ring = self.ring(f).iter().map(|&i| self.corners[i as usize]);
            height <= f.thickness(ring) + margin
        };
        self.faces.iter().all(below)
    }

    /// The cells behind its faces.
    pub(super) fn neighbours(&self) -> impl Iterator<Item = u32> {
        self.faces.iter().map(|f| f.beyond).filter(|&b| b < NO_FACE)
    }

    fn ring(&self, face: &Face) -> &[u32] {
        &self.rings[face.first as usize..(face.first + face.count) as usize]
    }

    /// Calls `passed` with the distances at which the line from `at` passes triangles outwards, and
    /// their faces.
    ///
    /// Seen along the line, a triangle is passed when the line, a point there, is on the same side
    /// of its edges. Two triangles with a common edge compute the same number for it with opposite
    /// signs, so that no line passes between them.
    fn each_passage(&self, at: DVec3, direction: DVec3, mut passed: impl FnMut(f64, &Face)) {
        let across = direction.any_orthonormal_pair();
        let seen = |p: DVec3| DVec2::new(across.0.dot(p - at), across.1.dot(p - at));
        let all: SmallVec<[DVec2; 8]> = self.corners.iter().map(|p| seen(*p)).collect();
        for face in &self.faces {
            let ring = self.ring(face);
            let on_ring = |i: usize| all[ring[i] as usize];
            let first = on_ring(0);
            let (mut low, mut high, mut sum) = (first, first, first);
            for i in 1..ring.len() {
                let p = on_ring(i);
                (low, high, sum) = (low.min(p), high.max(p), sum + p);
            }
            if low.max_element() > 0.0 || high.min_element() < 0.0 {
                continue;
            }
            let corner = |i: usize| self.corners[ring[i] as usize] - at;
            let mut test = |edges: [f64; 3], triangle: &dyn Fn() -> [DVec3; 3]| {
                let [x, y, z] = edges;
                let inside = x >= 0.0 && y >= 0.0 && z >= 0.0 || x <= 0.0 && y <= 0.0 && z <= 0.0;
                // The line is in the triangle's plane, or passes it inwards.
                if !inside || x + y + z == 0.0 || (x + y + z > 0.0) == face.clockwise {
                    return;
                }
                let [a, b, c] = triangle();
                let normal = (b - a).cross(c - a);
                let speed = normal.dot(direction);
                if speed != 0.0 {
                    passed(normal.dot(a) / speed, face);
                }
            };
            if let [a, b, c] = *ring {
                let [a, b, c] = [a, b, c].map(|i| all[i as usize]);
                let edges = [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)];
                test(edges, &|| [corner(0), corner(1), corner(2)]);
                continue;
            }
            let middle = sum / ring.len() as f64;
            let mut spoke = middle.perp_dot(first);
            for i in 0..ring.len() {
                let next = if i + 1 == ring.len() { 0 } else { i + 1 };
                let next_spoke = middle.perp_dot(on_ring(next));
                let edges = [on_ring(i).perp_dot(on_ring(next)), -next_spoke, spoke];
                test(edges, &|| {
                    let middle = (0..ring.len()).map(corner).sum::<DVec3>() / ring.len() as f64;
                    [middle, corner(i), corner(next)]
                });
                spoke = next_spoke;
            }
        }
    }
}

impl Face {
    fn new(ring: &[DVec3], inside: DVec3, beyond: u32, first: u32) -> Face {
        let (normal, middle) = normal_and_middle(ring);
        let clockwise = normal.dot(middle - inside) < 0.0;
        let normal = if clockwise { -normal } else { normal };
        let (offset, count) = (normal.dot(middle), ring.len() as u32);
        Face { normal, offset, beyond, first, count, clockwise }
    }

    /// The length of the normal; not zero where the face has no area.
    fn length(&self) -> f64 {
        self.normal.length().max(f64::MIN_POSITIVE)
    }

    /// Largest distance of a corner from the plane.
    fn thickness(&self, ring: impl Iterator<Item = DVec3>) -> f64 {
        let off = |p: DVec3| (self.normal.dot(p) - self.offset).abs();
        ring.map(off).fold(0.0, f64::max) / self.length()
    }
}
