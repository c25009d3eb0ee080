//! The result of the flow generators: fields with units on a uniform lattice, and the body in the
//! flow.

use crate::model::{DataArray, Dataset, ImageData, Values};
use glam::{DVec3, UVec3};
use rayon::prelude::*;
use rt_core::grid::Grid;
use rt_core::mesh::TriMesh;

/// A flow on a uniform lattice, in SI units.
///
/// A value is the mean over the box of one spacing around its point (over the part of it that is
/// not solid), not a sample at the point. With samples, shocks and surfaces between points would
/// become staircases, which are most visible in schlieren images because these show gradients.
/// Generators of smooth fields sample at points where both agree to within their own accuracy, and
/// say so.
#[derive(Debug, Clone, PartialEq)]
pub struct Flow {
    /// Points per axis.
    pub dims: UVec3,
    /// Position of point (0,0,0).
    pub origin_m: DVec3,
    /// Distance between points.
    pub spacing_m: DVec3,
    /// The fields; the first is the one that a schlieren image needs (density, or a refractive
    /// index).
    pub fields: Vec<Field>,
    /// The solid body, if any: closed, counter-clockwise from outside.
    pub body: Option<TriMesh>,
}

/// One quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// `density`, `temperature`, `pressure`, `Y_He` (mass fraction of a species), …; see [`names`].
    pub name: &'static str,
    /// Unit, such as "kg/m³"; "1" for ratios.
    pub unit: &'static str,
    /// One value per point, x fastest. NaN inside solids.
    pub values: Vec<f32>,
}

/// Field names, the same in all generators.
pub mod names {
    /// Density, kg/m³.
    pub const DENSITY: &str = "density";
    /// Temperature, K.
    pub const TEMPERATURE: &str = "temperature";
    /// Pressure, Pa.
    pub const PRESSURE: &str = "pressure";
    /// Mixture fraction: the share of the mass that came from the fuel stream.
    pub const MIXTURE_FRACTION: &str = "mixture_fraction";
    /// Refractive index, for sample fields that are not gases.
    pub const REFRACTIVE_INDEX: &str = "refractive_index";
    /// 1 in gas, 0 in the solid: the fraction of the box around the point that is gas.
    pub const GAS_FRACTION: &str = "gas_fraction";
}

/// Which fields a generator computes. Large flows take gigabytes, and a schlieren image of a single
/// gas needs only the density.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Fields {
    /// The first field only.
    Density,
    /// All fields that the generator supports.
    #[default]
    All,
}

/// Why a flow cannot be generated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlowError {
    /// Too few or too many lattice points.
    #[error("the lattice has {dims} points; each axis needs 4 to {most} points, and all together \
             at most 2³² points", most = MOST_POINTS)]
    Dims {
        /// The requested number.
        dims: UVec3,
    },
    /// No gas flow exists for these parameters.
    #[error(transparent)]
    Gas(#[from] super::gas_dynamics::GasError),
}

/// Maximum number of points along an axis.
const MOST_POINTS: u32 = 8192;

impl Flow {
    /// A lattice without fields over a box; the outermost points lie on the box's border.
    pub(crate) fn over(dims: UVec3, low_m: DVec3, high_m: DVec3) -> Result<Flow, FlowError> {
        let points = dims.as_u64vec3();
        let fits = dims.cmpge(UVec3::splat(4)).all() && dims.cmple(UVec3::splat(MOST_POINTS)).all();
        if !fits || points.x * points.y * points.z > 1 << 32 {
            return Err(FlowError::Dims { dims });
        }
        let spacing_m = (high_m - low_m) / (dims - 1).as_dvec3();
        Ok(Flow { dims, origin_m: low_m, spacing_m, fields: Vec::new(), body: None })
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.dims.x as usize * self.dims.y as usize * self.dims.z as usize
    }

    /// Position of a point.
    pub fn position_m(&self, i: u32, j: u32, k: u32) -> DVec3 {
        self.origin_m + self.spacing_m * DVec3::new(i as f64, j as f64, k as f64)
    }

    /// Position of the last point.
    pub fn high_m(&self) -> DVec3 {
        self.origin_m + self.spacing_m * (self.dims - 1).as_dvec3()
    }

    /// A field by name.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.name == name)
    }

    /// A field as a grid for rt-core (copies its values). `None` when there is no such field with a
    /// value at every point.
    pub fn grid(&self, name: &str) -> Option<Grid> {
        let values = self.field(name)?.values.clone();
        Grid::new(self.dims, self.origin_m, self.spacing_m, values).ok()
    }

    /// Converts the fields to VTK image data, to be written as `.vti`. The values are moved; the
    /// body is dropped.
    pub fn into_dataset(self) -> Dataset {
        let mut image = ImageData::new(self.dims.to_array(), self.origin_m, self.spacing_m);
        let arrays =
            self.fields.into_iter().map(|f| DataArray::new(f.name, 1, Values::F32(f.values)));
        image.attributes.point = arrays.collect();
        Dataset::ImageData(image)
    }

    /// Adds fields, computed one row (of constant y and z) at a time, in parallel over planes of
    /// constant z. The result does not depend on the number of threads. `row(scratch, j, k, rows)`
    /// fills one slice per field.
    pub(crate) fn fill<S>(
        &mut self,
        fields: &[(&'static str, &'static str)],
        scratch: impl Fn() -> S + Sync,
        row: impl Fn(&mut S, u32, u32, &mut [&mut [f32]]) + Sync,
    ) {
        let (nx, ny) = (self.dims.x as usize, self.dims.y as usize);
        let mut values: Vec<Vec<f32>> = fields.iter().map(|_| vec![0f32; self.points()]).collect();
        // One list of plane slices per k, with one slice per field.
        let mut planes: Vec<Vec<&mut [f32]>> = (0..self.dims.z).map(|_| Vec::new()).collect();
        for field in &mut values {
            for (k, plane) in field.chunks_mut(nx * ny).enumerate() {
                planes[k].push(plane);
            }
        }
        planes.into_par_iter().enumerate().for_each(|(k, mut plane)| {
            let mut own = scratch();
            for j in 0..ny {
                let mut rows: Vec<&mut [f32]> =
                    plane.iter_mut().map(|p| &mut p[j * nx..(j + 1) * nx]).collect();
                row(&mut own, j as u32, k as u32, &mut rows);
            }
        });
        self.fields.extend(fields.iter().zip(values).map(|(&(name, unit), values)| Field {
            name,
            unit,
            values,
        }));
    }
}

impl Field {
    /// Smallest and largest finite value; `None` if there is none.
    pub fn range(&self) -> Option<(f32, f32)> {
        let finite = self.values.iter().copied().filter(|v| v.is_finite());
        let (low, high) =
            finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (low <= high).then_some((low, high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fill_gives_each_point_its_own_row_and_plane() {
        let mut flow =
            Flow::over(UVec3::new(4, 5, 6), DVec3::ZERO, DVec3::new(3.0, 8.0, 5.0)).unwrap();
        flow.fill(
            &[("a", "1"), ("b", "1")],
            || (),
            |(), j, k, rows| {
                for i in 0..4 {
                    rows[0][i] = (i as u32 + 10 * j + 100 * k) as f32;
                    rows[1][i] = -rows[0][i];
                }
            },
        );
        assert_eq!(flow.spacing_m, DVec3::new(1.0, 2.0, 1.0));
        let grid = flow.grid("b").unwrap();
        assert_eq!(grid.at(3, 4, 5), -543.0);
        assert_eq!(flow.field("a").unwrap().range(), Some((0.0, 543.0)));
        assert!(flow.clone().into_dataset().check().is_ok());
        assert!(flow.field("c").is_none() && flow.grid("c").is_none());
    }

    #[test]
    fn absurd_lattices_are_refused_before_memory_is_taken() {
        for dims in
            [UVec3::new(3, 9, 9), UVec3::splat(0), UVec3::new(9, 9, 9000), UVec3::splat(8192)]
        {
            let error = Flow::over(dims, DVec3::ZERO, DVec3::ONE).unwrap_err().to_string();
            assert!(error.contains("4 to 8192"), "{error}");
        }
    }
}
