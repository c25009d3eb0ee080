//! Isosurfaces of uniform grids as triangle meshes with shared vertices: marching cubes (Lorensen
//! and Cline 1987) with a hole-free case table, in two parallel passes over bit masks.
//!
//! The rules are those of `vtkFlyingEdges3D`, so triangle counts are equal to VTK's. A point is
//! inside when its value is at or above the isovalue (compared in f64). Triangles without area,
//! which appear where a value equals the isovalue exactly, are kept. Triangles are
//! counter-clockwise seen from the lower values, and normals point there too.
//!
//! | file | what |
//! |---|---|
//! | `case_table.rs` | the 256 cases, derived |
//! | `inside_bits.rs` | one bit per point; crossed edges by exclusive-or |
//! | `slab.rs` | counting and emitting a range of planes |
//! | `gradient.rs` | normals |
//! | `stream.rs` | fields larger than memory, a batch of planes at a time |
//! | `pieces.rs` | surfaces larger than memory, a batch of planes at a time |
//!
//! A value that is NaN or infinite empties the eight cells around it. The number of skipped cells
//! is reported.

mod case_table;
mod gradient;
mod inside_bits;
mod pieces;
mod slab;
mod stream;

pub use pieces::extract_pieces;
pub use stream::{PlaneSource, extract_streamed};

use glam::{DVec3, Vec3};
use inside_bits::Block;
use rayon::prelude::*;
use rt_core::grid::{Grid, GridError};
use rt_core::mesh::{Attribute, MeshError, TriMesh};
use slab::{Cut, Output, PlaneCount};
use std::ops::Range;

/// What to compute besides positions and triangles.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Options {
    /// Unit normals from the field's gradient, one per vertex (12 bytes each).
    pub normals: bool,
    /// The isovalue as a scalar per vertex (4 bytes each), for colouring nested surfaces.
    pub scalars: bool,
}

/// Extracted surfaces.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Isosurfaces {
    /// All surfaces, one isovalue after the other.
    pub mesh: TriMesh,
    /// Triangles of each isovalue.
    pub triangles_per_iso: Vec<usize>,
    /// Cells without surface because one of their corners is NaN or infinite.
    pub skipped_cells: u64,
}

/// Why no surface can be extracted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IsosurfaceError {
    /// An isovalue is NaN or infinite.
    #[error("isovalue number {index} is {value}; isovalues must be finite")]
    Isovalue {
        /// Index of the isovalue, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The grid is inconsistent.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The result needs ids of more than 32 bits.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Extracts the surfaces where `grid` has the values `isos`. The result does not depend on the
/// number of threads.
///
/// ```
/// use datasets::{generate::wavelet::Wavelet, isosurface};
/// let grid = Wavelet::with_points(21).grid()?;
/// let contour = isosurface::extract(&grid, &[157.0909652709961], Default::default())?;
/// // As ParaView's Wavelet and Contour with their defaults.
/// assert_eq!(contour.mesh.num_triangles(), 5480);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn extract(
    grid: &Grid,
    isos: &[f64],
    options: Options,
) -> Result<Isosurfaces, IsosurfaceError> {
    extract_at(grid, isos, options, None)
}

/// [`extract`] with positions relative to `origin`; without it, to one that is chosen for them.
/// Pieces of one surface want one origin: relative to several, a point on their border would be
/// rounded in several ways, and rays could pass between them.
pub fn extract_at(
    grid: &Grid,
    isos: &[f64],
    options: Options,
    origin: Option<DVec3>,
) -> Result<Isosurfaces, IsosurfaceError> {
    let mut placement = Placement::of(
        grid.dims().as_u64vec3(),
        grid.origin(),
        grid.spacing(),
        grid.values().len(),
    )?;
    if let Some(origin) = origin {
        placement.mesh_origin = origin;
        placement.base = grid.origin() - origin;
    }
    let mut result = Isosurfaces { triangles_per_iso: vec![0; isos.len()], ..Default::default() };
    result.mesh.origin = placement.mesh_origin;
    let cuts = cuts(isos, &placement)?;
    let Some(block) = placement.whole(grid.values()) else { return Ok(result) };
    let planes = block.dims[2];

    // First pass: what every plane contributes to every surface.
    let counts: Vec<Vec<PlaneCount>> =
        cuts.iter().map(|cut| count_planes(&block, cut, 0..planes)).collect();
    result.skipped_cells =
        counts.first().map_or(0, |c| c.iter().map(|p| p.skipped_cells as u64).sum());

    // Allocate the exact sizes; every plane then has its own range of the result.
    let mut arrays = Arrays::new(options);
    let (mut vertices, mut triangles) = (0u64, 0u64);
    let first_vertices: Vec<Vec<u32>> = counts.iter().map(|c| prefix(c, &mut vertices)).collect();
    for (c, n) in counts.iter().zip(&mut result.triangles_per_iso) {
        *n = c.iter().map(|p| p.triangles as usize).sum();
        triangles += *n as u64;
    }
    arrays.allocate(vertices, triangles)?;

    // Second pass.
    let mut rest = arrays.remaining_output(0, 0);
    let mut jobs = Vec::new();
    for ((cut, counts), first) in cuts.iter().zip(&counts).zip(&first_vertices) {
        for range in split_planes(0..planes) {
            let out = rest.take(&counts[range.clone()]);
            jobs.push((cut, first[range.start..=range.end].to_vec(), range, out));
        }
    }
    jobs.into_par_iter()
        .for_each(|(cut, first, range, out)| slab::emit(&block, cut, range, &first, out));
    if let Some(scalars) = &mut arrays.scalars {
        for (first, &iso) in first_vertices.iter().zip(isos) {
            let end = first[planes] as usize;
            scalars[first[0] as usize..end].fill(iso as f32);
        }
    }
    arrays.into_mesh(&mut result.mesh);
    Ok(result)
}

/// Counts the triangles of each isovalue without generating them: about a third of the work and no
/// memory for the result.
pub fn count_triangles(grid: &Grid, isos: &[f64]) -> Result<Vec<usize>, IsosurfaceError> {
    let placement = Placement::of(
        grid.dims().as_u64vec3(),
        grid.origin(),
        grid.spacing(),
        grid.values().len(),
    )?;
    let cuts = cuts(isos, &placement)?;
    let Some(block) = placement.whole(grid.values()) else { return Ok(vec![0; isos.len()]) };
    let total = |cut| {
        count_planes(&block, cut, 0..block.dims[2]).iter().map(|p| p.triangles as usize).sum()
    };
    Ok(cuts.iter().map(total).collect())
}

/// Shape of a checked grid, and the placement of its surfaces.
struct Placement {
    dims: [usize; 3],
    mesh_origin: DVec3,
    base: DVec3,
    spacing: DVec3,
}

impl Placement {
    fn of(
        dims: glam::U64Vec3,
        origin: DVec3,
        spacing: DVec3,
        found: usize,
    ) -> Result<Self, GridError> {
        let expected = dims.x.saturating_mul(dims.y).saturating_mul(dims.z);
        if expected != found as u64 || expected == 0 {
            return Err(GridError::Length { dims: dims.as_uvec3(), expected, found });
        }
        if !(spacing.is_finite() && spacing.cmpgt(DVec3::ZERO).all()) {
            let rule = "finite and positive in every axis";
            return Err(GridError::Geometry { field: "spacing", value: spacing, rule });
        }
        if !origin.is_finite() {
            return Err(GridError::Geometry { field: "origin", value: origin, rule: "finite" });
        }
        // Far from the origin, f32 positions would lose precision: make them relative to the middle
        // (as TriMesh does). Near the origin they stay absolute, which keeps them equal to VTK's.
        let extent = spacing * (dims.as_dvec3() - DVec3::ONE);
        let center = origin + 0.5 * extent;
        let far = center.abs().max_element() > extent.max_element();
        let mesh_origin = if far { center.as_vec3().as_dvec3() } else { DVec3::ZERO };
        let dims = [dims.x as usize, dims.y as usize, dims.z as usize];
        Ok(Placement { dims, mesh_origin, base: origin - mesh_origin, spacing })
    }

    /// All values as one block; `None` when an axis has a single point, so that there are no cells.
    fn whole<'a>(&self, values: &'a [f32]) -> Option<Block<'a>> {
        let has_missing = values.par_chunks(1 << 16).any(|c| c.iter().any(|v| !v.is_finite()));
        let block = Block { dims: self.dims, first_plane: 0, values, has_missing };
        self.has_cells().then_some(block)
    }

    fn has_cells(&self) -> bool {
        self.dims.iter().all(|&n| n > 1)
    }
}

fn cuts(isos: &[f64], placement: &Placement) -> Result<Vec<Cut>, IsosurfaceError> {
    let cut = |(index, &iso): (usize, &f64)| {
        if !iso.is_finite() {
            return Err(IsosurfaceError::Isovalue { index, value: iso });
        }
        let nearest = iso as f32;
        let threshold = if (nearest as f64) < iso { nearest.next_up() } else { nearest };
        Ok(Cut { iso, threshold, base: placement.base, spacing: placement.spacing })
    };
    isos.iter().enumerate().map(cut).collect()
}

/// Splits planes into jobs. Every job computes the bits of one extra plane, so jobs are as long as
/// load balance allows. The result does not depend on the split.
fn split_planes(planes: Range<usize>) -> Vec<Range<usize>> {
    let length = (planes.len() / (4 * rayon::current_num_threads())).clamp(1, 16);
    planes.clone().step_by(length).map(|a| a..(a + length).min(planes.end)).collect()
}

fn count_planes(block: &Block<'_>, cut: &Cut, planes: Range<usize>) -> Vec<PlaneCount> {
    split_planes(planes)
        .into_par_iter()
        .flat_map_iter(|range| slab::count(block, cut, range))
        .collect()
}

/// Id of every plane's first vertex, and one after the last plane; `next` is the running count. Ids
/// beyond u32 wrap here, but [`Arrays::allocate`] rejects them before they are used.
fn prefix(counts: &[PlaneCount], next: &mut u64) -> Vec<u32> {
    let mut ids = Vec::with_capacity(counts.len() + 1);
    for c in counts {
        ids.push(*next as u32);
        *next += c.vertices as u64;
    }
    ids.push(*next as u32);
    ids
}

/// The growing result.
struct Arrays {
    positions: Vec<Vec3>,
    normals: Option<Vec<Vec3>>,
    scalars: Option<Vec<f32>>,
    triangles: Vec<[u32; 3]>,
}

/// The part of the result that is not assigned to a job yet.
struct RemainingOutput<'a> {
    positions: &'a mut [Vec3],
    normals: Option<&'a mut [Vec3]>,
    triangles: &'a mut [[u32; 3]],
}

impl Arrays {
    fn new(options: Options) -> Self {
        Arrays {
            positions: Vec::new(),
            normals: options.normals.then(Vec::new),
            scalars: options.scalars.then(Vec::new),
            triangles: Vec::new(),
        }
    }

    /// Grows to the given sizes.
    fn allocate(&mut self, vertices: u64, triangles: u64) -> Result<(), MeshError> {
        const LIMIT: u64 = u32::MAX as u64 - 1;
        for (what, found) in [("vertices", vertices), ("triangles", triangles)] {
            if found > LIMIT {
                return Err(MeshError::TooLarge {
                    what,
                    found: found as usize,
                    limit: LIMIT as usize,
                });
            }
        }
        let (vertices, triangles) = (vertices as usize, triangles as usize);
        grow(&mut self.positions, vertices);
        self.normals.iter_mut().for_each(|n| grow(n, vertices));
        self.scalars.iter_mut().for_each(|s| grow(s, vertices));
        grow(&mut self.triangles, triangles);
        Ok(())
    }

    fn remaining_output(
        &mut self,
        first_vertex: usize,
        first_triangle: usize,
    ) -> RemainingOutput<'_> {
        RemainingOutput {
            positions: &mut self.positions[first_vertex..],
            normals: self.normals.as_mut().map(|n| &mut n[first_vertex..]),
            triangles: &mut self.triangles[first_triangle..],
        }
    }

    fn into_mesh(self, mesh: &mut TriMesh) {
        mesh.positions = self.positions;
        mesh.indices = self.triangles;
        mesh.normals = self.normals.map(Attribute::per_vertex);
        mesh.scalars = self.scalars.map(Attribute::per_vertex);
    }
}

impl<'a> RemainingOutput<'a> {
    /// Takes the output range of the planes with these counts.
    fn take(&mut self, counts: &[PlaneCount]) -> Output<'a> {
        let vertices = counts.iter().map(|c| c.vertices as usize).sum();
        let triangles = counts.iter().map(|c| c.triangles as usize).sum();
        Output {
            positions: split_off(&mut self.positions, vertices),
            normals: self.normals.as_mut().map(|n| split_off(n, vertices)),
            triangles: split_off(&mut self.triangles, triangles),
        }
    }
}

fn split_off<'a, T>(rest: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let (head, tail) = std::mem::take(rest).split_at_mut(n);
    *rest = tail;
    head
}

/// Resizes with zeros. The first time this asks the allocator for zeroed memory, whose pages are
/// first touched by the threads that fill them.
fn grow<T: bytemuck::Zeroable + Clone>(v: &mut Vec<T>, n: usize) {
    if v.is_empty() {
        *v = bytemuck::allocation::zeroed_vec(n);
    } else {
        v.resize(n, T::zeroed());
    }
}

#[cfg(test)]
mod tests;
