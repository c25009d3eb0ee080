//! Traversal of the hierarchy by a packet.

use super::{BoxTest, Packet, PacketLeaf, PacketOrigin, SlabCounts, load_row};
use crate::bvh::Unit;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, STACK_SIZE};
use crate::bvh::traverse::single::{BOX_SLACK, inflate_t};
use crate::bvh::traverse::three;
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::LANES;
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8, f32x16};

/// A child to visit, identified by the index of its box: the node's unit times eight plus the slot.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Entry {
    /// The distance in the high half, the index in the low half.
    key: u64,
    /// Groups whose bounds intersect the box.
    groups: u16,
}

/// Smallest distance to a plane over intervals of origins and reciprocal directions. `o` is the end
/// of the origins' interval that makes it smallest.
#[inline(always)]
fn nearest<S: Simd, V: SimdFloat<S, Element = f32>>(plane: V, o: V, rcp_lo: V, rcp_hi: V) -> V {
    let p = plane - o;
    (p * rcp_lo).min(p * rcp_hi)
}

/// Largest distance to a plane over the same intervals. `o` is the end that makes it largest.
#[inline(always)]
fn farthest<S: Simd, V: SimdFloat<S, Element = f32>>(plane: V, o: V, rcp_lo: V, rcp_hi: V) -> V {
    let p = plane - o;
    (p * rcp_lo).max(p * rcp_hi)
}

/// The six planes of child `slot`, in the order near x, y, z, far x, y, z.
#[inline(always)]
fn planes(node: &[Unit; NODE_UNITS], near: [usize; 3], slot: usize) -> [f32; 6] {
    let at = |row: usize| node[row & 7].0[slot & 7];
    [at(near[0]), at(near[1]), at(near[2]), at(near[0] ^ 1), at(near[1] ^ 1), at(near[2] ^ 1)]
}

impl Packet {
    /// Groups that may intersect the box with these planes before `group_t`, judged by their
    /// intervals.
    #[inline(always)]
    fn groups_in_box<S: Simd>(
        &self,
        simd: S,
        planes: &[f32; 6],
        group_t: f32x16<S>,
        common: bool,
    ) -> u16 {
        let (n, f): ([f32x16<S>; 3], [f32x16<S>; 3]) = if common {
            // With one origin, the sign of a plane's offset tells which end of the interval is
            // nearest.
            let p: [f32; 3] = three!(|a| planes[a] - self.origin_near[a][0]);
            let q: [f32; 3] = three!(|a| planes[a + 3] - self.origin_near[a][0]);
            (
                three!(|a| load_row(simd, &self.rcp_bounds[a][(p[a] < 0.0) as usize])
                    * f32x16::splat(simd, p[a])),
                three!(|a| load_row(simd, &self.rcp_bounds[a][(q[a] >= 0.0) as usize])
                    * f32x16::splat(simd, q[a])),
            )
        } else {
            let lo: [f32x16<S>; 3] = three!(|a| load_row(simd, &self.rcp_bounds[a][0]));
            let hi: [f32x16<S>; 3] = three!(|a| load_row(simd, &self.rcp_bounds[a][1]));
            (
                three!(|a| {
                    let o = load_row(simd, &self.origin_near[a]);
                    nearest(f32x16::splat(simd, planes[a]), o, lo[a], hi[a])
                }),
                three!(|a| {
                    let o = load_row(simd, &self.origin_far[a]);
                    farthest(f32x16::splat(simd, planes[a + 3]), o, lo[a], hi[a])
                }),
            )
        };
        let near = n[0].max(n[1]).max(n[2].max(load_row(simd, &self.group_t_min)));
        let far = (f[0].min(f[1]).min(f[2]) * f32x16::splat(simd, BOX_SLACK)).min(group_t);
        near.simd_le(far).to_bitmask() as u16
    }

    /// Traverses the hierarchy. With per-ray tests, rays leave the packet at boxes that at most
    /// `most_leaving` of them hit. Returns the counts of the tests ray by ray.
    #[inline(never)]
    pub(super) fn walk<S: Simd, L: PacketLeaf<S>, B: BoxTest>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        leaves: &mut L,
        most_leaving: u32,
    ) -> SlabCounts {
        simd.vectorize(
            #[inline(always)]
            || self.walk_body::<S, L, B>(simd, tree, leaves, most_leaving),
        )
    }

    #[inline(always)]
    fn walk_body<S: Simd, L: PacketLeaf<S>, B: BoxTest>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        leaves: &mut L,
        most_leaving: u32,
    ) -> SlabCounts {
        let mut slabs = SlabCounts::default();
        if self.groups == 0 {
            return slabs;
        }
        let units = tree.units;
        let v8 = |x: f32| f32x8::splat(simd, x);
        let near_rows = self.near;
        let [nx, ny, nz] = near_rows;

        // ---- Bounds of the groups, and of the whole packet for eight boxes at a time.
        let all_lo: [f32x8<S>; 3] =
            three!(|a| v8(load_row(simd, &self.rcp_bounds[a][0]).reduce_min()));
        let all_hi: [f32x8<S>; 3] =
            three!(|a| v8(load_row(simd, &self.rcp_bounds[a][1]).reduce_max()));
        let positive = [nx & 1 == 0, ny & 1 == 0, nz & 1 == 0];
        let all_near: [f32x8<S>; 3] = three!(|a| {
            let o = load_row(simd, &self.origin_near[a]);
            v8(if positive[a] { o.reduce_max() } else { o.reduce_min() })
        });
        let all_far: [f32x8<S>; 3] = three!(|a| {
            let o = load_row(simd, &self.origin_far[a]);
            v8(if positive[a] { o.reduce_min() } else { o.reduce_max() })
        });
        let group_t_min = load_row(simd, &self.group_t_min);
        let all_t_min = v8(group_t_min.reduce_min().max(0.0));
        let mut group_t = load_row(simd, &self.group_t);
        let mut all_t = group_t.reduce_max();
        let slack8 = v8(BOX_SLACK);

        let mut memory = StackMemory::<Entry, STACK_SIZE>::new();
        let mut stack = Stack::empty(&mut memory);
        let mut node_at = 0;
        let mut groups = self.groups;
        'nodes: loop {
            // ---- A node: its eight boxes against the packet, then each box that passes against
            // the groups. Testing the groups here, for all children in a row, lets their long
            // chains of operations overlap. At the pop they would wait for one another.
            count(Counter::Nodes, 1);
            let node: &[Unit; NODE_UNITS] =
                units[node_at..node_at + NODE_UNITS].try_into().expect("a slice of that length");
            let row = |r: usize| f32x8::from_slice(simd, &node[r & 7].0);
            let n0 = nearest(row(nx), all_near[0], all_lo[0], all_hi[0]);
            let n1 = nearest(row(ny), all_near[1], all_lo[1], all_hi[1]);
            let n2 = nearest(row(nz), all_near[2], all_lo[2], all_hi[2]);
            let f0 = farthest(row(nx ^ 1), all_far[0], all_lo[0], all_hi[0]);
            let f1 = farthest(row(ny ^ 1), all_far[1], all_lo[1], all_hi[1]);
            let f2 = farthest(row(nz ^ 1), all_far[2], all_lo[2], all_hi[2]);
            let near = n0.max(n1).max(n2.max(all_t_min));
            let far = f0.min(f1).min(f2) * slack8;
            let mask = near.simd_le(far.min(v8(all_t))).to_bitmask() as u32;
            let mut mask = tree.visible(node_at, mask);
            if mask != 0 {
                let near: [f32; 8] = near.to_array();
                let refs = node[CHILD_ROW].bits();
                let base = stack.len();
                while mask != 0 {
                    let i = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    count(Counter::GroupBoxes, 1);
                    let reached = self.groups_in_box(
                        simd,
                        &planes(node, near_rows, i),
                        group_t,
                        L::Origin::COMMON,
                    ) & groups;
                    if reached == 0 {
                        continue;
                    }
                    prefetch::<4, _>(units, ChildRef(refs[i]).unit());
                    let place = (node_at * 8 + i) as u64;
                    stack.push(Entry {
                        key: ((near[i].to_bits() as u64) << 32) | place,
                        groups: reached,
                    });
                }
                stack.sort_descending_from(base);
            }

            // ---- Pops entries, nearest first, until an inner node is reached.
            loop {
                let Some(Entry { key, groups: mut reached }) = stack.pop() else { break 'nodes };
                let distance = f32::from_bits((key >> 32) as u32);
                if distance > all_t {
                    continue;
                }
                let (at, slot) = ((key as u32 >> 3) as usize, key as usize & 7);
                let node: &[Unit; NODE_UNITS] =
                    units[at..at + NODE_UNITS].try_into().expect("a slice of that length");
                let child = ChildRef(node[CHILD_ROW].bits()[slot]);
                let mut lanes = [0; LANES];
                let mut rays = u32::MAX;
                if B::PER_RAY {
                    slabs.tested += reached.count_ones();
                    (reached, rays) = self.cull_rays(
                        simd,
                        &planes(node, near_rows, slot),
                        reached,
                        L::Origin::COMMON,
                        &mut lanes,
                    );
                    slabs.kept += reached.count_ones();
                    slabs.rays += rays;
                    if reached == 0 {
                        continue;
                    }
                }
                if !child.is_leaf() && rays > most_leaving {
                    node_at = child.unit();
                    groups = reached;
                    continue 'nodes;
                }
                if !B::PER_RAY {
                    // Hits found since the push may be nearer than the leaf.
                    count(Counter::GroupBoxes, 1);
                    reached &= self.groups_in_box(
                        simd,
                        &planes(node, near_rows, slot),
                        group_t,
                        L::Origin::COMMON,
                    );
                    if reached == 0 {
                        continue;
                    }
                }
                let changed = if B::PER_RAY && !child.is_leaf() {
                    leaves.switch_to_single(self, simd, tree, child, reached, &lanes)
                } else {
                    leaves.leaf(self, simd, units, child, reached, &lanes)
                };
                if changed != 0 {
                    let mut rest = changed;
                    while rest != 0 {
                        let g = rest.trailing_zeros() as usize & 15;
                        rest &= rest - 1;
                        self.group_t[g] = inflate_t(load_row(simd, &self.t[g]).reduce_max());
                    }
                    group_t = load_row(simd, &self.group_t);
                    all_t = group_t.reduce_max();
                    if all_t < 0.0 {
                        break 'nodes;
                    }
                }
            }
        }
        slabs
    }

    /// Returns the groups of `reached` with a ray that hits the box, and the number of such rays.
    /// Writes their lanes to `lanes`. The intervals of rays with different origins or diverging
    /// directions are weak bounds far away; this test is exact for each ray.
    #[inline(always)]
    fn cull_rays<S: Simd>(
        &self,
        simd: S,
        planes: &[f32; 6],
        reached: u16,
        common: bool,
        lanes: &mut [u16; LANES],
    ) -> (u16, u32) {
        let (mut kept, mut rays) = (0, 0);
        let mut rest = reached;
        // The common origin is subtracted only once.
        let shared = |a: usize| if common { self.origin_near[a][0] } else { 0.0 };
        let p: [f32x16<S>; 3] = three!(|a| f32x16::splat(simd, planes[a] - shared(a)));
        let q: [f32x16<S>; 3] = three!(|a| f32x16::splat(simd, planes[a + 3] - shared(a)));
        while rest != 0 {
            let g = rest.trailing_zeros() as usize & 15;
            rest &= rest - 1;
            count(Counter::GroupBoxes, 1);
            let rcp: [f32x16<S>; 3] = three!(|a| load_row(simd, &self.rcp[g][a]));
            let (n, f): ([f32x16<S>; 3], [f32x16<S>; 3]) = if common {
                (three!(|a| p[a] * rcp[a]), three!(|a| q[a] * rcp[a]))
            } else {
                let o: [f32x16<S>; 3] = three!(|a| load_row(simd, &self.origin[g][a]));
                (three!(|a| (p[a] - o[a]) * rcp[a]), three!(|a| (q[a] - o[a]) * rcp[a]))
            };
            let near = n[0].max(n[1]).max(n[2].max(load_row(simd, &self.t_min[g])));
            let far = (f[0].min(f[1]).min(f[2]) * f32x16::splat(simd, BOX_SLACK))
                .min(load_row(simd, &self.t[g]) * f32x16::splat(simd, inflate_t(1.0)));
            let hit = near.simd_le(far).to_bitmask() as u16 & self.active[g];
            kept |= ((hit != 0) as u16) << g;
            rays += hit.count_ones();
            lanes[g] = hit;
        }
        (kept, rays)
    }
}
