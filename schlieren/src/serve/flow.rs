//! Keeps the data of a flow in memory, and makes fields from it whenever wavelengths or transfer
//! functions change.

use crate::field::{Field, Node};
use crate::input::{InputError, cells_from_dataset, from_dataset};
use crate::render::{RenderError, TestSection};
use crate::scene::Scene;
use crate::solids::Solids;
use datasets::model::Dataset;
use datasets::read::OpenOptions;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// An array of the file that can have a transfer function.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrayInfo {
    /// Name of the array.
    pub name: String,
    /// Smallest and largest finite value, of the magnitude for vectors.
    pub range: [f64; 2],
}

/// The data of a file.
pub(super) struct Flow {
    /// Path of the file.
    pub(super) file: PathBuf,
    data: Dataset,
    warnings: Vec<String>,
}

impl Flow {
    /// Reads a file; of a collection, the first time.
    pub(super) fn open(path: &Path, open: &OpenOptions) -> Result<Flow, InputError> {
        let file = path.to_path_buf();
        let (data, warnings) = crate::input::dataset(path, open)?;
        Ok(Flow { data, warnings, file })
    }

    /// Arrays of points and cells that are not constant, sorted by name.
    pub(super) fn arrays(&self) -> Vec<ArrayInfo> {
        let mut found: BTreeMap<String, [f64; 2]> = BTreeMap::new();
        let leaves = self.data.leaves();
        for a in leaves.iter().filter_map(|l| l.attributes()) {
            for array in a.point.iter().chain(&a.cell).filter(|a| !a.name.starts_with("vtk")) {
                // Vectors count by their magnitude, as when an array of the medium is read.
                let range = if array.components == 1 {
                    array.range().map(|r| [r.0, r.1])
                } else {
                    let sizes =
                        (0..array.tuples()).map(|i| array.magnitude(i)).filter(|m| m.is_finite());
                    let nothing = [f64::INFINITY, f64::NEG_INFINITY];
                    Some(sizes.fold(nothing, |[l, h], m| [l.min(m), h.max(m)]))
                };
                if let Some([low, high]) = range.filter(|r| r[0] < r[1]) {
                    let r = found.entry(array.name.clone()).or_insert([low, high]);
                    *r = [r[0].min(low), r[1].max(high)];
                }
            }
        }
        found.into_iter().map(|(name, range)| ArrayInfo { name, range }).collect()
    }

    /// n0 - 1 around this flow for the scene's first wavelength, to which all times of a series are
    /// relative.
    pub(super) fn reference_n_minus_1(&self, scene: &Scene) -> Result<f64, RenderError> {
        let options = scene.flow.options(scene.light.wavelengths_nm[0])?;
        let report = if scene.flow.on_cells {
            cells_from_dataset(&self.data, &options).map(|loaded| loaded.1)
        } else {
            from_dataset(&self.data, &options).map(|loaded| loaded.report)
        };
        Ok(report.map_err(|e| self.in_file(e))?.reference_n_minus_1)
    }

    fn in_file(&self, error: InputError) -> InputError {
        InputError::InFile { path: self.file.clone(), source: Box::new(error) }
    }

    /// The test section for a scene. `solids` are those of the previous test section, because a
    /// page cannot change them.
    pub(super) fn section(
        &self,
        scene: &Scene,
        solids: Option<Solids>,
    ) -> Result<TestSection, RenderError> {
        let of_input = |e: RenderError| match e {
            RenderError::Input(e) => RenderError::Input(self.in_file(e)),
            other => other,
        };
        let made = TestSection::of_gas_in(scene, &self.data, solids);
        let mut section = made.map_err(of_input)?;
        section.warnings.splice(0..0, self.warnings.iter().cloned());
        Ok(section)
    }
}

/// Largest number of nodes of a field that is rendered during an interaction.
const COARSE_NODES: usize = 1 << 18;

/// The field with every n-th node along each axis, small enough to be rendered during an
/// interaction. `None` when the field is already that small or would become too thin.
pub(super) fn coarse(field: &Field) -> Option<Field> {
    let d = field.dims();
    let kept = |every: usize| d.map(|n| (n - 1) / every + 1);
    let every = (1..).find(|e| kept(*e).iter().product::<usize>() <= COARSE_NODES)?;
    let dims = kept(every);
    // Interpolants need a few nodes along each axis.
    if every == 1 || dims.iter().any(|n| *n < 4) {
        return None;
    }
    let count = dims.iter().product();
    let from = |i: usize| {
        let [x, y, z] =
            [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])].map(|c| c * every);
        x + d[0] * (y + d[1] * z)
    };
    let eps = (0..count).map(|i| field.eps()[from(i)]).collect();
    let nodes = field.nodes().map(|n: &[Node]| (0..count).map(|i| n[from(i)]).collect());
    // Stretched so that its last node coincides with the full field's: the image must not jump when
    // it is refined.
    let spacing_m =
        [0, 1, 2].map(|c| field.spacing_m()[c] * (d[c] - 1) as f64 / (dims[c] - 1) as f64);
    Field::new(dims, spacing_m, field.origin_m(), eps, field.n0(), nodes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_coarse_field_fills_the_same_box() {
        let f =
            Field::from_fn([130, 129, 70], [1e-3; 3], DVec3::splat(0.5), 1.0003, |p| 1e-5 * p.x)
                .unwrap();
        let c = coarse(&f).unwrap();
        assert!(c.dims().iter().product::<usize>() <= COARSE_NODES);
        assert!((c.size_m() - f.size_m()).length() < 1e-12 && c.origin_m() == f.origin_m());
        let small = Field::from_fn([20; 3], [1e-3; 3], DVec3::ZERO, 1.0, |_| 0.0).unwrap();
        assert!(coarse(&small).is_none());
    }
}
