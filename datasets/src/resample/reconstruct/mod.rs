//! Smooth values between the points of a mesh.
//!
//! The finite elements of a mesh are linear along its edges, so their gradients jump from cell to
//! cell. Light is bent by gradients: a lattice finer than the mesh would show the cells. Here, each
//! point gets a polynomial of up to third degree, fitted by weighted least squares to the values
//! around it ([`expansion`]; [`quartic`] keeps fourth derivatives out of it), and the value at a
//! place in a cell is the mean of the polynomials of the cell's corners, weighted by their shares
//! ([`super::shape`]). This is a partition of unity (Melenk and Babuška, "The partition of unity
//! finite element method", 1996). With factors for the terms of each degree ([`factors`]) it is
//! continuous, exact for fields of fourth degree, and with an error of fifth order in the size of
//! the cells (fourth order for gradients) where the field is smooth. With the plain mean of cubic
//! fits, schlieren's test `a_bell_at_scattered_points_gives_its_deflections` had errors of 3e-3 of
//! the largest deflection.
//!
//! Where no polynomial fits, as at shocks, the mesh does not tell where in a cell the field
//! changes. Slopes and curvature of a cubic B-spline with the values as its coefficients take the
//! polynomial's place. They hardly make new extrema, and gradients have no steps at faces: a shock
//! that crosses the lines of a grid obliquely has no stairs.
//!
//! Values of cells are taken as what solvers of finite volumes mean by them, averages over the
//! cells: the averages of the polynomials are fitted to them ([`cell_moments`]).

mod cell_moments;
mod counts;
mod expansion;
mod least_squares;
mod neighbours;
mod polynomial;
mod quartic;
mod sample;

pub(super) use expansion::{CAUTION, Expansion, FACTOR_FALL, Parts, UNRESOLVED, factors};
pub(super) use polynomial::TERMS;

use super::mesh::{Mesh, Shape};
use super::shape::Shares;
use cell_moments::CellMoments;
use expansion::Fit;
use glam::DVec3;
use neighbours::{Incidence, Neighbourhood};
use rayon::prelude::*;

/// How values between the points of a mesh are computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reconstruction {
    /// By the linear, bilinear and trilinear functions of the cells. Gradients jump at the faces.
    Linear,
    /// By polynomials of third degree, or a B-spline where none fits. Needs about 130 bytes
    /// for each point of the mesh.
    #[default]
    Cubic,
}

impl Reconstruction {
    /// All ways, from the cheapest.
    pub const ALL: [Reconstruction; 2] = [Reconstruction::Linear, Reconstruction::Cubic];

    /// Its name in options.
    pub fn name(self) -> &'static str {
        match self {
            Reconstruction::Linear => "linear",
            Reconstruction::Cubic => "cubic",
        }
    }
}

/// Whether a mesh is half a plane of an axisymmetric flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Symmetry {
    None,
    /// y is the radius: cells are rings about a body.
    Rings,
    /// As these, and the flow reaches the axis y = 0.
    Axis,
}

/// Values everywhere in a mesh.
pub(super) struct PointField<'a> {
    values: &'a [f64],
    /// One for each point; none for [`Reconstruction::Linear`].
    expansions: Vec<Expansion>,
    /// Whether all cells are hexahedra.
    hexahedra: bool,
}

/// How well the polynomials fit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FitQuality {
    /// Points whose polynomial fits.
    pub fitted: usize,
    /// Points where the polynomial is faded out, wholly or in part: shocks, noise, features of the
    /// size of the cells.
    pub limited: usize,
    /// Points with too few neighbours for a polynomial of second degree.
    pub few_neighbours: usize,
    /// Root mean square over the cells of the difference of their corners' polynomials in the
    /// middle of the cell, in the unit of the values: an estimate of the error of the mesh itself.
    pub rms_difference: f64,
    /// Largest such difference.
    pub max_difference: f64,
}

impl<'a> PointField<'a> {
    /// The elements' own interpolation of values at points.
    pub(super) fn linear(values: &'a [f64]) -> PointField<'a> {
        PointField { values, expansions: vec![], hexahedra: false }
    }

    /// Fits polynomials to values at points.
    pub(super) fn of_points(mesh: &Mesh, values: &'a [f64], symmetry: Symmetry) -> PointField<'a> {
        let incidence = Incidence::of(mesh, None);
        let fit = |point: usize, around: &mut Neighbourhood, fit: &mut Fit| {
            around.points(mesh, &incidence, point);
            fit.over_points(mesh, values, point, around, symmetry)
        };
        PointField { values, expansions: fitted(mesh, fit), hexahedra: only_hexahedra(mesh) }
    }

    /// Fits polynomials to averages over cells. `values` are the means at the points, which remain
    /// where no polynomial fits.
    pub(super) fn of_cells(
        mesh: &Mesh,
        cells: &[f64],
        values: &'a [f64],
        symmetry: Symmetry,
    ) -> PointField<'a> {
        let incidence = Incidence::of(mesh, Some(cells));
        let moments = CellMoments::of(mesh, symmetry);
        let fit = |point: usize, around: &mut Neighbourhood, fit: &mut Fit| {
            around.cells(mesh, &incidence, &moments, point);
            fit.over_cells(mesh, cells, &moments, values[point], point, around, symmetry)
        };
        PointField { values, expansions: fitted(mesh, fit), hexahedra: only_hexahedra(mesh) }
    }

    /// Whether there are no polynomials.
    pub(super) fn is_linear(&self) -> bool {
        self.expansions.is_empty()
    }

    /// The polynomials alone, and the shares that join those of limited points.
    pub(super) fn into_parts(self) -> (Vec<Expansion>, Shares) {
        let shares = if self.hexahedra { Shares::Smooth } else { Shares::OfElement };
        (self.expansions, shares)
    }

    /// The shares of a cell's corners: without slope across its faces where polynomials disagree.
    pub(super) fn shares(&self, corners: &[u32]) -> Shares {
        match self.hexahedra && corners.iter().any(|&id| self.expansions[id as usize].is_limited())
        {
            true => Shares::Smooth,
            false => Shares::OfElement,
        }
    }

    /// The value at `p` in the cell with these corners, from their shares there, and an
    /// estimate of its error: how much less accurate means of the same polynomials differ.
    pub(super) fn at(&self, mesh: &Mesh, corners: &[u32], weights: &[f64], p: DVec3) -> [f64; 2] {
        let is_whole = |id: u32| self.expansions.get(id as usize).is_some_and(Expansion::is_whole);
        let whole = match self.shares(corners) {
            Shares::Smooth => 0.0,
            Shares::OfElement => {
                let whole = corners.iter().zip(weights).filter(|(id, _)| is_whole(**id));
                whole.map(|(_, w)| w).sum::<f64>()
            }
        };
        let factors = factors(whole);
        let mut sum = [0.0; 2];
        for (&id, &weight) in corners.iter().zip(weights) {
            // 0 · NaN is NaN: a corner without weight must not affect the value.
            if weight != 0.0 {
                let (id, value) = (id as usize, self.values[id as usize]);
                let Some(expansion) = self.expansions.get(id) else {
                    sum[0] += weight * value;
                    continue;
                };
                let d = p - mesh.point(id);
                let change = expansion.change(d, factors);
                sum[0] += weight * (value + change);
                sum[1] += weight
                    * match expansion.is_whole() {
                        true => CAUTION * (expansion.change(d, [1.0; 3]) - change),
                        false => UNRESOLVED * change,
                    };
            }
        }
        sum
    }

    #[inline]
    fn of_corner(&self, mesh: &Mesh, id: usize, p: DVec3) -> f64 {
        match self.expansions.get(id) {
            Some(expansion) => expansion.at(self.values[id], p - mesh.point(id)),
            None => self.values[id],
        }
    }

    /// How well the polynomials fit; nothing without polynomials.
    pub(super) fn quality(&self, mesh: &Mesh) -> FitQuality {
        let mut quality = FitQuality::default();
        for expansion in &self.expansions {
            match expansion.state() {
                expansion::State::Fitted => quality.fitted += 1,
                expansion::State::Limited => quality.limited += 1,
                expansion::State::FewNeighbours => quality.few_neighbours += 1,
                expansion::State::NoValue => {}
            }
        }
        if self.expansions.is_empty() {
            return quality;
        }
        let difference = |cell: usize| {
            let middle = mesh.cell_centre(cell);
            let ids = mesh.corners(cell).ids;
            let values = ids.iter().map(|&id| self.of_corner(mesh, id as usize, middle));
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let fits = ids.iter().all(|&id| self.expansions[id as usize].is_whole());
            Some(high - low).filter(|d| fits && d.is_finite() && !mesh.is_hidden(cell))
        };
        // In pieces of a fixed size, so that the sum does not depend on the number of threads.
        const PIECE: usize = 1 << 14;
        let pieces: Vec<(f64, f64, usize)> = (0..mesh.num_cells().div_ceil(PIECE))
            .into_par_iter()
            .map(|piece| {
                let cells = piece * PIECE..mesh.num_cells().min((piece + 1) * PIECE);
                cells
                    .filter_map(difference)
                    .fold((0.0, 0.0f64, 0), |(sum, most, n), d| (sum + d * d, most.max(d), n + 1))
            })
            .collect();
        let count: usize = pieces.iter().map(|p| p.2).sum();
        quality.rms_difference =
            (pieces.iter().map(|p| p.0).sum::<f64>() / count.max(1) as f64).sqrt();
        quality.max_difference = pieces.iter().map(|p| p.1).fold(0.0, f64::max);
        quality
    }
}

fn only_hexahedra(mesh: &Mesh) -> bool {
    (0..mesh.num_cells()).into_par_iter().all(|cell| mesh.corners(cell).shape == Shape::Hexa)
}

/// One expansion for each point, with scratch memory for each thread.
fn fitted(
    mesh: &Mesh,
    fit: impl Fn(usize, &mut Neighbourhood, &mut Fit) -> Expansion + Sync,
) -> Vec<Expansion> {
    let scratch = || (Neighbourhood::default(), Fit::default());
    (0..mesh.num_points())
        .into_par_iter()
        .with_min_len(256)
        .map_init(scratch, |(around, fitter), point| fit(point, around, fitter))
        .collect()
}

#[cfg(test)]
mod tests;
