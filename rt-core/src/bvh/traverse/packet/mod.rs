//! Traces up to 256 coherent rays at a time: tiles of primary rays, shadow rays to one light,
//! sorted ambient occlusion rays.
//!
//! Most of the work is done on two levels of bounds. All rays of a packet share one octant, so
//! intervals of their reciprocal directions (and origins) bound every ray's distance to a plane. A
//! node's eight children are first tested against the whole packet at once. A child that passes is
//! tested against the intervals of its sixteen groups of sixteen rays at once. Only groups that
//! reach a leaf test its triangles, sixteen rays at a time. (Interval packets: Boulos et al. 2006,
//! Overbeck et al. 2008; two levels: measured in this project, 1.2 to 2 times faster than flat
//! packets of 64 or 256.)
//!
//! The triangle test does the same operations in the same order as the test for single rays, so
//! both give the same bits.

mod load;
mod switch_to_single;
mod triangles;
mod walk;

use crate::bvh::Unit;
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{HitBlock, LANES, NO_HIT};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16, u32x16};
pub(crate) use load::PacketLimits;
use triangles::Triangles;

/// Largest number of groups of sixteen rays in a packet.
pub(crate) const GROUPS: usize = 16;

type Row = [f32; LANES];

/// Rays that share an octant and a dominant axis, with their closest hits so far.
#[repr(C, align(64))]
pub(crate) struct Packet {
    origin: [[Row; 3]; GROUPS],
    /// Shears of the triangle test: x, y, z.
    shear: [[Row; 3]; GROUPS],
    /// Reciprocal directions, for packets without a common origin.
    rcp: [[Row; 3]; GROUPS],
    t_min: [Row; GROUPS],
    /// Distance of the closest hit so far. Starts as the ray's limit.
    pub(crate) t: [Row; GROUPS],
    pub(crate) u: [Row; GROUPS],
    pub(crate) v: [Row; GROUPS],
    pub(crate) prim: [[u32; LANES]; GROUPS],
    /// Lanes that still search for a hit.
    active: [u16; GROUPS],
    /// Lanes that have a hit.
    pub(crate) hit: [u16; GROUPS],
    // Per group: intervals of reciprocal directions (per axis smallest and largest) and origins,
    // and the largest t.
    rcp_bounds: [[Row; 2]; 3],
    /// The end of the origins' interval that gives the nearest distances to near planes. The next
    /// field holds the other end.
    origin_near: [Row; 3],
    origin_far: [Row; 3],
    group_t: Row,
    group_t_min: Row,
    groups: u16,
    /// First row of the near plane per axis.
    near: [usize; 3],
    axes: [usize; 3],
    common_origin: bool,
    /// A shear in the middle of the packet's shears. The bounds below are differences from it.
    shear_mid: [f32; 2],
    /// Per group, for x and y: smallest and largest shear. Only for packets with a common origin.
    shear_bounds: [[Row; 2]; 2],
    /// Largest difference from `shear_mid` over all groups.
    shear_span: [f32; 2],
    /// Whether per-ray box tests pay off with a common origin, learned from earlier packets: one
    /// entry for closest hits, one for occlusion.
    slabs: [SlabHeuristic; 2],
}

/// Decides whether per-ray box tests reject enough of the groups whose intervals intersect a box.
/// They do so for shadow rays from points at many depths, but not for tiles of pixels. No measure
/// of the intervals predicted this as well as trying. Results do not depend on it.
///
/// It keeps means of shares, not sums of counts. With sums, packets with much work outweighed later
/// ones for a thousand packets: rays from a light over 3,000 meshes took 30 times as long after
/// another view than without it.
#[derive(Debug, Clone, Copy, Default)]
struct SlabHeuristic {
    /// Mean share of the tested groups that were kept.
    kept: f32,
    /// Mean number of rays in a tested group that intersect the box.
    rays: f32,
    /// Packets since the last trial.
    since: u8,
}

/// Counts of per-ray box tests in one traversal.
#[derive(Debug, Clone, Copy, Default)]
struct SlabCounts {
    /// Groups tested, groups kept, and their rays that intersect the boxes.
    tested: u32,
    kept: u32,
    rays: u32,
}

impl SlabHeuristic {
    /// The tests are tried again after this many packets.
    const TRIAL: u8 = 16;
    /// Above this share of kept groups the tests cost more than they save. Measured shares on one
    /// million triangles: 0.83 and 0.94 for pixels (orbit, close by), where the tests cost a tenth
    /// of the time; 0.66 and 0.93 for rays from a light, where they save a third and cost a
    /// quarter.
    const KEPT: f32 = 0.75;
    /// When a tested group has fewer rays than this on average, the packet loses coherence, and the
    /// tests find the few rays that are traced faster alone. One value was tried: rays from a light
    /// among pipes took 94 instead of 133 ms; among isosurfaces nothing changed.
    const RAYS: f32 = 5.0;

    /// Weights of a packet in the means: tests that would have paid count more, because without
    /// them a packet of diverging rays takes many times as long, and with them any packet takes at
    /// most a quarter longer.
    const PAYS: f32 = 0.5;
    const DOES_NOT_PAY: f32 = 0.1;

    fn next(&mut self) -> bool {
        self.since = if self.since >= Self::TRIAL { 0 } else { self.since + 1 };
        Self::pays(self.kept, self.rays) || self.since == 0
    }

    fn pays(kept: f32, rays: f32) -> bool {
        kept <= Self::KEPT || rays <= Self::RAYS
    }

    fn learn(&mut self, SlabCounts { tested, kept, rays }: SlabCounts) {
        if tested == 0 {
            return;
        }
        let (kept, rays) = (kept as f32 / tested as f32, rays as f32 / tested as f32);
        let weight = if Self::pays(kept, rays) { Self::PAYS } else { Self::DOES_NOT_PAY };
        self.kept += weight * (kept - self.kept);
        self.rays += weight * (rays - self.rays);
    }
}

impl Packet {
    pub(crate) fn new() -> Box<Packet> {
        Box::new(Packet {
            origin: [[[0.0; LANES]; 3]; GROUPS],
            shear: [[[0.0; LANES]; 3]; GROUPS],
            rcp: [[[0.0; LANES]; 3]; GROUPS],
            t_min: [[0.0; LANES]; GROUPS],
            t: [[0.0; LANES]; GROUPS],
            u: [[0.0; LANES]; GROUPS],
            v: [[0.0; LANES]; GROUPS],
            prim: [[0; LANES]; GROUPS],
            active: [0; GROUPS],
            hit: [0; GROUPS],
            rcp_bounds: [[[0.0; LANES]; 2]; 3],
            origin_near: [[0.0; LANES]; 3],
            origin_far: [[0.0; LANES]; 3],
            group_t: [0.0; LANES],
            group_t_min: [0.0; LANES],
            groups: 0,
            near: [0; 3],
            axes: [0; 3],
            common_origin: false,
            shear_mid: [0.0; 2],
            shear_bounds: [[[0.0; LANES]; 2]; 2],
            shear_span: [0.0; 2],
            slabs: [SlabHeuristic::default(); 2],
        })
    }

    /// Writes the hits of the loaded rays. Lanes without a hit keep their contents.
    pub(crate) fn store<Q: HitQuery>(&self, out: &mut [HitBlock], instance: u32) {
        for (g, h) in out.iter_mut().enumerate().take(GROUPS) {
            let hit = self.hit[g];
            if hit == 0 {
                continue;
            }
            for lane in 0..LANES {
                let on = hit >> lane & 1 == 1;
                if Q::ANY {
                    h.prim[lane] = if on { 0 } else { h.prim[lane] };
                    continue;
                }
                // Selects instead of branches, so that this loop is vectorized.
                h.t[lane] = if on { self.t[g][lane] } else { h.t[lane] };
                h.u[lane] = if on { self.u[g][lane] } else { h.u[lane] };
                h.v[lane] = if on { self.v[g][lane] } else { h.v[lane] };
                h.prim[lane] = if on { self.prim[g][lane] } else { h.prim[lane] };
                h.instance[lane] = if on { instance } else { h.instance[lane] };
            }
        }
    }

    /// Writes every lane of the packet's blocks: hits of `instance`, or misses.
    #[inline(never)]
    pub(crate) fn store_all<S: Simd>(&self, simd: S, out: &mut [HitBlock], instance: u32) {
        simd.vectorize(
            #[inline(always)]
            || {
                let none = u32x16::splat(simd, NO_HIT);
                let zero = f32x16::splat(simd, 0.0);
                for (g, h) in out.iter_mut().enumerate().take(GROUPS) {
                    let hit = mask32x16::from_bitmask(simd, self.hit[g] as u64);
                    let infinity = f32x16::splat(simd, f32::INFINITY);
                    hit.select(load_row(simd, &self.t[g]), infinity).store_slice(&mut h.t);
                    hit.select(load_row(simd, &self.u[g]), zero).store_slice(&mut h.u);
                    hit.select(load_row(simd, &self.v[g]), zero).store_slice(&mut h.v);
                    hit.select(u32x16::from_slice(simd, &self.prim[g]), none)
                        .store_slice(&mut h.prim);
                    hit.select(u32x16::splat(simd, instance), none).store_slice(&mut h.instance);
                }
            },
        );
    }

    /// Traces the loaded rays against a triangle hierarchy.
    pub(crate) fn trace<S: Simd, T: TriangleTest, Q: HitQuery>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
    ) {
        if !self.common_origin {
            // Combined intervals of origins and directions are weak bounds: measured seven times
            // slower without per-ray tests.
            self.walk::<S, _, IntervalsAndRays>(
                simd,
                tree,
                &mut Triangles::<T, Q, SeparateOrigins>::new(),
            );
        } else if self.slabs[Q::ANY as usize].next() {
            let mut leaves = Triangles::<T, Q, CommonOrigin>::new();
            let slabs = self.walk::<S, _, IntervalsAndRays>(simd, tree, &mut leaves);
            self.slabs[Q::ANY as usize].learn(slabs);
        } else {
            let mut leaves = Triangles::<T, Q, CommonOrigin>::new();
            self.walk::<S, _, IntervalsOnly>(simd, tree, &mut leaves);
        }
    }

    /// Collects the leaves of a hierarchy that some group of the packet may reach before its limit,
    /// each with the distance to its box.
    pub(crate) fn collect<S: Simd>(
        &mut self,
        simd: S,
        tree: &TreeView<'_>,
        out: &mut Vec<(f32, ChildRef)>,
    ) {
        self.walk::<S, _, IntervalsOnly>(simd, tree, &mut CollectLeaves(out));
    }
}

/// Where the rays of a packet start.
trait PacketOrigin {
    /// Whether they all start at one point.
    const COMMON: bool;
}

/// All rays start at one point.
struct CommonOrigin;

/// Each ray has its own origin.
struct SeparateOrigins;

impl PacketOrigin for CommonOrigin {
    const COMMON: bool = true;
}

impl PacketOrigin for SeparateOrigins {
    const COMMON: bool = false;
}

/// The test that a packet does at a box before it continues with it.
trait BoxTest {
    /// Whether the groups whose intervals intersect the box are also tested ray by ray.
    const PER_RAY: bool;
}

/// Only the intervals of the groups are tested.
struct IntervalsOnly;

/// The intervals are tested, then the rays of the groups that remain.
struct IntervalsAndRays;

impl BoxTest for IntervalsOnly {
    const PER_RAY: bool = false;
}

impl BoxTest for IntervalsAndRays {
    const PER_RAY: bool = true;
}

/// Callback for the leaves that a packet reaches.
trait PacketLeaf<S: Simd> {
    /// Where the rays start.
    type Origin: PacketOrigin;

    /// Tests the leaf for the groups `reached`, whose bounds intersect its box, at `distance` at
    /// the nearest. Returns the groups whose limits changed.
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        distance: f32,
    ) -> u16;

    /// Traces one by one the few rays that hit an inner node's box: `lanes` of the groups
    /// `reached`. Returns the groups whose limits changed.
    fn switch_to_single(
        &mut self,
        packet: &mut Packet,
        simd: S,
        tree: &TreeView<'_>,
        node: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
    ) -> u16;
}

struct CollectLeaves<'a>(&'a mut Vec<(f32, ChildRef)>);

impl<S: Simd> PacketLeaf<S> for CollectLeaves<'_> {
    type Origin = SeparateOrigins;

    #[inline(always)]
    fn leaf(
        &mut self,
        _: &mut Packet,
        _: S,
        _: &[Unit],
        leaf: ChildRef,
        _: u16,
        distance: f32,
    ) -> u16 {
        self.0.push((distance, leaf));
        0
    }

    fn switch_to_single(
        &mut self,
        _: &mut Packet,
        _: S,
        _: &TreeView<'_>,
        _: ChildRef,
        _: u16,
        _: &[u16; LANES],
    ) -> u16 {
        unreachable!("leaves are collected without the rays' own tests")
    }
}

/// One row of a packet as a vector.
#[inline(always)]
fn load_row<S: Simd>(simd: S, row: &Row) -> f32x16<S> {
    f32x16::from_slice(simd, row)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_of_another_scene_are_learned_within_a_hundred_packets() {
        let mut slabs = SlabHeuristic::default();
        assert!(slabs.next(), "untried tests are tried");
        // Tiles of pixels: much work, no gain.
        for _ in 0..1000 {
            if slabs.next() {
                slabs.learn(SlabCounts { tested: 3000, kept: 2850, rays: 40_000 });
            }
        }
        assert!((0..16).filter(|_| slabs.next()).count() <= 1);
        // Diverging rays: little work, because the rays soon leave the packet.
        let mut packets = 0;
        while packets < 1000 && !SlabHeuristic::pays(slabs.kept, slabs.rays) {
            packets += 1;
            if slabs.next() {
                slabs.learn(SlabCounts { tested: 40, kept: 30, rays: 60 });
            }
        }
        assert!(packets <= 100, "{packets} packets without the tests");
    }

    #[test]
    fn a_packet_that_tested_nothing_teaches_nothing() {
        let mut slabs = SlabHeuristic { kept: 0.9, rays: 12.0, since: 3 };
        slabs.learn(SlabCounts::default());
        assert_eq!((slabs.kept, slabs.rays), (0.9, 12.0));
    }
}
