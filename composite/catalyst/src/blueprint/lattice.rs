//! Uniform points with one array, where the simulation has it.

use super::{BlueprintError, Domain, Field, coordset, fields};
use crate::node::{Numbers, Scalar};
use rt_core::glam::DVec3;

/// One array on the points of a uniform lattice, or at the centres of its cells.
#[derive(Debug, Clone)]
pub struct Lattice<'a> {
    /// Values per axis.
    pub dims: [usize; 3],
    /// Position of the first value.
    pub origin: DVec3,
    /// Distance of neighbouring values.
    pub spacing: DVec3,
    /// Whether values are those of cells.
    pub of_cells: bool,
    field: Field<'a>,
    component: Option<usize>,
}

impl<'a> Lattice<'a> {
    /// The array `name` (see [`Field::find`]) on a topology of a domain; `None` for a domain
    /// without topologies.
    ///
    /// # Errors
    /// Points that are not uniform, and arrays that are not there.
    pub fn of(
        domain: &Domain<'_, 'a>,
        topology: Option<&str>,
        name: &str,
    ) -> Result<Option<Lattice<'a>>, BlueprintError> {
        let Some(topology) = domain.topology(topology)? else { return Ok(None) };
        let (path, node) = domain.coordset(topology)?;
        let kind = coordset::kind(&path, node)?;
        if kind != "uniform" {
            let cure = "volumes and photographs need `uniform` points";
            return Err(BlueprintError::unsupported(&format!("{path}/type"), kind, cure));
        }
        let points = coordset::uniform(&path, node)?;
        let fields = fields(domain, topology.0, &mut Vec::new());
        let Some((field, component)) = Field::find(&fields, name) else {
            let names: Vec<&str> = fields.iter().map(|f| f.name.as_str()).collect();
            let what = format!("an array (there are: {})", names.join(", "));
            return Err(BlueprintError::missing(&format!("{}/fields/{name}", domain.path), what));
        };
        let mut lattice = Lattice {
            dims: points.dims,
            origin: points.origin,
            spacing: points.spacing,
            of_cells: !field.per_point,
            field: field.clone(),
            component,
        };
        if lattice.of_cells {
            for axis in 0..3 {
                if lattice.dims[axis] > 1 {
                    lattice.dims[axis] -= 1;
                    lattice.origin[axis] += 0.5 * lattice.spacing[axis];
                }
            }
        }
        let count = lattice.dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
        let found = field.components[0].len();
        if count != Some(found) {
            let [i, j, k] = lattice.dims;
            let reason = format!("{found} numbers, but {i} x {j} x {k} belong there");
            let at = format!("{}/fields/{}", domain.path, field.name);
            return Err(BlueprintError::inconsistent(&at, reason));
        }
        Ok(Some(lattice))
    }

    /// All values as a slice, x fastest, if they are of this type, of one component, without gaps
    /// and aligned.
    pub fn as_slice<T: Scalar>(&self) -> Option<&'a [T]> {
        self.field.components.get(self.component?).and_then(Numbers::as_slice)
    }

    /// The value at `at`. Panics when out of range.
    #[inline]
    pub fn value(&self, at: [usize; 3]) -> f64 {
        let i = at[0] + self.dims[0] * (at[1] + self.dims[1] * at[2]);
        self.field.value(self.component, i)
    }

    /// All values, x fastest.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        (0..self.dims.iter().product()).map(|i| self.field.value(self.component, i))
    }
}
