//! Traversal by several independent rays in turns.
//!
//! A single ray waits for memory: for a node, for its leaves, and then for the branch on what it
//! found. Here each ray takes one step, requests the memory of its next step and lets the others
//! have theirs before it goes on. (Measured among one to four million triangles with eight rays:
//! rays with random ends run 1.6 to 2.1 times as fast as two at a time.)
//!
//! Branches are the second cost, because whether a box is hit is unpredictable. So the leaves among
//! a node's children are tested together, two to a vector, children are pushed without a branch
//! ([`super::child_order`] for closest hits), and a leaf alone is tested twice rather than by code
//! of its own.

use super::single::{
    BOX_SLACK, LeafTest, RaySetup, distances, inflate_t, leaf_slots, push_children,
};
use super::three;
use super::tree_view::TreeView;
use crate::bvh::Unit;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, STACK_SIZE};
use crate::bvh::query::HitQuery;
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};

/// The subtrees that a ray has still to visit: the distance in the high half, the reference in the
/// low half.
pub(crate) type RayStack<'m> = Stack<'m, u64, STACK_SIZE>;

/// Source of the rays to trace, and receiver of their results.
pub(crate) trait RayQueue<'r, S: Simd> {
    type Leaf: LeafTest<S> + Copy;

    /// The next ray. Pushes at least one subtree to search on the empty `stack`.
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>>;

    /// Takes the result of ray `number`.
    fn done(&mut self, number: usize, leaf: Self::Leaf);
}

/// A ray to trace.
#[derive(Clone, Copy)]
pub(crate) struct RayTask<'r, L> {
    pub(crate) number: usize,
    pub(crate) ray: &'r RaySetup,
    pub(crate) t_max: f32,
    pub(crate) leaf: L,
}

/// A ray under way.
#[derive(Clone, Copy)]
struct Lane<'r, L> {
    ray: &'r RaySetup,
    skip_t: f32,
    /// The next node or leaf, or [`ChildRef::NONE`].
    current: ChildRef,
    /// Leaves to test before it: a set of slots of the node at `parent`.
    leaves: u32,
    parent: usize,
    number: usize,
    leaf: L,
}

impl<'r, L: Copy> Lane<'r, L> {
    /// A ray at the first of the subtrees on `stack`.
    #[inline(always)]
    fn new(units: &[Unit], task: RayTask<'r, L>, stack: &mut RayStack<'_>) -> Self {
        let current = stack.pop().map_or(ChildRef::NONE, |entry| ChildRef(entry as u32));
        prefetch::<4, _>(units, current.unit());
        Lane {
            ray: task.ray,
            skip_t: inflate_t(task.t_max),
            current,
            leaves: 0,
            parent: 0,
            number: task.number,
            leaf: task.leaf,
        }
    }

    /// One step: tests the leaves that the last step found, then the next node or leaf. Returns
    /// true when the ray is answered.
    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, tree: &TreeView<'_>, stack: &mut RayStack<'_>) -> bool
    where
        L: LeafTest<S>,
    {
        let units = tree.units;
        if self.leaves != 0 {
            count(Counter::Leaves, self.leaves.count_ones() as u64);
            let refs = units[self.parent + CHILD_ROW].bits();
            if self.leaf.test_many(simd, units, refs, self.leaves, &mut self.skip_t) {
                return true;
            }
            self.leaves = 0;
        }
        if self.current == ChildRef::NONE {
            return true;
        }
        if self.current.is_leaf() {
            // The queue pushed a leaf, or leaves are visited in the order of their distance.
            count(Counter::Leaves, 1);
            if self.leaf.test(simd, units, self.current, &mut self.skip_t) {
                return true;
            }
            self.current = pop_nearer(stack, 0, self.skip_t);
        } else {
            self.visit_node(simd, tree, stack);
        }
        prefetch::<4, _>(units, self.current.unit());
        self.leaves == 0 && self.current == ChildRef::NONE
    }

    /// Tests the boxes of a node, notes its leaves and selects the next node.
    #[inline(always)]
    fn visit_node<S: Simd>(&mut self, simd: S, tree: &TreeView<'_>, stack: &mut RayStack<'_>)
    where
        L: LeafTest<S>,
    {
        let at = self.current.unit();
        let NodeHits { leaves, next } =
            open_node::<S, L::Query>(simd, tree, at, self.ray, self.skip_t, !L::TREES, stack);
        (self.leaves, self.parent) = (leaves, at);
        self.current = match next {
            Some(next) => next,
            None => pop_nearer(stack, 0, self.skip_t),
        };
    }
}

/// What a node has for a ray.
pub(crate) struct NodeHits {
    /// Leaves to test now: a set of slots.
    pub(crate) leaves: u32,
    /// The child to visit next; `None` when it is on the stack.
    pub(crate) next: Option<ChildRef>,
}

/// Tests the boxes of the node at unit `at` and pushes the children that the ray enters. With
/// `together`, leaves are not pushed: they are to be tested now, and the first two are requested
/// from memory.
#[inline(always)]
pub(crate) fn open_node<S: Simd, Q: HitQuery>(
    simd: S,
    tree: &TreeView<'_>,
    at: usize,
    ray: &RaySetup,
    skip_t: f32,
    together: bool,
    stack: &mut RayStack<'_>,
) -> NodeHits {
    count(Counter::Nodes, 1);
    let units = tree.units;
    let node: &[Unit; NODE_UNITS] =
        units[at..at + NODE_UNITS].try_into().expect("a slice of that length");
    let origin: [f32x8<S>; 3] = three!(|a| f32x8::splat(simd, ray.origin[a]));
    let rcp: [f32x8<S>; 3] = three!(|a| f32x8::splat(simd, ray.rcp[a]));
    let [x, y, z]: [f32x8<S>; 3] =
        three!(|a| distances(simd, node, ray.near[a], origin[a], rcp[a]));
    let near = x.max(y).max(z.max(f32x8::splat(simd, ray.t_min)));
    let [x, y, z]: [f32x8<S>; 3] =
        three!(|a| distances(simd, node, ray.near[a] ^ 1, origin[a], rcp[a]));
    let far = x.min(y).min(z) * f32x8::splat(simd, BOX_SLACK);
    let hit = near.simd_le(far.min(f32x8::splat(simd, skip_t)));
    let hit = tree.visible(at, hit.to_bitmask() as u32);
    let refs = node[CHILD_ROW].bits();
    let leaves = if together { hit & leaf_slots(simd, refs) } else { 0 };
    // The first two leaves are requested without a branch on their number. Where there is none,
    // this node is, which is in the cache: what is requested in vain takes the place of what is
    // not.
    for set in [leaves, leaves & leaves.wrapping_sub(1)] {
        let leaf = ChildRef(refs[set.trailing_zeros() as usize & 7]);
        prefetch::<3, _>(units, if set == 0 { at } else { leaf.unit() });
    }
    let next = push_children::<S, Q, false>(simd, units, node, near, hit & !leaves, stack);
    NodeHits { leaves, next }
}

/// The next subtree nearer than `skip_t` above the first `base` entries of the stack, or
/// [`ChildRef::NONE`].
#[inline(always)]
pub(crate) fn pop_nearer(stack: &mut RayStack<'_>, base: usize, skip_t: f32) -> ChildRef {
    while stack.len() > base {
        let Some(entry) = stack.pop() else { break };
        if f32::from_bits((entry >> 32) as u32) <= skip_t {
            return ChildRef(entry as u32);
        }
    }
    ChildRef::NONE
}

/// Traces all rays of the queue, `N` in turns.
#[inline(always)]
pub(crate) fn traverse_interleaved<'r, const N: usize, S: Simd, Q: RayQueue<'r, S>>(
    simd: S,
    tree: &TreeView<'_>,
    queue: &mut Q,
) {
    let units = tree.units;
    let mut memory = [const { StackMemory::new() }; N];
    let mut stacks = memory.each_mut().map(Stack::empty);
    let mut lanes: [Option<Lane<'r, Q::Leaf>>; N] = [const { None }; N];
    let mut under_way = 0;
    for (lane, stack) in lanes.iter_mut().zip(&mut stacks) {
        let Some(task) = queue.next(stack) else { break };
        *lane = Some(Lane::new(units, task, stack));
        under_way += 1;
    }
    let mut i = 0;
    while under_way > 0 {
        let stack = &mut stacks[i];
        let Some(lane) = &mut lanes[i] else { break };
        if !lane.step(simd, tree, stack) {
            i += 1;
        } else {
            queue.done(lane.number, lane.leaf);
            stack.clear();
            if let Some(task) = queue.next(stack) {
                *lane = Lane::new(units, task, stack);
                i += 1;
            } else {
                // The last ray moves to the free place. A swap would write both.
                under_way -= 1;
                if i < under_way {
                    lanes[i] = lanes[under_way];
                    stacks.swap(i, under_way);
                }
            }
        }
        if i >= under_way {
            i = 0;
        }
    }
}
