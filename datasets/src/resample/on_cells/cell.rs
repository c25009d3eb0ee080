//! One cell, prepared for lines: where they leave it, and over which face.

use super::blend::{Corner, Mean, Polynomials};
use super::border::{each_triangle, line_through, normal_and_middle};
use super::shares::Map;
use super::{CellField, Kind};
use crate::resample::mesh::NO_FACE;
use crate::resample::shape::Shares;
use glam::DVec3;

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

/// A cell with what lines need of it. Places are relative to its first corner.
#[derive(Default)]
pub(super) struct PreparedCell {
    pub(super) origin: DVec3,
    /// Diagonal of its box.
    pub(super) size: f64,
    pub(super) corners: Vec<DVec3>,
    /// Middle of the corners.
    pub(super) middle: DVec3,
    pub(super) faces: Vec<Face>,
    /// Corners of the faces, one face after the other.
    pub(super) rings: Vec<u32>,
    /// Whether lines leave through planes.
    convex: bool,
    pub(super) has_values: bool,
    pub(super) map: Map,
    pub(super) polynomials: Polynomials,
}

/// A face of the cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Outwards, of length one.
    normal: DVec3,
    /// Distance of its plane along the normal.
    offset: f64,
    /// Largest distance of a corner from the plane.
    thickness: f64,
    pub(super) middle: DVec3,
    beyond: u32,
    pub(super) first: u32,
    pub(super) count: u32,
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
        let corners = field.mesh.corners(cell);
        let place = |&i: &u32| field.mesh.point(i as usize);
        self.origin = place(&corners.ids[0]);
        self.corners.clear();
        self.corners.extend(corners.ids.iter().map(|i| place(i) - self.origin));
        let (low, high) = self
            .corners
            .iter()
            .fold((DVec3::ZERO, DVec3::ZERO), |(l, h), p| (l.min(*p), h.max(*p)));
        self.size = (high - low).length();
        self.middle = self.corners.iter().sum::<DVec3>() / self.corners.len() as f64;
        self.faces.clear();
        self.rings.clear();
        self.convex = true;
        let beyond = field.neighbours.of_cell(cell);
        let (mut number, mut ring_places) = (0, Vec::with_capacity(8));
        corners.shape.each_face(|ring| {
            ring_places.clear();
            ring_places.extend(ring.iter().map(|&i| self.corners[i as usize]));
            let first = self.rings.len() as u32;
            self.rings.extend(ring);
            if beyond[number] != NO_FACE {
                let face = Face::new(&ring_places, self.middle, beyond[number], first);
                let above = |p: &DVec3| face.normal.dot(*p) - face.offset;
                let farthest = self.corners.iter().map(above).fold(0.0, f64::max);
                self.convex &= face.thickness.max(farthest) <= PLANE * self.size;
                self.faces.push(face);
            }
            number += 1;
        });
        self.has_values = field.kinds[cell] == Kind::Gas;
        let is_limited =
            |&id: &u32| field.expansions.get(id as usize).is_some_and(|e| e.is_limited());
        let shares =
            if corners.ids.iter().any(is_limited) { field.shares } else { Shares::OfElement };
        self.map.prepare(&self.corners, &corners.shape, self.size, shares);
        let corner = |(&id, &place): (&u32, &DVec3)| Corner {
            place,
            value: field.values[id as usize],
            expansion: field.expansions.get(id as usize),
        };
        let of_element = shares == Shares::OfElement;
        let corners = corners.ids.iter().zip(&self.corners).map(corner);
        self.polynomials.prepare(corners, of_element, mean);
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
        for f in &self.faces {
            let nearest = ways.ahead.map_or(f64::INFINITY, |w| w.0);
            if f.may_be_before(at, direction, back, nearest) {
                self.through_triangles(f, at, direction, |distance| {
                    let way = Some((distance, f.beyond));
                    if distance < -at_once {
                        let nearer = ways.behind.is_none_or(|w| distance > w.0);
                        if distance >= back && nearer {
                            ways.behind = way;
                        }
                    } else if distance <= at_once && f.beyond == from {
                        ways.returning = way;
                    } else if ways.ahead.is_none_or(|w| distance < w.0) {
                        ways.ahead = way;
                    }
                });
            }
        }
        let way = ways.ahead.or(ways.behind).or(ways.returning);
        way.map(|(distance, beyond)| (distance.max(0.0), beyond))
    }

    /// Whether the cell is inside out, and lies on this side of the face that the line comes
    /// through.
    fn is_behind(&self, direction: DVec3, from: u32) -> bool {
        let mut entrances = self.faces.iter().filter(|f| f.beyond == from && from < NO_FACE);
        let outwards = |f: &Face| f.normal.dot(direction) > INSIDE_OUT;
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

    /// Whether a place is between the planes of all faces.
    pub(super) fn contains(&self, at: DVec3) -> bool {
        let at = at - self.origin;
        let margin = 1e-9 * self.size;
        let below = |f: &Face| f.normal.dot(at) - f.offset <= f.thickness + margin;
        self.faces.iter().all(below)
    }

    /// The cells behind its faces.
    pub(super) fn neighbours(&self) -> impl Iterator<Item = u32> {
        self.faces.iter().map(|f| f.beyond).filter(|&b| b < NO_FACE)
    }

    /// Calls `passed` with the distances at which a line passes a face outwards.
    fn through_triangles(
        &self,
        face: &Face,
        at: DVec3,
        direction: DVec3,
        mut passed: impl FnMut(f64),
    ) {
        let ring = &self.rings[face.first as usize..(face.first + face.count) as usize];
        let place = |i: usize| self.corners[ring[i] as usize] - at;
        each_triangle(ring.len(), face.middle - at, place, |triangle| {
            if let Some((distance, along)) = line_through(triangle, direction)
                && along != face.clockwise
            {
                passed(distance);
            }
        });
    }
}

impl Face {
    fn new(ring: &[DVec3], inside: DVec3, beyond: u32, first: u32) -> Face {
        let (normal, middle) = normal_and_middle(ring);
        let clockwise = normal.dot(middle - inside) < 0.0;
        let normal = normal.normalize_or_zero() * if clockwise { -1.0 } else { 1.0 };
        let offset = normal.dot(middle);
        let off = |p: &DVec3| (normal.dot(*p) - offset).abs();
        let thickness = ring.iter().map(off).fold(0.0, f64::max);
        let count = ring.len() as u32;
        Face { normal, offset, thickness, middle, beyond, first, count, clockwise }
    }

    /// Whether a line may pass the face between two distances: it is between the planes that the
    /// face lies between.
    fn may_be_before(&self, at: DVec3, direction: DVec3, from: f64, to: f64) -> bool {
        let (height, speed) = (self.normal.dot(at) - self.offset, self.normal.dot(direction));
        let half = self.thickness * (1.0 + 1e-9) + f64::EPSILON * at.abs().max_element();
        if speed.abs() < 1e-12 {
            return height.abs() <= half + 1e-9 * self.thickness.max(at.length());
        }
        let ends = [(-half - height) / speed, (half - height) / speed];
        let margin = 1e-9 * (ends[0].abs().max(ends[1].abs()));
        ends[0].max(ends[1]) + margin >= from && ends[0].min(ends[1]) - margin <= to
    }
}
