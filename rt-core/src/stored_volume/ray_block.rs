//! The way of sixteen rays through the blocks of a whole brick, a step of all of them at a time. It
//! finds for each ray the active cells, and the parameters between them, that
//! [`walk_active`](super::active_walk::walk_active) finds, bit for bit.
//!
//! All numbers are rows with one place a lane, and nothing branches on a lane but the visit of a
//! block that has active cells: loops over lanes are vectorized by the compiler.

use super::active_cells::{ActiveCells, BLOCKS};
use super::active_walk::{BlockVisit, BrickRay, Place};
use super::layout::{BLOCK_CELLS, BRICK_CELLS};
use crate::grid_walk::{Crossing, IndexRay};
use crate::ray::{LANES, RayBlock};
use glam::DVec3;

/// Cells along the edge of a block.
const CELLS: f64 = BLOCK_CELLS as f64;
/// Added to a whole number from 0 on, it has that number in its lowest bits.
const WHOLE: f64 = 4_503_599_627_370_496.0;

/// A number for each lane.
type Row = [f64; LANES];

/// Sixteen rays in continuous grid indices.
pub(super) struct IndexRays {
    o: [Row; 3],
    d: [Row; 3],
    inverse: [Row; 3],
}

impl IndexRays {
    /// Converts rays as [`IndexRay::new`] does.
    #[inline(always)]
    pub(super) fn new(rays: &RayBlock, spacing: DVec3) -> IndexRays {
        let (o, d) = ([&rays.ox, &rays.oy, &rays.oz], [&rays.dx, &rays.dy, &rays.dz]);
        let zero = [[0.0; LANES]; 3];
        let mut all = IndexRays { o: zero, d: zero, inverse: zero };
        for a in 0..3 {
            for l in 0..LANES {
                let slope = f64::from(d[a][l]) / spacing[a];
                all.o[a][l] = f64::from(o[a][l]) / spacing[a];
                all.d[a][l] = slope;
                all.inverse[a][l] = 1.0 / slope;
            }
        }
        all
    }

    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> IndexRay {
        let lane = lane & (LANES - 1);
        let [o, d, inverse] = [&self.o, &self.d, &self.inverse];
        IndexRay::of_parts(
            [o[0][lane], o[1][lane], o[2][lane]],
            [d[0][lane], d[1][lane], d[2][lane]],
            [inverse[0][lane], inverse[1][lane], inverse[2][lane]],
        )
    }

    /// The lanes whose numbers and their reciprocals are finite, and that move along each axis.
    #[inline(always)]
    pub(super) fn moving(&self) -> u16 {
        let mut moving = 0;
        for l in 0..LANES {
            let mut plain = true;
            for a in 0..3 {
                // The reciprocal of an infinite number is zero.
                let inverse = self.inverse[a][l];
                plain &= self.o[a][l].is_finite() & inverse.is_finite() & (inverse != 0.0);
            }
            moving |= u16::from(plain) << l;
        }
        moving
    }

    /// The parameter at plane `plane` of an axis.
    #[inline(always)]
    fn at(&self, a: usize, l: usize, plane: f64) -> f64 {
        (plane - self.o[a][l]) * self.inverse[a][l]
    }
}

/// Where the rays stand, and what they meet next.
struct Places {
    t0: Row,
    /// Axis of the face through which a ray came, or 3 where its range begins.
    entry: Row,
    /// The number of the block.
    block: Row,
    /// What a step along each axis adds to it.
    stride: [Row; 3],
    /// The plane at the far side of the block along each axis, and its parameter.
    plane: [Row; 3],
    next: [Row; 3],
    /// From one plane between blocks to the next.
    step: [Row; 3],
    /// The plane behind the last block that has active cells.
    last: [Row; 3],
}

/// Visits the active cells that the rays `lanes` cross within their ranges, each ray's in order,
/// until `visit` returns false for the ray. `lo` is the first cell of the brick. The rays are
/// [moving](IndexRays::moving).
#[inline(always)]
pub(super) fn walk_active_block(
    rays: &IndexRays,
    lanes: u16,
    lo: [i64; 3],
    active: &ActiveCells,
    (t_min, t_max): (&[f32; LANES], &[f32; LANES]),
    mut visit: impl FnMut(usize, &IndexRay, &Crossing) -> bool,
) {
    let (mut from, mut to) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        (from[l], to[l]) = (f64::from(t_min[l]), f64::from(t_max[l]));
    }
    let (t_min, t_max) = (from, to);
    let Some(bounds) = active.bounds() else { return };
    let (mut places, passing) = enter(rays, lo, bounds, &t_min, &t_max);
    let mut left = lanes & passing;
    let cells = active.all();
    while left != 0 {
        let Places { t0, entry, block, stride, plane, next, step, last } = &mut places;
        // ---- The axis whose plane comes first; the first axis of those at the same parameter.
        let (mut axis, mut leaves) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let [x, y, z] = [next[0][l], next[1][l], next[2][l]];
            let (first, second) = ((x <= y) & (x <= z), y <= z);
            let (other, other_at) = if second { (1.0, y) } else { (2.0, z) };
            (axis[l], leaves[l]) = if first { (0.0, x) } else { (other, other_at) };
        }
        // ---- Blocks with active cells, ray by ray.
        let (mut words, mut some) = ([0; LANES], 0u16);
        for l in 0..LANES {
            let number = (block[l] + WHOLE).to_bits() as usize;
            words[l] = cells[number & (cells.len() - 1)];
            some |= u16::from(words[l] != 0) << l;
        }
        some &= left;
        while some != 0 {
            let lane = some.trailing_zeros() as usize & (LANES - 1);
            some &= some - 1;
            let ray = rays.get(lane);
            let (mut sign, mut near, mut far) = ([1; 3], [0; 3], [0.0; 3]);
            for a in 0..3 {
                sign[a] = if step[a][lane] > 0.0 { 1 } else { -1 };
                near[a] = (plane[a][lane] - step[a][lane]) as i64;
                far[a] = next[a][lane];
            }
            let t_max = t_max[lane];
            let way = BrickRay { ray: &ray, t_max, sign, moves: [true; 3], still: [0; 3] };
            let place = Place { t0: t0[lane], entry: entry[lane] as usize };
            let block = BlockVisit { near, far, place, cells: words[lane] };
            if !way.walk_block(block, &mut |crossing: &Crossing| visit(lane, &ray, crossing)) {
                left &= !(1 << lane);
            }
        }
        // ---- On into the next blocks.
        let mut ended = 0u16;
        for l in 0..LANES {
            let mut ends = leaves[l] > t_max[l];
            for a in 0..3 {
                let is_crossed = axis[l] == a as f64;
                ends |= is_crossed & (plane[a][l] == last[a][l]);
                let beyond = plane[a][l] + step[a][l];
                let beyond_at = rays.at(a, l, beyond);
                plane[a][l] = if is_crossed { beyond } else { plane[a][l] };
                next[a][l] = if is_crossed { beyond_at } else { next[a][l] };
                block[l] += if is_crossed { stride[a][l] } else { 0.0 };
            }
            t0[l] = leaves[l].max(t0[l]);
            entry[l] = axis[l];
            ended |= u16::from(ends) << l;
        }
        left &= !ended;
    }
}

/// Where the rays enter the box of a brick's active blocks, whose first and one past the last along
/// each axis are `bounds`; and the lanes that do, within their ranges.
#[inline(always)]
fn enter(
    rays: &IndexRays,
    lo: [i64; 3],
    bounds: [[u8; 2]; 3],
    t_min: &Row,
    t_max: &Row,
) -> (Places, u16) {
    let zero = [[0.0; LANES]; 3];
    // ---- Planes in the order in which the rays meet them.
    let (mut near, mut step, mut first, mut end, mut last) = (zero, zero, zero, zero, zero);
    // As in `IndexRay::walk`: of planes met at the same parameter, the last is the entry and the
    // first the exit.
    let (mut enter, mut leave) = ([f64::NEG_INFINITY; LANES], [f64::INFINITY; LANES]);
    let (mut entry, mut exit) = ([0.0; LANES], [0.0; LANES]);
    for a in 0..3 {
        let (low, high) = (f64::from(bounds[a][0]), f64::from(bounds[a][1]));
        let low_corner = lo[a] as f64;
        let high_corner = low_corner + f64::from(BRICK_CELLS);
        for l in 0..LANES {
            let turned = rays.d[a][l] < 0.0;
            near[a][l] = if turned { high_corner } else { low_corner };
            step[a][l] = if turned { -CELLS } else { CELLS };
            first[a][l] = if turned { BLOCKS as f64 - high } else { low };
            end[a][l] = if turned { BLOCKS as f64 - low } else { high };
            last[a][l] = near[a][l] + step[a][l] * end[a][l];
            let nearest = rays.at(a, l, near[a][l] + step[a][l] * first[a][l]);
            let farthest = rays.at(a, l, last[a][l]);
            let (is_entry, is_exit) = (nearest >= enter[l], farthest < leave[l]);
            enter[l] = if is_entry { nearest } else { enter[l] };
            entry[l] = if is_entry { a as f64 } else { entry[l] };
            leave[l] = if is_exit { farthest } else { leave[l] };
            exit[l] = if is_exit { a as f64 } else { exit[l] };
        }
    }
    let (mut t0, mut passing) = ([0.0; LANES], 0u16);
    for l in 0..LANES {
        let crosses = (enter[l] < leave[l]) | ((enter[l] == leave[l]) & (entry[l] < exit[l]));
        let reaches = (enter[l] < t_max[l]) & (leave[l] > t_min[l]);
        passing |= u16::from(crosses & reaches) << l;
        let starts_inside = enter[l] <= t_min[l];
        t0[l] = if starts_inside { t_min[l] } else { enter[l] };
        entry[l] = if starts_inside { 3.0 } else { entry[l] };
    }
    // ---- The block where each begins: planes that it has met by then are behind it.
    let (mut plane, mut next, mut stride, mut block) = (zero, zero, zero, [0.0f64; LANES]);
    let mut size = 1.0f64;
    for a in 0..3 {
        let mut behind = [0.0f64; LANES];
        for k in 1..BLOCKS {
            for l in 0..LANES {
                let at = rays.at(a, l, near[a][l] + step[a][l] * k as f64);
                // A plane met just there is behind, if the ray has its axis' turn behind it.
                let is_behind = (at < t0[l]) | ((at == t0[l]) & ((a as f64) < entry[l]));
                behind[l] += if is_behind { 1.0 } else { 0.0 };
            }
        }
        for l in 0..LANES {
            let k = behind[l].max(first[a][l]).min(end[a][l] - 1.0);
            plane[a][l] = near[a][l] + step[a][l] * (k + 1.0);
            next[a][l] = rays.at(a, l, plane[a][l]);
            let is_turned = step[a][l] < 0.0;
            stride[a][l] = if is_turned { -size } else { size };
            block[l] += if is_turned { BLOCKS as f64 - 1.0 - k } else { k } * size;
        }
        size *= BLOCKS as f64;
    }
    (Places { t0, entry, block, stride, plane, next, step, last }, passing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SplitMix64;
    use crate::ray::Ray;
    use crate::stored_volume::active_cells::sides;
    use crate::stored_volume::active_walk::walk_active;
    use fearless_simd::{Level, Simd as _, dispatch};
    use glam::Vec3;

    /// Rays through points, edges and planes of the lattice among others, so that they meet planes
    /// at the same parameter.
    #[test]
    fn sixteen_rays_meet_the_active_cells_of_each_bit_for_bit() {
        let lo = [32i64, 64, 0];
        let last = [96, 96, 32];
        let mut r = SplitMix64::new(19);
        let mut met = 0;
        for share in [0.0, 0.0002, 0.01, 0.3] {
            let values: Vec<f32> =
                (0..33 * 33 * 33).map(|_| if r.unit() < share { 1.0 } else { 0.0 }).collect();
            let active = ActiveCells::new(|iso, out| sides(&values, iso, out), &[0.5], 0);
            for i in 0..600 {
                let mut block = RayBlock::INACTIVE;
                for lane in 0..LANES {
                    let (mut o, mut d) = ([0.0; 3], [0.0; 3]);
                    for a in 0..3 {
                        let (place, slope) = (44.0 * r.unit() - 6.0, 4.0 * r.unit() - 2.0);
                        let is_round = !(i + lane).is_multiple_of(4);
                        o[a] = lo[a] as f32 + (if is_round { place.round() } else { place }) as f32;
                        d[a] = (if is_round { slope.round() } else { slope }) as f32;
                    }
                    let t_min = [0.0, 2.0, 3.7][i % 3];
                    let t_max = [f32::INFINITY, 9.0, 14.3][i / 3 % 3];
                    let (origin, dir) = (Vec3::from(o), Vec3::from(d));
                    block.set(lane, &Ray { origin, dir, t_min, t_max });
                }
                let parts =
                    |c: &Crossing| (c.cell, c.t0.to_bits(), c.t1.to_bits(), c.entry, c.exit);
                let mut found: [Vec<_>; LANES] = Default::default();
                let mut moving = 0;
                dispatch!(Level::new(), simd => simd.vectorize(#[inline(always)] || {
                    let rays = IndexRays::new(&block, DVec3::ONE);
                    moving = rays.moving();
                    let range = (&block.t_min, &block.t_max);
                    walk_active_block(&rays, moving, lo, &active, range, |lane, _, c| {
                        found[lane].push(parts(c));
                        found[lane].len() < 20
                    });
                }));
                for lane in (0..LANES).filter(|lane| moving >> lane & 1 == 1) {
                    let ray = block.get(lane);
                    let index =
                        IndexRay::new(ray.origin.as_dvec3(), ray.dir.as_dvec3(), DVec3::ONE);
                    assert!(index.is_plain());
                    let range = (f64::from(ray.t_min), f64::from(ray.t_max));
                    let mut expected = vec![];
                    walk_active(&index, lo, last, &active, range, |c| {
                        expected.push(parts(c));
                        expected.len() < 20
                    });
                    assert_eq!(found[lane], expected, "{ray:?}");
                    met += expected.len();
                }
            }
        }
        assert!(met > 5000, "{met}");
    }
}
