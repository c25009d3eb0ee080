//! Chooses where to cut a set of primitives: the surface area heuristic over bins (Wald, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies", 2007), with a leaf of up to four
//! primitives costing one test.

use super::prim_ref::{Box4, PrimRef, SetBounds};
use super::progress::{PRIMITIVES_BETWEEN_CHECKS, Progress};
use fearless_simd::{Level, Simd, dispatch};
use glam::Vec4;
use rayon::prelude::*;
use std::ops::Range;

/// Most bins per axis.
const MAX_BINS: usize = 16;
/// Sets at least this large are binned in parallel, in chunks of this size (fixed, so that the tree
/// does not depend on the threads).
const PARALLEL_CHUNK: usize = PRIMITIVES_BETWEEN_CHECKS;

/// Sets at least this large fill two sets of bins in turn: neighbours often fall into the same bin,
/// and the second would wait for what the first has just stored (6 % of a build).
const TWO_SETS: usize = 96;

/// A cut of a set in two.
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

/// Adding 2²³ to a float in [0, 2²³) rounds it to an integer that stands in the low bits: the
/// conversion in one addition.
const ROUND: Vec4 = Vec4::splat(8_388_608.0);

impl BinMap {
    fn new(b: &SetBounds, bins: usize) -> Self {
        let extent = b.center2_hi - b.center2_lo;
        // Zero extent (and overflow to infinity) gives scale 0: everything in bin 0, and no cut on
        // that axis.
        let k = (bins - 1) as f32;
        let inv = |e: f32| if e > 0.0 && (k / e).is_finite() { k / e } else { 0.0 };
        BinMap {
            lo: b.center2_lo,
            scale: Vec4::new(inv(extent.x), inv(extent.y), inv(extent.z), 0.0),
        }
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
        let longest =
            (0..3).filter(|&a| s[a] > 0.0).min_by(|&a, &b| s[a].total_cmp(&s[b])).unwrap_or(0);
        longest..longest + 1
    }
}

/// Boxes and numbers of primitives per axis and bin.
struct Bins {
    boxes: [[Box4; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    fn empty() -> Self {
        Bins { boxes: [[Box4::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] }
    }

    #[inline(always)]
    fn clear(&mut self, bins: usize, axes: Range<usize>) {
        for axis in axes {
            self.boxes[axis][..bins].fill(Box4::EMPTY);
            self.counts[axis][..bins].fill(0);
        }
    }

    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, p: &PrimRef, map: &BinMap, axes: Range<usize>) {
        let b = map.bins(p);
        for axis in axes {
            let i = b[axis] as usize & (MAX_BINS - 1);
            self.boxes[axis][i].grow(simd, p);
            self.counts[axis][i] += 1;
        }
    }

    #[inline(always)]
    fn add_bins<S: Simd>(&mut self, simd: S, o: &Bins, bins: usize, axes: Range<usize>) {
        for axis in axes {
            for i in 0..bins {
                self.boxes[axis][i].union(simd, &o.boxes[axis][i]);
                self.counts[axis][i] += o.counts[axis][i];
            }
        }
    }

    /// The cut with the smallest cost area(left)·tests(left) + area(right)·tests(right); `None`
    /// when all primitives share one bin in every axis.
    #[inline(always)]
    fn best_cut<S: Simd>(
        &self,
        simd: S,
        bins: usize,
        axes: Range<usize>,
        leaves: LeafCapacity,
    ) -> Option<Cut> {
        let tests = |n: u32| leaves.tests(n as usize);
        let mut best: Option<(f32, Cut)> = None;
        for axis in axes {
            let (boxes, counts) = (&self.boxes[axis], &self.counts[axis]);
            // Cost of everything right of each bin.
            let mut right_cost = [0f32; MAX_BINS];
            let (mut acc, mut n) = (Box4::EMPTY, 0);
            for i in (1..bins).rev() {
                acc.union(simd, &boxes[i]);
                n += counts[i];
                right_cost[i] = if n > 0 { acc.half_area() * tests(n) } else { f32::INFINITY };
            }
            let (mut acc, mut n) = (Box4::EMPTY, 0);
            for i in 0..bins - 1 {
                acc.union(simd, &boxes[i]);
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

    #[inline(always)]
    fn best_plane<S: Simd>(
        &self,
        simd: S,
        map: BinMap,
        bins: usize,
        axes: Range<usize>,
        leaves: LeafCapacity,
    ) -> Option<SplitPlane> {
        let cut = self.best_cut(simd, bins, axes, leaves)?;
        let (left, right) = self.boxes[cut.axis][..bins].split_at(cut.bin as usize + 1);
        let boxes = [Box4::around(simd, left), Box4::around(simd, right)];
        Some(SplitPlane { map, cut, boxes })
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
pub(crate) struct SahConfig {
    /// Most bins per axis, 4 to 16.
    pub(crate) bins: usize,
    /// Looks at the longest axis alone: a third of the work.
    pub(crate) longest_axis_only: bool,
    /// Largest number of primitives in a leaf.
    pub(crate) leaves: LeafCapacity,
}

/// How many primitives one leaf test covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LeafCapacity {
    /// One: a reference to a subtree.
    One,
    /// Four, tested by one vector.
    Four,
}

impl LeafCapacity {
    #[inline(always)]
    pub(crate) fn size(self) -> usize {
        match self {
            LeafCapacity::One => 1,
            LeafCapacity::Four => 4,
        }
    }

    /// Leaf tests that `n` primitives cost.
    #[inline(always)]
    pub(crate) fn tests(self, n: usize) -> f32 {
        match self {
            LeafCapacity::One => n as f32,
            LeafCapacity::Four => n.div_ceil(4) as f32,
        }
    }
}

/// A cut and how to apply it.
struct SplitPlane {
    map: BinMap,
    cut: Cut,
    /// Boxes of both sides.
    boxes: [Box4; 2],
}

impl SplitPlane {
    #[inline(always)]
    fn is_left(&self, p: &PrimRef) -> bool {
        self.map.bin(p, self.cut.axis) <= self.cut.bin
    }
}

/// Buffers of a search, and the instruction set to use. Every level gives the same cuts: there are
/// only minima, and arithmetic without fused operations.
pub(crate) struct SearchSpace {
    level: Level,
    even: Bins,
    odd: Bins,
}

impl SearchSpace {
    pub(crate) fn new(level: Level) -> Box<SearchSpace> {
        Box::new(SearchSpace { level, even: Bins::empty(), odd: Bins::empty() })
    }

    /// Fills `self.even`.
    #[inline(always)]
    fn fill<S: Simd>(
        &mut self,
        simd: S,
        refs: &[PrimRef],
        map: &BinMap,
        bins: usize,
        axes: Range<usize>,
    ) {
        self.even.clear(bins, axes.clone());
        if refs.len() < TWO_SETS {
            for p in refs {
                self.even.add(simd, p, map, axes.clone());
            }
            return;
        }
        self.odd.clear(bins, axes.clone());
        let (pairs, rest) = refs.as_chunks::<2>();
        for [a, b] in pairs {
            self.even.add(simd, a, map, axes.clone());
            self.odd.add(simd, b, map, axes.clone());
        }
        for p in rest {
            self.even.add(simd, p, map, axes.clone());
        }
        self.even.add_bins(simd, &self.odd, bins, axes);
    }
}

/// The best cut of `refs`; `None` for primitives that no cut separates (duplicates).
fn find_plane(
    refs: &[PrimRef],
    bounds: &SetBounds,
    sah: SahConfig,
    space: &mut SearchSpace,
    progress: &Progress<'_>,
) -> Option<SplitPlane> {
    if refs.len() >= 2 * PARALLEL_CHUNK {
        let level = space.level;
        return dispatch!(level, simd => {
            find_plane_of_many(simd, refs, bounds, sah, level, progress)
        });
    }
    dispatch!(space.level, simd => find_plane_of_few(simd, refs, bounds, sah, space))
}

/// Bins and axes to search.
#[inline(always)]
fn search(n: usize, bounds: &SetBounds, sah: SahConfig) -> (BinMap, usize, Range<usize>) {
    let bins = (4 + n / 16).min(sah.bins).min(MAX_BINS);
    let map = BinMap::new(bounds, bins);
    (map, bins, if sah.longest_axis_only { map.longest_axis() } else { 0..3 })
}

#[inline(always)]
fn find_plane_of_few<S: Simd>(
    simd: S,
    refs: &[PrimRef],
    bounds: &SetBounds,
    sah: SahConfig,
    space: &mut SearchSpace,
) -> Option<SplitPlane> {
    simd.vectorize(
        #[inline(always)]
        || {
            let (map, bins, axes) = search(refs.len(), bounds, sah);
            // With the axes known here the loops over them unroll.
            match (axes.len(), axes.start) {
                (3, _) => space.fill(simd, refs, &map, bins, 0..3),
                (_, 0) => space.fill(simd, refs, &map, bins, 0..1),
                (_, 1) => space.fill(simd, refs, &map, bins, 1..2),
                _ => space.fill(simd, refs, &map, bins, 2..3),
            }
            space.even.best_plane(simd, map, bins, axes, sah.leaves)
        },
    )
}

fn find_plane_of_many<S: Simd>(
    simd: S,
    refs: &[PrimRef],
    bounds: &SetBounds,
    sah: SahConfig,
    level: Level,
    progress: &Progress<'_>,
) -> Option<SplitPlane> {
    let (map, bins, axes) = search(refs.len(), bounds, sah);
    let fill = |chunk| {
        let mut space = SearchSpace::new(level);
        if progress.check().is_ok() {
            simd.vectorize(
                #[inline(always)]
                || space.fill(simd, chunk, &map, bins, axes.clone()),
            );
        }
        space
    };
    let all = refs.par_chunks(PARALLEL_CHUNK).map(fill).reduce_with(|mut a, b| {
        simd.vectorize(
            #[inline(always)]
            || a.even.add_bins(simd, &b.even, bins, axes.clone()),
        );
        a
    })?;
    if progress.is_stopped() {
        return None;
    }
    simd.vectorize(
        #[inline(always)]
        || all.even.best_plane(simd, map, bins, axes, sah.leaves),
    )
}

/// Cuts `from` (at least two) at the best place: the two sides are the parts of `to`, which is as
/// long. `None` when no cut separates the primitives, or when the build was stopped.
///
/// Every primitive is written to both ends and only one end moves on: no branch depends on the
/// data, which a processor would often guess wrong.
pub(crate) fn split_into<'a>(
    from: &[PrimRef],
    to: &'a mut [PrimRef],
    bounds: &SetBounds,
    sah: SahConfig,
    space: &mut SearchSpace,
    progress: &Progress<'_>,
) -> Option<Split<'a>> {
    let plane = find_plane(from, bounds, sah, space, progress)?;
    let to = &mut to[..from.len()];
    let mut i = 0;
    for (k, piece) in from.chunks(PARALLEL_CHUNK).enumerate() {
        if k > 0 && progress.check().is_err() {
            return None;
        }
        for (done, p) in piece.iter().enumerate() {
            // Places i.. and ..=from the other end are free; together they are as many as
            // primitives are left.
            let j = from.len() - 1 - (k * PARALLEL_CHUNK + done - i);
            to[i] = *p;
            to[j] = *p;
            i += plane.is_left(p) as usize;
        }
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
