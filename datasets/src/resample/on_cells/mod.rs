//! Values and their gradients anywhere in a mesh, cell by cell, without a lattice.
//!
//! ```text
//! cells ── faces: which cell lies behind ── tree of the faces at the border
//!   │                                              │
//!   └── prepared cell: planes, shares, polynomials ┴── walker: enter, sample, leave
//! ```
//! The value at a place is that of [`Reconstruction`]: the mean of the polynomials of the cell's
//! corners, weighted by the shape functions of the element, f = Σ Nᵢ pᵢ, with factors for the
//! terms of each degree. Its gradient is the exact one of this blend, Σ (Nᵢ ∇pᵢ + pᵢ ∇Nᵢ), and
//! where the factors change, a part along their gradient: an integral of the gradient along
//! neighbouring lines is the change of the integral of the value between them. The value is
//! continuous across faces. The gradient jumps there by the polynomials' differences by the size of
//! the cell: by its third power where the field is smooth. (The faces of the shape functions of
//! hexahedra are bent smoothly, and lines leave bent faces through triangles. Between the two, the
//! value differs by the jump of the gradient times their distance.)
//!
//! A line goes from cell to cell over their faces ([`CellWalker`]). Cells of all types have the
//! same faces: polygons, which are fans of triangles around their middles unless they are plane, so
//! that neighbours of different types leave no gap. Where the faces of two blocks do not match, the
//! line leaves one at its border and enters the other at its own.

mod beside_hidden;
mod blend;
mod bodies;
mod border;
mod cell;
mod shares;
#[cfg(test)]
mod tests;
mod trilinear;
mod walker;

pub use walker::{Beyond, CellWalker, Entry};

use super::mesh::{Mesh, Neighbours, Topology};
use super::reconstruct::{Expansion, FitQuality, PointField, Reconstruction, Symmetry};
use super::shape::Shares;
use super::walls::Walls;
use super::{ResampleError, Samples};
use blend::Mean;
use bodies::Bodies;
use border::Border;
use cell::Form;
use glam::DVec3;
use rayon::prelude::*;

/// What a cell holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Values.
    Gas,
    /// No value, or not a finite one at a corner.
    NoValue,
    /// Hidden by the solver.
    Hidden,
    /// No volume or no finite place: it is left out.
    LeftOut,
}

/// Values and gradients in the cells of a mesh.
///
/// ```
/// use datasets::model::{Dataset, ImageData};
/// use datasets::resample::{Beyond, CellField, Mesh, Reconstruction, Samples};
/// use glam::DVec3;
///
/// // Four cells along each axis, and the value x² at their corners.
/// let image = ImageData::new([5, 5, 5], DVec3::ZERO, DVec3::splat(0.25));
/// let mesh = Mesh::new(&Dataset::ImageData(image))?;
/// let values: Vec<f64> = (0..mesh.num_points()).map(|i| mesh.point(i).x.powi(2)).collect();
/// let field = CellField::new(mesh, Samples::Points(&values), Reconstruction::Cubic)?;
///
/// // A line along x crosses four cells. The integral of the slope is the change of the value.
/// let (mut walker, mut sum) = (field.walker(), 0.0);
/// let start = DVec3::new(-1.0, 0.3, 0.6);
/// let entry = walker.enter(start, DVec3::X, 10.0, 0.0).expect("the line meets the mesh");
/// let (mut at, mut from) = (start + DVec3::X * entry.distance, Beyond::Outside);
/// let mut place = Beyond::Cell(entry.cell);
/// while let Beyond::Cell(cell) = place {
///     let (length, beyond) = walker.leave(cell, at, DVec3::X, from).expect("a way out");
///     let (_, gradient) = walker.sample(cell, at + DVec3::X * (0.5 * length));
///     sum += gradient.x * length;
///     at += DVec3::X * length;
///     (from, place) = (place, beyond);
/// }
/// assert!((sum - 1.0).abs() < 1e-6 && (at.x - 1.0).abs() < 1e-12);
/// # Ok::<(), datasets::resample::ResampleError>(())
/// ```
pub struct CellField {
    mesh: Mesh,
    /// One for each point.
    values: Vec<f64>,
    /// One for each point; none for [`Reconstruction::Linear`].
    expansions: Vec<Expansion>,
    /// Those of cells with limited points.
    shares: Shares,
    kinds: Vec<Kind>,
    forms: Vec<Form>,
    neighbours: Neighbours,
    border: Border,
    /// The faces of hidden cells at the border of the mesh.
    hidden: Border,
    bodies: Option<Bodies>,
    report: CellReport,
}

/// The cells of a [`CellField`], and what was repaired or left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct CellReport {
    /// Cells that light can be traced through: with values.
    pub cells: usize,
    /// Cells without a value, or with one that is not finite at a corner.
    pub without_value: usize,
    /// Cells hidden by the solver.
    pub hidden: usize,
    /// Solid cells left out, because they have no volume or corners that are not finite, and cells
    /// that are not solid.
    pub left_out: usize,
    /// Cells whose map folds, with the shares of tetrahedra between their middle and their faces.
    pub folded: usize,
    /// Higher-order cells with straight edges.
    pub straightened: usize,
    /// Faces that more than two cells have, which are taken as borders.
    pub crowded_faces: usize,
    /// Faces at the border of the mesh, holes and hidden cells included.
    pub border_faces: usize,
    /// Volume of the cells with values as a part of that of the mesh's box.
    pub filled: f64,
    /// How well polynomials fit the values of the mesh.
    pub fit: FitQuality,
}

impl CellReport {
    /// Warnings for the user, as sentences; empty when there are none.
    pub fn warnings(&self) -> Vec<String> {
        let all = [
            (
                self.left_out,
                "cells left out: not solid, without volume, or with points that do not exist or \
                 are not finite",
            ),
            (self.straightened, "higher-order cells taken with straight edges"),
            (self.folded, "cells fold or collapse and have the shape functions of tetrahedra"),
            (self.crowded_faces, "faces belong to more than two cells and are taken as borders"),
            (self.without_value, "cells have no finite value and are blank"),
        ];
        all.iter().filter(|(n, _)| *n > 0).map(|(n, text)| format!("{n} {text}")).collect()
    }
}

impl CellField {
    /// The values of a mesh, and what gradients need. The result does not depend on the number of
    /// threads.
    ///
    /// # Errors
    /// If the number of values is not that of the points or cells, or no cell has values.
    pub fn new(
        mesh: Mesh,
        samples: Samples<'_>,
        reconstruction: Reconstruction,
    ) -> Result<CellField, ResampleError> {
        CellField::with_walls(mesh, samples, reconstruction, &Walls::default())
    }

    /// As [`CellField::new`], for a mesh whose walls are known: behind them lines meet
    /// [`Beyond::Wall`], and [`CellWalker::passes_body`] knows the bodies. Walls of another mesh
    /// are none.
    ///
    /// # Errors
    /// As [`CellField::new`].
    pub fn with_walls(
        mut mesh: Mesh,
        samples: Samples<'_>,
        reconstruction: Reconstruction,
        walls: &Walls,
    ) -> Result<CellField, ResampleError> {
        super::check_count(&mesh, samples)?;
        let averaged;
        let (values, of_cells) = match samples {
            Samples::Points(v) => (v, None),
            Samples::Cells(v) => {
                averaged = mesh.cells_to_points(v);
                (averaged.as_slice(), Some(v))
            }
        };
        let field = match (reconstruction, of_cells) {
            (Reconstruction::Linear, _) => PointField::linear(values),
            (Reconstruction::Cubic, None) => PointField::of_points(&mesh, values, Symmetry::None),
            (Reconstruction::Cubic, Some(cells)) => {
                PointField::of_cells(&mesh, cells, values, Symmetry::None)
            }
        };
        let fit = field.quality(&mesh);
        let (expansions, shares) = field.into_parts();
        let has_value = |cell: usize, ids: &[u32]| {
            of_cells.is_none_or(|v| v[cell].is_finite())
                && ids.iter().all(|&id| values[id as usize].is_finite())
        };
        let Topology { volumes, mut neighbours } = mesh.take_topology();
        let kind_and_form = |cell: usize| {
            let corners = mesh.corners(cell);
            let kind = match volumes[cell] {
                0.0 => Kind::LeftOut,
                _ if mesh.is_hidden(cell) => Kind::Hidden,
                _ if has_value(cell, &corners.ids) => Kind::Gas,
                _ => Kind::NoValue,
            };
            let beyond = neighbours.of_cell(cell);
            let form = if kind == Kind::LeftOut {
                Form::default()
            } else {
                Form::of(&mesh, &corners, beyond)
            };
            (kind, form)
        };
        let (kinds, forms): (Vec<Kind>, Vec<Form>) =
            (0..mesh.num_cells()).into_par_iter().map(kind_and_form).unzip();
        let folded = kinds.iter().zip(&forms).filter(|(k, f)| **k == Kind::Gas && f.folded).count();
        let of = |kind: Kind| kinds.iter().filter(|k| **k == kind).count();
        let cells = of(Kind::Gas);
        if cells == 0 {
            return Err(ResampleError::NoVolume {
                kind: "mesh",
                found: format!("{} cells without values", mesh.num_cells()),
                cure: "check that the arrays hold finite numbers and the cells have volume",
            });
        }
        neighbours.mark_walls(walls.of_cells());
        neighbours.mark_baffles(walls.cells_at_baffles());
        mesh.insert_baffles(walls.cells_at_baffles());
        let border = Border::of_gas(&mesh, &neighbours, &kinds);
        let hidden = Border::of_hidden(&mesh, &neighbours, &kinds);
        let bodies = Bodies::of(&mesh, walls);
        let (low, high) = mesh.bounds();
        let of_gas = volumes.iter().zip(&kinds).filter(|(_, kind)| **kind == Kind::Gas);
        let volume: f64 = of_gas.map(|(volume, _)| volume).sum();
        let report = CellReport {
            cells,
            without_value: of(Kind::NoValue),
            hidden: of(Kind::Hidden),
            left_out: mesh.left_out() + of(Kind::LeftOut),
            folded,
            straightened: mesh.higher_order(),
            crowded_faces: neighbours.crowded(),
            border_faces: border.len(),
            filled: volume / (high - low).element_product(),
            fit,
        };
        let values = values.to_vec();
        Ok(CellField {
            mesh,
            values,
            expansions,
            shares,
            kinds,
            forms,
            neighbours,
            border,
            hidden,
            bodies,
            report,
        })
    }

    /// What the cells are, and what was repaired.
    pub fn report(&self) -> &CellReport {
        &self.report
    }

    /// Whether values between the points are those of polynomials.
    pub fn has_polynomials(&self) -> bool {
        !self.expansions.is_empty()
    }

    /// Bounding box of all points.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.mesh.bounds()
    }

    /// Number of solid cells.
    pub fn num_cells(&self) -> usize {
        self.mesh.num_cells()
    }

    /// Side of a cube with the volume of a typical cell's box, as [`Mesh::typical_cell`].
    pub fn typical_cell(&self) -> f64 {
        self.mesh.typical_cell()
    }

    /// A walker, which one thread uses for many lines.
    pub fn walker(&self) -> CellWalker<'_> {
        CellWalker::new(self, Mean::Exact)
    }

    /// A walker whose values differ from those of [`CellField::walker`] by the error that the mesh
    /// itself makes, about: by what means of the same polynomials differ. See
    /// [`super::ResampledField::truncation`].
    pub fn walker_for_error_estimate(&self) -> CellWalker<'_> {
        CellWalker::new(self, Mean::Doubted)
    }

    /// The median of the values on those faces of the border that lie in the sides of the mesh's
    /// box, each weighted by its area. `None` when no face with values does.
    pub fn border_median(&self) -> Option<f64> {
        let (low, high) = self.bounds();
        let near = 1e-5 * (high - low);
        let mut faces = Vec::new();
        for face in 0..self.border.len() {
            let (cell, ring) = self.border.face(face);
            if self.kinds[cell as usize] != Kind::Gas {
                continue;
            }
            let at = |i: u32| self.mesh.point(i as usize);
            let on_side = (0..3).any(|a| {
                ring.iter().all(|&i| (at(i)[a] - low[a]).abs() <= near[a])
                    || ring.iter().all(|&i| (at(i)[a] - high[a]).abs() <= near[a])
            });
            if on_side {
                let sum: f64 = ring.iter().map(|&i| self.values[i as usize]).sum();
                let area = (2..ring.len())
                    .map(|k| {
                        let [a, b, c] = [ring[0], ring[k - 1], ring[k]].map(at);
                        (b - a).cross(c - a)
                    })
                    .sum::<DVec3>();
                faces.push((sum / ring.len() as f64, area.length()));
            }
        }
        weighted_median(faces)
    }

    /// The median of the values of all cells, each the mean of its corners' values, weighted by its
    /// volume.
    pub fn median(&self) -> Option<f64> {
        let of_cell = |cell: usize| {
            let corners = self.mesh.corners(cell);
            let sum: f64 = corners.ids.iter().map(|&i| self.values[i as usize]).sum();
            (sum / corners.ids.len() as f64, self.mesh.volume(&corners))
        };
        let gas = (0..self.mesh.num_cells()).into_par_iter();
        weighted_median(gas.filter(|&c| self.kinds[c] == Kind::Gas).map(of_cell).collect())
    }

    /// The largest finite value at the points of cells with values.
    pub fn largest(&self) -> f64 {
        let gas = (0..self.mesh.num_cells()).filter(|&c| self.kinds[c] == Kind::Gas);
        gas.flat_map(|c| self.mesh.corners(c).ids)
            .map(|i| self.values[i as usize])
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

/// The value with half of the weight below it.
fn weighted_median(mut pairs: Vec<(f64, f64)>) -> Option<f64> {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * pairs.iter().map(|p| p.1).sum::<f64>();
    let mut below = 0.0;
    let middle = pairs.iter().find(|p| {
        below += p.1;
        below >= half
    });
    middle.or(pairs.last()).map(|p| p.0)
}
