//! Data sets as files contain them: VTK's five kinds and collections of them, with named arrays of
//! any scalar type.
//!
//! Readers return a [`Dataset`] with the types of the file. Data is converted only on request, by
//! [`Dataset::to_trimesh`] (boundary surface), [`Dataset::to_lines`] (for tubes),
//! [`Dataset::to_points`] (for spheres) and [`Dataset::to_grid`] (for volumes). A [`SurfaceReport`]
//! counts what a conversion leaves out.

pub mod array;
mod axisymmetric;
mod boundary_faces;
pub mod cells;
pub mod coloring;
pub(crate) mod from_core;
pub mod grid;
pub mod lines;
mod merge;
pub mod polygon;
pub(crate) mod shape_of_faces;
pub mod shared_faces;
pub mod surface;
mod wall_names;

pub use array::{Attributes, DataArray, Endian, ScalarType, Values};
pub use cells::{CellType, Cells};
pub use coloring::ColorBy;
pub use lines::{PointSet, Polyline};
pub use shared_faces::{PieceBoundaries, SharedFaces};
pub use surface::SurfaceReport;
pub use wall_names::{BAFFLES, WALL_POINTS, is_name_of_body};

use glam::{DMat3, DVec3};

/// Why a data set cannot be converted as requested.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// There is no array of this name.
    #[error("no array `{name}` in this {kind}; it has {available}")]
    NoArray {
        /// The requested name.
        name: String,
        /// The kind of data set.
        kind: &'static str,
        /// The names of the existing arrays, quoted.
        available: String,
    },
    /// The array does not have this component.
    #[error("array `{name}` has {components} components; `{asked}` is out of range")]
    NoComponent {
        /// Array name.
        name: String,
        /// The requested component.
        asked: String,
        /// Number of components of the array.
        components: usize,
    },
    /// The data set cannot be converted to this kind.
    #[error("{kind} cannot become {target}: {reason}")]
    NotConvertible {
        /// Kind of data set.
        kind: &'static str,
        /// The requested kind.
        target: &'static str,
        /// The reason, and what to do instead.
        reason: String,
    },
    /// The arrays do not fit the geometry: the data set is inconsistent.
    #[error("{field}: expected {expected}, found {found}")]
    Inconsistent {
        /// Name of the array or count.
        field: String,
        /// Expected number.
        expected: u64,
        /// Found number.
        found: u64,
    },
    /// The resulting mesh or grid exceeds the renderer's limits.
    #[error(transparent)]
    Mesh(#[from] rt_core::mesh::MeshError),
    /// The resulting grid is not usable.
    #[error(transparent)]
    Grid(#[from] rt_core::grid::GridError),
}

/// Point coordinates in the precision of the file.
#[derive(Debug, Clone, PartialEq)]
pub enum Points {
    /// Single precision.
    F32(Vec<[f32; 3]>),
    /// Double precision.
    F64(Vec<[f64; 3]>),
}

impl Default for Points {
    fn default() -> Self {
        Points::F32(Vec::new())
    }
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Points::F32(v) => v.len(),
            Points::F64(v) => v.len(),
        }
    }
    /// True when there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Point `i`. Panics when `i` is out of range.
    #[inline]
    pub fn get(&self, i: usize) -> DVec3 {
        match self {
            Points::F32(v) => DVec3::from(v[i].map(f64::from)),
            Points::F64(v) => DVec3::from(v[i]),
        }
    }
    /// Points from a three-component array. Single precision is kept; all other types become
    /// double.
    pub fn from_array(array: DataArray) -> Result<Self, ModelError> {
        if array.components != 3 {
            return Err(ModelError::Inconsistent {
                field: format!("components of the point array `{}`", array.name),
                expected: 3,
                found: array.components as u64,
            });
        }
        Ok(match array.values {
            Values::F32(v) => Points::F32(v.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()),
            other => Points::F64(
                (0..other.len() / 3)
                    .map(|i| std::array::from_fn(|c| other.get_f64(3 * i + c)))
                    .collect(),
            ),
        })
    }
    /// The coordinates as a flat array, x y z per point.
    pub fn to_array(&self) -> DataArray {
        let values = match self {
            Points::F32(v) => Values::F32(v.as_flattened().to_vec()),
            Points::F64(v) => Values::F64(v.as_flattened().to_vec()),
        };
        DataArray { name: "Points".into(), components: 3, values }
    }
    /// Appends `other`; the result is double precision when either is.
    pub fn append(&mut self, other: &Points) {
        match (&mut *self, other) {
            (Points::F32(a), Points::F32(b)) => a.extend_from_slice(b),
            (Points::F64(a), _) => a.extend((0..other.len()).map(|i| other.get(i).to_array())),
            (Points::F32(a), Points::F64(b)) => {
                let wide = a.iter().map(|p| p.map(f64::from)).chain(b.iter().copied()).collect();
                *self = Points::F64(wide);
            }
        }
    }
}

/// Vertices, lines, polygons and strips over shared points. Cell data is ordered verts, lines,
/// polys, strips.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PolyData {
    /// Point coordinates.
    pub points: Points,
    /// One or more points per cell.
    pub verts: Cells,
    /// Polylines.
    pub lines: Cells,
    /// Polygons.
    pub polys: Cells,
    /// Triangle strips.
    pub strips: Cells,
    /// Arrays.
    pub attributes: Attributes,
}

/// Cells of any type over shared points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UnstructuredGrid {
    /// Point coordinates.
    pub points: Points,
    /// Point ids per cell.
    pub cells: Cells,
    /// VTK cell type number of each cell; see [`CellType`].
    pub types: Vec<u8>,
    /// For polyhedra (type 42): faces of all polyhedra, as point ids.
    pub polyhedron_faces: Cells,
    /// For each cell, which entries of `polyhedron_faces` are its faces; empty when there are no
    /// polyhedra.
    pub faces_of_cell: Vec<std::ops::Range<usize>>,
    /// Arrays.
    pub attributes: Attributes,
}

/// Points on a uniform lattice: point (i,j,k) is at `origin + direction * (spacing * (i,j,k))`.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageData {
    /// First and last index per axis: x0, x1, y0, y1, z0, z1.
    pub extent: [i32; 6],
    /// Position of index (0,0,0), which need not lie inside the extent.
    pub origin: DVec3,
    /// Distance between points.
    pub spacing: DVec3,
    /// Rotation of the axes; columns are the directions of i, j and k.
    pub direction: DMat3,
    /// Arrays.
    pub attributes: Attributes,
}

/// Points on a lattice with individual spacing along each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct RectilinearGrid {
    /// First and last index per axis.
    pub extent: [i32; 6],
    /// Coordinates along x, y and z.
    pub coordinates: [Vec<f64>; 3],
    /// Arrays.
    pub attributes: Attributes,
}

/// A lattice with a free position for each point (a curvilinear or "structured" grid), x index
/// fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct StructuredGrid {
    /// First and last index per axis.
    pub extent: [i32; 6],
    /// Point coordinates, i fastest.
    pub points: Points,
    /// Arrays.
    pub attributes: Attributes,
}

/// One named member of a [`Dataset::MultiBlock`].
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Name of the block, or its number.
    pub name: String,
    /// Its content.
    pub data: Dataset,
}

/// Any data set that a file can hold.
#[derive(Debug, Clone, PartialEq)]
pub enum Dataset {
    /// Surfaces, lines, points.
    PolyData(PolyData),
    /// Cells of any type.
    UnstructuredGrid(UnstructuredGrid),
    /// Uniform lattice.
    ImageData(ImageData),
    /// Lattice with uneven spacing.
    RectilinearGrid(RectilinearGrid),
    /// Curvilinear lattice.
    StructuredGrid(StructuredGrid),
    /// Several data sets.
    MultiBlock(Vec<Block>),
}

/// Points per axis of an extent; 0 for an empty axis.
pub fn extent_dims(extent: [i32; 6]) -> [usize; 3] {
    std::array::from_fn(|a| {
        (i64::from(extent[2 * a + 1]) - i64::from(extent[2 * a]) + 1).try_into().unwrap_or(0)
    })
}

/// Number of points and cells of a lattice; `None` when they do not fit in 64 bits.
pub fn lattice_counts(dims: [usize; 3]) -> Option<(u64, u64)> {
    let points = dims.iter().try_fold(1u64, |n, &d| n.checked_mul(d as u64))?;
    if points == 0 {
        return Some((0, 0)); // an axis without points leaves no cells either
    }
    // An axis with one point has one layer of (flat) cells. The product cannot overflow: each
    // factor is at most the number of points along that axis.
    let cells = dims.iter().map(|&d| if d == 1 { 1 } else { d as u64 - 1 }).product();
    Some((points, cells))
}

impl ImageData {
    /// Points per axis.
    pub fn dims(&self) -> [usize; 3] {
        extent_dims(self.extent)
    }
    /// A lattice of `dims` points from index 0, without rotation.
    pub fn new(dims: [u32; 3], origin: DVec3, spacing: DVec3) -> Self {
        let extent = std::array::from_fn(|i| if i % 2 == 0 { 0 } else { dims[i / 2] as i32 - 1 });
        ImageData {
            extent,
            origin,
            spacing,
            direction: DMat3::IDENTITY,
            attributes: Attributes::default(),
        }
    }
    /// Position of the point with index (i,j,k), counted from the start of the extent.
    pub fn point(&self, i: usize, j: usize, k: usize) -> DVec3 {
        let e = self.extent;
        let index =
            DVec3::new(e[0] as f64 + i as f64, e[2] as f64 + j as f64, e[4] as f64 + k as f64);
        self.origin + self.direction * (self.spacing * index)
    }
}

impl Dataset {
    /// Kind of data set, by VTK's name.
    pub fn kind(&self) -> &'static str {
        match self {
            Dataset::PolyData(_) => "PolyData",
            Dataset::UnstructuredGrid(_) => "UnstructuredGrid",
            Dataset::ImageData(_) => "ImageData",
            Dataset::RectilinearGrid(_) => "RectilinearGrid",
            Dataset::StructuredGrid(_) => "StructuredGrid",
            Dataset::MultiBlock(_) => "MultiBlock",
        }
    }

    /// The arrays; `None` for a collection, whose blocks have their own.
    pub fn attributes(&self) -> Option<&Attributes> {
        match self {
            Dataset::PolyData(d) => Some(&d.attributes),
            Dataset::UnstructuredGrid(d) => Some(&d.attributes),
            Dataset::ImageData(d) => Some(&d.attributes),
            Dataset::RectilinearGrid(d) => Some(&d.attributes),
            Dataset::StructuredGrid(d) => Some(&d.attributes),
            Dataset::MultiBlock(_) => None,
        }
    }

    /// The arrays, mutable; `None` for a collection.
    pub fn attributes_mut(&mut self) -> Option<&mut Attributes> {
        match self {
            Dataset::PolyData(d) => Some(&mut d.attributes),
            Dataset::UnstructuredGrid(d) => Some(&mut d.attributes),
            Dataset::ImageData(d) => Some(&mut d.attributes),
            Dataset::RectilinearGrid(d) => Some(&mut d.attributes),
            Dataset::StructuredGrid(d) => Some(&mut d.attributes),
            Dataset::MultiBlock(_) => None,
        }
    }

    /// All data sets that are not collections, in order.
    pub fn leaves(&self) -> Vec<&Dataset> {
        match self {
            Dataset::MultiBlock(blocks) => blocks.iter().flat_map(|b| b.data.leaves()).collect(),
            leaf => vec![leaf],
        }
    }

    /// Number of points and of cells, summed over blocks.
    pub fn counts(&self) -> (u64, u64) {
        let lattice = |e: [i32; 6]| lattice_counts(extent_dims(e)).unwrap_or((u64::MAX, u64::MAX));
        match self {
            Dataset::PolyData(d) => {
                let cells = d.verts.len() + d.lines.len() + d.polys.len() + d.strips.len();
                (d.points.len() as u64, cells as u64)
            }
            Dataset::UnstructuredGrid(d) => (d.points.len() as u64, d.cells.len() as u64),
            Dataset::ImageData(d) => lattice(d.extent),
            Dataset::RectilinearGrid(d) => lattice(d.extent),
            Dataset::StructuredGrid(d) => lattice(d.extent),
            Dataset::MultiBlock(blocks) => blocks
                .iter()
                .map(|b| b.data.counts())
                .fold((0, 0), |s, c| (s.0.saturating_add(c.0), s.1.saturating_add(c.1))),
        }
    }

    /// Checks that every array has as many values as the geometry has points or cells. Readers,
    /// conversions and writers call this, so every data set from a file is consistent.
    pub fn check(&self) -> Result<(), ModelError> {
        if let Dataset::MultiBlock(blocks) = self {
            return blocks.iter().try_for_each(|b| b.data.check());
        }
        let (points, cells) = self.counts();
        let same = |field: String, expected: u64, found: usize| {
            let found = found as u64;
            if expected == found {
                Ok(())
            } else {
                Err(ModelError::Inconsistent { field, expected, found })
            }
        };
        match self {
            Dataset::StructuredGrid(d) => {
                same("points of the lattice".into(), points, d.points.len())?
            }
            Dataset::RectilinearGrid(d) => {
                for (a, n) in extent_dims(d.extent).into_iter().enumerate() {
                    same(
                        format!("{} coordinates", ["x", "y", "z"][a]),
                        n as u64,
                        d.coordinates[a].len(),
                    )?;
                }
            }
            Dataset::UnstructuredGrid(d) => {
                same("cell types".into(), cells, d.types.len())?;
                if !d.faces_of_cell.is_empty() {
                    same("face ranges of polyhedra".into(), cells, d.faces_of_cell.len())?;
                    for r in &d.faces_of_cell {
                        if r.start > r.end || r.end > d.polyhedron_faces.len() {
                            let (expected, found) = (d.polyhedron_faces.len() as u64, r.end as u64);
                            return Err(ModelError::Inconsistent {
                                field: "faces of a polyhedron".into(),
                                expected,
                                found,
                            });
                        }
                    }
                }
            }
            _ => {}
        }
        let Some(a) = self.attributes() else { return Ok(()) };
        for (what, arrays, n) in [("point", &a.point, points), ("cell", &a.cell, cells)] {
            for array in arrays {
                same(format!("tuples of the {what} array `{}`", array.name), n, array.tuples())?;
                let whole = (array.tuples() as u64).saturating_mul(array.components as u64);
                same(
                    format!("values of the {what} array `{}`", array.name),
                    whole,
                    array.values.len(),
                )?;
            }
        }
        Ok(())
    }
}
