//! Resamples data of any mesh on a uniform lattice: curvilinear and rectilinear grids, tetrahedra,
//! hexahedra, wedges, pyramids, prisms, polyhedra, and collections of them.
//!
//! For each cell, the lattice nodes inside it are determined (`rasterize`). No search tree is
//! needed, and the time is proportional to the number of nodes plus the number of cells. Newton's
//! method inverts the trilinear map of a hexahedron (`shape`); cells whose map cannot be inverted
//! are divided into tetrahedra and counted. Between the points of the mesh, values are those of
//! polynomials fitted to the values around ([`Reconstruction`]).
//!
//! [`CellField`] has the same values, and their gradients, in the cells themselves, without a
//! lattice (`on_cells`).
//!
//! [`Mark`] classifies a node. [`Report`] measures the loss of accuracy by sampling the lattice
//! back at the points of the mesh.

mod beyond_border;
mod centre_values;
mod corner_values;
mod extrude;
mod face_tree;
mod jumps;
mod mesh;
mod on_cells;
mod rasterize;
mod reconstruct;
mod report;
mod revolve;
mod shape;
mod smooth;
mod walls;

pub use beyond_border::in_bodies;
pub use centre_values::centre_values;
pub use corner_values::corner_values;
pub use jumps::{JumpReport, average_jumps};
pub use mesh::{Mesh, Plane};
pub use on_cells::{Beyond, CellField, CellReport, CellWalker, Entry};
pub use reconstruct::{FitQuality, Reconstruction};
pub use report::{Report, ResamplingError};
pub use revolve::{revolve, revolved_bounds};
pub use smooth::smooth;
pub use walls::Walls;

use crate::model::ModelError;
use crate::plane_of_points::FLATNESS;
use glam::DVec3;
use reconstruct::{PointField, Symmetry};

/// Why a data set cannot be resampled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResampleError {
    /// The data set has no solid cells.
    #[error("the {kind} has no cells that fill space ({found}); {cure}")]
    NoVolume {
        /// Kind of data set.
        kind: &'static str,
        /// What the data set contains.
        found: String,
        /// What to do.
        cure: &'static str,
    },
    /// Data in no plane got a depth.
    #[error(
        "a depth is given, a span or a revolution, but the data has depth of its own: the farthest \
         point is {off:.2e} of its longest side off a plane, and up to {FLATNESS:e} is none; \
         leave the depth out, or save a slice"
    )]
    NotFlat {
        /// Distance of the farthest point from the plane of the largest triangle, by the longest
        /// side of the box.
        off: f64,
    },
    /// The requested lattice is impossible.
    #[error("a lattice of {0}x{1}x{2} nodes: {what}", dims[0], dims[1], dims[2])]
    Lattice {
        /// Nodes per axis.
        dims: [usize; 3],
        /// What is wrong, with the cure.
        what: String,
    },
    /// The number of values equals neither the number of points nor that of cells.
    #[error("{found} values for a mesh with {points} points and {cells} cells")]
    Count {
        /// Number of values given.
        found: usize,
        /// Number of points of the mesh.
        points: usize,
        /// Number of cells of the mesh.
        cells: usize,
    },
    /// An option has an invalid value.
    #[error("{option} is {value}; {cure}")]
    Option {
        /// Its name.
        option: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        cure: &'static str,
    },
    /// The data set is not consistent or lacks an array.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// A uniform lattice: node (i, j, k) is at `origin + spacing * (i, j, k)`, x fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Nodes per axis, at least 2.
    pub dims: [usize; 3],
    /// First node.
    pub origin: DVec3,
    /// Distance between nodes.
    pub spacing: DVec3,
}

/// Resolution of a lattice.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Resolution {
    /// Two nodes along the side of half of the cells or more, with 64 to 256 nodes along the
    /// longest axis.
    #[default]
    Auto,
    /// This many nodes along the longest axis, and the nearest equal spacing along the others that
    /// whole numbers of nodes allow.
    Longest(usize),
    /// Nodes at this distance, in the unit of the mesh; the remainder is left over in equal parts
    /// on both sides.
    Spacing(f64),
    /// Nodes per axis.
    Dims([usize; 3]),
}

/// Maximum number of nodes: indices must fit in 31 bits.
const MAX_NODES: usize = (1 << 31) - 1;

impl Lattice {
    /// A lattice over the box `low`..`high`; `typical_cell` is [`Mesh::typical_cell`].
    pub fn fit(
        low: DVec3,
        high: DVec3,
        typical_cell: f64,
        resolution: Resolution,
    ) -> Result<Self, ResampleError> {
        let size = high - low;
        let flat = |what: String| ResampleError::Lattice { dims: [0; 3], what };
        if !(size.is_finite() && low.is_finite() && size.min_element() > 0.0) {
            return Err(flat(format!(
                "the box from {low} to {high} has no volume; give bounds that have, or a depth to \
                 plane data"
            )));
        }
        let even = |h: f64| -> [usize; 3] {
            size.to_array().map(|l| ((l / h).round().clamp(1.0, MAX_NODES as f64) as usize) + 1)
        };
        let (dims, spacing) = match resolution {
            Resolution::Auto => {
                // In stretched meshes, the mean is dominated by the far field; the median
                // represents the region where the cells are.
                let nodes = size.max_element() / (0.5 * typical_cell) + 1.0;
                let longest =
                    if nodes.is_finite() { nodes.clamp(64.0, 256.0).round() } else { 64.0 };
                (even(size.max_element() / (longest - 1.0)), None)
            }
            Resolution::Longest(n) => {
                (even(size.max_element() / n.saturating_sub(1).max(1) as f64), None)
            }
            Resolution::Dims(d) => (d, None),
            Resolution::Spacing(h) => {
                if !(h > 0.0 && h.is_finite()) {
                    let cure = "give the distance between nodes in the unit of the mesh";
                    return Err(ResampleError::Option { option: "spacing", value: h, cure });
                }
                // The small excess absorbs rounding, so that 1/0.1 gives ten steps.
                let dims = size
                    .to_array()
                    .map(|l| (l / h * (1.0 + 1e-12)).floor().min(MAX_NODES as f64) as usize + 1);
                (dims, Some(h))
            }
        };
        let nodes = dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
        if nodes.is_none_or(|n| n > MAX_NODES) || dims.iter().any(|&d| d < 2) {
            let what = "every axis needs at least 2 nodes, and all together at most 2^31; change \
                        the resolution or the bounds";
            return Err(ResampleError::Lattice { dims, what: what.into() });
        }
        let steps = DVec3::from_array(dims.map(|d| (d - 1) as f64));
        Ok(match spacing {
            None => Lattice { dims, origin: low, spacing: size / steps },
            Some(h) => {
                Lattice { dims, origin: low + 0.5 * (size - h * steps), spacing: DVec3::splat(h) }
            }
        })
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }
    /// Size of the box of the nodes.
    pub fn size(&self) -> DVec3 {
        self.spacing * DVec3::from_array(self.dims.map(|d| d.saturating_sub(1) as f64))
    }
    /// Always false: a lattice has nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Position of a node.
    pub fn node(&self, i: usize, j: usize, k: usize) -> DVec3 {
        self.origin + self.spacing * DVec3::new(i as f64, j as f64, k as f64)
    }
}

/// Location of a lattice node relative to the mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Mark {
    /// Inside a cell with values.
    Inside,
    /// In no cell.
    #[default]
    Outside,
    /// Inside a cell that is hidden (`vtkGhostType`, iblank 0).
    Hidden,
    /// Inside a cell that has no finite value.
    NotFinite,
}

/// Values of a mesh.
#[derive(Debug, Clone, Copy)]
pub enum Samples<'a> {
    /// One per point.
    Points(&'a [f64]),
    /// One per cell, its average over the cell. [`Reconstruction::Linear`] gives points the mean of
    /// their cells, as `vtkCellDataToPointData` does.
    Cells(&'a [f64]),
}

/// Options of the resampling.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// A node gets the mean over this many samples per axis of the box around it. 1 takes the value
    /// at the node; 2 or more also average features finer than the lattice, such as shocks.
    pub samples_per_axis: usize,
    /// How values between the points of the mesh are computed.
    pub reconstruction: Reconstruction,
}

impl Default for Options {
    fn default() -> Self {
        Options { samples_per_axis: 1, reconstruction: Reconstruction::default() }
    }
}

/// Values on a lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct ResampledField {
    /// The lattice.
    pub lattice: Lattice,
    /// Values at the nodes, x fastest; NaN where the mark is not [`Mark::Inside`].
    pub values: Vec<f32>,
    /// About the error that the mesh itself makes, whatever the lattice: four times what the values
    /// gain over the plain mean of the corners' polynomials, which is of an order less. Where none
    /// fits, 1.75 times what the spline in its place adds to the linear elements. Empty with
    /// [`Reconstruction::Linear`], which has nothing to compare with.
    pub truncation: Vec<f32>,
    /// The mark of each node.
    pub marks: Vec<Mark>,
    /// Statistics and errors of the resampling.
    pub report: Report,
}

/// Maximum samples per axis and node. Meshes gain little beyond 4³ samples per node.
const MAX_SAMPLES: usize = 8;

/// Resamples the values of a mesh on a lattice. The result does not depend on the number of
/// threads.
///
/// ```
/// use datasets::model::{Dataset, ImageData};
/// use datasets::resample::{Lattice, Mesh, Options, Resolution, Samples, resample};
/// use glam::DVec3;
///
/// // 5³ points with the value x + 2y at unequal distance from the nodes of the new lattice.
/// let image = ImageData::new([5, 5, 5], DVec3::ZERO, DVec3::splat(0.25));
/// let mesh = Mesh::new(&Dataset::ImageData(image))?;
/// let points = (0..mesh.num_points()).map(|i| mesh.point(i));
/// let values: Vec<f64> = points.map(|p| p.x + 2.0 * p.y).collect();
/// let (low, high) = mesh.bounds();
/// let lattice = Lattice::fit(low, high, mesh.typical_cell(), Resolution::Longest(8))?;
/// let fine = resample(&mesh, Samples::Points(&values), &lattice, &Options::default())?;
/// let p = lattice.node(3, 5, 7);
/// assert!((fine.values[3 + 8 * (5 + 8 * 7)] as f64 - (p.x + 2.0 * p.y)).abs() < 1e-6);
/// assert!(fine.report.resampling_error.max < 1e-6);
/// # Ok::<(), datasets::resample::ResampleError>(())
/// ```
pub fn resample(
    mesh: &Mesh,
    samples: Samples<'_>,
    lattice: &Lattice,
    options: &Options,
) -> Result<ResampledField, ResampleError> {
    resample_with(mesh, samples, lattice, options, Symmetry::None)
}

/// [`resample`], also of half a plane of an axisymmetric flow.
fn resample_with(
    mesh: &Mesh,
    samples: Samples<'_>,
    lattice: &Lattice,
    options: &Options,
    symmetry: Symmetry,
) -> Result<ResampledField, ResampleError> {
    if !(1..=MAX_SAMPLES).contains(&options.samples_per_axis) {
        return Err(ResampleError::Option {
            option: "samples per axis",
            value: options.samples_per_axis as f64,
            cure: "from 1 to 8 are allowed",
        });
    }
    check_count(mesh, samples)?;
    let averaged;
    let (points, cells) = match samples {
        Samples::Points(v) => (v, None),
        Samples::Cells(v) => {
            averaged = mesh.cells_to_points(v);
            (averaged.as_slice(), Some(v))
        }
    };
    let field = match (options.reconstruction, cells) {
        (Reconstruction::Linear, _) => PointField::linear(points),
        (Reconstruction::Cubic, None) => PointField::of_points(mesh, points, symmetry),
        (Reconstruction::Cubic, Some(cells)) => PointField::of_cells(mesh, cells, points, symmetry),
    };
    let rasterize::Nodes { values, truncation, marks, counts } =
        rasterize::rasterize(mesh, &field, cells, lattice, options.samples_per_axis);
    let resampling_error = report::resampling_error(mesh, samples, lattice, &values);
    let fit = field.quality(mesh);
    let report = Report { fit, ..Report::new(mesh, &marks, counts, resampling_error) };
    Ok(ResampledField { lattice: *lattice, values, truncation, marks, report })
}

/// Whether there is a value for each point or cell.
fn check_count(mesh: &Mesh, samples: Samples<'_>) -> Result<(), ResampleError> {
    let (found, wanted) = match samples {
        Samples::Points(v) => (v.len(), mesh.num_points()),
        Samples::Cells(v) => (v.len(), mesh.num_cells()),
    };
    if found == wanted {
        return Ok(());
    }
    Err(ResampleError::Count { found, points: mesh.num_points(), cells: mesh.num_cells() })
}

#[cfg(test)]
mod tests;
