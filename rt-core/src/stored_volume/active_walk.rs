//! The way of a ray through the active cells of a whole brick. It finds the cells, and the
//! parameters between them, that [`IndexRay::walk`] finds, bit for bit, and calls for those alone
//! that are active.
//!
//! The parameters of the planes between blocks are computed once, along each axis in the order in
//! which the ray meets them. They rise, so where the ray stands is the number of planes behind it,
//! and a step is a look into the table. In a block that has active cells, the same is done with the
//! planes between its cells.

use super::active_cells::{ActiveCells, BLOCKS};
use super::layout::{BLOCK_CELLS, BRICK_CELLS};
use crate::grid_walk::{Crossing, IndexRay};

/// Cells along the edge of a block.
const CELLS: usize = BLOCK_CELLS as usize;

/// The numbers of planes, to count with.
const NUMBERS: [f64; BLOCKS + 2] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];

/// Parameters of planes along an axis, in the ray's order: more than there are, so that no place
/// in the table needs a check.
type Table<const N: usize> = [[f64; N]; 3];

/// Where a ray stands.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) t0: f64,
    /// Axis of the face through which it came, or 3 where its range begins.
    pub(super) entry: usize,
}

/// A ray in a whole brick.
pub(super) struct BrickRay<'a> {
    pub(super) ray: &'a IndexRay,
    pub(super) t_max: f64,
    /// 1 where it moves to higher cells, else -1.
    pub(super) sign: [i64; 3],
    /// Whether it moves along the axis at all. Where it does not, planes up to `still` lie behind
    /// it.
    pub(super) moves: [bool; 3],
    pub(super) still: [i64; 3],
}

/// A block that a ray enters.
pub(super) struct BlockVisit {
    /// The plane of the lattice that the ray meets first along each axis.
    pub(super) near: [i64; 3],
    /// Parameters at the planes that it meets last.
    pub(super) far: [f64; 3],
    pub(super) place: Place,
    /// Its active cells.
    pub(super) cells: u64,
}

/// Visits the active cells that a ray crosses within `[t_min, t_max]`, in order, until `visit`
/// returns false. `lo` is the first cell of the brick, `last` the number of cells of the lattice,
/// `active` the brick's active cells. The ray [is plain](IndexRay::is_plain).
#[inline(always)]
pub(super) fn walk_active(
    ray: &IndexRay,
    lo: [i64; 3],
    last: [i64; 3],
    active: &ActiveCells,
    (t_min, t_max): (f64, f64),
    mut visit: impl FnMut(&Crossing) -> bool,
) {
    let edge = i64::from(BRICK_CELLS);
    let Some(bounds) = active.bounds() else { return };
    // The first of the blocks around all active cells, and one past the last, in the ray's order.
    let (mut first, mut end) = ([0; 3], [0; 3]);
    // The plane of the lattice that it meets first along each axis.
    let mut near = lo;
    let mut way = BrickRay { ray, t_max, sign: [1; 3], moves: [true; 3], still: [0; 3] };
    for a in 0..3 {
        let [low, high] = [usize::from(bounds[a][0]), usize::from(bounds[a][1])];
        let turned = ray.d[a] < 0.0;
        first[a] = if turned { BLOCKS - high } else { low };
        end[a] = if turned { BLOCKS - low } else { high };
        if ray.d[a] == 0.0 {
            let cell = (ray.o[a].floor() as i64).min(last[a] - 1);
            let is_outside = ray.o[a] < 0.0 || ray.o[a] > last[a] as f64;
            if is_outside || cell < lo[a] || cell >= lo[a] + edge {
                // It passes beside the brick.
                return;
            }
            (way.moves[a], way.still[a]) = (false, cell);
        } else if turned {
            (near[a], way.sign[a]) = (lo[a] + edge, -1);
        }
    }
    // As in `IndexRay::walk`: of planes met at the same parameter, the last is the entry and the
    // first the exit.
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    let (mut entry, mut exit) = (0, 0);
    for a in 0..3 {
        if !way.moves[a] {
            continue;
        }
        let plane = |k: usize| near[a] + way.sign[a] * (CELLS * k) as i64;
        let low = ray.plane_at(a, plane(first[a]) as f64);
        let far = ray.plane_at(a, plane(end[a]) as f64);
        if low >= enter {
            (enter, entry) = (low, a);
        }
        if far < leave {
            (leave, exit) = (far, a);
        }
    }
    let passes = enter < leave || (enter == leave && entry < exit);
    if !passes || enter >= t_max || leave <= t_min {
        return;
    }
    let mut place = match enter <= t_min {
        true => Place { t0: t_min, entry: 3 },
        false => Place { t0: enter, entry },
    };
    let mut planes: Table<16> = [[f64::INFINITY; 16]; 3];
    for a in 0..3 {
        way.fill::<{ BLOCKS + 2 }>(a, near[a], CELLS, &mut planes[a]);
    }
    // The number of the block, and what a step along each axis adds to it.
    let (mut at, mut step, mut next, mut k) = (0isize, [0isize; 3], [0f64; 3], [0usize; 3]);
    let mut stride = 1;
    for a in 0..3 {
        let behind = planes_behind::<16, { BLOCKS - 1 }>(&planes, a, place);
        if !way.moves[a] && (behind < first[a] || behind >= end[a]) {
            return;
        }
        k[a] = behind.max(first[a]).min(end[a] - 1);
        next[a] = planes[a][(k[a] + 1) & 15];
        step[a] = way.sign[a] as isize * stride;
        let lowest = if way.sign[a] > 0 { 0 } else { BLOCKS as isize - 1 };
        at += lowest * stride + k[a] as isize * step[a];
        stride *= BLOCKS as isize;
    }
    loop {
        let (a, leaves_at) = first_of(next);
        let ends = leaves_at > t_max;
        let cells = active.in_block(at as usize);
        if cells != 0 {
            let near = std::array::from_fn(|b| near[b] + way.sign[b] * (CELLS * k[b]) as i64);
            if !way.walk_block(BlockVisit { near, far: next, place, cells }, &mut visit) {
                return;
            }
        }
        if ends {
            return;
        }
        for b in 0..3 {
            let is_crossed = b == a;
            k[b] += usize::from(is_crossed);
            at += if is_crossed { step[b] } else { 0 };
            next[b] = planes[b][(k[b] + 1) & 15];
        }
        if (k[0] >= end[0]) | (k[1] >= end[1]) | (k[2] >= end[2]) {
            return;
        }
        place = Place { t0: leaves_at.max(place.t0), entry: a };
    }
}

/// The axis whose plane comes first, and its parameter; the first axis of those at the same.
#[inline(always)]
fn first_of(next: [f64; 3]) -> (usize, f64) {
    if next[0] <= next[1] && next[0] <= next[2] {
        (0, next[0])
    } else if next[1] <= next[2] {
        (1, next[1])
    } else {
        (2, next[2])
    }
}

/// How many of the planes 1 to `LAST` of an axis the ray has passed.
#[inline(always)]
fn planes_behind<const N: usize, const LAST: usize>(
    planes: &Table<N>,
    a: usize,
    place: Place,
) -> usize {
    // A plane met just there is behind, if the ray has its axis' turn behind it.
    let end = if a < place.entry { place.t0.next_up() } else { place.t0 };
    let mut count = 0;
    for k in 1..=LAST {
        count += u64::from(planes[a][k] < end);
    }
    count as usize
}

impl BrickRay<'_> {
    /// The parameters at `COUNT` planes along axis `a`, from plane `near` on in the ray's order
    /// with `step` between them.
    #[inline(always)]
    fn fill<const COUNT: usize>(&self, a: usize, near: i64, step: usize, out: &mut [f64]) {
        if !self.moves[a] {
            for (k, t) in out.iter_mut().take(COUNT).enumerate() {
                let is_behind = near + (step * k) as i64 <= self.still[a];
                *t = if is_behind { f64::NEG_INFINITY } else { f64::INFINITY };
            }
            return;
        }
        // Numbers of planes are whole and below 2³², so these sums are the numbers themselves.
        let (near, step) = (near as f64, (self.sign[a] * step as i64) as f64);
        for (t, &k) in out.iter_mut().zip(&NUMBERS[..COUNT]) {
            *t = self.ray.plane_at(a, near + step * k);
        }
    }

    /// The active cells of a block, in the ray's order. Returns whether to go on.
    #[inline(always)]
    pub(super) fn walk_block(
        &self,
        BlockVisit { near, far, mut place, cells: active }: BlockVisit,
        visit: &mut impl FnMut(&Crossing) -> bool,
    ) -> bool {
        let mut planes: Table<8> = [[f64::INFINITY; 8]; 3];
        let (mut bit, mut step, mut next, mut c) = (0i32, [0i32; 3], [0f64; 3], [0usize; 3]);
        let mut stride = 1;
        for a in 0..3 {
            self.fill::<CELLS>(a, near[a], 1, &mut planes[a]);
            planes[a][CELLS] = far[a];
            c[a] = planes_behind::<8, { CELLS - 1 }>(&planes, a, place);
            next[a] = planes[a][(c[a] + 1) & 7];
            step[a] = self.sign[a] as i32 * stride;
            let first = if self.sign[a] > 0 { 0 } else { CELLS as i32 - 1 };
            bit += first * stride + c[a] as i32 * step[a];
            stride *= CELLS as i32;
        }
        loop {
            let (a, leaves_at) = first_of(next);
            let ends = leaves_at > self.t_max;
            let t1 = if ends { self.t_max } else { leaves_at.max(place.t0) };
            if active >> (bit & 63) & 1 == 1 {
                let mut cell = [0; 3];
                for b in 0..3 {
                    let back = i64::from(self.sign[b] < 0);
                    cell[b] = near[b] + self.sign[b] * c[b] as i64 - back;
                }
                let crossing = Crossing {
                    cell,
                    t0: place.t0,
                    t1,
                    entry: (place.entry < 3).then_some(place.entry),
                    exit: (!ends).then_some(a),
                };
                if !visit(&crossing) {
                    return false;
                }
            }
            if ends {
                return false;
            }
            for b in 0..3 {
                let is_crossed = b == a;
                c[b] += usize::from(is_crossed);
                bit += if is_crossed { step[b] } else { 0 };
                next[b] = planes[b][(c[b] + 1) & 7];
            }
            if c[0].max(c[1]).max(c[2]) >= CELLS {
                return true;
            }
            place = Place { t0: t1, entry: a };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SplitMix64;
    use crate::stored_volume::active_cells::sides;
    use glam::DVec3;

    /// Rays through points, edges and planes of the lattice among others, so that they meet planes
    /// at the same parameter.
    #[test]
    fn the_active_cells_are_met_as_by_a_walk_through_all_bit_for_bit() {
        let (lo, edge) = ([32i64, 64, 0], i64::from(BRICK_CELLS));
        let (hi, last) = (lo.map(|c| c + edge), [96, 96, 32]);
        let mut r = SplitMix64::new(9);
        let mut met = 0;
        for share in [0.0, 0.0002, 0.01, 0.3] {
            let values: Vec<f32> =
                (0..33 * 33 * 33).map(|_| if r.unit() < share { 1.0 } else { 0.0 }).collect();
            let active = ActiveCells::new(|iso, out| sides(&values, iso, out), &[0.5], 0);
            let is_active = |cell: [i64; 3]| {
                let at = [0, 1, 2].map(|a| (cell[a] - lo[a]) as usize);
                let number = |size: usize, [x, y, z]: [usize; 3]| (z * size + y) * size + x;
                let bit = number(CELLS, at.map(|c| c % CELLS));
                active.in_block(number(BLOCKS, at.map(|c| c / CELLS))) >> bit & 1 == 1
            };
            for i in 0..10_000 {
                let (mut o, mut d) = ([0.0; 3], [0.0; 3]);
                for a in 0..3 {
                    let (place, slope) = (44.0 * r.unit() - 6.0, 4.0 * r.unit() - 2.0);
                    let is_round = i % 4 != 0;
                    o[a] = lo[a] as f64 + if is_round { place.round() } else { place };
                    d[a] = if is_round { slope.round() } else { slope };
                }
                let ray = IndexRay::new(DVec3::from(o), DVec3::from(d), DVec3::ONE);
                if !ray.is_plain() {
                    continue;
                }
                let t_min = [0.0, 2.0, 3.7][i % 3];
                let t_max = [f64::INFINITY, 9.0, 14.3][i / 3 % 3];
                let parts =
                    |c: &Crossing| (c.cell, c.t0.to_bits(), c.t1.to_bits(), c.entry, c.exit);
                let (mut expected, mut found) = (vec![], vec![]);
                // What begins at the end of the range is of no use to any ray.
                ray.walk(lo, hi, last, 1, t_min, t_max, |c| {
                    if c.t0 < t_max && is_active(c.cell) {
                        expected.push(parts(c));
                    }
                    true
                });
                walk_active(&ray, lo, last, &active, (t_min, t_max), |c| {
                    if c.t0 < t_max {
                        found.push(parts(c));
                    }
                    true
                });
                assert_eq!(found, expected, "{ray:?} {t_min} {t_max}");
                met += found.len();
            }
        }
        assert!(met > 10_000, "{met}");
    }
}
