//! Isosurfaces of stored volumes. The primitives are bricks.

use super::active_walk::walk_active;
use super::brick::StoredBrick;
use super::layout::BLOCK_CELLS;
use super::read::StoredVolume;
use crate::grid::{cell_of, gradient_in_cell};
use crate::grid_walk::{Crossing, IndexRay};
use crate::math::Aabb;
use crate::ray::Ray;
use crate::shapes::isosurface_cell::{
    Root, check_isovalues, place_on, root_in_cell, smooth_gradient, smooth_gradient_inside,
};
use crate::shapes::{
    IsosurfaceNormals, Shape, ShapeError, ShapeHit, ShapeSurface, in_range, outward_box,
};
use glam::{DVec3, UVec3, Vec3};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The surfaces value = isovalue of a stored volume, for one or several isovalues. Hits are those
/// of an [`Isosurface`](crate::shapes::Isosurface) of the same lattice in memory, bit for bit: `u`
/// is the number of the isovalue, `v` is 0.
///
/// Bricks that no surface crosses are never read. Within a brick, rays pass over blocks of
/// 4 x 4 x 4 cells that no surface crosses.
pub struct StoredIsosurface {
    volume: Arc<StoredVolume>,
    isovalues: Vec<f32>,
    /// Numbers of the bricks that a surface may cross.
    bricks: Vec<u32>,
    normals: IsosurfaceNormals,
    /// Different for any two of a process: bricks keep which cells its surfaces cross.
    number: u64,
}

impl StoredIsosurface {
    /// Surfaces of `volume` at `isovalues`.
    ///
    /// # Errors
    /// Without an isovalue, or with one that is not finite.
    pub fn new(
        volume: Arc<StoredVolume>,
        isovalues: &[f32],
        normals: IsosurfaceNormals,
    ) -> Result<StoredIsosurface, ShapeError> {
        check_isovalues(isovalues)?;
        let isovalues = isovalues.to_vec();
        let bricks = (0..volume.num_bricks())
            .filter(|&number| crosses(&isovalues, volume.brick_range(number)))
            .collect();
        static NUMBERS: AtomicU64 = AtomicU64::new(0);
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        Ok(StoredIsosurface { volume, isovalues, bricks, normals, number })
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<StoredVolume> {
        &self.volume
    }

    /// The isovalues, in the order of a hit's `u`.
    pub fn isovalues(&self) -> &[f32] {
        &self.isovalues
    }

    fn index_ray(&self, ray: &Ray) -> IndexRay {
        let spacing = self.volume.layout().spacing;
        IndexRay::new(ray.origin.as_dvec3(), ray.dir.as_dvec3(), spacing)
    }

    /// The first root in brick `prim` within the ray's range.
    fn first(&self, prim: u32, ray: &Ray) -> Option<Root> {
        let number = *self.bricks.get(prim as usize)?;
        let found = self.volume.with_brick(number, |brick| self.first_in(brick, ray));
        found.flatten().filter(|r| in_range(r.t as f32, ray))
    }

    fn first_in(&self, brick: &StoredBrick, ray: &Ray) -> Option<Root> {
        let index_ray = self.index_ray(ray);
        let cells = |p: UVec3| p.to_array().map(i64::from);
        let last = cells(self.volume.layout().dims - UVec3::ONE);
        let (lo, hi) = (cells(brick.place.lo), cells(brick.place.hi));
        let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
        let mut found = None;
        let mut look = |crossing: &Crossing| {
            found = cell_in(brick, crossing.cell).and_then(|cell| {
                root_in_cell(&brick.corners(cell), &self.isovalues, &index_ray, crossing)
            });
            found.is_none()
        };
        if index_ray.is_plain()
            && let Some(active) = brick.active_cells(&self.isovalues, self.number)
        {
            walk_active(&index_ray, lo, last, active, (t_min, t_max), look);
            return found;
        }
        // Walks of parts of the lattice have the cells and parameters of a walk of the whole, bit
        // for bit, so blocks can be left out.
        index_ray.walk(lo, hi, last, i64::from(BLOCK_CELLS), t_min, t_max, |block| {
            let from = block.cell;
            let Some(cell) = cell_in(brick, from) else { return true };
            if !crosses(&self.isovalues, brick.block_range(cell)) {
                return true;
            }
            let to = std::array::from_fn(|a| (from[a] + i64::from(BLOCK_CELLS)).min(hi[a]));
            let mut goes_on = true;
            index_ray.walk(from, to, last, 1, t_min, t_max, |crossing| {
                goes_on = look(crossing);
                goes_on
            });
            goes_on
        });
        found
    }

    /// The gradient at a continuous index, in value per world unit.
    fn gradient(&self, brick: &StoredBrick, at: Vec3) -> Vec3 {
        let layout = self.volume.layout();
        let (cell, f) = cell_of(layout.dims, at);
        // A point between two bricks may be rounded into the other one.
        let value = |point: UVec3| match brick.has(point) {
            true => brick.at(point),
            false => self.volume.value(point),
        };
        match self.normals {
            IsosurfaceNormals::Surface => {
                let corner = |c: u32| cell + UVec3::new(c & 1, c >> 1 & 1, c >> 2 & 1);
                let corners = std::array::from_fn(|c| value(corner(c as u32)));
                gradient_in_cell(&corners, f, layout.spacing)
            }
            IsosurfaceNormals::Smooth => match brick.around(cell) {
                Some(values) => smooth_gradient_inside(&values, f, layout.spacing),
                None => smooth_gradient(layout.dims, layout.spacing, at, value),
            },
        }
    }
}

/// Whether one of the surfaces may lie among values of this range.
#[inline]
fn crosses(isovalues: &[f32], [lo, hi]: [f32; 2]) -> bool {
    isovalues.iter().any(|&iso| lo < iso && iso <= hi)
}

/// A cell of a brick. `None` where it lies outside: a ray whose numbers overflow in units of cells
/// has no place in the lattice.
#[inline]
fn cell_in(brick: &StoredBrick, cell: [i64; 3]) -> Option<UVec3> {
    let (lo, hi) = (brick.place.lo.to_array(), brick.place.hi.to_array());
    let is_inside = (0..3).all(|a| i64::from(lo[a]) <= cell[a] && cell[a] < i64::from(hi[a]));
    is_inside.then(|| UVec3::from_array(cell.map(|c| c as u32)))
}

impl Shape for StoredIsosurface {
    fn num_primitives(&self) -> usize {
        self.bricks.len()
    }

    /// The lattice's origin.
    fn origin(&self) -> DVec3 {
        self.volume.layout().origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let layout = self.volume.layout();
        let place = layout.brick(self.bricks[prim as usize]);
        outward_box(place.lo.as_dvec3() * layout.spacing, place.hi.as_dvec3() * layout.spacing)
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let root = self.first(prim, ray)?;
        Some(ShapeHit { t: root.t as f32, u: root.isovalue as f32, v: 0.0 })
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let layout = self.volume.layout();
        let place = place_on(&self.index_ray(ray), layout.dims, layout.spacing, hit, ray, |near| {
            self.first(prim, near)
        });
        let number = self.bricks.get(prim as usize).copied();
        let at = place.index.as_vec3();
        let gradient = number
            .and_then(|number| self.volume.with_brick(number, |brick| self.gradient(brick, at)));
        let isovalue = self.isovalues[place.isovalue.min(self.isovalues.len() - 1)];
        place.surface(gradient.unwrap_or(Vec3::ZERO), isovalue, ray)
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn failure(&self) -> Option<String> {
        self.volume.failure().map(String::from)
    }
}
