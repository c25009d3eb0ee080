//! Where to cut a set of primitives: the surface area heuristic over bins (Wald, "On fast Construction of SAH-based Bounding Volume
//! Hierarchies", 2007), with a leaf of up to four primitives costing one test.

use super::prim_ref::{Box4, PrimRef, SetBounds};
use crate::accel::wide::LEAF_SIZE;
use glam::Vec4;
use rayon::prelude::*;
use std::ops::Range;

/// Most bins per axis.
const MAX_BINS: usize = 16;
/// Sets at least this large are binned in parallel, in pieces of this size (fixed, so that the tree does not depend on the threads).
const PARALLEL_CHUNK: usize = 1 << 16;

/// Sets at least this large fill two sets of bins in turn: neighbours often fall into the same bin, and the second would wait for what the
/// first has just stored.
const TWO_SETS: usize = 96;

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

    /// `bins(p)[axis]`.
    #[inline(always)]
    fn bin(&self, p: &PrimRef, axis: usize) -> u32 {
        self.bins(p)[axis]
    }

    /// The axis along which the centres reach furthest, as a range.
    fn longest_axis(&self) -> Range<usize> {
        let s = self.scale.to_array();
        // The longest has the smallest scale; scale 0 means no extent at all.
        let longest = (0..3).filter(|&a| s[a] > 0.0).min_by(|&a, &b| s[a].total_cmp(&s[b])).unwrap_or(0);
        longest..longest + 1
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
    fn add_all(&mut self, refs: &[PrimRef], map: &BinMap, axes: Range<usize>) {
        for p in refs {
            self.add(p, map, axes.clone());
        }
    }

    #[inline(always)]
    fn add(&mut self, p: &PrimRef, map: &BinMap, axes: Range<usize>) {
        let b = map.bins(p);
        for axis in axes {
            let i = b[axis] as usize & (MAX_BINS - 1);
            self.boxes[axis][i].grow(p);
            self.counts[axis][i] += 1;
        }
    }

    fn add_bins(&mut self, o: &Bins, bins: usize) {
        for axis in 0..3 {
            for i in 0..bins {
                self.boxes[axis][i].union(&o.boxes[axis][i]);
                self.counts[axis][i] += o.counts[axis][i];
            }
        }
    }

    fn merge(mut self, o: Bins) -> Bins {
        self.add_bins(&o, MAX_BINS);
        self
    }

    /// The cut with the smallest cost area(left)·tests(left) + area(right)·tests(right); `None` when all primitives share one bin in
    /// every axis.
    fn best_cut(&self, bins: usize, axes: Range<usize>) -> Option<Cut> {
        let tests = |n: u32| leaf_tests(n as usize);
        let mut best: Option<(f32, Cut)> = None;
        for axis in axes {
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

/// Effort of a search for cuts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SahEffort {
    /// Most bins per axis, 4 to 16; 0 halves sets by position instead of searching.
    pub(crate) bins: usize,
    /// Looks at the longest axis alone: a third of the work.
    pub(crate) longest_axis_only: bool,
}

impl SahEffort {
    /// No search: the depth is logarithmic whatever the input.
    pub(crate) const HALVE: SahEffort = SahEffort { bins: 0, longest_axis_only: false };
}

/// A cut and how to apply it.
struct Plane {
    map: BinMap,
    cut: Cut,
    /// Boxes of both sides.
    boxes: [Box4; 2],
}

impl Plane {
    #[inline(always)]
    fn is_left(&self, p: &PrimRef) -> bool {
        self.map.bin(p, self.cut.axis) <= self.cut.bin
    }
}

/// The best place to cut `refs`; `None` for primitives that no cut separates (duplicates).
fn find_plane(
    refs: &[PrimRef],
    bounds: &SetBounds,
    effort: SahEffort,
    bins: &mut [Bins; 2],
) -> Option<Plane> {
    let n = refs.len();
    let num_bins = (4 + n / 16).min(effort.bins).min(MAX_BINS);
    let map = BinMap::new(bounds, num_bins);
    let axes = if effort.longest_axis_only { map.longest_axis() } else { 0..3 };
    if n >= 2 * PARALLEL_CHUNK {
        bins[0] = refs
            .par_chunks(PARALLEL_CHUNK)
            .map(|chunk| {
                let mut b = Bins::empty();
                b.add_all(chunk, &map, axes.clone());
                b
            })
            .reduce(Bins::empty, Bins::merge);
    } else {
        let [even, odd] = bins;
        even.clear(num_bins);
        if n < TWO_SETS {
            even.add_all(refs, &map, axes.clone());
        } else {
            odd.clear(num_bins);
            let (pairs, rest) = refs.as_chunks::<2>();
            for [a, b] in pairs {
                even.add(a, &map, axes.clone());
                odd.add(b, &map, axes.clone());
            }
            even.add_all(rest, &map, axes.clone());
            even.add_bins(odd, num_bins);
        }
    }
    let cut = bins[0].best_cut(num_bins, axes)?;
    let (left, right) = bins[0].boxes[cut.axis][..num_bins].split_at(cut.bin as usize + 1);
    let boxes = [left, right].map(|side| {
        let mut b = Box4::EMPTY;
        side.iter().for_each(|bin| b.union(bin));
        b
    });
    Some(Plane { map, cut, boxes })
}

/// Cuts `refs` (at least two) at the best place, reordering them. Primitives that no cut separates are halved by position, so the depth
/// of the tree stays logarithmic. For sets too large to copy: see [`split_into`].
pub(crate) fn split<'a>(refs: &'a mut [PrimRef], bounds: &SetBounds, effort: SahEffort) -> Split<'a> {
    let Some(plane) = find_plane(refs, bounds, effort, &mut [Bins::empty(), Bins::empty()]) else {
        return halve(refs);
    };
    let (mut left_bounds, mut right_bounds) = (SetBounds::EMPTY, SetBounds::EMPTY);
    let (mut i, mut j) = (0, refs.len());
    while i < j {
        if plane.is_left(&refs[i]) {
            left_bounds.grow_centers(&refs[i]);
            i += 1;
        } else {
            j -= 1;
            refs.swap(i, j);
            right_bounds.grow_centers(&refs[j]);
        }
    }
    left_bounds.set_box(plane.boxes[0]);
    right_bounds.set_box(plane.boxes[1]);
    let (left, right) = refs.split_at_mut(i);
    Split { left, left_bounds, right, right_bounds }
}

/// The same out of place: on success the two sides are the parts of `to`; `None` when no cut separates the primitives.
///
/// Every primitive is written to both ends and only one end moves on: no branch depends on the data, which a processor would guess wrong
/// half the time (a third of the build went into that).
pub(crate) fn split_into<'a>(
    from: &[PrimRef],
    to: &'a mut [PrimRef],
    bounds: &SetBounds,
    effort: SahEffort,
    bins: &mut [Bins; 2],
) -> Option<Split<'a>> {
    let plane = find_plane(from, bounds, effort, bins)?;
    let to = &mut to[..from.len()];
    let mut i = 0;
    for (done, p) in from.iter().enumerate() {
        // Places i.. and ..=from the other end are free; together they are as many as primitives are left.
        let j = from.len() - 1 - (done - i);
        to[i] = *p;
        to[j] = *p;
        i += plane.is_left(p) as usize;
    }
    let (left, right) = to.split_at_mut(i);
    let [left_bounds, right_bounds] = [(&*left, 0), (&*right, 1)].map(|(side, k)| {
        let mut b = SetBounds::EMPTY;
        side.iter().for_each(|p| b.grow_centers(p));
        b.set_box(plane.boxes[k]);
        b
    });
    Some(Split { left, left_bounds, right, right_bounds })
}

/// Two halves in the present order.
pub(crate) fn halve(refs: &mut [PrimRef]) -> Split<'_> {
    let (left, right) = refs.split_at_mut(refs.len() / 2);
    let (left_bounds, right_bounds) = (SetBounds::of(left), SetBounds::of(right));
    Split { left, left_bounds, right, right_bounds }
}
