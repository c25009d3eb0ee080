//! Where to cut a set of primitives: the surface area heuristic over bins (Wald, "On fast Construction of SAH-based Bounding Volume
//! Hierarchies", 2007), with a leaf of up to four primitives costing one test.

use super::prim_ref::{Box4, PrimRef, SetBounds};
use crate::accel::wide::LEAF_SIZE;
use glam::Vec4;
use rayon::prelude::*;

/// Most bins per axis.
const MAX_BINS: usize = 16;
/// Sets at least this large are binned in parallel, in pieces of this size (fixed, so that the tree does not depend on the threads).
const PARALLEL_CHUNK: usize = 1 << 16;

/// Leaf tests that `n` primitives cost.
#[inline(always)]
pub(crate) fn leaf_tests(n: usize) -> f32 {
    n.div_ceil(LEAF_SIZE) as f32
}

/// A way to cut a set in two.
#[derive(Debug, Clone, Copy)]
struct Cut {
    axis: usize,
    /// Primitives in bins up to and including this one go left.
    bin: u32,
}

/// Maps twice a centre to a bin per axis.
#[derive(Debug, Clone, Copy)]
struct BinMap {
    lo: Vec4,
    scale: Vec4,
}

/// Adding 2²³ to a float in [0, 2²³) rounds it to an integer that stands in the low bits: the conversion in one addition.
const ROUND: Vec4 = Vec4::splat(8_388_608.0);

impl BinMap {
    fn new(b: &SetBounds, bins: usize) -> Self {
        let extent = b.center2_hi - b.center2_lo;
        // Zero extent (and overflow to infinity) gives scale 0: everything in bin 0, and no cut on that axis.
        let k = (bins - 1) as f32;
        let inv = |e: f32| if e > 0.0 && (k / e).is_finite() { k / e } else { 0.0 };
        BinMap { lo: b.center2_lo, scale: Vec4::new(inv(extent.x), inv(extent.y), inv(extent.z), 0.0) }
    }

    #[inline(always)]
    fn bins(&self, p: &PrimRef) -> [u32; 4] {
        let x = (p.center2() - self.lo) * self.scale + ROUND;
        x.to_array().map(|v| v.to_bits() & (MAX_BINS as u32 - 1))
    }
}

/// Boxes and numbers of primitives per axis and bin.
pub(crate) struct Bins {
    boxes: [[Box4; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    pub(crate) fn empty() -> Self {
        Bins { boxes: [[Box4::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] }
    }

    fn clear(&mut self, bins: usize) {
        for axis in 0..3 {
            self.boxes[axis][..bins].fill(Box4::EMPTY);
            self.counts[axis][..bins].fill(0);
        }
    }

    #[inline]
    fn add_all(&mut self, refs: &[PrimRef], map: &BinMap) {
        for p in refs {
            let b = map.bins(p);
            for axis in 0..3 {
                let i = b[axis] as usize & (MAX_BINS - 1);
                self.boxes[axis][i].grow(p);
                self.counts[axis][i] += 1;
            }
        }
    }

    fn merge(mut self, o: Bins) -> Bins {
        for axis in 0..3 {
            for i in 0..MAX_BINS {
                self.boxes[axis][i].union(&o.boxes[axis][i]);
                self.counts[axis][i] += o.counts[axis][i];
            }
        }
        self
    }

    /// The cut with the smallest cost area(left)·tests(left) + area(right)·tests(right); `None` when all primitives share one bin in
    /// every axis.
    fn best_cut(&self, bins: usize) -> Option<Cut> {
        let tests = |n: u32| leaf_tests(n as usize);
        let mut best: Option<(f32, Cut)> = None;
        for axis in 0..3 {
            let (boxes, counts) = (&self.boxes[axis], &self.counts[axis]);
            // Cost of everything right of each bin.
            let mut right_cost = [0f32; MAX_BINS];
            let (mut acc, mut n) = (Box4::EMPTY, 0);
            for i in (1..bins).rev() {
                acc.union(&boxes[i]);
                n += counts[i];
                right_cost[i] = if n > 0 { acc.half_area() * tests(n) } else { f32::INFINITY };
            }
            let (mut acc, mut n) = (Box4::EMPTY, 0);
            for i in 0..bins - 1 {
                acc.union(&boxes[i]);
                n += counts[i];
                if n == 0 {
                    continue;
                }
                let cost = acc.half_area() * tests(n) + right_cost[i + 1];
                if cost < f32::INFINITY && best.is_none_or(|(c, _)| cost < c) {
                    best = Some((cost, Cut { axis, bin: i as u32 }));
                }
            }
        }
        best.map(|(_, cut)| cut)
    }
}

/// A set cut in two; both sides hold at least one primitive.
pub(crate) struct Split<'a> {
    pub(crate) left: &'a mut [PrimRef],
    pub(crate) left_bounds: SetBounds,
    pub(crate) right: &'a mut [PrimRef],
    pub(crate) right_bounds: SetBounds,
}

/// Cuts `refs` (at least two) at the best place. Primitives that no cut separates (duplicates) are halved by position, so the depth of
/// the tree stays logarithmic. `max_bins` is at most 16.
pub(crate) fn split<'a>(
    refs: &'a mut [PrimRef],
    bounds: &SetBounds,
    max_bins: usize,
    bins: &mut Bins,
) -> Split<'a> {
    let n = refs.len();
    let num_bins = (4 + n / 16).min(max_bins).min(MAX_BINS);
    let map = BinMap::new(bounds, num_bins);
    if n >= 2 * PARALLEL_CHUNK {
        *bins = refs
            .par_chunks(PARALLEL_CHUNK)
            .map(|chunk| {
                let mut b = Bins::empty();
                b.add_all(chunk, &map);
                b
            })
            .reduce(Bins::empty, Bins::merge);
    } else {
        bins.clear(num_bins);
        bins.add_all(refs, &map);
    }
    let Some(cut) = bins.best_cut(num_bins) else { return halve(refs) };

    // Partition in place, gathering both sides' bounds on the way.
    let (mut left_bounds, mut right_bounds) = (SetBounds::EMPTY, SetBounds::EMPTY);
    let (mut i, mut j) = (0, n);
    while i < j {
        if map.bins(&refs[i])[cut.axis] <= cut.bin {
            left_bounds.grow(&refs[i]);
            i += 1;
        } else {
            j -= 1;
            refs.swap(i, j);
            right_bounds.grow(&refs[j]);
        }
    }
    let (left, right) = refs.split_at_mut(i);
    Split { left, left_bounds, right, right_bounds }
}

/// Two halves in the present order.
pub(crate) fn halve(refs: &mut [PrimRef]) -> Split<'_> {
    let (left, right) = refs.split_at_mut(refs.len() / 2);
    let (left_bounds, right_bounds) = (SetBounds::of(left), SetBounds::of(right));
    Split { left, left_bounds, right, right_bounds }
}
