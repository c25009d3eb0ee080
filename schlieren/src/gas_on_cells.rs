//! Describes the gas by the cells of a mesh, for marches that need no lattice.

use crate::field::Node;
use datasets::resample::CellField;
use glam::DVec3;
use std::sync::Arc;

/// The gas in the cells of a mesh, in metres: eps = n/n0 - 1 and its gradient at any place.
///
/// The field of light is the mesh's box. Solid and blank places in it beside the cells, and cells
/// that the solver hides, stop a ray. Through gas there it goes on straight, as through the
/// reference medium.
#[derive(Clone)]
pub struct GasOnCells {
    cells: Arc<CellField>,
    /// The value of the reference medium, in the unit of the cells' values.
    reference: f64,
    n0: f64,
    pub(crate) outside: Node,
    pub(crate) hidden: Node,
    pub(crate) walls: Node,
    at_rest: bool,
}

impl GasOnCells {
    /// The gas of a field of n − 1 in metres; a constant may be subtracted from it. `reference`
    /// is the value of the medium of index `n0` around it. `outside` and `hidden` are what is in
    /// the mesh's box beside the cells, and what hidden cells are.
    pub fn new(
        cells: CellField,
        reference: f64,
        n0: f64,
        outside: Node,
        hidden: Node,
    ) -> GasOnCells {
        let (cells, walls) = (Arc::new(cells), outside);
        GasOnCells { cells, reference, n0, outside, hidden, walls, at_rest: false }
    }

    /// The same gas, with this behind those faces of the border that are walls. It is what is
    /// outside by default.
    #[must_use]
    pub fn with_walls(self, walls: Node) -> GasOnCells {
        GasOnCells { walls, ..self }
    }

    /// The same cells, with the reference medium in all of them.
    #[must_use]
    pub fn at_rest(&self) -> GasOnCells {
        GasOnCells { at_rest: true, ..self.clone() }
    }

    /// Index of refraction of the reference medium.
    pub fn n0(&self) -> f64 {
        self.n0
    }

    /// n − 1 of the reference medium.
    pub(crate) fn reference(&self) -> f64 {
        self.reference
    }

    /// The cells.
    pub fn cells(&self) -> &CellField {
        &self.cells
    }

    /// Centre of the mesh's box.
    pub fn centre_m(&self) -> DVec3 {
        let (low, high) = self.cells.bounds();
        0.5 * (low + high)
    }

    /// Size of the mesh's box.
    pub fn size_m(&self) -> DVec3 {
        let (low, high) = self.cells.bounds();
        high - low
    }

    /// eps and its gradient per metre, from the value of the cells and its gradient.
    pub(crate) fn eps(&self, (value, gradient): (f64, DVec3)) -> (f64, DVec3) {
        if self.at_rest {
            // Cells without values stay blank.
            return (0.0 * value, 0.0 * gradient);
        }
        ((value - self.reference) / self.n0, gradient / self.n0)
    }
}
