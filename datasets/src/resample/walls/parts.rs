//! The parts of a mesh's border that do not lie in the sides of its box, and what their shapes
//! tell.
//!
//! A part is what points join. Where it ends, it ends in sides of the box, so that these close it:
//!
//! ```text
//! ┌──────────┐   ┌──────────┐   ┌──────────┐   ╱‾‾‾‾‾‾‾‾‾╲
//! │   ╭──╮   │   │          │   │          │  ╱           ╲
//! │   ╰──╯   │   │   ╭──╮   │   │      ╱‾‾‾│  ╲           ╱
//! └──────────┘   └───╯  ╰───┘   └─────╱    │   ╲_________╱
//!     hole          hollow         unknown       unknown
//! ```
//! A hole, and a hollow in one side, are bodies. A part that ends in several sides may be a ramp,
//! or an open border that slants. Along the span of the flow, parts may end in both sides.
//!
//! The outwards normals of a hole point into it: the volume within it that they give is negative
//! (Gauss). Where it is positive, the part is the outer border of a piece of the mesh.

use super::Walls;
use super::sides::Sides;
use super::velocity::{Flux, Motion, Velocity};
use crate::resample::mesh::Mesh;
use glam::DVec3;

/// A volume below this part of a part's area times its diagonal is none: blocks whose faces do not
/// match, with slivers between them.
const LEAST_VOLUME: f64 = 5e-4;
/// Area vectors along an axis of less than this part of the area are none.
const LEAST_AREA: f64 = 1e-3;
/// Blocks that fill a hole differ from it by less than these parts of its diagonal and volume.
const SAME_PLACE: f64 = 0.05;
const SAME_VOLUME: f64 = 0.1;

/// What the shape of a part tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outline {
    /// It is closed, with the flow around it. `through`: by two opposite sides of the box.
    Hole { through: bool },
    /// One side of the box closes it, with the flow around it.
    Hollow,
    /// It is the outer border of a piece of the mesh, or the hole that the piece fills.
    Piece,
    /// Nothing.
    Unknown,
}

/// A part of the border.
pub(super) struct Part {
    pub(super) outline: Outline,
    pub(super) motion: Motion,
    /// Area of its faces in the mean.
    pub(super) mean_area: f64,
}

/// All parts of a border.
pub(super) struct Parts<'a> {
    pub(super) all: Vec<Part>,
    /// The part of each face.
    pub(super) of_faces: Vec<u32>,
    pub(super) velocity: Option<&'a Velocity>,
}

/// Sums over the faces of a part.
#[derive(Clone)]
struct Sums {
    faces: f64,
    touched: [[bool; 2]; 3],
    low: DVec3,
    high: DVec3,
    area: f64,
    /// Of the area vectors, of their sizes along each axis, and of their products with the places.
    vector: DVec3,
    sizes: DVec3,
    moments: DVec3,
    flux: Flux,
}

impl<'a> Parts<'a> {
    pub(super) fn of(
        mesh: &Mesh,
        walls: &Walls,
        sides: &Sides,
        velocity: Option<&'a Velocity>,
    ) -> Parts<'a> {
        let (of_faces, count) = joined(walls, mesh.first_at_place());
        let mut sums = vec![Sums::new(); count];
        let mut first = 0;
        for (face, &part) in walls.faces.iter().zip(&of_faces) {
            let ring = &walls.rings[first..face.end];
            first = face.end;
            sums[part as usize].add(mesh, sides, velocity, face.cell as usize, ring);
        }
        let mut outlines: Vec<(Outline, f64)> = sums.iter().map(|s| s.outline(sides)).collect();
        mark_filled(&sums, &mut outlines);
        let part = |(s, o): (&Sums, &(Outline, f64))| Part {
            outline: o.0,
            motion: velocity.map_or(Motion::Unknown, |v| v.motion(&s.flux)),
            mean_area: s.area / s.faces.max(1.0),
        };
        let all = sums.iter().zip(&outlines).map(part).collect();
        Parts { all, of_faces, velocity }
    }
}

/// Holes that pieces of the mesh fill, whose faces do not match theirs, are not holes.
fn mark_filled(sums: &[Sums], outlines: &mut [(Outline, f64)]) {
    let is_hole = |o: Outline| matches!(o, Outline::Hole { .. } | Outline::Hollow);
    let mut pieces: Vec<usize> =
        (0..sums.len()).filter(|&i| outlines[i].0 == Outline::Piece).collect();
    pieces.sort_by(|&a, &b| sums[a].low.x.total_cmp(&sums[b].low.x));
    for hole in (0..sums.len()).filter(|&i| is_hole(outlines[i].0)).collect::<Vec<_>>() {
        let near = SAME_PLACE * (sums[hole].high - sums[hole].low).length();
        let first = pieces.partition_point(|&p| sums[p].low.x < sums[hole].low.x - near);
        let at_hole =
            pieces[first..].iter().take_while(|&&p| sums[p].low.x <= sums[hole].low.x + near);
        let volume = outlines[hole].1;
        let fills = |&piece: &usize| {
            sums[hole].is_at(&sums[piece], near)
                && (volume + outlines[piece].1).abs() <= SAME_VOLUME * volume.abs()
        };
        if at_hole.copied().any(|p| fills(&p)) {
            outlines[hole].0 = Outline::Piece;
        }
    }
}

/// The part of each face, by the points that faces share, and the number of parts. `same` is the
/// first of the points at the same place.
fn joined(walls: &Walls, same: &[u32]) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..same.len() as u32).collect();
    let root = |parent: &mut Vec<u32>, mut i: u32| {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    };
    // The two layers of a plane are joined by faces.
    walls.each_face(|ring, _| {
        let first = root(&mut parent, same[ring[0] as usize]);
        for &i in ring {
            let other = root(&mut parent, same[i as usize]);
            parent[other as usize] = first;
        }
    });
    let mut number = vec![u32::MAX; same.len()];
    let (mut of_faces, mut count) = (Vec::with_capacity(walls.faces.len()), 0);
    walls.each_face(|ring, _| {
        let part = &mut number[root(&mut parent, same[ring[0] as usize]) as usize];
        if *part == u32::MAX {
            *part = count;
            count += 1;
        }
        of_faces.push(*part);
    });
    (of_faces, count as usize)
}

impl Sums {
    fn new() -> Sums {
        Sums {
            faces: 0.0,
            touched: [[false; 2]; 3],
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            area: 0.0,
            vector: DVec3::ZERO,
            sizes: DVec3::ZERO,
            moments: DVec3::ZERO,
            flux: Flux::default(),
        }
    }

    fn add(
        &mut self,
        mesh: &Mesh,
        sides: &Sides,
        velocity: Option<&Velocity>,
        cell: usize,
        ring: &[u32],
    ) {
        let place = |i: usize| mesh.point(ring[i % ring.len()] as usize);
        let count = ring.len();
        for p in (0..count).map(place) {
            let touched = sides.touched(p);
            for (of_part, of_point) in self.touched.iter_mut().zip(touched) {
                *of_part = [of_part[0] | of_point[0], of_part[1] | of_point[1]];
            }
            (self.low, self.high) = (self.low.min(p), self.high.max(p));
        }
        let middle = (0..count).map(place).sum::<DVec3>() / count as f64;
        let twice: DVec3 =
            (0..count).map(|i| (place(i) - middle).cross(place(i + 1) - middle)).sum();
        let outwards = twice.dot(middle - mesh.cell_centre(cell)) >= 0.0;
        let vector = twice * if outwards { 0.5 } else { -0.5 };
        if !vector.is_finite() {
            return;
        }
        self.faces += 1.0;
        self.area += vector.length();
        self.vector += vector;
        self.sizes += vector.abs();
        self.moments += vector * middle;
        if let Some(velocity) = velocity {
            velocity.add(&mut self.flux, cell, ring, vector);
        }
    }

    /// What the shape tells, and the volume of the mesh's piece within the part, if it is closed:
    /// negative for a hole in the mesh.
    fn outline(&self, sides: &Sides) -> (Outline, f64) {
        let ends: Vec<(usize, usize)> = (0..6)
            .map(|k| (k / 2, k % 2))
            .filter(|&(axis, side)| self.touched[axis][side])
            .collect();
        let none = |axis: usize| self.vector[axis].abs() <= LEAST_AREA * self.area;
        // Moments about a side leave out the face in it that closes the part.
        let about = |axis: usize, place: f64| self.moments[axis] - place * self.vector[axis];
        let centre = 0.5 * (self.low + self.high);
        let volume = |closing: Option<(usize, usize)>, span: Option<usize>| -> f64 {
            let of_axis = |axis: usize| match closing {
                Some((a, side)) if a == axis => about(axis, sides.place(axis, side)),
                _ => about(axis, sides.mirror(axis).unwrap_or(centre[axis])),
            };
            (0..3).filter(|a| Some(*a) != span).map(of_axis).sum::<f64>() / 3.0
        };
        let named = |volume: f64, hole: Outline| {
            let least = LEAST_VOLUME * self.area * (self.high - self.low).length() / 3.0;
            (if volume < -least { hole } else { Outline::Piece }, volume)
        };
        match ends[..] {
            [] => return named(volume(None, None), Outline::Hole { through: false }),
            [only] => return named(volume(Some(only), None), Outline::Hollow),
            _ => {}
        }
        // The axis along which the part has the span of the mesh.
        for span in (0..3).filter(|&a| self.touched[a] == [true; 2]) {
            let across = || (0..3).filter(|a| *a != span);
            match ends.iter().filter(|e| e.0 != span).collect::<Vec<_>>()[..] {
                [] if across().all(none) => {
                    return named(volume(None, Some(span)), Outline::Hole { through: true });
                }
                [&only]
                    if self.sizes[span] <= LEAST_AREA * self.area
                        && across().filter(|a| *a != only.0).all(none) =>
                {
                    return named(volume(Some(only), Some(span)), Outline::Hollow);
                }
                _ => {}
            }
        }
        (Outline::Unknown, 0.0)
    }

    /// Whether another part has the same box.
    fn is_at(&self, other: &Sums, near: f64) -> bool {
        let off = (self.low - other.low).abs().max((self.high - other.high).abs());
        off.max_element() <= near
    }
}
