//! Fills a packet: decides which rays can be traced together and computes the bounds of each group.

use super::{GROUPS, Packet, Row, load_row};
use crate::bvh::intersect::watertight::dominant_axis;
use crate::bvh::traverse::single::{MIN_COMPONENT, inflate_t, safe_reciprocal};
use crate::bvh::traverse::three;
use crate::ray::{LANES, RayBlock};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};

/// Limits that a packet's rays must keep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PacketLimits {
    /// Smallest and largest value allowed for a direction's largest component.
    pub(crate) length: (f32, f32),
    /// Centre of the region where origins may be; `reach` is their largest distance from it per
    /// axis.
    pub(crate) center: [f32; 3],
    pub(crate) reach: f32,
}

impl PacketLimits {
    /// Accepts any finite ray.
    pub(crate) const NONE: PacketLimits =
        PacketLimits { length: (0.0, f32::MAX), center: [0.0; 3], reach: f32::INFINITY };
}

impl Packet {
    /// Fills the packet from at most sixteen blocks. Returns false when the rays do not share an
    /// octant and a dominant axis, or when one of them is not finite or outside `limits`.
    #[inline(never)]
    pub(crate) fn load<S: Simd>(
        &mut self,
        simd: S,
        blocks: &[RayBlock],
        limits: &PacketLimits,
    ) -> bool {
        simd.vectorize(
            #[inline(always)]
            || self.load_body(simd, blocks, limits),
        )
    }

    #[inline(always)]
    fn load_body<S: Simd>(&mut self, simd: S, blocks: &[RayBlock], limits: &PacketLimits) -> bool {
        debug_assert!(blocks.len() <= GROUPS, "{} groups", blocks.len());
        let v = |x: f32| f32x16::splat(simd, x);

        // ---- Finds the lanes that hold rays. The first ray represents the packet. Its values fill
        // empty lanes, so these widen no interval.
        self.active = [0; GROUPS];
        self.hit = [0; GROUPS];
        // Number 0 at the ray's own limit: nothing at exactly t_max can win the tie, so the range
        // is half-open.
        self.prim = [[0; LANES]; GROUPS];
        self.groups = 0;
        for (g, b) in blocks.iter().enumerate() {
            let on = load_row(simd, &b.t_max).simd_gt(load_row(simd, &b.t_min));
            self.active[g] = on.to_bitmask() as u16;
            self.groups |= ((self.active[g] != 0) as u16) << g;
        }
        if self.groups == 0 {
            return true;
        }
        let first = self.groups.trailing_zeros() as usize & 15;
        let (b, lane) = (&blocks[first], self.active[first].trailing_zeros() as usize & 15);
        let d0 = [b.dx[lane], b.dy[lane], b.dz[lane]];
        let o0 = [b.ox[lane], b.oy[lane], b.oz[lane]];
        let kz = dominant_axis(d0);
        let (kx, ky) = ([1, 2, 0][kz], [2, 0, 1][kz]);
        self.axes = [kx, ky, kz];
        let r0 = [safe_reciprocal(d0[0]), safe_reciprocal(d0[1]), safe_reciprocal(d0[2])];
        let negative = [r0[0] < 0.0, r0[1] < 0.0, r0[2] < 0.0];
        self.near = [negative[0] as usize, 2 + negative[1] as usize, 4 + negative[2] as usize];
        let all_active = self.active[..blocks.len()].iter().all(|&a| a == u16::MAX);

        // ---- Directions. Octant and dominant axis must be those of the first ray.
        let one = v(1.0);
        let mut same = mask32x16::splat(simd, true);
        let mut common = mask32x16::splat(simd, true);
        for g in 0..GROUPS {
            if self.groups >> g & 1 == 0 {
                for a in 0..3 {
                    self.rcp[g][a] = [r0[a]; LANES];
                    self.origin[g][a] = [o0[a]; LANES];
                }
                self.shear[g] = [[d0[kx] / d0[kz]; LANES], [d0[ky] / d0[kz]; LANES], [0.0; LANES]];
                self.t[g] = [-1.0; LANES];
                self.t_min[g] = [f32::INFINITY; LANES];
                continue;
            }
            let b = &blocks[g];
            let on = mask32x16::from_bitmask(simd, self.active[g] as u64);
            let fill = self.active[g].trailing_zeros() as usize & 15;
            let on = (!all_active).then_some((on, fill));
            let (d_rows, o_rows) = ([&b.dx, &b.dy, &b.dz], [&b.ox, &b.oy, &b.oz]);
            let d: [f32x16<S>; 3] = three!(|a| filled(simd, d_rows[a], on));
            let o: [f32x16<S>; 3] = three!(|a| filled(simd, o_rows[a], on));
            let abs: [f32x16<S>; 3] = three!(|a| d[a].abs());
            // At least as large as the axes after it, and larger than those before it: ties go to
            // the lower axis, as for single rays.
            let [x, y, z] = abs;
            same &= match kz {
                0 => x.simd_ge(y) & x.simd_ge(z) & x.simd_gt(v(0.0)),
                1 => y.simd_gt(x) & y.simd_ge(z),
                _ => z.simd_gt(x) & z.simd_gt(y),
            };
            let length = x.max(y).max(z);
            same &= length.simd_ge(v(limits.length.0)) & length.simd_le(v(limits.length.1));
            let away: [f32x16<S>; 3] = three!(|a| (o[a] - v(limits.center[a])).abs());
            same &= away[0].max(away[1]).max(away[2]).simd_le(v(limits.reach));
            for a in 0..3 {
                let rcp = one / abs[a].max(v(MIN_COMPONENT)).copysign(d[a]);
                rcp.store_slice(&mut self.rcp[g][a]);
                o[a].store_slice(&mut self.origin[g][a]);
                common &= o[a].simd_eq(v(o0[a]));
            }
            let sz = one / d[kz];
            let (sx, sy) = (d[kx] * sz, d[ky] * sz);
            sx.store_slice(&mut self.shear[g][0]);
            sy.store_slice(&mut self.shear[g][1]);
            sz.store_slice(&mut self.shear[g][2]);
            let t_max = load_row(simd, &b.t_max);
            let t_max = if let Some((on, _)) = on { on.select(t_max, v(-1.0)) } else { t_max };
            t_max.store_slice(&mut self.t[g]);
            filled(simd, &b.t_min, on).store_slice(&mut self.t_min[g]);
        }
        if !same.all_true() {
            return false;
        }

        // ---- Intervals of the groups, sixteen reductions at a time.
        for a in 0..3 {
            let lo = reduce_rows::<S, Smallest>(simd, &self.rcp.as_flattened()[a..], 3);
            let hi = reduce_rows::<S, Largest>(simd, &self.rcp.as_flattened()[a..], 3);
            let octant = if negative[a] { hi.simd_lt(v(0.0)) } else { lo.simd_gt(v(0.0)) };
            if !octant.all_true() {
                return false;
            }
            lo.store_slice(&mut self.rcp_bounds[a][0]);
            hi.store_slice(&mut self.rcp_bounds[a][1]);
        }
        self.common_origin = common.all_true();
        for a in 0..3 {
            if self.common_origin {
                self.origin_near[a] = [o0[a]; LANES];
                self.origin_far[a] = [o0[a]; LANES];
                if !o0[a].is_finite() {
                    return false;
                }
                continue;
            }
            let lo = reduce_rows::<S, Smallest>(simd, &self.origin.as_flattened()[a..], 3);
            let hi = reduce_rows::<S, Largest>(simd, &self.origin.as_flattened()[a..], 3);
            // NaN and infinite origins fail this comparison.
            if !(hi - lo).simd_lt(v(f32::INFINITY)).all_true() {
                return false;
            }
            let (near, far) = if negative[a] { (lo, hi) } else { (hi, lo) };
            near.store_slice(&mut self.origin_near[a]);
            far.store_slice(&mut self.origin_far[a]);
        }
        (reduce_rows::<S, Largest>(simd, &self.t, 1) * v(inflate_t(1.0)))
            .store_slice(&mut self.group_t);
        reduce_rows::<S, Smallest>(simd, &self.t_min, 1).store_slice(&mut self.group_t_min);

        // ---- Shears of the groups, as differences from the middle. Leaves test triangles' edges
        // against them.
        if self.common_origin {
            for a in 0..2 {
                let lo = reduce_rows::<S, Smallest>(simd, &self.shear.as_flattened()[a..], 3);
                let hi = reduce_rows::<S, Largest>(simd, &self.shear.as_flattened()[a..], 3);
                let mid = 0.5 * (lo.reduce_min() + hi.reduce_max());
                let (lo, hi) = (lo - v(mid), hi - v(mid));
                self.shear_mid[a] = mid;
                self.shear_span[a] = hi.reduce_max().max(-lo.reduce_min());
                lo.store_slice(&mut self.shear_bounds[a][0]);
                hi.store_slice(&mut self.shear_bounds[a][1]);
            }
        }
        true
    }
}

/// A row of rays. With `on` (mask and lane), lanes outside the mask get the value of that lane.
#[inline(always)]
fn filled<S: Simd>(simd: S, row: &Row, on: Option<(mask32x16<S>, usize)>) -> f32x16<S> {
    let r = load_row(simd, row);
    match on {
        Some((on, fill)) => on.select(r, f32x16::splat(simd, row[fill])),
        None => r,
    }
}

/// What remains of two numbers.
trait Reduction {
    fn of<S: Simd>(x: f32x16<S>, y: f32x16<S>) -> f32x16<S>;
}

struct Smallest;

struct Largest;

impl Reduction for Smallest {
    #[inline(always)]
    fn of<S: Simd>(x: f32x16<S>, y: f32x16<S>) -> f32x16<S> {
        x.min(y)
    }
}

impl Reduction for Largest {
    #[inline(always)]
    fn of<S: Simd>(x: f32x16<S>, y: f32x16<S>) -> f32x16<S> {
        x.max(y)
    }
}

/// Sixteen reductions over sixteen lanes each: lane g of the result is the smallest (or largest) of
/// `rows[g * stride]`. Each step combines two rows, so all reductions take fifteen steps instead of
/// sixteen times four and as many transfers to scalar registers.
#[inline(always)]
fn reduce_rows<S: Simd, R: Reduction>(simd: S, rows: &[Row], stride: usize) -> f32x16<S> {
    #[inline(always)]
    fn step<S: Simd, R: Reduction>(a: f32x16<S>, b: f32x16<S>) -> f32x16<S> {
        let (x, y) = (a.zip_low(b), a.zip_high(b));
        R::of(x, y)
    }
    #[inline(always)]
    fn pair<S: Simd, R: Reduction>(simd: S, rows: &[Row], stride: usize, i: usize) -> f32x16<S> {
        step::<S, R>(load_row(simd, &rows[i * stride]), load_row(simd, &rows[(i + 8) * stride]))
    }
    // Zipping interleaves lanes. Rows are passed in bit-reversed order, so the results are in the
    // order of the rows.
    let ab = pair::<S, R>(simd, rows, stride, 0);
    let cd = pair::<S, R>(simd, rows, stride, 4);
    let ef = pair::<S, R>(simd, rows, stride, 2);
    let gh = pair::<S, R>(simd, rows, stride, 6);
    let even = step::<S, R>(step::<S, R>(ab, cd), step::<S, R>(ef, gh));
    let ij = pair::<S, R>(simd, rows, stride, 1);
    let kl = pair::<S, R>(simd, rows, stride, 5);
    let mn = pair::<S, R>(simd, rows, stride, 3);
    let op = pair::<S, R>(simd, rows, stride, 7);
    let odd = step::<S, R>(step::<S, R>(ij, kl), step::<S, R>(mn, op));
    step::<S, R>(even, odd)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn sixteen_reductions_give_each_rows_own() {
        let rows: [Row; 16] = std::array::from_fn(|g| {
            std::array::from_fn(|l| ((g * 31 + l * 7) % 53) as f32 + g as f32 * 100.0)
        });
        dispatch!(Level::new(), simd => {
            let lo = reduce_rows::<_, Smallest>(simd, &rows, 1);
            let hi = reduce_rows::<_, Largest>(simd, &rows, 1);
            for g in 0..16 {
                assert_eq!(lo.as_slice()[g], rows[g].iter().copied().fold(f32::INFINITY, f32::min));
                let highest = rows[g].iter().copied().fold(f32::NEG_INFINITY, f32::max);
                assert_eq!(hi.as_slice()[g], highest);
            }
        });
    }
}
