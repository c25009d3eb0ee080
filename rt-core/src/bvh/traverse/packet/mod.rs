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

mod entries;
mod load;
mod meshlets;
mod part;
mod strategy;
mod switch_to_single;
mod triangles;
mod walk;

use crate::bvh::Unit;
use crate::bvh::compact::TrianglePlace;
use crate::bvh::layout::wide::ChildRef;
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::single::RaySetup;
use crate::bvh::traverse::tree_view::TreeView;
use crate::ray::{HitBlock, LANES, NO_HIT};
pub(crate) use entries::PacketEntries;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16, u32x16};
pub(crate) use load::PacketLimits;
pub(crate) use part::PacketPart;
use strategy::{Strategy, StrategyChoice};
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
    /// Where the closest triangles lie, in compact trees and where `keeps_places` is set; without a
    /// meaning in lanes without a hit.
    pub(crate) place: [[TrianglePlace; LANES]; GROUPS],
    /// Whether somebody will ask for `place`.
    keeps_places: bool,
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
    /// Inner nodes' rays that leave the packet: group times sixteen plus lane, and set-up.
    leaving: Vec<(usize, RaySetup)>,
    /// The way to trace, learned from earlier packets: closest hits or occlusion, and separate
    /// origins or a common one.
    choices: [[StrategyChoice; 2]; 2],
}

/// Counts of per-ray box tests in one traversal.
#[derive(Debug, Clone, Copy, Default)]
struct SlabCounts {
    /// Groups tested, groups kept, and their rays that intersect the boxes.
    tested: u32,
    kept: u32,
    rays: u32,
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
            place: [[TrianglePlace::NONE; LANES]; GROUPS],
            keeps_places: false,
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
            leaving: Vec::new(),
            choices: [[StrategyChoice::new(); 2]; 2],
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
        let choice = &mut self.choices[Q::ANY as usize][self.common_origin as usize];
        let (strategy, start) = choice.next(self.common_origin);
        let most_leaving = strategy.most_leaving();
        let counts = match (self.common_origin, strategy) {
            _ if tree.meshlets() != 0 => self.walk_compact::<S, T, Q>(simd, tree, strategy),
            (false, _) => {
                let mut leaves = Triangles::<T, Q, SeparateOrigins>::new();
                self.walk::<S, _, IntervalsAndRays>(simd, tree, &mut leaves, most_leaving)
            }
            (true, Strategy::Intervals) => {
                let mut leaves = Triangles::<T, Q, CommonOrigin>::new();
                self.walk::<S, _, IntervalsOnly>(simd, tree, &mut leaves, most_leaving)
            }
            (true, Strategy::Rays | Strategy::RaysLeaveEarly) => {
                let mut leaves = Triangles::<T, Q, CommonOrigin>::new();
                self.walk::<S, _, IntervalsAndRays>(simd, tree, &mut leaves, most_leaving)
            }
        };
        let seconds = start.map_or(0.0, |start| start.elapsed().as_secs_f32());
        let groups = self.groups.count_ones().max(1) as f32;
        let choice = &mut self.choices[Q::ANY as usize][self.common_origin as usize];
        choice.learn(strategy, counts, seconds / groups);
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

    /// Tests the leaf for the groups `reached`, whose bounds intersect its box; with per-ray tests,
    /// `lanes` are the rays that do. Returns the groups whose limits changed.
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        lanes: &[u16; LANES],
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

/// One row of a packet as a vector.
#[inline(always)]
fn load_row<S: Simd>(simd: S, row: &Row) -> f32x16<S> {
    f32x16::from_slice(simd, row)
}
