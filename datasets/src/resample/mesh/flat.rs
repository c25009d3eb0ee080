//! Planes as meshes: cells of one layer become as thick as the span of their flow, and a plane that
//! slants to the axes is turned onto two of them.

use super::{Mesh, PartDepth, Plane};
use glam::{DMat3, DQuat, DVec3};

/// Corners of one layer of cells lie in its two sides within this part of the mesh's size, and of
/// the thickness of the layer.
const OF_SIZE: f64 = 1e-4;
const OF_THICKNESS: f64 = 0.05;

/// A direction is along an axis whose component is all of its length but for this part.
pub(super) const ALONG: f64 = 1e-12;

/// Two parallel planes in which all corners seen so far lie.
#[derive(Clone, Copy)]
struct Sides {
    normal: DVec3,
    low: f64,
    high: f64,
}

impl Sides {
    fn hold(&self, p: DVec3, tolerance: f64) -> bool {
        let height = p.dot(self.normal);
        let tolerance = tolerance.min(OF_THICKNESS * (self.high - self.low));
        (height - self.low).abs() <= tolerance || (height - self.high).abs() <= tolerance
    }
}

impl Mesh {
    /// Makes the cells of a part that are one layer as thick as `span`, their middle in place.
    /// Returns whether they are one layer: all corners lie in two parallel planes. Of several such
    /// pairs, as a row of cells has, it takes the nearest.
    pub(super) fn stretch_layer(&mut self, part: usize, span: f64) -> bool {
        let cells = self.parts[part].cells.clone();
        let Some(first) = cells.clone().next() else { return false };
        let (low, high) = self.bounds();
        let tolerance = OF_SIZE * (high - low).max_element();
        let mut sides = self.sides_of_cell(first);
        for cell in cells {
            let ids = self.corners(cell).ids;
            sides.retain(|s| ids.iter().all(|&i| s.hold(self.points[i as usize], tolerance)));
            if sides.is_empty() {
                return false;
            }
        }
        let thickness = |s: &Sides| s.high - s.low;
        sides.sort_by(|a, b| thickness(a).total_cmp(&thickness(b)));
        let Sides { normal, low, high } = sides[0];
        let middle = 0.5 * (low + high);
        let stretch = span / (high - low) - 1.0;
        let points = self.parts[part].points.clone();
        let above = self.points[points].iter_mut().map(|p| {
            let height = p.dot(normal) - middle;
            *p += normal * (height * stretch);
            height > 0.0
        });
        let above = above.collect();
        self.parts[part].depth = Some(PartDepth::Sides(above));
        self.parts[part].normal = normal;
        true
    }

    /// For each face of a cell, its plane and the one through the corner that is farthest from it.
    fn sides_of_cell(&self, cell: usize) -> Vec<Sides> {
        let corners = self.corners(cell);
        let at = |i: &u32| self.points[*i as usize];
        let mut found: Vec<Sides> = Vec::new();
        corners.shape.each_face(|ring| {
            let ring: Vec<DVec3> = ring.iter().map(|&i| at(&corners.ids[i as usize])).collect();
            let pairs = ring.windows(2).map(|w| (w[0] - ring[0]).cross(w[1] - ring[0]));
            let Some(normal) = pairs.sum::<DVec3>().try_normalize() else { return };
            let normal = forward(normal);
            let heights = corners.ids.iter().map(|i| at(i).dot(normal));
            let (low, high) =
                heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            if high > low {
                found.push(Sides { normal, low, high });
            }
        });
        found
    }

    /// Turns a plane that slants to the axes, about the origin and by the least angle, so that two
    /// of them lie along it; one to revolve that lies along x is turned about x, so that y is the
    /// radius. Without depth, or with planes of several directions, the mesh stays.
    pub(super) fn turn_to_axes(&mut self, plane: Option<Plane>) {
        let Some(first) = self.parts.first().filter(|p| p.depth.is_some()) else { return };
        let normal = forward(first.normal);
        let is_along = |p: &super::Part| {
            p.depth.is_some() && p.normal.dot(normal).abs() > 1.0 - OF_SIZE * OF_SIZE
        };
        if !normal.is_normalized() || !self.parts.iter().all(is_along) {
            return;
        }
        let is_meridian =
            matches!(plane, Some(Plane::Meridian { .. })) && normal.x.abs() <= OF_SIZE;
        let axis = if is_meridian { 2 } else { normal.abs().max_position() };
        if normal[axis] > 1.0 - ALONG {
            return;
        }
        let turn = match is_meridian {
            true => self.turn_about_x(normal),
            false => DMat3::from_quat(DQuat::from_rotation_arc(normal, DVec3::AXES[axis])),
        };
        self.points.iter_mut().for_each(|p| *p = turn * *p);
        self.parts.iter_mut().for_each(|p| p.normal = DVec3::AXES[axis]);
        self.turn = Some(turn);
    }

    /// The rotation about x that brings a plane along x with this normal across z, and that side of
    /// it to which it extends farther to positive y.
    fn turn_about_x(&self, normal: DVec3) -> DMat3 {
        let radial = DVec3::X.cross(normal).normalize_or(DVec3::Y);
        let reach = |side: f64| {
            let along = self.points.iter().map(|p| side * p.dot(radial));
            along.filter(|r| r.is_finite()).fold(f64::NEG_INFINITY, f64::max)
        };
        let radial = if reach(1.0) >= reach(-1.0) { radial } else { -radial };
        DMat3::from_cols(DVec3::X, radial, DVec3::X.cross(radial)).transpose()
    }

    /// The rotation about the origin that brought a plane that slants to the axes onto two of them;
    /// `None` for other meshes. Points of the file times it are points of the mesh.
    ///
    /// ```
    /// use datasets::model::{Dataset, Points, StructuredGrid};
    /// use datasets::resample::{Mesh, Plane};
    ///
    /// // Four points of the plane y = x.
    /// let corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
    /// let points = Points::F64(corners.to_vec());
    /// let (extent, attributes) = ([0, 1, 0, 1, 0, 0], Default::default());
    /// let slice = StructuredGrid { extent, points, attributes };
    /// let mesh = Mesh::with_plane(&Dataset::StructuredGrid(slice), Plane::Extrude { span: 0.5 })?;
    /// let (low, high) = mesh.bounds();
    /// // As wide as the diagonal, as high as it was, and as deep as the span.
    /// let mut sides = (high - low).to_array();
    /// sides.sort_by(f64::total_cmp);
    /// assert!((sides[0] - 0.5).abs() < 1e-12 && (sides[2] - 2f64.sqrt()).abs() < 1e-12);
    /// assert!(mesh.turn().is_some());
    /// # Ok::<(), datasets::resample::ResampleError>(())
    /// ```
    pub fn turn(&self) -> Option<DMat3> {
        self.turn
    }
}

/// The direction with its largest component positive.
pub(super) fn forward(v: DVec3) -> DVec3 {
    if v[v.abs().max_position()] < 0.0 { -v } else { v }
}
