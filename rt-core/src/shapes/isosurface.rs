//! Isosurfaces of a uniform grid without extracted geometry: rays intersect the trilinear
//! interpolant itself (thesis chapter 6; Parker et al. 1998).
//!
//! Primitives are the blocks of cells (bricks) that contain part of a surface. Inside a brick a ray
//! walks from cell to cell ([`crate::grid_walk`]) and finds the first root of the cubic along it
//! ([`crate::ray_cubic`], Marmitt et al. 2004). Neighbouring cells, also in different bricks,
//! evaluate the same value with the same bits at the same point of their common face, and a change
//! of sign between a cell's ends always yields a root: a ray cannot pass a closed surface between
//! two cells.
//!
//! "Inside" is value ≥ isovalue: a plateau exactly at the isovalue is solid, not a thick surface.

use super::isosurface_cell::{
    Root, SHAPE, check_isovalues, min_max, place_on, root_in_cell, smooth_gradient,
};
use super::{Shape, ShapeError, ShapeHit, ShapeSurface, in_range, outward_box};
use crate::grid::Grid;
use crate::grid_walk::IndexRay;
use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, UVec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Where normals come from. Both point to smaller values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum IsosurfaceNormals {
    /// The gradient of the trilinear interpolant: exactly the surface that is hit, so it shows the
    /// cells' edges.
    #[default]
    Surface,
    /// Central differences at the grid points, interpolated (as contouring programs do): smooth,
    /// but not the normal of the surface at grazing angles.
    Smooth,
}

/// Options of an [`Isosurface`].
#[derive(Debug, Clone, Copy)]
pub struct IsosurfaceOptions {
    /// Cells per edge of a brick, 1 to 255: smaller ones fit the surface closer and take more
    /// memory.
    pub brick_cells: u32,
    /// Where normals come from.
    pub normals: IsosurfaceNormals,
}

impl Default for IsosurfaceOptions {
    fn default() -> Self {
        IsosurfaceOptions { brick_cells: 4, normals: IsosurfaceNormals::default() }
    }
}

/// Sizes of an isosurface, and the cells left out of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct IsosurfaceReport {
    /// Cells of the grid.
    pub cells: u64,
    /// Cells with a NaN or infinite corner. They are empty: the surface ends at them.
    pub cells_non_finite: u64,
    /// Cells that some surface crosses.
    pub cells_active: u64,
    /// Bricks of the grid.
    pub blocks: u64,
    /// Bricks that some surface crosses: the primitives.
    pub bricks_active: u64,
    /// Isovalues outside the range of the data: their surfaces are empty.
    pub isovalues_out_of_range: usize,
}

/// The surfaces value = isovalue of a grid, for one or several isovalues. `u` of a hit is the
/// number of its isovalue, `v` is 0.
///
/// ```
/// use rt_core::{grid::Grid, ray::Ray, shapes::{Isosurface, Shape}, glam::{DVec3, UVec3, Vec3}};
/// // f = x on 3×3×3 points: the surface f = 0.75 is the plane x = 0.75.
/// let values = (0..27).map(|i| (i % 3) as f32).collect();
/// let grid = Grid::new(UVec3::splat(3), DVec3::ZERO, DVec3::ONE, values).unwrap();
/// let plane = Isosurface::new(grid.into(), &[0.75], &Default::default()).unwrap();
/// let hit = plane.closest(0, &Ray::new(Vec3::new(-1.0, 0.3, 0.6), Vec3::X)).unwrap();
/// assert_eq!(hit.t, 1.75);
/// ```
#[derive(Debug, Clone)]
pub struct Isosurface {
    grid: Arc<Grid>,
    isovalues: Vec<f32>,
    blocks: Vec<CellBlock>,
    normals: IsosurfaceNormals,
    color_by: Option<Arc<Grid>>,
    report: IsosurfaceReport,
}

/// A box of cells around the active cells of a brick.
#[derive(Debug, Clone, Copy)]
struct CellBlock {
    lo: [u32; 3],
    size: [u8; 3],
}

/// Result of scanning one brick's cells.
#[derive(Default)]
struct BlockScan {
    block: Option<CellBlock>,
    active: u64,
    non_finite: u64,
}

impl Isosurface {
    /// Surfaces of `grid` at `isovalues`.
    pub fn new(
        grid: Arc<Grid>,
        isovalues: &[f32],
        options: &IsosurfaceOptions,
    ) -> Result<Self, ShapeError> {
        if grid.dims.min_element() < 2 {
            return Err(ShapeError::NoCells { shape: SHAPE, dims: grid.dims });
        }
        check_isovalues(isovalues)?;
        if !(1..=255).contains(&options.brick_cells) {
            let value = options.brick_cells as f32;
            return Err(ShapeError::Value {
                shape: SHAPE,
                field: "brick_cells",
                value,
                rule: "1 to 255",
            });
        }

        let cells = grid.dims - UVec3::ONE;
        let per_axis = (cells + options.brick_cells - UVec3::ONE) / options.brick_cells;
        let count = per_axis.as_u64vec3().element_product();
        let at = |n: u64| {
            let (x, y) = (u64::from(per_axis.x), u64::from(per_axis.y));
            UVec3::new((n % x) as u32, (n / x % y) as u32, (n / x / y) as u32) * options.brick_cells
        };
        let (lo, hi) = grid.range().unwrap_or((f32::INFINITY, f32::NEG_INFINITY));
        let mut report = IsosurfaceReport {
            cells: cells.as_u64vec3().element_product(),
            blocks: count,
            isovalues_out_of_range: isovalues.iter().filter(|v| !(lo < **v && **v <= hi)).count(),
            ..Default::default()
        };
        let scans: Vec<BlockScan> = (0..count)
            .into_par_iter()
            .map(|n| scan(&grid, isovalues, at(n), (at(n) + options.brick_cells).min(cells)))
            .filter(|s| s.block.is_some() || s.non_finite > 0)
            .collect();
        let mut blocks = Vec::new();
        for s in scans {
            report.cells_active += s.active;
            report.cells_non_finite += s.non_finite;
            blocks.extend(s.block);
        }
        report.bricks_active = blocks.len() as u64;
        super::error::check_count(SHAPE, blocks.len())?;
        Ok(Isosurface {
            grid,
            isovalues: isovalues.to_vec(),
            blocks,
            normals: options.normals,
            color_by: None,
            report,
        })
    }

    /// Takes the scalar for the colour map from another grid, sampled at the hit (outside it, at
    /// its nearest point). Without it, the scalar is the isovalue.
    pub fn with_color_by(self, grid: Arc<Grid>) -> Self {
        Isosurface { color_by: Some(grid), ..self }
    }

    /// Sizes, and cells left out.
    pub fn report(&self) -> IsosurfaceReport {
        self.report
    }

    /// The isovalues, in the order of a hit's `u`.
    pub fn isovalues(&self) -> &[f32] {
        &self.isovalues
    }

    fn index_ray(&self, ray: &Ray) -> IndexRay {
        IndexRay::new(ray.origin.as_dvec3(), ray.dir.as_dvec3(), self.grid.spacing)
    }

    /// The first root in brick `prim` within the ray's range.
    #[inline]
    fn first(&self, prim: u32, ray: &Ray) -> Option<Root> {
        let index_ray = self.index_ray(ray);
        let block = &self.blocks[prim as usize];
        let lo = block.lo.map(i64::from);
        let hi = std::array::from_fn(|a| lo[a] + i64::from(block.size[a]));
        let last = (self.grid.dims - UVec3::ONE).to_array().map(i64::from);
        let mut found = None;
        index_ray.walk(lo, hi, last, 1, f64::from(ray.t_min), f64::from(ray.t_max), |crossing| {
            let corners = self.grid.corners(UVec3::from_array(crossing.cell.map(|c| c as u32)));
            found = root_in_cell(&corners, &self.isovalues, &index_ray, crossing);
            found.is_none()
        });
        found.filter(|r| in_range(r.t as f32, ray))
    }
}

/// Scans the cells `lo..hi`.
fn scan(grid: &Grid, isovalues: &[f32], lo: UVec3, hi: UVec3) -> BlockScan {
    let mut s = BlockScan::default();
    let (mut first, mut last) = (hi, lo);
    for k in lo.z..hi.z {
        for j in lo.y..hi.y {
            for i in lo.x..hi.x {
                let v = grid.corners(UVec3::new(i, j, k));
                if !v.iter().all(|x| x.is_finite()) {
                    s.non_finite += 1;
                    continue;
                }
                let (a, b) = min_max(&v);
                if isovalues.iter().any(|&iso| a < iso && iso <= b) {
                    s.active += 1;
                    first = first.min(UVec3::new(i, j, k));
                    last = last.max(UVec3::new(i + 1, j + 1, k + 1));
                }
            }
        }
    }
    if s.active > 0 {
        s.block = Some(CellBlock {
            lo: first.to_array(),
            size: (last - first).to_array().map(|n| n as u8),
        });
    }
    s
}

impl Shape for Isosurface {
    fn num_primitives(&self) -> usize {
        self.blocks.len()
    }

    /// The grid's origin.
    fn origin(&self) -> DVec3 {
        self.grid.origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let b = &self.blocks[prim as usize];
        let (lo, size) = (UVec3::from_array(b.lo), UVec3::from_array(b.size.map(u32::from)));
        outward_box(lo.as_dvec3() * self.grid.spacing, (lo + size).as_dvec3() * self.grid.spacing)
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let root = self.first(prim, ray)?;
        Some(ShapeHit { t: root.t as f32, u: root.isovalue as f32, v: 0.0 })
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let Grid { dims, origin, spacing, .. } = *self.grid;
        let place =
            place_on(&self.index_ray(ray), dims, spacing, hit, ray, |near| self.first(prim, near));
        let at = place.index.as_vec3();
        let gradient = match self.normals {
            IsosurfaceNormals::Surface => self.grid.gradient(at),
            IsosurfaceNormals::Smooth => {
                smooth_gradient(dims, spacing, at, |p| self.grid.at(p.x, p.y, p.z))
            }
        };
        let scalar = match &self.color_by {
            None => self.isovalues[place.isovalue.min(self.isovalues.len() - 1)],
            Some(g) => g.value(((origin - g.origin + place.index * spacing) / g.spacing).as_vec3()),
        };
        place.surface(gradient, scalar, ray)
    }
}
