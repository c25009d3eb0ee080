//! The points and cells around a point of a mesh.

use super::cell_moments::CellMoments;
use crate::resample::mesh::Mesh;
use crate::rows::Rows;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use smallvec::SmallVec;

/// Which points belong to which cells. Points of different blocks at the same place are one.
pub(super) struct Incidence {
    /// The first of the points at the same place.
    same: Vec<u32>,
    corners: Rows,
    cells: Rows,
}

impl Incidence {
    /// Hidden cells are left out: their values are not those of the flow. So are cells without a
    /// value, if `averages` are those of cells: they would be counted among the neighbours, and
    /// what is behind them with them.
    pub(super) fn of(mesh: &Mesh, averages: Option<&[f64]>) -> Incidence {
        let same = mesh.first_at_place().to_vec();
        let is_of_flow =
            |cell: usize| !mesh.is_hidden(cell) && averages.is_none_or(|v| v[cell].is_finite());
        let of_cell = |cell: usize| {
            let ids = if is_of_flow(cell) { mesh.corners(cell).ids } else { SmallVec::new() };
            ids.into_iter().map(|id| same[id as usize]).collect::<Vec<u32>>()
        };
        // In pieces, because a list for each cell takes more memory than the rows.
        const PIECE: usize = 1 << 18;
        let mut corners = Rows::new();
        for first in (0..mesh.num_cells()).step_by(PIECE) {
            let cells = first..mesh.num_cells().min(first + PIECE);
            let lists: Vec<Vec<u32>> = cells.into_par_iter().map(of_cell).collect();
            lists.iter().for_each(|list| corners.push(list));
        }
        let cells = Rows::inverse(corners.iter(), mesh.num_points());
        Incidence { same, corners, cells }
    }
}

/// The neighbours of one point, in the order in which they were found; memory that is used again.
#[derive(Default)]
pub(super) struct Neighbourhood {
    /// Points or cells within two steps.
    pub(super) ids: Vec<u32>,
    /// How many of them are within one step; they come first.
    pub(super) near: usize,
    /// The point that was last seen at, for each point and each cell.
    seen_points: Vec<u32>,
    seen_cells: Vec<u32>,
    ring: Vec<u32>,
}

/// With as many neighbours within two steps, none at three steps are needed. On a cubic grid, 124
/// points are within two steps of a point, and 64 cells.
const ENOUGH: usize = 60;

/// Steps from cell to cell, at most: at a corner of a mesh.
const MOST_STEPS: usize = 4;

/// At a border, all neighbours lie on one side. A cubic polynomial then needs points at three
/// steps. (Cells at four steps would determine one too, but badly: in stretched cells, averages of
/// a quadratic field came back with errors of 2e-4.)
const STEPS_AT_BORDERS: usize = 3;

/// Where the square of the neighbours' mean distance is more than this part of their mean square,
/// along any line, they lie on one side. At a face of a cubic grid it is 0.53, inside it is 0, and
/// 0.07 where one of two neighbours is twice as far as the other.
const ONE_SIDED: f64 = 0.3;

/// Beyond this number nothing is added: points at which thousands of cells meet.
const MOST: usize = 512;

impl Neighbourhood {
    /// The points that share a cell with `point`, and those that share one with these, without the
    /// point itself.
    pub(super) fn points(&mut self, mesh: &Mesh, incidence: &Incidence, point: usize) {
        self.start(mesh, incidence, point);
        let centre = incidence.same[point];
        self.ids.clear();
        self.grow_points(incidence, point as u32, &[centre]);
        self.near = self.ids.len();
        let place = mesh.point(point);
        let one_sided = self.is_one_sided(|id| mesh.point(id as usize) - place);
        let least = if one_sided { STEPS_AT_BORDERS } else { 2 };
        // Two steps, and more at borders and among tetrahedra.
        let mut first = 0;
        for step in 2..=MOST_STEPS {
            if step > least && self.ids.len() >= ENOUGH {
                break;
            }
            let mut ring = std::mem::take(&mut self.ring);
            ring.clear();
            ring.extend(&self.ids[first..]);
            first = self.ids.len();
            self.grow_points(incidence, point as u32, &ring);
            self.ring = ring;
        }
    }

    fn start(&mut self, mesh: &Mesh, incidence: &Incidence, point: usize) {
        if self.seen_points.len() != mesh.num_points() {
            self.seen_points = vec![u32::MAX; mesh.num_points()];
        }
        if self.seen_cells.len() != mesh.num_cells() {
            self.seen_cells = vec![u32::MAX; mesh.num_cells()];
        }
        self.seen_points[incidence.same[point] as usize] = point as u32;
    }

    /// Adds the points that share a cell with one of `from` and were not seen yet.
    fn grow_points(&mut self, incidence: &Incidence, stamp: u32, from: &[u32]) {
        for &p in from {
            for &cell in incidence.cells.row(p as usize) {
                if std::mem::replace(&mut self.seen_cells[cell as usize], stamp) == stamp {
                    continue;
                }
                for &id in incidence.corners.row(cell as usize) {
                    let seen = &mut self.seen_points[id as usize];
                    if std::mem::replace(seen, stamp) != stamp && self.ids.len() < MOST {
                        self.ids.push(id);
                    }
                }
            }
        }
    }

    /// The cells of `point`, and those of its neighbours.
    pub(super) fn cells(
        &mut self,
        mesh: &Mesh,
        incidence: &Incidence,
        moments: &CellMoments,
        point: usize,
    ) {
        self.start(mesh, incidence, point);
        let stamp = point as u32;
        let centre = incidence.same[point] as usize;
        self.ids.clear();
        let mut ring = std::mem::take(&mut self.ring);
        ring.clear();
        ring.push(centre as u32);
        let mut first = 0;
        for step in 1..=MOST_STEPS {
            let last = ring.len();
            for i in first..last {
                for &cell in incidence.cells.row(ring[i] as usize) {
                    if std::mem::replace(&mut self.seen_cells[cell as usize], stamp) == stamp {
                        continue;
                    }
                    if moments.is_sound(cell as usize) && self.ids.len() < MOST {
                        self.ids.push(cell);
                    }
                    for &id in incidence.corners.row(cell as usize) {
                        let seen = &mut self.seen_points[id as usize];
                        if std::mem::replace(seen, stamp) != stamp {
                            ring.push(id);
                        }
                    }
                }
            }
            first = last;
            if step == 1 {
                self.near = self.ids.len();
            } else if self.ids.len() >= ENOUGH {
                break;
            }
        }
        self.ring = ring;
    }

    /// Whether the points within one step lie on one side, in any measure of distance.
    fn is_one_sided(&self, distance: impl Fn(u32) -> DVec3) -> bool {
        let (mut mean, mut square) = (DVec3::ZERO, DMat3::ZERO);
        for &id in &self.ids[..self.near] {
            let d = distance(id);
            mean += d;
            square += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        let n = self.near.max(1) as f64;
        // In a plane or on a line, no distance is not on one side.
        let trace = square.x_axis.x + square.y_axis.y + square.z_axis.z;
        let square = square + DMat3::from_diagonal(DVec3::splat(1e-9 * trace));
        mean.dot(square.inverse() * mean) / n > ONE_SIDED
    }

    /// The mean square of the distances along and across the axes, of those within one step: xx,
    /// xy, xz, yy, yz, zz. `own` is the part of a cell itself.
    pub(super) fn spread(
        &self,
        distance: impl Fn(u32) -> DVec3,
        own: impl Fn(u32) -> [f64; 6],
    ) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for &id in &self.ids[..self.near] {
            let d = distance(id);
            let products = [d.x * d.x, d.x * d.y, d.x * d.z, d.y * d.y, d.y * d.z, d.z * d.z];
            for ((s, p), own) in sum.iter_mut().zip(products).zip(own(id)) {
                *s += p + own;
            }
        }
        sum.map(|s| s / self.near.max(1) as f64)
    }
}
