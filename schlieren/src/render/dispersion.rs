//! How differently the gas bends the light of each wavelength.

use super::TestSection;
use crate::field::Field;
use crate::gas_on_cells::GasOnCells;

/// Nodes that are compared at most.
const NODES: usize = 1 << 16;

impl TestSection {
    /// Deflections and paths of the light of each wavelength, relative to those of the first: for
    /// lattices the best factor between their values in the sense of least squares, for cells the
    /// factor between the reference media.
    #[must_use]
    pub fn dispersion(&self) -> Vec<f64> {
        match (&self.fields[..], &self.cells[..]) {
            ([first, ..], _) => self.fields.iter().map(|f| of_fields(first, f)).collect(),
            (_, [first, ..]) => self.cells.iter().map(|c| of_cells(first, c)).collect(),
            _ => Vec::new(),
        }
    }
}

fn of_fields(first: &Field, other: &Field) -> f64 {
    let every = first.eps().len().div_ceil(NODES).max(1);
    let (mut products, mut squares) = (0.0, 0.0);
    for (a, b) in first.eps().iter().zip(other.eps()).step_by(every) {
        let [a, b] = [a, b].map(|v| f64::from(*v));
        if (a * b).is_finite() {
            products += a * b;
            squares += a * a;
        }
    }
    if squares > 0.0 { products / squares } else { 1.0 }
}

fn of_cells(first: &GasOnCells, other: &GasOnCells) -> f64 {
    let of = |gas: &GasOnCells| gas.reference() / gas.n0();
    if of(first) == 0.0 { 1.0 } else { of(other) / of(first) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use glam::DVec3;

    #[test]
    fn a_gas_that_bends_blue_more_has_that_factor() {
        let field = |scale: f64| {
            let eps = |p: DVec3| 1e-5 * scale * (7.0 * p.x).sin() * p.y;
            Field::from_fn([40, 50, 60], [0.01; 3], DVec3::ZERO, 1.0003, eps).unwrap()
        };
        let scene = |nm: &str| {
            let toml =
                format!("[flow]\nfile = \"\"\ndensity = \"-\"\n[light]\nwavelengths_nm = {nm}");
            Scene::from_toml(&toml).unwrap()
        };
        let fields = vec![field(1.0), field(1.014), field(0.99)];
        let section =
            TestSection::of_fields(&scene("[650.0, 450.0, 700.0]"), fields, None).unwrap();
        for (found, wanted) in section.dispersion().into_iter().zip([1.0, 1.014, 0.99]) {
            assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
        }
        let still = TestSection::of_fields(&scene("[650.0]"), vec![field(0.0)], None).unwrap();
        assert_eq!(still.dispersion(), [1.0]);
    }
}
