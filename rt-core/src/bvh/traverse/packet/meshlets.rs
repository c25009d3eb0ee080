//! A packet through a compact tree: at a meshlet, the groups that reach it go on through the small
//! tree, and its leaves get the ordinary test.

use super::{
    BoxTest, CommonOrigin, IntervalsAndRays, IntervalsOnly, Packet, PacketLeaf, PacketOrigin,
    SeparateOrigins, SlabCounts, Triangles,
};
use crate::bvh::Unit;
use crate::bvh::compact::{ExpandedLeaves, MeshletCache, TrianglePlace, with_cache};
use crate::bvh::layout::triangles::{TRI_LEAF_UNITS, leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{ChildRef, LEAF_SIZE};
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::block_hits::set_bits;
use crate::bvh::traverse::meshlets;
use crate::bvh::traverse::packet::strategy::Strategy;
use crate::bvh::traverse::single::traverse_from;
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::ray::LANES;
use crate::stats::{Counter, count};
use fearless_simd::Simd;
use std::cell::RefCell;
use std::marker::PhantomData;

impl Packet {
    /// Keeps the places of the closest triangles that are those with these numbers, in the slots of
    /// one leaf, where some lane of the groups `changed` has just found one of them.
    #[inline(always)]
    fn keep_places(&mut self, changed: u16, ids: &[u32; LEAF_SIZE], first: TrianglePlace) {
        for g in set_bits(changed) {
            let (prims, places) = (&self.prim[g], &mut self.place[g]);
            for slot in 0..LEAF_SIZE {
                let place = first.in_slot(slot);
                for lane in 0..LANES {
                    let is_this = prims[lane] == ids[slot];
                    places[lane] = if is_this { place } else { places[lane] };
                }
            }
        }
    }

    /// As the walk through an ordinary tree.
    pub(super) fn walk_compact<S: Simd, T: TriangleTest, Q: HitQuery>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        strategy: Strategy,
    ) -> SlabCounts {
        let most_leaving = strategy.most_leaving();
        with_cache(|cache| {
            let common = self.common_origin;
            match strategy {
                _ if !common => {
                    let mut leaves =
                        Meshlets::<T, Q, SeparateOrigins, IntervalsAndRays>::new(cache, tree);
                    self.walk::<S, _, IntervalsAndRays>(simd, tree, &mut leaves, most_leaving)
                }
                Strategy::Intervals => {
                    let mut leaves =
                        Meshlets::<T, Q, CommonOrigin, IntervalsOnly>::new(cache, tree);
                    self.walk::<S, _, IntervalsOnly>(simd, tree, &mut leaves, most_leaving)
                }
                Strategy::Rays | Strategy::RaysLeaveEarly => {
                    let mut leaves =
                        Meshlets::<T, Q, CommonOrigin, IntervalsAndRays>::new(cache, tree);
                    self.walk::<S, _, IntervalsAndRays>(simd, tree, &mut leaves, most_leaving)
                }
            }
        })
    }
}

/// The leaf test of compact trees.
struct Meshlets<'c, T, Q, O, B> {
    triangles: Triangles<T, Q, O>,
    cache: &'c RefCell<MeshletCache>,
    key: u64,
    boxes: PhantomData<B>,
}

impl<'c, T: TriangleTest, Q: HitQuery, O: PacketOrigin, B> Meshlets<'c, T, Q, O, B> {
    fn new(cache: &'c RefCell<MeshletCache>, tree: &TreeView<'_>) -> Self {
        Meshlets { triangles: Triangles::new(), cache, key: tree.meshlets(), boxes: PhantomData }
    }
}

impl<S: Simd, T: TriangleTest, Q: HitQuery, O: PacketOrigin, B: BoxTest> PacketLeaf<S>
    for Meshlets<'_, T, Q, O, B>
{
    type Origin = O;

    #[inline(always)]
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        _: &[u16; LANES],
    ) -> u16 {
        let mut cache = self.cache.borrow_mut();
        let (expanded, words) = cache.last.meshlet(simd, self.key, units, leaf);
        let (nodes, leaves) = expanded.with_all_nodes(simd, words);
        let (triangles, unit) = (&mut self.triangles, leaf.unit());
        let mut inner = MeshletLeaves { triangles, leaves, words, unit, changed: 0 };
        let groups = std::mem::replace(&mut packet.groups, reached);
        packet.walk::<S, _, B>(simd, &TreeView::of_units(nodes), &mut inner, 0);
        packet.groups = groups;
        inner.changed
    }

    #[inline(never)]
    fn switch_to_single(
        &mut self,
        packet: &mut Packet,
        simd: S,
        tree: &TreeView<'_>,
        node: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        simd.vectorize(
            #[inline(always)]
            || {
                let (mut groups, mut changed) = (reached, 0);
                while groups != 0 {
                    let g = groups.trailing_zeros() as usize & 15;
                    groups &= groups - 1;
                    let mut rest = lanes[g];
                    while rest != 0 {
                        let lane = rest.trailing_zeros() as usize & 15;
                        rest &= rest - 1;
                        count(Counter::Fallbacks, 1);
                        changed |= self.trace_ray(packet, simd, tree, node, g, lane);
                    }
                }
                changed
            },
        )
    }
}

impl<T: TriangleTest, Q: HitQuery, O, B> Meshlets<'_, T, Q, O, B> {
    /// Traces one ray of the packet through the subtree at `node`. Returns the bit of its group
    /// when it has a new hit.
    #[inline(always)]
    fn trace_ray<S: Simd>(
        &mut self,
        packet: &mut Packet,
        simd: S,
        tree: &TreeView<'_>,
        node: ChildRef,
        g: usize,
        lane: usize,
    ) -> u16 {
        let (ray, t) = (&packet.setup(g, lane), packet.t[g][lane]);
        let (cache, key, keeps_places) = (self.cache, self.key, !Q::ANY && packet.keeps_places);
        let kind = meshlets::InMeshlets { cache, key, keeps_places };
        if Q::ANY {
            let inner = AnyLeaf::<T>::new(ray, t);
            let mut leaves = kind.meshlets(ray, inner);
            traverse_from(simd, tree, ray, t, node, &mut leaves);
            if !leaves.inner.found {
                return 0;
            }
            packet.active[g] &= !(1 << lane);
            packet.t[g][lane] = -1.0;
        } else {
            let found = packet.hit[g] >> lane & 1 == 1;
            let (u, v) = (packet.u[g][lane], packet.v[g][lane]);
            let best = ClosestTri { t, u, v, prim: packet.prim[g][lane], found };
            let inner = ClosestLeaf::<T>::continuing(ray, best);
            let mut leaves = kind.meshlets(ray, inner);
            traverse_from(simd, tree, ray, t, node, &mut leaves);
            let b = leaves.inner.best;
            if !b.found {
                return 0;
            }
            (packet.t[g][lane], packet.prim[g][lane]) = (b.t, b.prim);
            (packet.u[g][lane], packet.v[g][lane]) = (b.u, b.v);
            if let Some(place) = leaves.place {
                packet.place[g][lane] = place;
            }
        }
        packet.hit[g] |= 1 << lane;
        1 << g
    }
}

/// The leaves of one meshlet.
struct MeshletLeaves<'m, T, Q, O> {
    triangles: &'m mut Triangles<T, Q, O>,
    leaves: &'m mut ExpandedLeaves,
    words: &'m [u32],
    /// The first unit of the meshlet.
    unit: usize,
    /// Groups with new hits.
    changed: u16,
}

impl<S: Simd, T: TriangleTest, Q: HitQuery, O: PacketOrigin> PacketLeaf<S>
    for MeshletLeaves<'_, T, Q, O>
{
    type Origin = O;

    #[inline(always)]
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        _: &[Unit],
        leaf: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16 {
        let units = self.leaves.with(simd, self.words, leaf);
        let changed = self.triangles.leaf(packet, simd, units, leaf, reached, lanes);
        if !Q::ANY && changed != 0 && packet.keeps_places {
            let first = TrianglePlace::of_leaf(self.unit, leaf.unit() / TRI_LEAF_UNITS);
            packet.keep_places(changed, &leaf_triangle_ids(leaf_floats(units, leaf)), first);
        }
        self.changed |= changed;
        changed
    }

    /// Never called: rays do not leave the packet inside a meshlet.
    fn switch_to_single(
        &mut self,
        _: &mut Packet,
        _: S,
        _: &TreeView<'_>,
        _: ChildRef,
        _: u16,
        _: &[u16; LANES],
    ) -> u16 {
        0
    }
}
