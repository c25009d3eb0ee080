//! How planes say that they are halves of axisymmetric flows.

use super::{Attributes, Dataset};

/// Name of the field data that axisymmetric planes have: texts that say which coordinate is which.
const AXISYMMETRIC: &str = "axisymmetric";

impl Attributes {
    /// Says that x runs along the axis of a flow and that y is the distance from it.
    pub(crate) fn set_axisymmetric(&mut self) {
        let texts = ["x along the axis", "y the radius"].map(String::from);
        self.text.push((AXISYMMETRIC.into(), texts.into()));
    }
}

impl Dataset {
    /// Whether the file says that it is a plane of an axisymmetric flow, with x along the axis and
    /// y the distance from it: a case of OpenFOAM between wedges, or a table with a radius.
    ///
    /// ```
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("jet.csv");
    /// std::fs::write(&path, "x,r,rho\n0,0,1\n1,0,2\n0,1,3\n2,2,4\n")?;
    /// assert!(datasets::read::open(&path)?.dataset()?.is_axisymmetric());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn is_axisymmetric(&self) -> bool {
        let says = |a: &Attributes| a.text.iter().any(|(name, _)| name == AXISYMMETRIC);
        self.leaves().into_iter().filter_map(Dataset::attributes).any(says)
    }
}
