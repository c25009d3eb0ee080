//! Traversal by sixteen rays that start close together: together near the root, then a few in
//! turns, as [`crate::bvh::traverse::hybrid`] does it for rays in f32.

use super::leaf::Search;
use crate::bvh::Unit;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, STACK_SIZE};
use crate::bvh::query::HitQuery;
use crate::bvh::traverse::block_boxes::BlockSetup;
use crate::bvh::traverse::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use crate::bvh::traverse::single::{RaySetup, inflate_t};
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::LANES;
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, f32x16};

/// With this many rays or fewer, each ray traverses the subtree by itself: as for rays in f32.
const MAX_SINGLE_RAYS_ANY: u32 = 5;
const MAX_SINGLE_RAYS_CLOSEST: u32 = 8;

/// Number of rays that search a subtree in turns.
const IN_TURNS: usize = 4;

/// Rays share the start of the traversal when they start within this distance of one another along
/// every axis. It is an eighth of the tree's box, whose largest extent is between 1 and 2.
const CLOSE: f32 = 0.125;

/// Whether these rays start close together.
#[inline(always)]
pub(super) fn start_together(rays: &[&RaySetup; LANES], active: u16) -> bool {
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for lane in (0..LANES).filter(|lane| active >> lane & 1 == 1) {
        for axis in 0..3 {
            lo[axis] = lo[axis].min(rays[lane].origin[axis]);
            hi[axis] = hi[axis].max(rays[lane].origin[axis]);
        }
    }
    active != 0 && (0..3).all(|axis| hi[axis] - lo[axis] <= CLOSE)
}

/// A subtree and the rays that hit its box.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Entry {
    /// Distance of one of the rays to the box, for the order of visits. Not used for occlusion.
    distance: f32,
    child: u32,
    rays: u16,
}

/// Goes on with the `active` searches until they are over.
#[inline(always)]
pub(super) fn trace<S: Simd, L: Search<S>>(
    simd: S,
    tree: &TreeView<'_>,
    setups: &[&RaySetup; LANES],
    searches: &mut [L; LANES],
    mut active: u16,
) {
    let any = L::Query::ANY;
    let units = tree.units;
    let block = BlockSetup::of(simd, *setups);
    let skip = f32x16::splat(simd, inflate_t(1.0));
    let mut limits = [0.0f32; LANES];
    for (limit, search) in limits.iter_mut().zip(&*searches) {
        *limit = search.limit();
    }
    let mut memory = StackMemory::<Entry, STACK_SIZE>::new();
    let mut stack = Stack::empty(&mut memory);
    stack.push(Entry { distance: 0.0, child: ChildRef::node(0).0, rays: active });
    while let Some(Entry { child, rays: met, .. }) = stack.pop() {
        let met = met & active;
        if met == 0 {
            continue;
        }
        let child = ChildRef(child);
        let few = if any { MAX_SINGLE_RAYS_ANY } else { MAX_SINGLE_RAYS_CLOSEST };
        if child.is_leaf() || met.count_ones() <= few {
            // ---- Few rays or a leaf: each ray separately from here.
            let mut queue = Lanes { setups, searches, start: child, waiting: met };
            traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
            let mut lanes = met;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 15;
                lanes &= lanes - 1;
                limits[lane] = searches[lane].limit();
                active &= !(u16::from(searches[lane].is_over()) << lane);
            }
            continue;
        }
        // ---- A node for many rays: each child's box against all of them.
        count(Counter::Nodes, 1);
        let at = child.unit();
        let node: &[Unit; NODE_UNITS] =
            units[at..at + NODE_UNITS].try_into().expect("a slice of that length");
        let refs = node[CHILD_ROW].bits();
        let limit = f32x16::from_slice(simd, &limits) * skip;
        let base = stack.len();
        for slot in 0..8 {
            if refs[slot] == ChildRef::NONE.0 {
                // A node fills its slots in order.
                break;
            }
            count(Counter::GroupBoxes, 1);
            let (near, hit) = block.enter(simd, node, slot, limit);
            let hit = hit & met;
            if hit == 0 {
                continue;
            }
            prefetch::<4, _>(units, ChildRef(refs[slot]).unit());
            let distance =
                if any { 0.0 } else { near.as_slice()[hit.trailing_zeros() as usize & 15] };
            stack.push(Entry { distance, child: refs[slot], rays: hit });
        }
        if !any {
            stack.sort_descending_from(base);
        }
    }
}

/// Searches that go on in the subtree at `start`.
struct Lanes<'a, 'r, L> {
    setups: &'a [&'r RaySetup; LANES],
    searches: &'a mut [L; LANES],
    start: ChildRef,
    waiting: u16,
}

impl<'r, S: Simd, L: Search<S>> RayQueue<'r, S> for Lanes<'_, 'r, L> {
    type Leaf = L;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, L>> {
        if self.waiting == 0 {
            return None;
        }
        let number = self.waiting.trailing_zeros() as usize & 15;
        self.waiting &= self.waiting - 1;
        let leaf = self.searches[number];
        stack.push(self.start.0 as u64);
        Some(RayTask { number, ray: self.setups[number], t_max: leaf.limit(), leaf })
    }

    #[inline(always)]
    fn done(&mut self, number: usize, leaf: L) {
        self.searches[number & 15] = leaf;
    }
}
