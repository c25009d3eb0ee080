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

use super::{Shape, ShapeError, ShapeHit, ShapeSurface, in_range, outward_box, rounded_point};
use crate::grid::Grid;
use crate::grid_walk::{Crossing, IndexRay};
use crate::math::Aabb;
use crate::ray::Ray;
use crate::ray_cubic;
use glam::{DVec3, UVec3, Vec3};
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

/// A root: ray parameter, isovalue.
struct Root {
    t: f64,
    isovalue: usize,
}

impl Isosurface {
    /// Surfaces of `grid` at `isovalues`.
    pub fn new(
        grid: Arc<Grid>,
        isovalues: &[f32],
        options: &IsosurfaceOptions,
    ) -> Result<Self, ShapeError> {
        const SHAPE: &str = "isosurface";
        if grid.dims.min_element() < 2 {
            return Err(ShapeError::NoCells { shape: SHAPE, dims: grid.dims });
        }
        if isovalues.is_empty() {
            return Err(ShapeError::Length {
                shape: SHAPE,
                field: "isovalues",
                per: "surface",
                expected: 1,
                found: 0,
            });
        }
        if let Some(&value) = isovalues.iter().find(|v| !v.is_finite()) {
            return Err(ShapeError::Value {
                shape: SHAPE,
                field: "isovalue",
                value,
                rule: "finite",
            });
        }
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
            found = self.root_in_cell(&index_ray, crossing);
            found.is_none()
        });
        found.filter(|r| in_range(r.t as f32, ray))
    }

    #[inline]
    fn root_in_cell(&self, ray: &IndexRay, crossing: &Crossing) -> Option<Root> {
        let corners = self.grid.corners(UVec3::from_array(crossing.cell.map(|c| c as u32)));
        let (lo, hi) = min_max(&corners);
        let mut positions = None;
        let mut best: Option<(f64, usize)> = None;
        for (n, &iso) in self.isovalues.iter().enumerate() {
            let crosses = lo < iso && iso <= hi && corners.iter().all(|v| v.is_finite());
            if !crosses {
                continue;
            }
            let (p, q) = positions.get_or_insert_with(|| ray.fractions(crossing, 1));
            // Differences first: f32 values minus an f32 are exact in f64 unless 2²⁹ apart, so the
            // sign at grid points is right.
            let iso = f64::from(iso);
            let b = ray_cubic::along(&corners.map(|v| f64::from(v) - iso), p, q);
            // A ray that starts exactly on the surface touches it there, in any direction.
            let touches = crossing.entry.is_none() && b[0] == 0.0;
            if let Some(u) = if touches { Some(0.0) } else { ray_cubic::first_change(&b) }
                && best.is_none_or(|(least, _)| u < least)
            {
                best = Some((u, n));
            }
        }
        best.map(|(u, isovalue)| Root {
            t: crossing.t0 + u * (crossing.t1 - crossing.t0),
            isovalue,
        })
    }
}

/// Smallest and largest of eight values; NaN is ignored.
#[inline]
fn min_max(v: &[f32; 8]) -> (f32, f32) {
    v.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)))
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

/// Central differences (one-sided at the border) at the corners of the cell around the continuous
/// index `p`, interpolated; in value per world unit. NaN where a neighbour is.
pub(crate) fn smooth_gradient(grid: &Grid, p: Vec3) -> Vec3 {
    let (cell, f) = grid.cell_of(p);
    let mut sum = Vec3::ZERO;
    for corner in 0..8u32 {
        let bit = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
        let c = (cell + bit).min(grid.dims - UVec3::ONE);
        let weight = Vec3::select(bit.cmpeq(UVec3::ONE), f, Vec3::ONE - f).element_product();
        if weight == 0.0 {
            continue;
        }
        let mut g = [0f32; 3];
        for a in 0..3 {
            let (mut lo, mut hi) = (c.to_array(), c.to_array());
            lo[a] = lo[a].saturating_sub(1);
            hi[a] = (hi[a] + 1).min(grid.dims[a] - 1);
            let width = (hi[a] - lo[a]) as f32 * grid.spacing[a] as f32;
            if width > 0.0 {
                g[a] = (grid.at(hi[0], hi[1], hi[2]) - grid.at(lo[0], lo[1], lo[2])) / width;
            }
        }
        sum += weight * Vec3::from_array(g);
    }
    sum
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
        // The root again in f64, in the few ulps around the reported parameter.
        let near = Ray {
            t_min: hit.t.next_down().max(ray.t_min),
            t_max: hit.t.next_up().next_up(),
            ..*ray
        };
        let root = self.first(prim, &near);
        let t = root.as_ref().map_or(f64::from(hit.t), |r| r.t);
        let isovalue = root.map_or(hit.u as usize, |r| r.isovalue).min(self.isovalues.len() - 1);
        let index_ray = self.index_ray(ray);
        let last = (self.grid.dims - UVec3::ONE).as_dvec3();
        let index = DVec3::from_array(index_ray.at(t)).clamp(DVec3::ZERO, last);
        // Rounding of o + t·d in index space: relative to the largest of its terms.
        let terms = (0..3)
            .map(|a| (index_ray.o[a].abs() + (t * index_ray.d[a]).abs()) * self.grid.spacing[a])
            .fold(0.0, f64::max);
        let (point, point_error) =
            rounded_point(index * self.grid.spacing, 8.0 * f64::EPSILON * terms);
        let at = index.as_vec3();
        let gradient = match self.normals {
            IsosurfaceNormals::Surface => self.grid.gradient(at),
            IsosurfaceNormals::Smooth => smooth_gradient(&self.grid, at),
        };
        // In f64: gradients of 1e-30 per metre have squares below f32's range.
        let normal = (-gradient.as_dvec3()).normalize_or(-ray.dir.as_dvec3().normalize_or_zero());
        let scalar = match &self.color_by {
            None => self.isovalues[isovalue],
            Some(g) => g.value(
                ((self.grid.origin - g.origin + index * self.grid.spacing) / g.spacing).as_vec3(),
            ),
        };
        ShapeSurface {
            point,
            point_error,
            normal: normal.as_vec3(),
            shading_normal: None,
            scalar: Some(scalar),
            color: None,
        }
    }
}
