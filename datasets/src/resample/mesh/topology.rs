//! Which points are at one place, which cells have volume, and which share a face. It is computed
//! when it is first asked for, and once for a mesh: reconstruction, walls and cells need it.

use super::faces::Neighbours;
use super::{Corners, Mesh, places};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::OnceLock;

/// A cell with less volume than this part of the cube of its box's diagonal has none. Cells at
/// walls are 1e5 times as wide as high.
const LEAST_VOLUME: f64 = 1e-15;

/// What was computed of a mesh so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Computed {
    first_at_place: OnceLock<Vec<u32>>,
    topology: OnceLock<Topology>,
}

/// The cells of a mesh among each other.
#[derive(Debug, Clone)]
pub(in crate::resample) struct Topology {
    /// Volume of each cell; zero where it has none or no finite place, so that it is left out.
    pub(in crate::resample) volumes: Vec<f64>,
    pub(in crate::resample) neighbours: Neighbours,
}

impl Mesh {
    /// For each point the first of those at the same place.
    pub(in crate::resample) fn first_at_place(&self) -> &[u32] {
        self.computed.first_at_place.get_or_init(|| places::first_at_place(self))
    }

    /// The volumes and neighbours of the cells.
    pub(in crate::resample) fn topology(&self) -> &Topology {
        self.computed.topology.get_or_init(|| self.new_topology())
    }

    /// As [`Mesh::topology`], for who keeps it.
    pub(in crate::resample) fn take_topology(&mut self) -> Topology {
        self.computed.topology.take().unwrap_or_else(|| self.new_topology())
    }

    fn new_topology(&self) -> Topology {
        let volume = |cell: usize| self.volume(&self.corners(cell));
        let volumes: Vec<f64> = (0..self.num_cells()).into_par_iter().map(volume).collect();
        let neighbours = Neighbours::of(self, self.first_at_place(), &volumes);
        Topology { volumes, neighbours }
    }

    /// Volume of a cell, by the tetrahedra between its middle, the middles of its faces and its
    /// edges. Zero if it has none.
    pub(in crate::resample) fn volume(&self, corners: &Corners) -> f64 {
        let points: Vec<DVec3> = corners.ids.iter().map(|&i| self.point(i as usize)).collect();
        if points.len() < 4 || !points.iter().all(|p| p.is_finite()) {
            return 0.0;
        }
        let (low, high) =
            points.iter().fold((points[0], points[0]), |(l, h), p| (l.min(*p), h.max(*p)));
        let middle = points.iter().sum::<DVec3>() / points.len() as f64;
        let mut volume = 0.0;
        corners.shape.each_face(|face| {
            let place = |i: u32| points[i as usize] - middle;
            let on_face = face.iter().map(|&i| place(i)).sum::<DVec3>() / face.len() as f64;
            for (n, &i) in face.iter().enumerate() {
                let next = place(face[(n + 1) % face.len()]);
                volume += on_face.cross(place(i)).dot(next).abs() / 6.0;
            }
        });
        let diagonal = (high - low).length();
        // Not a number is no volume either.
        if volume > LEAST_VOLUME * diagonal.powi(3) { volume } else { 0.0 }
    }
}
