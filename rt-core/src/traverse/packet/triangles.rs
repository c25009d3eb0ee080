//! Triangles against the groups of a packet.

use super::{Packet, PacketLeaf, load_row, three};
use crate::accel::wide::ChildRef;
use crate::accel::{Unit, triangles};
use crate::intersect::watertight::test;
use crate::stats::{Work, count};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x4, f32x16, mask32x16, u32x16};

/// The leaf test of triangle hierarchies. `COMMON`: all rays start at one point.
pub(super) struct Triangles<const EXACT: bool, const ANY: bool, const COMMON: bool>;

impl<S: Simd, const EXACT: bool, const ANY: bool, const COMMON: bool> PacketLeaf<S>
    for Triangles<EXACT, ANY, COMMON>
{
    #[inline(always)]
    fn leaf(
        &mut self,
        packet: &mut Packet,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
        _: f32,
    ) -> u16 {
        packet.triangles::<S, EXACT, ANY, COMMON>(simd, units, leaf, reached)
    }
}

impl Packet {
    /// The triangles of a leaf against the groups that reached it. Returns the groups with new hits.
    #[inline(always)]
    fn triangles<S: Simd, const EXACT: bool, const ANY: bool, const COMMON: bool>(
        &mut self,
        simd: S,
        units: &[Unit],
        leaf: ChildRef,
        reached: u16,
    ) -> u16 {
        count(Work::Leaves, 1);
        let floats = triangles::leaf_floats(units, leaf);
        let ids = triangles::leaf_ids(floats);
        let [kx, ky, kz] = self.axes;
        // The nine coordinates in shear order; with one origin for all it is subtracted here, once.
        let mut corners = [[0f32; 4]; 9];
        for vertex in 0..3 {
            for (k, axis) in [kx, ky, kz].into_iter().enumerate() {
                let r = f32x4::from_slice(simd, triangles::row(floats, 3 * vertex + axis));
                let r = if COMMON { r - f32x4::splat(simd, self.origin_near[axis][0]) } else { r };
                corners[3 * vertex + k] = r.to_array();
            }
        }
        let v = |x: f32| f32x16::splat(simd, x);
        let mut changed = 0u16;
        for j in 0..leaf.count() {
            let mut rest = reached;
            let corner = |k: usize| f32x16::splat(simd, corners[k][j & 3]);
            let corner: [f32x16<S>; 9] = [
                corner(0),
                corner(1),
                corner(2),
                corner(3),
                corner(4),
                corner(5),
                corner(6),
                corner(7),
                corner(8),
            ];
            let id = u32x16::splat(simd, ids[j & 3]);
            while rest != 0 {
                let g = rest.trailing_zeros() as usize & 15;
                rest &= rest - 1;
                count(Work::Primitives, 1);
                let [sx, sy, sz]: [f32x16<S>; 3] = three!(|k| f32x16::from_slice(simd, &self.shear[g][k]));
                let (mut a, mut b, mut c) = (
                    [corner[0], corner[1], corner[2]],
                    [corner[3], corner[4], corner[5]],
                    [corner[6], corner[7], corner[8]],
                );
                if !COMMON {
                    let o: [f32x16<S>; 3] = three!(|k| load_row(simd, &self.origin[g][self.axes[k]]));
                    a = three!(|k| a[k] - o[k]);
                    b = three!(|k| b[k] - o[k]);
                    c = three!(|k| c[k] - o[k]);
                }
                let Some(c) = test::<S, f32x16<S>, EXACT>(simd, a, b, c, sx, sy, sz) else {
                    continue;
                };
                let best = f32x16::from_slice(simd, &self.t[g]);
                let t_min = f32x16::from_slice(simd, &self.t_min[g]);
                let in_range = c.inside & c.t.simd_ge(t_min);
                let ok = if ANY {
                    in_range & c.t.simd_lt(best)
                } else {
                    let old = u32x16::from_slice(simd, &self.prim[g]);
                    in_range & (c.t.simd_lt(best) | (c.t.simd_eq(best) & id.simd_lt(old)))
                };
                let bits = ok.to_bitmask() as u16 & self.active[g];
                if bits == 0 {
                    continue;
                }
                changed |= 1 << g;
                self.hit[g] |= bits;
                let ok = mask32x16::from_bitmask(simd, bits as u64);
                if ANY {
                    self.active[g] &= !bits;
                    ok.select(v(-1.0), best).store_slice(&mut self.t[g]);
                } else {
                    ok.select(c.t, best).store_slice(&mut self.t[g]);
                    ok.select(c.u, load_row(simd, &self.u[g])).store_slice(&mut self.u[g]);
                    ok.select(c.v, load_row(simd, &self.v[g])).store_slice(&mut self.v[g]);
                    let old = u32x16::from_slice(simd, &self.prim[g]);
                    ok.select(id, old).store_slice(&mut self.prim[g]);
                }
            }
        }
        changed
    }
}
