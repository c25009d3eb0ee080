//! Sixteen rays in any direction against one box of a node.

use super::single::{BOX_SLACK, MIN_COMPONENT, RaySetup};
use super::three;
use crate::bvh::intersect::watertight::{Shear, dominant_axis};
use crate::bvh::layout::wide::{NODE_UNITS, Unit};
use crate::ray::{LANES, RayBlock};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x16};

/// What the box tests of a block need, computed once.
pub(crate) struct BlockSetup<S: Simd> {
    origin: [f32x16<S>; 3],
    rcp: [f32x16<S>; 3],
    t_min: f32x16<S>,
    slack: f32x16<S>,
}

impl<S: Simd> BlockSetup<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, rays: &RayBlock) -> Self {
        let directions = [&rays.dx, &rays.dy, &rays.dz];
        let origins = [&rays.ox, &rays.oy, &rays.oz];
        let d: [f32x16<S>; 3] = three!(|a| f32x16::from_slice(simd, directions[a]));
        let (one, smallest) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, MIN_COMPONENT));
        BlockSetup {
            origin: three!(|a| f32x16::from_slice(simd, origins[a])),
            rcp: three!(|a| one / d[a].abs().max(smallest).copysign(d[a])),
            t_min: f32x16::from_slice(simd, &rays.t_min),
            slack: f32x16::splat(simd, BOX_SLACK),
        }
    }

    /// The constants of rays that are set up already.
    #[inline(always)]
    pub(crate) fn of(simd: S, rays: [&RaySetup; LANES]) -> Self {
        let mut rows = [[0.0; LANES]; 7];
        for (lane, ray) in rays.into_iter().enumerate() {
            for axis in 0..3 {
                rows[axis][lane] = ray.origin[axis];
                rows[3 + axis][lane] = ray.rcp[axis];
            }
            rows[6][lane] = ray.t_min;
        }
        BlockSetup {
            origin: three!(|a| f32x16::from_slice(simd, &rows[a])),
            rcp: three!(|a| f32x16::from_slice(simd, &rows[3 + a])),
            t_min: f32x16::from_slice(simd, &rows[6]),
            slack: f32x16::splat(simd, BOX_SLACK),
        }
    }

    /// Distances to the box of child `slot`, and the rays that enter it before `limit`. The rays
    /// differ in octant, so both planes of an axis are sorted per ray.
    #[inline(always)]
    pub(crate) fn enter(
        &self,
        simd: S,
        node: &[Unit; NODE_UNITS],
        slot: usize,
        limit: f32x16<S>,
    ) -> (f32x16<S>, u16) {
        let (o, rcp) = (&self.origin, &self.rcp);
        let lo: [f32x16<S>; 3] =
            three!(|a| (f32x16::splat(simd, node[2 * a].0[slot & 7]) - o[a]) * rcp[a]);
        let hi: [f32x16<S>; 3] =
            three!(|a| (f32x16::splat(simd, node[2 * a + 1].0[slot & 7]) - o[a]) * rcp[a]);
        let near = lo[0].min(hi[0]).max(lo[1].min(hi[1])).max(lo[2].min(hi[2]).max(self.t_min));
        let far = lo[0].max(hi[0]).min(lo[1].max(hi[1])).min(lo[2].max(hi[2])) * self.slack;
        (near, near.simd_le(far.min(limit)).to_bitmask() as u16)
    }

    /// The constants of each ray for its own traversal, from the reciprocals of the block: the bits
    /// of [`RaySetup::new`] without its divisions.
    #[inline(always)]
    pub(crate) fn rays(&self, rays: &RayBlock) -> [RaySetup; LANES] {
        let rcp: [[f32; LANES]; 3] = three!(|a| self.rcp[a].to_array());
        let ray = |lane: usize| {
            let lane = lane & 15;
            let d = [rays.dx[lane], rays.dy[lane], rays.dz[lane]];
            let rcp = [rcp[0][lane], rcp[1][lane], rcp[2][lane]];
            let kz = dominant_axis(d);
            let (kx, ky) = ([1, 2, 0][kz], [2, 0, 1][kz]);
            // In the local space of a huge mesh, even the dominant component may be smaller than
            // what the box tests replace it by.
            let sz = if d[kz].abs() >= MIN_COMPONENT { rcp[kz] } else { 1.0 / d[kz] };
            RaySetup {
                origin: [rays.ox[lane], rays.oy[lane], rays.oz[lane]],
                rcp,
                near: [
                    (rcp[0] < 0.0) as usize,
                    2 + (rcp[1] < 0.0) as usize,
                    4 + (rcp[2] < 0.0) as usize,
                ],
                shear: Shear { kx, ky, kz, sx: d[kx] * sz, sy: d[ky] * sz, sz },
                t_min: rays.t_min[lane],
            }
        };
        let mut setups = [ray(0); LANES];
        for lane in 1..LANES {
            setups[lane] = ray(lane);
        }
        setups
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp2i;
    use crate::ray::Ray;
    use crate::test_shapes::Random;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn rays_of_a_block_have_the_constants_of_single_rays_for_any_length_of_direction() {
        let mut r = Random::new(3);
        for exponent in [-126, -125, -124, -123, -100, -13, 0, 13, 100] {
            let rays: Vec<Ray> = (0..LANES)
                .map(|lane| {
                    let mut d = r.direction();
                    if lane % 4 == 0 {
                        d[lane / 4 % 3] = if lane % 8 == 0 { 0.0 } else { -0.0 };
                    }
                    Ray::new(r.direction(), d * exp2i(exponent)).with_t_max(lane as f32)
                })
                .collect();
            let block = RayBlock::from_rays(&rays)[0];
            dispatch!(Level::new(), simd => {
                let together = BlockSetup::new(simd, &block).rays(&block);
                for (a, ray) in together.iter().zip(&rays) {
                    let b = RaySetup::new(ray);
                    let words = |s: &RaySetup| {
                        let shear = [s.shear.sx, s.shear.sy, s.shear.sz].map(f32::to_bits);
                        let axes = [s.shear.kx, s.shear.ky, s.shear.kz];
                        (s.origin.map(f32::to_bits), s.rcp.map(f32::to_bits), s.near, shear, axes)
                    };
                    assert_eq!(words(a), words(&b), "2^{exponent}: {ray:?}");
                }
            });
        }
    }
}
