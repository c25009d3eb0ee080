//! Isosurfaces of stored volumes. The primitives are bricks.

use super::active_walk::walk_active;
use super::brick::StoredBrick;
use super::layout::{BLOCK_CELLS, VolumeLayout};
use super::ray_block::{IndexRays, walk_active_block};
use super::read::StoredVolume;
use crate::grid::{cell_of, gradient_in_cell};
use crate::grid_walk::{Crossing, IndexRay};
use crate::math::Aabb;
use crate::ray::{HitBlock, LANES, Ray, RayBlock};
use crate::shapes::isosurface_cell::{
    Root, check_isovalues, place_on, root_in_cell, smooth_gradient, smooth_gradient_inside,
};
use crate::shapes::{
    IsosurfaceNormals, Shape, ShapeError, ShapeHit, ShapeSurface, in_range, outward_box,
};
use fearless_simd::Simd;
use glam::{DVec3, UVec3, Vec3};
use std::any::Any;
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

    /// The first roots of blocks of rays in brick `prim`, of lanes whose ranges are not empty.
    #[inline(always)]
    pub(crate) fn closest_of_blocks<S: Simd>(
        &self,
        simd: S,
        prim: u32,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
    ) {
        let Some(&number) = self.bricks.get(prim as usize) else { return };
        self.volume.with_brick(number, |brick| {
            simd.vectorize(
                #[inline(always)]
                || {
                    for (rays, hits) in rays.iter().zip(hits) {
                        self.closest_of_block(brick, prim, rays, hits);
                    }
                },
            );
        });
    }

    #[inline(always)]
    fn closest_of_block(
        &self,
        brick: &StoredBrick,
        prim: u32,
        rays: &RayBlock,
        hits: &mut HitBlock,
    ) {
        let mut set = |lane: usize, root: Root| {
            let t = root.t as f32;
            if t >= rays.t_min[lane] && t < rays.t_max[lane] {
                (hits.t[lane], hits.u[lane]) = (t, root.isovalue as f32);
                (hits.v[lane], hits.prim[lane]) = (0.0, prim);
            }
        };
        let mut left = 0u16;
        for lane in 0..LANES {
            left |= u16::from(rays.t_min[lane] < rays.t_max[lane]) << lane;
        }
        if let Some(active) = brick.active_cells(&self.isovalues, self.number) {
            let index_rays = IndexRays::new(rays, self.volume.layout().spacing);
            let together = left & index_rays.moving();
            left &= !together;
            let lo = brick.place.lo.to_array().map(i64::from);
            let range = (&rays.t_min, &rays.t_max);
            walk_active_block(&index_rays, together, lo, active, range, |lane, ray, crossing| {
                let root = self.root_in(brick, ray, crossing);
                let goes_on = root.is_none();
                root.into_iter().for_each(|root| set(lane, root));
                goes_on
            });
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize & (LANES - 1);
            left &= left - 1;
            if let Some(root) = self.first_in(brick, &rays.get(lane)) {
                set(lane, root);
            }
        }
    }

    /// The first root in a cell of a brick.
    #[inline(always)]
    fn root_in(&self, brick: &StoredBrick, ray: &IndexRay, crossing: &Crossing) -> Option<Root> {
        let cell = cell_in(brick, crossing.cell)?;
        root_in_cell(&brick.corners(cell), &self.isovalues, ray, crossing)
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
            found = self.root_in(brick, &index_ray, crossing);
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

    /// As [`Self::first_in`], for a range of few cells: a walk through these alone has less to
    /// prepare.
    fn first_near(&self, brick: &StoredBrick, index_ray: &IndexRay, near: &Ray) -> Option<Root> {
        let cells = |p: UVec3| p.to_array().map(i64::from);
        let last = cells(self.volume.layout().dims - UVec3::ONE);
        let (lo, hi) = (cells(brick.place.lo), cells(brick.place.hi));
        let (t_min, t_max) = (f64::from(near.t_min), f64::from(near.t_max));
        let mut found = None;
        index_ray.walk(lo, hi, last, 1, t_min, t_max, |crossing| {
            found = self.root_in(brick, index_ray, crossing);
            found.is_none()
        });
        found.filter(|r| in_range(r.t as f32, near))
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
#[inline(always)]
fn cell_in(brick: &StoredBrick, cell: [i64; 3]) -> Option<UVec3> {
    let (lo, hi) = (brick.place.lo, brick.place.hi);
    let mut is_inside = true;
    for a in 0..3 {
        is_inside &= i64::from(lo[a]) <= cell[a] && cell[a] < i64::from(hi[a]);
    }
    let [x, y, z] = cell;
    if is_inside { Some(UVec3::new(x as u32, y as u32, z as u32)) } else { None }
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
        let VolumeLayout { dims, spacing, .. } = self.volume.layout();
        let index_ray = self.index_ray(ray);
        let number = self.bricks.get(prim as usize).copied();
        let in_brick = |brick: &StoredBrick| {
            let again = |near: &Ray| self.first_near(brick, &index_ray, near);
            let place = place_on(&index_ray, dims, spacing, hit, ray, again);
            let gradient = self.gradient(brick, place.index.as_vec3());
            (place, gradient)
        };
        let found = number.and_then(|number| self.volume.with_brick(number, in_brick));
        let (place, gradient) = found.unwrap_or_else(|| {
            // The brick could be read for the hit and cannot be read now: the render fails.
            (place_on(&index_ray, dims, spacing, hit, ray, |_| None), Vec3::ZERO)
        });
        let isovalue = self.isovalues[place.isovalue.min(self.isovalues.len() - 1)];
        place.surface(gradient, isovalue, ray)
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn failure(&self) -> Option<String> {
        self.volume.failure().map(String::from)
    }
}
