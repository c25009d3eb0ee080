//! Represents any data set as points and solid cells, numbered consecutively over all blocks.
//! Lattices keep their implicit cells.

mod baffles;
mod explicit;
mod faces;
mod flat;
mod layers;
mod places;
mod topology;

use super::{ResampleError, extrude};
use crate::model::{Attributes, CellType, Dataset, Points, UnstructuredGrid, extent_dims};
use crate::plane_of_points::{Lie, lie};
pub(super) use faces::{HIDDEN, NO_FACE, Neighbours, OUTSIDE, WALL};
use glam::{DMat3, DVec3};
use layers::{flat_source, hidden_cells_of_lattice, plane_normal};
use rayon::prelude::*;
use rt_core::math::median_high;
use smallvec::{SmallVec, smallvec};
use std::ops::Range;
use topology::Computed;
pub(super) use topology::Topology;

/// Bits of `vtkGhostType` (vtkDataSetAttributes.h): a hidden point, and cells that are refined
/// elsewhere or hidden.
const HIDDEN_POINT: u8 = 2;
const HIDDEN_CELL: u8 = 32 | 8;

/// The solid cells of a data set.
#[derive(Debug, Clone)]
pub struct Mesh {
    points: Vec<DVec3>,
    parts: Vec<Part>,
    /// Flag per cell; empty when no cell is hidden.
    hidden: Vec<bool>,
    cells: usize,
    left_out: usize,
    higher_order: usize,
    computed: Computed,
    turn: Option<DMat3>,
    /// Pairs of cells with a wall between them, the lower number first, in order.
    baffles: Vec<[u32; 2]>,
}

/// A cell whose box is longer than this part of the mesh's is the only one along that axis.
const WHOLE: f64 = 0.75;

#[derive(Debug, Clone)]
struct Part {
    /// Index into [`Dataset::leaves`].
    leaf: usize,
    /// How a plane got depth.
    depth: Option<PartDepth>,
    /// The direction of the depth, of length 1.
    normal: DVec3,
    points: Range<usize>,
    cells: Range<usize>,
    kind: PartKind,
}

/// Where the points of a plane with depth come from.
#[derive(Debug, Clone)]
enum PartDepth {
    /// From a lattice, with a second layer along this axis.
    Layer(usize),
    /// From polygons, below the plane and then again above it.
    Copies,
    /// From one layer of cells. Flag per point: whether it is above the plane.
    Sides(Vec<bool>),
}

#[derive(Debug, Clone)]
enum PartKind {
    /// Points per axis, at least 2.
    Lattice([usize; 3]),
    Cells(Box<Explicit>),
}

/// Cells with explicit lists. Point and face ids are relative to the part.
#[derive(Debug, Clone)]
struct Explicit {
    /// The cell of the grid for each cell of the part.
    cell: Vec<u32>,
    /// For prisms over polygons: the polygon of each cell of the grid. Otherwise empty.
    source: Vec<u32>,
    grid: UnstructuredGrid,
}

/// A cell: its corners in VTK's order and its shape.
pub(super) struct Corners {
    pub(super) ids: SmallVec<[u32; 8]>,
    pub(super) shape: Shape,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    Tetra,
    Hexa,
    Wedge,
    Pyramid,
    /// Faces as indices into the corners.
    Faces(Vec<Vec<u32>>),
}

/// Treatment of data in a plane, which has no depth for light to cross.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Plane {
    /// The same flow over this span, half on either side of the plane.
    Extrude {
        /// Length, in the unit of the mesh.
        span: f64,
    },
    /// Half a plane of an axisymmetric flow, as thin as this. One that lies along the x axis is
    /// turned about it until y is the radius, whatever direction it slants to.
    Meridian {
        /// Length, in the unit of the mesh.
        thickness: f64,
    },
}

impl Plane {
    fn depth(self) -> f64 {
        match self {
            Plane::Extrude { span } => span,
            Plane::Meridian { thickness } => thickness,
        }
    }
}

impl Mesh {
    /// All solid cells of a data set. Lines, surfaces and vertices are counted in
    /// [`Self::left_out`].
    pub fn new(data: &Dataset) -> Result<Mesh, ResampleError> {
        Self::build(data, None)
    }

    /// As [`Self::new`], with depth for data in a plane, and for one layer of cells instead of its
    /// thickness. Other three-dimensional data is rejected. A plane that slants to the axes is
    /// turned onto two of them ([`Self::turn`]).
    ///
    /// # Errors
    /// If the data is not consistent, has no plane, or is in none; or the depth is not above 0.
    pub fn with_plane(data: &Dataset, plane: Plane) -> Result<Mesh, ResampleError> {
        Self::build(data, Some(plane))
    }

    fn build(data: &Dataset, plane: Option<Plane>) -> Result<Mesh, ResampleError> {
        data.check()?;
        if let Some(depth) = plane.map(Plane::depth)
            && !(depth > 0.0 && depth.is_finite())
        {
            let cure = "give a positive length in the unit of the mesh";
            return Err(ResampleError::Option { option: "span", value: depth, cure });
        }
        let mut mesh = Mesh {
            points: vec![],
            parts: vec![],
            hidden: vec![],
            cells: 0,
            left_out: 0,
            higher_order: 0,
            computed: Computed::default(),
            turn: None,
            baffles: vec![],
        };
        let mut flat = 0;
        // Beside cells that fill space, polygons in a plane are patches of the border, and no flow.
        let leaves = data.leaves();
        let of_leaves = plane.filter(|_| !leaves.iter().any(|l| extrude::has_solids(l)));
        for (number, leaf) in leaves.into_iter().enumerate() {
            let before = mesh.parts.len();
            let is_flat = mesh.add(leaf, of_leaves)?;
            flat += usize::from(is_flat && of_leaves == plane);
            mesh.parts[before..].iter_mut().for_each(|p| p.leaf = number);
            mesh.add_baffles(leaf, before);
            let Some(span) = plane.map(Plane::depth) else { continue };
            for part in before..mesh.parts.len() {
                if mesh.parts[part].depth.is_none() && mesh.stretch_layer(part, span) {
                    flat += 1;
                }
            }
        }
        if mesh.cells == 0 {
            let (found, cure) = if flat > 0 {
                (
                    "it is a plane".to_string(),
                    "give it a depth: its span, for a two-dimensional flow",
                )
            } else {
                (
                    format!("{} cells of other kinds", mesh.left_out),
                    "save the volume, not a slice or a surface of it",
                )
            };
            return Err(ResampleError::NoVolume { kind: data.kind(), found, cure });
        }
        if plane.is_some() && flat == 0 {
            if let Lie::Space { off } = lie(mesh.points.iter().copied().filter(|p| p.is_finite())) {
                return Err(ResampleError::NotFlat { off });
            }
            return Err(ResampleError::Option {
                option: "span",
                value: 0.0,
                cure: "leave it out: the data has depth of its own",
            });
        }
        mesh.turn_to_axes(plane);
        Ok(mesh)
    }

    /// Adds a leaf; returns true when it is plane.
    fn add(&mut self, leaf: &Dataset, plane: Option<Plane>) -> Result<bool, ResampleError> {
        match leaf {
            Dataset::ImageData(d) => {
                let n = d.dims();
                let at = |i: usize| d.point(i % n[0], i / n[0] % n[1], i / n[0] / n[1]);
                self.add_lattice(n, &at, &d.attributes, plane)
            }
            Dataset::RectilinearGrid(d) => {
                let (n, c) = (extent_dims(d.extent), &d.coordinates);
                let at = |i: usize| {
                    DVec3::new(c[0][i % n[0]], c[1][i / n[0] % n[1]], c[2][i / n[0] / n[1]])
                };
                self.add_lattice(n, &at, &d.attributes, plane)
            }
            Dataset::StructuredGrid(d) => {
                self.add_lattice(extent_dims(d.extent), &|i| d.points.get(i), &d.attributes, plane)
            }
            Dataset::UnstructuredGrid(d) if extrude::has_only_polygons(d) => {
                self.add_polygons(d, 0, plane)
            }
            Dataset::UnstructuredGrid(d) => {
                self.add_cells(d)?;
                Ok(false)
            }
            Dataset::PolyData(d) => {
                let (polygons, first) = extrude::polygons_of(d);
                let flat = self.add_polygons(&polygons, first as u32, plane)?;
                self.left_out += d.verts.len() + d.lines.len() + d.strips.len();
                Ok(flat)
            }
            Dataset::MultiBlock(_) => Ok(false),
        }
    }

    fn add_lattice(
        &mut self,
        dims: [usize; 3],
        at: &(dyn Fn(usize) -> DVec3 + Sync),
        attributes: &Attributes,
        plane: Option<Plane>,
    ) -> Result<bool, ResampleError> {
        let count: usize = dims.iter().product();
        let is_flat = count > 0 && dims.iter().filter(|&&d| d == 1).count() == 1;
        let flat_axis = dims.iter().position(|&d| d == 1);
        let first = self.points.len();
        let mut hidden = hidden_cells_of_lattice(dims, attributes);
        let mut dims = dims;
        let mut normal = DVec3::Z;
        if is_flat {
            let Some(span) = plane.map(Plane::depth) else {
                self.left_out += count;
                return Ok(true);
            };
            // Add a second layer of points along the missing axis; the layers lie half a span to
            // either side.
            let axis = flat_axis.unwrap_or(2);
            let flat: Vec<DVec3> = (0..count).map(at).collect();
            normal = plane_normal(&flat, dims, axis);
            dims[axis] = 2;
            let total = 2 * count;
            self.points.extend((0..total).map(|i| {
                let (source, side) = flat_source(i, dims, axis);
                flat[source] + normal * (span * (side as f64 - 0.5))
            }));
        } else {
            if count == 0 || dims.iter().any(|&d| d < 2) {
                self.left_out += count;
                return Ok(false);
            }
            let new: Vec<DVec3> = (0..count).into_par_iter().map(at).collect();
            self.points.extend(new);
        }
        let cells: usize = dims.iter().map(|&d| d - 1).product();
        self.push(first, cells, PartKind::Lattice(dims), &mut hidden)?;
        if is_flat && let Some(part) = self.parts.last_mut() {
            part.depth = flat_axis.map(PartDepth::Layer);
            part.normal = normal;
        }
        Ok(is_flat)
    }

    fn add_cells(&mut self, d: &UnstructuredGrid) -> Result<(), ResampleError> {
        let ghost_cells = d.attributes.cell_array("vtkGhostType");
        let ghost_points = d.attributes.point_array("vtkGhostType");
        let n = d.points.len();
        let (mut cell, mut hidden) = (Vec::new(), Vec::new());
        for c in 0..d.cells.len() {
            let ids = d.cells.get(c);
            let needed = match CellType::of(d.types[c]) {
                CellType::Solid(faces) => {
                    1 + faces.iter().flat_map(|f| f.iter()).copied().max().unwrap_or(0) as usize
                }
                CellType::Polyhedron if d.faces_of_cell.get(c).is_some_and(|r| !r.is_empty()) => 4,
                _ => usize::MAX,
            };
            let faces_fit = d.faces_of_cell.get(c).is_none_or(|r| {
                r.clone().all(|f| d.polyhedron_faces.get(f).iter().all(|&k| (k as usize) < n))
            });
            if ids.len() < needed || ids.iter().any(|&k| k as usize >= n) || !faces_fit {
                self.left_out += 1;
                continue;
            }
            self.higher_order +=
                usize::from(needed != usize::MAX && d.types[c] > 16 && d.types[c] != 42);
            cell.push(c as u32);
            hidden.push(
                ghost_cells.is_some_and(|a| a.get(c, 0) as u8 & HIDDEN_CELL != 0)
                    || ghost_points.is_some_and(|a| {
                        ids.iter().any(|&k| a.get(k as usize, 0) as u8 & HIDDEN_POINT != 0)
                    }),
            );
        }
        let first = self.points.len();
        self.points.extend((0..n).map(|i| d.points.get(i)));
        let cells = cell.len();
        let grid = UnstructuredGrid {
            points: Points::default(),
            attributes: Attributes::default(),
            ..d.clone()
        };
        self.push(
            first,
            cells,
            PartKind::Cells(Box::new(Explicit { cell, source: Vec::new(), grid })),
            &mut hidden,
        )
    }

    /// Adds prisms over polygons, which count from `first_cell` on in the arrays of their data set.
    /// Returns true if the polygons lie in a plane.
    fn add_polygons(
        &mut self,
        d: &UnstructuredGrid,
        first_cell: u32,
        plane: Option<Plane>,
    ) -> Result<bool, ResampleError> {
        let span = plane.map_or(1.0, Plane::depth);
        let Some(prisms) = extrude::extruded(d, span) else {
            self.left_out += d.cells.len();
            return Ok(false);
        };
        if plane.is_none() {
            self.left_out += d.cells.len();
            return Ok(true);
        }
        self.add_cells(&prisms.grid)?;
        self.left_out += prisms.left_out;
        // Hidden cells and points are those of the polygons.
        let ghosts = (d.attributes.cell_array("vtkGhostType"), first_cell as usize);
        let points = d.attributes.point_array("vtkGhostType");
        let hidden: Vec<bool> = prisms
            .source
            .iter()
            .map(|&cell| {
                let hides = |bits: u8, a: &crate::model::DataArray, i: usize| {
                    i < a.tuples() && a.get(i, 0) as u8 & bits != 0
                };
                ghosts.0.is_some_and(|a| hides(HIDDEN_CELL, a, cell as usize + ghosts.1))
                    || points.is_some_and(|a| {
                        let mut ids = d.cells.get(cell as usize).iter();
                        ids.any(|&k| hides(HIDDEN_POINT, a, k as usize))
                    })
            })
            .collect();
        let Some(part) = self.parts.last_mut() else { return Ok(true) };
        (part.depth, part.normal) = (Some(PartDepth::Copies), prisms.normal);
        if let PartKind::Cells(e) = &mut part.kind {
            e.source = prisms.source.iter().map(|c| c + first_cell).collect();
        }
        if hidden.iter().any(|h| *h) {
            self.hidden.resize(part.cells.start, false);
            self.hidden.extend(hidden);
        }
        Ok(true)
    }

    fn push(
        &mut self,
        first: usize,
        cells: usize,
        kind: PartKind,
        hidden: &mut Vec<bool>,
    ) -> Result<(), ResampleError> {
        if self.points.len() >= u32::MAX as usize || self.cells + cells >= u32::MAX as usize {
            let what =
                "the mesh has more than 2^32 points or cells; resample its blocks one by one"
                    .to_string();
            return Err(ResampleError::Lattice { dims: [self.points.len(), 1, 1], what });
        }
        let range = self.cells..self.cells + cells;
        self.cells = range.end;
        if !self.hidden.is_empty() || hidden.iter().any(|h| *h) {
            self.hidden.resize(range.start, false);
            self.hidden.append(hidden);
            self.hidden.resize(range.end, false);
        }
        self.parts.push(Part {
            leaf: 0,
            depth: None,
            normal: DVec3::Z,
            points: first..self.points.len(),
            cells: range,
            kind,
        });
        Ok(())
    }

    /// Number of points, over all blocks.
    pub fn num_points(&self) -> usize {
        self.points.len()
    }
    /// Number of solid cells.
    pub fn num_cells(&self) -> usize {
        self.cells
    }
    /// Position of a point. Panics when `i` is out of range.
    pub fn point(&self, i: usize) -> DVec3 {
        self.points[i]
    }
    /// Number of cells that are not solid or refer to points that do not exist.
    pub fn left_out(&self) -> usize {
        self.left_out
    }
    /// Number of higher-order cells, which are treated as linear cells.
    pub fn higher_order(&self) -> usize {
        self.higher_order
    }
    /// Number of hidden cells.
    pub fn num_hidden(&self) -> usize {
        self.hidden.iter().filter(|h| **h).count()
    }
    pub(super) fn is_hidden(&self, cell: usize) -> bool {
        self.hidden.get(cell).copied().unwrap_or(false)
    }
    /// The mesh with all lengths times `factor`: from the unit of a file to metres.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Mesh {
        self.points.iter_mut().for_each(|p| *p *= factor);
        self.computed = Computed::default();
        self
    }

    /// Bounding box of all finite points.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let finite = self.points.iter().filter(|p| p.is_finite());
        finite.fold(nothing, |(low, high), p| (low.min(*p), high.max(*p)))
    }

    /// Side of a cube with the volume of a typical cell's box: the median over at most 10 000
    /// cells; NaN without cells. Sides that are as long as the mesh, as those of a plane with
    /// depth, do not count: their length says nothing of how fine the mesh is.
    pub fn typical_cell(&self) -> f64 {
        let step = (self.cells / 10_000).max(1);
        let (low, high) = self.bounds();
        let whole = WHOLE * (high - low);
        let side = |cell: usize| {
            let ids = self.corners(cell).ids;
            let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (low, high) = ids
                .iter()
                .map(|&i| self.points[i as usize])
                .fold(nothing, |(l, h), p| (l.min(p), h.max(p)));
            let sides = high - low;
            let counts = |axis: &usize| sides[*axis] < whole[*axis];
            let (product, count) =
                (0..3).filter(counts).fold((1.0, 0), |(p, n), axis| (p * sides[axis], n + 1));
            if count == 0 {
                sides.element_product().cbrt()
            } else {
                product.powf(1.0 / f64::from(count))
            }
        };
        let mut sides: Vec<f64> =
            (0..self.cells).step_by(step).map(side).filter(|s| s.is_finite() && *s > 0.0).collect();
        median_high(&mut sides).unwrap_or(f64::NAN)
    }

    /// The corners of a cell. Panics when `cell` is out of range.
    pub(super) fn corners(&self, cell: usize) -> Corners {
        let part = &self.parts[self.parts.partition_point(|p| p.cells.end <= cell)];
        let local = cell - part.cells.start;
        let first = part.points.start;
        match &part.kind {
            PartKind::Lattice([nx, ny, _]) => {
                let (cx, cy) = (nx - 1, ny - 1);
                let (i, j, k) = (local % cx, local / cx % cy, local / cx / cy);
                let at = |di: usize, dj: usize, dk: usize| {
                    (first + i + di + nx * (j + dj + ny * (k + dk))) as u32
                };
                let ids = smallvec![
                    at(0, 0, 0),
                    at(1, 0, 0),
                    at(1, 1, 0),
                    at(0, 1, 0),
                    at(0, 0, 1),
                    at(1, 0, 1),
                    at(1, 1, 1),
                    at(0, 1, 1),
                ];
                Corners { ids, shape: Shape::Hexa }
            }
            PartKind::Cells(e) => e.corners(local, first as u32),
        }
    }

    /// Mean of the corners of a cell.
    pub(super) fn cell_centre(&self, cell: usize) -> DVec3 {
        let c = self.corners(cell);
        c.ids.iter().map(|&i| self.points[i as usize]).sum::<DVec3>() / c.ids.len() as f64
    }

    /// For each point, the mean of the finite values of its visible cells; NaN where there are
    /// none.
    pub fn cells_to_points(&self, of_cells: &[f64]) -> Vec<f64> {
        let mut sum = vec![(0.0, 0u32); self.points.len()];
        for (cell, value) in of_cells.iter().enumerate().take(self.cells) {
            if value.is_finite() && !self.is_hidden(cell) {
                for id in self.corners(cell).ids {
                    let s = &mut sum[id as usize];
                    *s = (s.0 + value, s.1 + 1);
                }
            }
        }
        sum.into_iter().map(|(s, n)| if n == 0 { f64::NAN } else { s / f64::from(n) }).collect()
    }

    /// Collects values per point in the order of [`Self::point`]. `value` is called with the arrays
    /// of each block and the index of the point in it.
    pub fn gather_points(
        &self,
        data: &Dataset,
        mut value: impl FnMut(&Attributes, usize) -> f64,
    ) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.points.len());
        self.each_part(data, |part, attributes| {
            out.extend((0..part.points.len()).map(|i| value(attributes, part.source_of(i))));
        });
        out
    }

    /// Collects values per cell in the order of this mesh; like [`Self::gather_points`].
    pub fn gather_cells(
        &self,
        data: &Dataset,
        mut value: impl FnMut(&Attributes, usize) -> f64,
    ) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.cells);
        self.each_part(data, |part, attributes| {
            out.extend((0..part.cells.len()).map(|i| match &part.kind {
                PartKind::Lattice(_) => value(attributes, i),
                PartKind::Cells(e) => {
                    let cell = e.cell[i] as usize;
                    value(attributes, e.source.get(cell).map_or(cell, |c| *c as usize))
                }
            }));
        });
        out
    }

    /// Visits the parts with the arrays of the leaves from which they were made.
    fn each_part(&self, data: &Dataset, mut f: impl FnMut(&Part, &Attributes)) {
        let leaves = data.leaves();
        for part in &self.parts {
            if let Some(attributes) = leaves.get(part.leaf).and_then(|l| l.attributes()) {
                f(part, attributes);
            }
        }
    }
}
