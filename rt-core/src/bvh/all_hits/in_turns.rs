//! Visits every triangle that each of many rays crosses, several rays in turns.
//!
//! A ray that wants all hits cannot stop at the first, so it reads more of the tree than one that
//! asks for the nearest, and waits for more of it. Others step meanwhile.

use crate::bvh::Unit;
use crate::bvh::entry::Entry;
use crate::bvh::instance_filter::InstanceFilter;
use crate::bvh::intersect::crossing::crosses;
use crate::bvh::layout::triangles::{leaf_floats, leaf_triangle_ids, row};
use crate::bvh::layout::wide::{ChildRef, WIDTH};
use crate::bvh::query::{AnyHit, WatertightTest};
use crate::bvh::streams::any_unusual_length;
use crate::bvh::traverse::block_boxes::BlockSetup;
use crate::bvh::traverse::interleaved::{RayQueue, RayStack, RayTask, traverse_interleaved};
use crate::bvh::traverse::packet::GROUPS;
use crate::bvh::traverse::single::{LeafTest, RaySetup};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::test_two_leaves;
use crate::bvh::world::World;
use crate::ray::{Hit, LANES, RayBlock};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch, f32x8};

/// Number of rays in turns through trees that caches hold: twelve are slower there.
const IN_TURNS: usize = 8;
/// The same for larger trees: sixteen take 18 % (a million triangles) and 24 % (ten million) less
/// time than eight. (The record that `traverse/scattered.rs` names.)
const IN_TURNS_IF_LARGE: usize = 16;
/// Larger than the caches of a core, in bytes.
const LARGE: usize = 16 << 20;

/// Takes a hit of a ray, and returns true when the ray wants no more. Rays are numbered through the
/// blocks of the call.
///
/// A type that is not generic, so that the traversal is compiled once for each instruction set.
type Take<'f> = &'f dyn Fn(usize, Hit) -> bool;

impl World {
    /// Passes the hits of at most sixteen blocks to `found`, in no order. Returns false, without
    /// any hit, where the rays cannot go in turns: through several entries, shapes and compact
    /// trees, from far away, or with directions of unusual lengths.
    pub(super) fn visit_hits_in_turns(&self, rays: &[RayBlock], found: Take<'_>) -> bool {
        let Some(entry) = self.only_entry() else { return false };
        let Some(tree) = entry.triangles(InstanceFilter::All).filter(|t| t.meshlets() == 0) else {
            return false;
        };
        let found = |ray: usize, hit: Hit| match entry {
            Entry::Instance { number, .. } => found(ray, Hit { instance: number, ..hit }),
            Entry::Group(group) => {
                let (instance, prim) = group.owner(hit.prim);
                found(ray, Hit { prim, instance, ..hit })
            }
        };
        let found: Take<'_> = &found;
        dispatch!(self.level, simd => {
            let usual = !any_unusual_length(simd, rays)
                && entry.placement().accepts_blocks(simd, rays);
            if usual {
                trace(simd, &tree, rays, found);
            }
            usual
        })
    }
}

#[inline(never)]
fn trace<S: Simd>(simd: S, tree: &TreeView<'_>, rays: &[RayBlock], found: Take<'_>) {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut setups = [[RaySetup::ZERO; LANES]; GROUPS];
            let mut active = [0; GROUPS];
            for (b, rays) in rays.iter().enumerate().take(GROUPS) {
                active[b] = rays.active_lanes();
                setups[b] = BlockSetup::new(simd, rays).rays(rays);
            }
            let mut queue = Rays { rays, setups: &setups, active, block: 0, found };
            if size_of_val(tree.units) > LARGE {
                traverse_interleaved::<IN_TURNS_IF_LARGE, _, _>(simd, tree, &mut queue);
            } else {
                traverse_interleaved::<IN_TURNS, _, _>(simd, tree, &mut queue);
            }
        },
    );
}

/// The rays that have not been traced yet.
struct Rays<'a, 'r> {
    rays: &'a [RayBlock],
    setups: &'r [[RaySetup; LANES]; GROUPS],
    /// Lanes to trace, per block.
    active: [u16; GROUPS],
    /// The first block that may have some.
    block: usize,
    found: Take<'r>,
}

impl<'r, S: Simd> RayQueue<'r, S> for Rays<'_, 'r> {
    type Leaf = TriangleCrossings<'r>;

    #[inline(always)]
    fn next(&mut self, stack: &mut RayStack<'_>) -> Option<RayTask<'r, Self::Leaf>> {
        while let Some(&lanes) = self.active.get(self.block) {
            if lanes == 0 {
                self.block += 1;
                continue;
            }
            let (b, lane) = (self.block, lanes.trailing_zeros() as usize & 15);
            self.active[b] = lanes & (lanes - 1);
            stack.push(ChildRef::node(0).0 as u64);
            let (ray, t_max) = (&self.setups[b][lane], self.rays[b].t_max[lane]);
            let number = b * LANES + lane;
            let leaf = TriangleCrossings { ray, t_max, number, found: self.found };
            return Some(RayTask { number, ray, t_max, leaf });
        }
        None
    }

    #[inline(always)]
    fn done(&mut self, _: usize, _: Self::Leaf) {}
}

/// Passes on the triangles of a leaf that the ray crosses.
#[derive(Clone, Copy)]
struct TriangleCrossings<'r> {
    ray: &'r RaySetup,
    t_max: f32,
    number: usize,
    found: Take<'r>,
}

impl<S: Simd> LeafTest<S> for TriangleCrossings<'_> {
    type Query = AnyHit;
    const TOGETHER: bool = true;

    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        mut leaves: u32,
        _: &mut f32,
    ) -> bool {
        while leaves != 0 {
            let first = ChildRef(refs[leaves.trailing_zeros() as usize & 7]);
            leaves &= leaves - 1;
            // A leaf alone is tested twice: no branch on the number of leaves.
            let second = refs[leaves.trailing_zeros() as usize & 7];
            let (second, in_second) = match leaves {
                0 => (first, 0),
                _ => (ChildRef(second), ChildRef(second).count()),
            };
            leaves &= leaves.wrapping_sub(1);
            if self.test_two(simd, units, [first, second], in_second) {
                return true;
            }
        }
        false
    }

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        self.test_two(simd, units, [leaf, leaf], 0)
    }
}

impl TriangleCrossings<'_> {
    /// Tests the first leaf, and the first `in_second` triangles of the second.
    #[inline(always)]
    fn test_two<S: Simd>(
        &mut self,
        simd: S,
        units: &[Unit],
        leaves: [ChildRef; 2],
        in_second: usize,
    ) -> bool {
        count(Counter::Primitives, 2);
        let (ray, floats) = (self.ray, leaves.map(|leaf| leaf_floats(units, leaf)));
        let Some(c) = test_two_leaves::<S, WatertightTest>(simd, floats, ray) else { return false };
        let in_range = c.inside
            & c.t.simd_ge(f32x8::splat(simd, ray.t_min))
            & c.t.simd_lt(f32x8::splat(simd, self.t_max));
        // Unused slots repeat a triangle.
        let used = ((1 << leaves[0].count()) - 1) | (((1 << in_second) - 1) << 4);
        let mut mask = in_range.to_bitmask() as u32 & used;
        if mask == 0 {
            return false;
        }
        let (t, u, v) = (c.t.to_array(), c.u.to_array(), c.v.to_array());
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let (leaf, slot) = (floats[i >> 2], i & 3);
            let corners =
                [0, 1, 2].map(|vertex| [0, 1, 2].map(|axis| row(leaf, 3 * vertex + axis)[slot]));
            let prim = leaf_triangle_ids(leaf)[slot];
            if crosses(corners, ray.origin, &ray.shear)
                && (self.found)(self.number, Hit { t: t[i], u: u[i], v: v[i], prim, instance: 0 })
            {
                return true;
            }
        }
        false
    }
}
