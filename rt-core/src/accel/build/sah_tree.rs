//! A fragment's binary tree by the surface area heuristic, top down: bins for large sets, every cut of the sorted order for small ones.

use super::binary_tree::BinaryTree;
use super::binned_sah::{Bins, SahEffort, halve, leaf_tests, split_into};
use super::prim_ref::{Box4, PrimRef, SetBounds};
use crate::accel::wide::LEAF_SIZE;

/// Sets up to this size are cut by trying every place along each axis.
const SWEEP: usize = 8;
/// Below this depth sets are halved instead of cut by cost. Cost-driven cuts of adversarial input (sizes that grow like 2^k) can
/// peel off one primitive at a time; halving bounds the depth by this plus log2 of the count, and with it the traversal stack.
const MAX_COST_DEPTH: usize = 40;

/// The tree over `refs` (at least one), whose order is lost.
pub(crate) fn sah_tree(refs: &mut [PrimRef], bounds: &SetBounds, effort: SahEffort) -> BinaryTree {
    let mut builder =
        SahTree { tree: BinaryTree::with_room_for(refs.len()), bins: Box::new(Bins::empty()), effort };
    let mut copy = refs.to_vec();
    builder.tree.add_root();
    builder.build(0, refs, &mut copy, bounds, 0, 1);
    builder.tree
}

struct SahTree {
    tree: BinaryTree,
    bins: Box<Bins>,
    effort: SahEffort,
}

impl SahTree {
    /// Fills `node` with `refs`, which are the fragment's primitives from place `first` on; `spare` is as long.
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
        if n <= LEAF_SIZE {
            self.tree.make_leaf(node, first, refs.iter().map(PrimRef::id));
            return;
        }
        let child = self.tree.open(node);
        let by_cost = self.effort != SahEffort::HALVE && depth <= MAX_COST_DEPTH;
        if by_cost && n <= SWEEP {
            // Both sides are leaves or one is left to sweep: no need for the boxes of the centres.
            let (at, bounds) = sweep(refs);
            let (left, right) = refs.split_at_mut(at);
            self.build(child, left, spare, &bounds[0], first, depth + 1);
            self.build(child + 1, right, spare, &bounds[1], first + at, depth + 1);
            return;
        }
        let cut = by_cost.then(|| split_into(refs, spare, bounds, self.effort, &mut self.bins)).flatten();
        // The cut moved everything to `spare`; halves stay where they are.
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

/// Sorts `refs` (two to eight) along the axis with the cheapest cut; returns how many go left and the boxes of both sides.
fn sweep(refs: &mut [PrimRef]) -> (usize, [SetBounds; 2]) {
    let n = refs.len();
    let mut copy = [refs[0]; SWEEP];
    copy[..n].copy_from_slice(refs);
    let mut best = (f32::INFINITY, n / 2, std::array::from_fn(|i| i as u64));
    let centers = copy.map(|p| p.center2().to_array());
    for axis in 0..3 {
        // Keys that sort by centre, then by place; only the low bits are read afterwards.
        let mut order: [u64; SWEEP] = std::array::from_fn(|i| (sortable(centers[i][axis]) << 32) | i as u64);
        for i in 1..n {
            let mut j = i;
            while j > 0 && order[j] < order[j - 1] {
                order.swap(j, j - 1);
                j -= 1;
            }
        }
        let at = |i: usize| &copy[order[i] as usize & (SWEEP - 1)];
        let mut right_cost = [0f32; SWEEP];
        let mut acc = Box4::EMPTY;
        for i in (1..n).rev() {
            acc.grow(at(i));
            right_cost[i] = acc.half_area() * leaf_tests(n - i);
        }
        let mut acc = Box4::EMPTY;
        for i in 1..n {
            acc.grow(at(i - 1));
            let cost = acc.half_area() * leaf_tests(i) + right_cost[i];
            if cost < best.0 {
                best = (cost, i, order);
            }
        }
    }
    for (p, o) in refs.iter_mut().zip(best.2) {
        *p = copy[o as usize & (SWEEP - 1)];
    }
    let (left, right) = refs.split_at(best.1);
    (best.1, [left, right].map(SetBounds::of))
}

/// Bits that compare as unsigned integers like the numbers themselves (no NaN).
#[inline(always)]
fn sortable(x: f32) -> u64 {
    let b = x.to_bits();
    (b ^ (((b as i32 >> 31) as u32) | 1 << 31)) as u64
}
