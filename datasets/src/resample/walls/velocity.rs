//! What the velocity of a flow tells of its border.

use super::Walls;
use super::velocity_arrays::VelocityArrays;
use crate::model::{Attributes, Dataset};
use crate::resample::mesh::Mesh;
use glam::DVec3;

/// A speed below this part of the largest is zero: what a solver writes for a wall without slip.
const AT_REST: f64 = 1e-9;
/// Gas beside a wall that moves is faster than this part of the largest speed. Gas at rest far from
/// a jet is slower.
const IN_MOTION: f64 = 1e-6;
/// A border tells nothing where the gas is slower than this part of the mean velocity, nor a mean
/// velocity that is less than this part of the mean speed.
const SLOW: f64 = 0.1;
/// Gas follows a border that it crosses by less than this part of what the mean velocity would.
const ALONG: f64 = 0.25;
/// Gas crosses a border from this part on, and by at least so much of its own speed.
const ACROSS: f64 = 0.5;
const LEAST_ACROSS: f64 = 0.05;
/// The mean velocity crosses a border that tells something by at least this part: half a degree.
const LEAST_TURN: f64 = 0.01;

/// How gas moves at a part of the border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    /// Along it where the flow as a whole would cross it: a wall with slip turns it.
    Along,
    /// Across it, so that it is no wall.
    Across,
    /// Too slowly, or the border is along the whole flow, or there is no velocity.
    Unknown,
}

/// The velocity of a flow at the points or in the cells of a mesh.
pub(super) struct Velocity {
    pub(super) name: String,
    per_point: bool,
    values: Vec<DVec3>,
    mean: DVec3,
}

/// Sums over the faces of a part of the border.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Flux {
    area: f64,
    /// Integrals of the size of the velocity, of its part across the border, and of that of the
    /// mean velocity.
    speed: f64,
    across: f64,
    of_mean: f64,
}

impl Velocity {
    /// `None` without arrays that have the name of a velocity or of its components.
    pub(super) fn of(mesh: &Mesh, data: &Dataset) -> Option<Velocity> {
        let leaves = data.leaves();
        let across = mesh.axis_of_depth().filter(|_| mesh.turn().is_none());
        let arrays = || leaves.iter().filter_map(|d| d.attributes());
        let of_points = arrays().find_map(|a| VelocityArrays::among(&a.point, across));
        let of_cells = || arrays().find_map(|a| VelocityArrays::among(&a.cell, across));
        let per_point = of_points.is_some();
        let found = of_points.or_else(of_cells)?;
        let component = |axis: usize| {
            let of = |a: &Attributes, i: usize| match per_point {
                true => found.component(axis, |name| a.point_array(name), i),
                false => found.component(axis, |name| a.cell_array(name), i),
            };
            if per_point { mesh.gather_points(data, of) } else { mesh.gather_cells(data, of) }
        };
        let [x, y, z] = [component(0), component(1), component(2)];
        let turn = mesh.turn().unwrap_or_default();
        let values = (0..x.len()).map(|i| turn * DVec3::new(x[i], y[i], z[i])).collect();
        let mut velocity = Velocity { name: found.name, per_point, values, mean: DVec3::ZERO };
        velocity.mean = velocity.mean_of(mesh);
        Some(velocity)
    }

    /// The mean over the cells, each by the volume of its box; zero where it says little.
    fn mean_of(&self, mesh: &Mesh) -> DVec3 {
        let (mut sum, mut speeds, mut volumes) = (DVec3::ZERO, 0.0, 0.0);
        for cell in (0..mesh.num_cells()).filter(|c| !mesh.is_hidden(*c)) {
            let ids = mesh.corners(cell).ids;
            let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let places = ids.iter().map(|&i| mesh.point(i as usize));
            let (low, high) = places.fold(nothing, |(l, h), p| (l.min(p), h.max(p)));
            let (of_cell, volume) = (self.at(cell, &ids), (high - low).element_product());
            if of_cell.is_finite() && volume.is_finite() {
                sum += of_cell * volume;
                speeds += of_cell.length() * volume;
                volumes += volume;
            }
        }
        if volumes > 0.0 && sum.length() >= SLOW * speeds { sum / volumes } else { DVec3::ZERO }
    }

    /// The velocity in a cell, or at a face of it with these corners.
    fn at(&self, cell: usize, corners: &[u32]) -> DVec3 {
        if !self.per_point {
            return self.values[cell];
        }
        let sum: DVec3 = corners.iter().map(|&i| self.values[i as usize]).sum();
        sum / corners.len() as f64
    }

    /// Adds a face with an area vector to the sums.
    pub(super) fn add(&self, flux: &mut Flux, cell: usize, corners: &[u32], area: DVec3) {
        let of_face = self.at(cell, corners);
        if of_face.is_finite() {
            flux.area += area.length();
            flux.speed += of_face.length() * area.length();
            flux.across += of_face.dot(area).abs();
            flux.of_mean += self.mean.dot(area).abs();
        }
    }

    /// How gas moves at a part of the border with these sums.
    pub(super) fn motion(&self, flux: &Flux) -> Motion {
        let mean = self.mean.length();
        let is_fast = flux.speed > SLOW * mean * flux.area;
        if mean == 0.0 || !is_fast {
            return Motion::Unknown;
        }
        let across = flux.across / flux.speed;
        let of_mean = flux.of_mean / (mean * flux.area);
        if across >= (ACROSS * of_mean).max(LEAST_ACROSS) {
            Motion::Across
        } else if of_mean >= LEAST_TURN && across <= ALONG * of_mean {
            Motion::Along
        } else {
            Motion::Unknown
        }
    }
}

impl Walls {
    /// Points at rest beside gas in motion.
    pub(super) fn add_without_slip(&mut self, mesh: &Mesh, data: &Dataset) {
        let across = mesh.axis_of_depth().filter(|_| mesh.turn().is_none());
        let of_leaf = |d: &&Dataset| VelocityArrays::among(&d.attributes()?.point, across);
        let Some(found) = data.leaves().iter().find_map(of_leaf) else { return };
        let speed = |a: &Attributes, i: usize| found.speed(|name| a.point_array(name), i);
        let speeds = mesh.gather_points(data, speed);
        let largest = speeds.iter().copied().filter(|s| s.is_finite()).fold(0.0, f64::max);
        let mut has_rest = false;
        for cell in (0..mesh.num_cells()).filter(|c| !mesh.is_hidden(*c)) {
            let ids = mesh.corners(cell).ids;
            if ids.iter().any(|&i| speeds[i as usize] > IN_MOTION * largest) {
                for &i in &ids {
                    let rest = speeds[i as usize] <= AT_REST * largest;
                    self.of_points[i as usize] |= rest;
                    has_rest |= rest;
                }
            }
        }
        if has_rest {
            self.evidence.push(format!("`{}` being zero, as at a wall without slip", found.name));
        }
    }
}
