//! The error of a resampling: samples the lattice back at the points where the mesh has its values.

use super::mesh::Mesh;
use super::rasterize::Counts;
use super::reconstruct::FitQuality;
use super::{Lattice, Mark, Samples};
use glam::DVec3;
use rayon::prelude::*;

/// Differences between the linearly interpolated lattice and the values of the mesh at its points
/// (or cell centres).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ResamplingError {
    /// Root mean square, in the unit of the values.
    pub rms: f64,
    /// Largest difference, in the unit of the values.
    pub max: f64,
    /// Position of the largest difference.
    pub max_at: DVec3,
    /// Largest minus smallest value at the compared points, as the scale for the differences.
    pub range: f64,
    /// Number of compared points.
    pub compared: usize,
    /// Number of points that could not be compared: next to nodes without value, outside the
    /// lattice, hidden or not finite.
    pub not_compared: usize,
}

/// Statistics of mesh and lattice.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Number of nodes with a value.
    pub inside: usize,
    /// Number of nodes outside all cells.
    pub outside: usize,
    /// Number of nodes in hidden cells.
    pub hidden: usize,
    /// Number of nodes in cells without finite values.
    pub not_finite: usize,
    /// Number of samples in gaps between cells, which get the value of the nearest cell.
    pub in_gaps: usize,
    /// Number of cells of the mesh.
    pub cells: usize,
    /// Number of cells that contain no sample because they are finer than the lattice; their values
    /// appear only through their neighbours.
    pub missed_cells: usize,
    /// Number of cells divided into tetrahedra because their map folds or collapses.
    pub folded_cells: usize,
    /// Number of cells left out: not solid, or with points that do not exist or are not finite.
    pub left_out_cells: usize,
    /// Number of higher-order cells treated as linear cells.
    pub straightened_cells: usize,
    /// Error of sampling the lattice back at the mesh.
    pub resampling_error: ResamplingError,
    /// How well polynomials fit the values of the mesh.
    pub fit: FitQuality,
}

impl Report {
    pub(super) fn new(
        mesh: &Mesh,
        marks: &[Mark],
        counts: Counts,
        resampling_error: ResamplingError,
    ) -> Self {
        let of = |m: Mark| marks.par_iter().filter(|x| **x == m).count();
        Report {
            inside: of(Mark::Inside),
            outside: of(Mark::Outside),
            hidden: of(Mark::Hidden),
            not_finite: of(Mark::NotFinite),
            in_gaps: counts.in_gaps,
            cells: mesh.num_cells(),
            missed_cells: counts.without_samples,
            folded_cells: counts.folded,
            left_out_cells: mesh.left_out() + counts.non_finite,
            straightened_cells: mesh.higher_order(),
            resampling_error,
            fit: FitQuality::default(),
        }
    }

    /// Warnings for the user, as sentences; empty when there are none.
    pub fn warnings(&self) -> Vec<String> {
        self.warnings_with_cure(
            "refine it, or average over more samples for each node (Options::samples_per_axis)",
        )
    }

    /// As [`Report::warnings`], where what helps against a lattice that is too coarse has other
    /// names.
    pub fn warnings_with_cure(&self, finer: &str) -> Vec<String> {
        let mut out = Vec::new();
        let mut warn = |n: usize, text: &str| {
            if n > 0 {
                out.push(format!("{n} {text}"));
            }
        };
        warn(
            self.left_out_cells,
            "cells left out: not solid, or with points that do not exist or are not finite",
        );
        warn(self.straightened_cells, "higher-order cells taken with straight edges");
        warn(self.folded_cells, "cells fold or collapse and were divided into tetrahedra");
        warn(self.not_finite, "nodes are in cells whose values are not finite");
        if 4 * self.missed_cells > self.cells {
            out.push(format!(
                "{} of {} cells are finer than the lattice; {finer}",
                self.missed_cells, self.cells
            ));
        }
        out
    }
}

/// Points compared in one task; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 1 << 14;

pub(super) fn resampling_error(
    mesh: &Mesh,
    samples: Samples<'_>,
    lattice: &Lattice,
    values: &[f32],
) -> ResamplingError {
    let of_mesh = match samples {
        Samples::Points(v) | Samples::Cells(v) => v,
    };
    let place = |i: usize| match samples {
        Samples::Points(_) => mesh.point(i),
        Samples::Cells(_) => mesh.cell_centre(i),
    };
    struct Part {
        squares: f64,
        worst: (f64, DVec3),
        range: (f64, f64),
        compared: usize,
    }
    let parts: Vec<Part> = of_mesh
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(c, chunk)| {
            let mut part = Part {
                squares: 0.0,
                worst: (0.0, DVec3::ZERO),
                range: (f64::INFINITY, f64::NEG_INFINITY),
                compared: 0,
            };
            for (i, &value) in chunk.iter().enumerate() {
                let p = place(c * CHUNK + i);
                let Some(got) = trilinear(lattice, values, p).filter(|_| value.is_finite()) else {
                    continue;
                };
                let error = (got - value).abs();
                part.squares += error * error;
                part.compared += 1;
                part.range = (part.range.0.min(value), part.range.1.max(value));
                if error > part.worst.0 {
                    part.worst = (error, p);
                }
            }
            part
        })
        .collect();
    let compared: usize = parts.iter().map(|p| p.compared).sum();
    let squares: f64 = parts.iter().map(|p| p.squares).sum();
    let low = parts.iter().fold(f64::INFINITY, |a, p| a.min(p.range.0));
    let high = parts.iter().fold(f64::NEG_INFINITY, |a, p| a.max(p.range.1));
    let worst =
        parts.iter().fold((0.0, DVec3::ZERO), |a, p| if p.worst.0 > a.0 { p.worst } else { a });
    ResamplingError {
        rms: (squares / compared.max(1) as f64).sqrt(),
        max: worst.0,
        max_at: worst.1,
        range: if compared > 0 { high - low } else { 0.0 },
        compared,
        not_compared: of_mesh.len() - compared,
    }
}

/// Linear interpolation. `None` outside the lattice, and where a node without value has a weight.
fn trilinear(lattice: &Lattice, values: &[f32], p: DVec3) -> Option<f64> {
    let mut cell = [0usize; 3];
    let mut t = [0.0f64; 3];
    for a in 0..3 {
        let x = (p[a] - lattice.origin[a]) / lattice.spacing[a];
        let last = (lattice.dims[a] - 1) as f64;
        // Up to rounding, points of the mesh can lie exactly on the border of the lattice.
        if !(x >= -1e-6 && x <= last + 1e-6) {
            return None;
        }
        let i = x.floor().clamp(0.0, last - 1.0);
        (cell[a], t[a]) = (i as usize, (x - i).clamp(0.0, 1.0));
    }
    let mut sum = 0.0;
    for corner in 0..8usize {
        let bit = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
        let weight: f64 = (0..3).map(|a| if bit[a] == 1 { t[a] } else { 1.0 - t[a] }).product();
        if weight > 0.0 {
            let at = [0, 1, 2].map(|a| cell[a] + bit[a]);
            let v = f64::from(values[at[0] + lattice.dims[0] * (at[1] + lattice.dims[1] * at[2])]);
            if !v.is_finite() {
                return None;
            }
            sum += weight * v;
        }
    }
    Some(sum)
}
