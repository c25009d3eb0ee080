//! Builds a fragment's binary tree top down by the surface area heuristic: with bins for large
//! sets, by a full sweep for small ones.

use super::binary_tree::BinaryTree;
use super::binned_sah::{LeafCapacity, SahConfig, SearchSpace, halve, split_into};
use super::prim_ref::{Box4, PrimRef, SetBounds};
use super::progress::UNWATCHED;
use fearless_simd::{Level, Simd, dispatch};
use glam::Vec4;
use std::ops::Range;

/// Sets up to this size are swept: every split of the sorted order is tried on each axis.
const SWEEP: usize = 8;
/// Below this depth, sets are halved instead of split by cost. Splits by cost can peel off one
/// primitive at a time from adversarial input (sizes that grow like 2^k). Halving limits the depth
/// to this plus log2 of the count, and so limits the traversal stack.
pub(super) const MAX_COST_DEPTH: usize = 36;

/// Builds the tree over `refs` (at least one). Reorders `refs` and uses `spare`, which has the same
/// length, as scratch memory.
pub(crate) fn sah_tree(
    refs: &mut [PrimRef],
    spare: &mut [PrimRef],
    bounds: &SetBounds,
    sah: SahConfig,
    level: Level,
) -> BinaryTree {
    let tree = BinaryTree::with_room_for(refs.len());
    let mut builder = SahTree { tree, space: SearchSpace::new(level), level, sah };
    builder.tree.add_root();
    builder.build(0, refs, spare, bounds, 0, 1);
    builder.tree
}

struct SahTree {
    tree: BinaryTree,
    space: Box<SearchSpace>,
    level: Level,
    sah: SahConfig,
}

impl SahTree {
    /// Builds the subtree of `node` over `refs`, the fragment's primitives from index `first` on.
    /// `spare` has the same length.
    fn build(
        &mut self,
        node: usize,
        refs: &mut [PrimRef],
        spare: &mut [PrimRef],
        bounds: &SetBounds,
        first: usize,
        depth: usize,
    ) {
        self.tree.nodes[node].bounds = bounds.aabb();
        self.tree.depth = self.tree.depth.max(depth);
        let n = refs.len();
        if n <= self.sah.leaves.size() {
            self.tree.make_leaf(node, first, refs.iter().map(PrimRef::id));
            return;
        }
        let child = self.tree.open(node);
        let by_cost = depth <= MAX_COST_DEPTH;
        if by_cost && n <= SWEEP {
            // Each side becomes a leaf or is swept again, so the boxes of the centres are not
            // needed.
            let axes = if self.sah.longest_axis_only { longest_axis(bounds) } else { 0..3 };
            let (at, bounds) =
                dispatch!(self.level, simd => sweep(simd, refs, axes, self.sah.leaves));
            let (left, right) = refs.split_at_mut(at);
            self.build(child, left, spare, &bounds[0], first, depth + 1);
            self.build(child + 1, right, spare, &bounds[1], first + at, depth + 1);
            return;
        }
        // A fragment is small enough to be finished.
        let (sah, progress) = (self.sah, &UNWATCHED);
        let cut = by_cost
            .then(|| split_into(refs, spare, bounds, sah, &mut self.space, progress))
            .flatten();
        // The split moved everything to `spare`. Halves stay in `refs`.
        let (s, spare) = match cut {
            Some(s) => (s, refs),
            None => (halve(refs), spare),
        };
        let at = s.left.len();
        let (spare_left, spare_right) = spare.split_at_mut(at);
        self.build(child, s.left, spare_left, &s.left_bounds, first, depth + 1);
        self.build(child + 1, s.right, spare_right, &s.right_bounds, first + at, depth + 1);
    }
}

fn longest_axis(bounds: &SetBounds) -> Range<usize> {
    let e = bounds.aabb().extent();
    let axis = if e.x >= e.y && e.x >= e.z { 0 } else { 1 + (e.z > e.y) as usize };
    axis..axis + 1
}

/// Sorts `refs` (two to eight) along the axis with the cheapest split. Returns the number of
/// primitives on the left and the bounds of both sides.
#[inline(always)]
fn sweep<S: Simd>(
    simd: S,
    refs: &mut [PrimRef],
    axes: Range<usize>,
    leaves: LeafCapacity,
) -> (usize, [SetBounds; 2]) {
    simd.vectorize(
        #[inline(always)]
        || sweep_body(simd, refs, axes, leaves),
    )
}

#[inline(always)]
fn sweep_body<S: Simd>(
    simd: S,
    refs: &mut [PrimRef],
    axes: Range<usize>,
    leaves: LeafCapacity,
) -> (usize, [SetBounds; 2]) {
    let n = refs.len();
    let mut copy = [refs[0]; SWEEP];
    copy[..n].copy_from_slice(refs);
    let sorted = orders(&copy, n);
    let mut best = (f32::INFINITY, n / 2, axes.start);
    for axis in axes {
        let at = |i: usize| &copy[sorted[i][axis] as usize & (SWEEP - 1)];
        let mut right_cost = [0f32; SWEEP];
        let mut acc = Box4::EMPTY;
        for i in (1..n).rev() {
            acc.grow(simd, at(i));
            right_cost[i] = acc.half_area() * leaves.tests(n - i);
        }
        let mut acc = Box4::EMPTY;
        for i in 1..n {
            acc.grow(simd, at(i - 1));
            let cost = acc.half_area() * leaves.tests(i) + right_cost[i];
            if cost < best.0 {
                best = (cost, i, axis);
            }
        }
    }
    let (_, at, axis) = best;
    for (p, o) in refs.iter_mut().zip(sorted) {
        *p = copy[o[axis] as usize & (SWEEP - 1)];
    }
    let (left, right) = refs.split_at(at);
    (at, [left, right].map(SetBounds::of))
}

/// Sorts the first `n` primitives by centre. The low three bits of `[i][axis]` are the index of the
/// i-th primitive along an axis.
///
/// Keys are the centres with their last three bits replaced by the index, so no two are equal. A
/// sorting network (19 exchanges, Knuth vol. 3, section 5.3.4) sorts all axes at once without a
/// branch.
#[inline(always)]
fn orders(refs: &[PrimRef; SWEEP], n: usize) -> [[u32; 4]; SWEEP] {
    // Finite even where the sum of two coordinates overflows, because NaN would break the network.
    let limit = Vec4::splat(0.5 * f32::MAX);
    let mut keys: [Vec4; SWEEP] = std::array::from_fn(|i| {
        let c = if i < n { refs[i].center2().clamp(-limit, limit) } else { Vec4::MAX };
        Vec4::from_array(c.to_array().map(|x| f32::from_bits(x.to_bits() & !7 | i as u32)))
    });
    #[rustfmt::skip]
    const NETWORK: [(usize, usize); 19] = [
        (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7), (0, 1), (2, 3),
        (4, 5), (6, 7), (2, 4), (3, 5), (1, 4), (3, 6), (1, 2), (3, 4), (5, 6),
    ];
    for (a, b) in NETWORK {
        (keys[a], keys[b]) = (keys[a].min(keys[b]), keys[a].max(keys[b]));
    }
    keys.map(|k| k.to_array().map(f32::to_bits))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Aabb;
    use crate::test_shapes::Random;
    use glam::Vec3;

    #[test]
    fn orders_sort_every_axis_and_lose_nobody_even_at_the_ends_of_the_range() {
        let mut r = Random::new(5);
        for case in 0..2000 {
            let n = 2 + case % (SWEEP - 1);
            let huge = if case % 3 == 0 { f32::MAX } else { 1.0 };
            let refs: [PrimRef; SWEEP] = std::array::from_fn(|i| {
                let p = r.direction() * r.unit();
                // Some positions are equal, some are zero.
                let p = if r.unit() < 0.2 { Vec3::ZERO } else { p * huge };
                PrimRef::new(Aabb::new(p, p), i as u32)
            });
            let sorted = orders(&refs, n);
            for axis in 0..3 {
                let places: Vec<usize> = sorted.iter().map(|o| o[axis] as usize & 7).collect();
                let mut all = places[..n].to_vec();
                all.sort_unstable();
                assert_eq!(all, (0..n).collect::<Vec<_>>(), "case {case} axis {axis}");
                for w in places[..n].windows(2) {
                    // Twice the centre, clamped where larger values cannot be distinguished.
                    let center2 =
                        |i: usize| (2.0 * refs[i].bounds().min[axis]).clamp(-1.7e38, 1.7e38);
                    let [a, b] = [w[0], w[1]].map(center2);
                    assert!(a <= b + 1e-6 * b.abs().max(a.abs()), "case {case}: {a} before {b}");
                }
            }
        }
    }
}
