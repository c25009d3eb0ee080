//! The surfaces that the rays of a block have met.

use super::FrameContext;
use super::response_block::length;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use crate::simd::vectors::{Row, Vec3x16};
use crate::surface::{ExactRows, ShadingPointBlock, SurfacePoint, SurfacePointBlock};
use fearless_simd::{Simd, SimdBase, dispatch, f32x16};

/// Surfaces at the hits of a block.
pub(super) struct BlockSurfaces {
    /// Lanes without a hit are undefined.
    points: SurfacePointBlock,
    /// Lengths of the rays' directions, and the factors that turn these into views.
    pub(super) lengths: Row,
    pub(super) to_view: Row,
    of_one_instance: SurfacePointBlock,
}

impl BlockSurfaces {
    pub(super) fn new() -> BlockSurfaces {
        BlockSurfaces {
            points: SurfacePointBlock::new(),
            lengths: [0.0; LANES],
            to_view: [0.0; LANES],
            of_one_instance: SurfacePointBlock::new(),
        }
    }

    /// The surface in a lane with a hit.
    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> SurfacePoint {
        self.points.get(lane)
    }

    /// All surfaces, one row per component.
    #[inline(always)]
    pub(super) fn rows(&self) -> (&ShadingPointBlock, &ExactRows) {
        self.points.rows()
    }

    /// Looks up the surfaces of all hits, or only the rays' lengths where the surfaces are known.
    /// Returns whether there is a hit.
    pub(super) fn look_up(
        &mut self,
        context: &FrameContext<'_>,
        rays: &RayBlock,
        hits: &HitBlock,
        surfaces: bool,
    ) -> bool {
        let hit = (0..LANES).fold(0u16, |m, l| m | ((hits.prim[l] != NO_HIT) as u16) << l);
        if hit == 0 {
            return false;
        }
        dispatch!(context.level, simd => {
            self.measure(simd, rays);
            if surfaces {
                self.look_up_block(simd, context, rays, hits, hit);
            }
        });
        true
    }

    #[inline(never)]
    fn measure<S: Simd>(&mut self, simd: S, rays: &RayBlock) {
        simd.vectorize(
            #[inline(always)]
            || {
                let dir = Vec3x16::load_rows(simd, [&rays.dx, &rays.dy, &rays.dz]);
                let lengths = length(dir);
                lengths.store_slice(&mut self.lengths);
                (f32x16::splat(simd, -1.0) / lengths).store_slice(&mut self.to_view);
            },
        );
    }

    fn look_up_block<S: Simd>(
        &mut self,
        simd: S,
        context: &FrameContext<'_>,
        rays: &RayBlock,
        hits: &HitBlock,
        hit: u16,
    ) {
        // ---- One instance at a time; nearly always there is only one.
        let mut left = hit;
        while left != 0 {
            let instance = hits.instance[left.trailing_zeros() as usize & 15];
            let same =
                (0..LANES).fold(0u16, |m, l| m | ((hits.instance[l] == instance) as u16) << l);
            let lanes = left & same;
            left &= !lanes;
            let resolved = &context.instances[instance as usize];
            let alone = lanes == hit;
            let out = if alone { &mut self.points } else { &mut self.of_one_instance };
            let done = resolved.surface_block(simd, lanes, rays, hits, out);
            for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                if done >> lane & 1 == 0 {
                    let Some(hit) = hits.get(lane) else { continue };
                    self.points.set(lane, &resolved.surface(&rays.get(lane), &hit));
                } else if !alone {
                    self.points.set(lane, &self.of_one_instance.get(lane));
                }
            }
        }
    }
}
