//! Up to 256 rays at a time, for rays that go the same way: tiles of primary rays, shadow rays to one light, sorted ambient occlusion rays.
//!
//! Two levels of bounds do most of the work. All rays of a packet share one octant, so intervals of their reciprocal directions (and origins)
//! bound every ray's distance to a plane. A node's eight children are tested against the whole packet at once, and a child that survives
//! against the intervals of its sixteen groups of sixteen rays at once; only groups that reach a leaf test its triangles, sixteen rays at a
//! time. (Interval packets: Boulos et al. 2006, Overbeck et al. 2008; two levels: measured in this project, 1.2 to 2 times faster than flat
//! packets of 64 or 256.)
//!
//! The triangle test is the single ray's, operation by operation, so both give the same bits.

mod load;
mod triangles;
mod walk;

use crate::accel::wide::ChildRef;
use crate::accel::{Unit, WideBvh};
use crate::ray::{HitBlock, LANES};
use fearless_simd::{Simd, SimdBase, f32x16};
use triangles::Triangles;

/// `[f(0), f(1), f(2)]` written out. Closures handed to library functions such as `array::from_fn` are compiled without the instruction set of
/// the function around them, and every vector operation in them becomes a call (measured: half the speed).
macro_rules! three {
    (|$i:ident| $e:expr) => {{
        [
            {
                let $i = 0usize;
                $e
            },
            {
                let $i = 1usize;
                $e
            },
            {
                let $i = 2usize;
                $e
            },
        ]
    }};
}
pub(crate) use three;

/// Groups of sixteen rays in a packet, at most.
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
    /// Closest hit so far; starts as the ray's limit.
    pub(crate) t: [Row; GROUPS],
    pub(crate) u: [Row; GROUPS],
    pub(crate) v: [Row; GROUPS],
    pub(crate) prim: [[u32; LANES]; GROUPS],
    /// Lanes still looking for a hit.
    active: [u16; GROUPS],
    /// Lanes that have one.
    pub(crate) hit: [u16; GROUPS],
    // Per group: intervals of reciprocal directions and origins, and the largest t.
    rcp_lo: [Row; 3],
    rcp_hi: [Row; 3],
    /// The end of the origins' interval that makes near planes nearest, and the other one.
    origin_near: [Row; 3],
    origin_far: [Row; 3],
    group_t: Row,
    group_t_min: Row,
    groups: u16,
    /// First row of the near plane per axis.
    near: [usize; 3],
    axes: [usize; 3],
    common_origin: bool,
    /// Groups are spread over more than their share of the packet: their intervals say little, each ray's own box test says more.
    gappy: bool,
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
            rcp_lo: [[0.0; LANES]; 3],
            rcp_hi: [[0.0; LANES]; 3],
            origin_near: [[0.0; LANES]; 3],
            origin_far: [[0.0; LANES]; 3],
            group_t: [0.0; LANES],
            group_t_min: [0.0; LANES],
            groups: 0,
            near: [0; 3],
            axes: [0; 3],
            common_origin: false,
            gappy: false,
        })
    }

    /// Writes the hits of the loaded rays; lanes without one are left as they are.
    pub(crate) fn store<const ANY: bool>(&self, out: &mut [HitBlock], instance: u32) {
        for (g, h) in out.iter_mut().enumerate().take(GROUPS) {
            let hit = self.hit[g];
            if hit == 0 {
                continue;
            }
            for lane in 0..LANES {
                let on = hit >> lane & 1 == 1;
                if ANY {
                    h.prim[lane] = if on { 0 } else { h.prim[lane] };
                    continue;
                }
                // Selects instead of branches: this loop becomes vector code.
                h.t[lane] = if on { self.t[g][lane] } else { h.t[lane] };
                h.u[lane] = if on { self.u[g][lane] } else { h.u[lane] };
                h.v[lane] = if on { self.v[g][lane] } else { h.v[lane] };
                h.prim[lane] = if on { self.prim[g][lane] } else { h.prim[lane] };
                h.instance[lane] = if on { instance } else { h.instance[lane] };
            }
        }
    }

    /// Traces the loaded rays against a triangle hierarchy.
    pub(crate) fn trace<S: Simd, const EXACT: bool, const ANY: bool>(&mut self, simd: S, bvh: &WideBvh) {
        match (self.common_origin, self.gappy) {
            (true, false) => self.walk::<S, _, false>(simd, bvh, &mut Triangles::<EXACT, ANY, true>),
            (true, true) => self.walk::<S, _, true>(simd, bvh, &mut Triangles::<EXACT, ANY, true>),
            (false, _) => self.walk::<S, _, true>(simd, bvh, &mut Triangles::<EXACT, ANY, false>),
        }
    }

    /// The leaves of a hierarchy that some group of the packet may reach before its limit, with the distance to the leaf's box.
    pub(crate) fn collect<S: Simd>(&mut self, simd: S, bvh: &WideBvh, out: &mut Vec<(f32, ChildRef)>) {
        self.walk::<S, _, false>(simd, bvh, &mut Collect(out));
    }
}

/// What happens at a leaf.
trait PacketLeaf<S: Simd> {
    /// `reached` are the groups whose bounds meet the leaf's box, first at `distance`. Returns the groups whose limits changed.
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        distance: f32,
    ) -> u16;
}

struct Collect<'a>(&'a mut Vec<(f32, ChildRef)>);

impl<S: Simd> PacketLeaf<S> for Collect<'_> {
    #[inline(always)]
    fn leaf(&mut self, _: &mut Packet, _: S, _: &[Unit], leaf: ChildRef, _: u16, distance: f32) -> u16 {
        self.0.push((distance, leaf));
        0
    }
}

/// One row of a packet as a vector.
#[inline(always)]
fn load_row<S: Simd>(simd: S, row: &Row) -> f32x16<S> {
    f32x16::from_slice(simd, row)
}
