//! The rays of a tile through the centres of 16 x 16 pixels, generated 16 at a time.
//!
//! Origins and directions are affine in window coordinates. So are the numerators and denominators
//! of the parameters at which planes cut a ray. A single ray ([`Prepared::ray`]) costs a matrix
//! product and a sum of magnitudes per plane. The affine form needs only a few multiplications.
//! Rays only find triangles, so the last bits of the two computations need not agree.

use super::{Prepared, Rect, TILE};
use crate::capture::draw::Draw;
use fearless_simd::{
    Level, Select, Simd, SimdBase, SimdMask, SimdNarrow, dispatch, f32x16, f64x8, mask32x16,
};
use rt_core::glam::{DVec3, DVec4};
use rt_core::ray::{HitBlock, LANES, Ray, RayBlock};
use std::sync::atomic::Ordering::Relaxed;

/// The number of blocks in a tile.
pub(super) const BLOCKS: usize = 16;

/// A function that is affine in window coordinates: its value at the window's origin, and its
/// change with x and with y.
#[derive(Debug, Clone, Copy, Default)]
struct AffineFunction([f64; 3]);

impl AffineFunction {
    #[inline(always)]
    fn at(&self, x: f64, y: f64) -> f64 {
        self.0[0] + self.0[1] * x + self.0[2] * y
    }

    #[inline(always)]
    fn row<S: Simd>(&self, x: f64x8<S>, y: f64x8<S>) -> f64x8<S> {
        x * self.0[1] + self.0[0] + y * self.0[2]
    }
}

/// Two rows of a block.
struct HalfBlock<S: Simd> {
    origin: [f64x8<S>; 3],
    dir: [f64x8<S>; 3],
    /// Where rays start, and the interval from there on that is not clipped.
    back: f64x8<S>,
    from: f64x8<S>,
    to: f64x8<S>,
    /// The lanes whose interval is not empty.
    some: u64,
}

/// The rays of a draw as functions of window coordinates.
#[derive(Default)]
pub(super) struct AffineRays {
    origin: [AffineFunction; 3],
    dir: [AffineFunction; 3],
    /// The height of the origin above each plane (slightly overestimated), and its growth along the
    /// ray.
    planes: Vec<[AffineFunction; 2]>,
    /// The parameter at which rays start when the scene is far away, so that f32 loses no
    /// precision.
    start: f64,
    /// Clip z and w of the origin and of the direction. They give the depth at a parameter.
    depth: [[AffineFunction; 2]; 2],
}

impl AffineRays {
    pub(super) fn new(p: &Prepared<'_>) -> AffineRays {
        let [vx, vy, vw, vh] = p.draw.state.viewport.map(f64::from);
        let ndc = |x: f64, y: f64| [2.0 * (x - vx) / vw - 1.0, 2.0 * (y - vy) / vh - 1.0];
        // Differences span the whole viewport, so that they lose no precision.
        let [zero, right, up] =
            [[vx, vy], [vx + vw, vy], [vx, vy + vh]].map(|[x, y]| p.camera.world_ray(ndc(x, y)));
        let affine = |f: &dyn Fn((DVec3, DVec3)) -> f64| {
            let (dx, dy) = ((f(right) - f(zero)) / vw, (f(up) - f(zero)) / vh);
            AffineFunction([f(zero) - dx * vx - dy * vy, dx, dy])
        };
        let axes = [0, 1, 2];
        let center = p.world.origin();
        let rect = p.rect;
        let corners = [(0, 0), (rect.w, 0), (0, rect.h), (rect.w, rect.h)]
            .map(|(x, y)| (f64::from(rect.x + x), f64::from(rect.y + y)));
        let origin = axes.map(|k| affine(&|(o, _)| o[k] - center[k]));
        let dir = axes.map(|k| affine(&|(_, d)| d[k]));
        let planes = p
            .planes
            .iter()
            .map(|plane| {
                let plane = DVec4::from_array(*plane);
                let n = plane.truncate();
                // The fragment makes the exact test. This is the largest rounding error anywhere in
                // the rectangle.
                let size = corners.map(|(x, y)| {
                    let o = axes.map(|k| origin[k].at(x, y) + center[k]);
                    (0..3).map(|k| (n[k] * o[k]).abs()).sum::<f64>() + plane.w.abs()
                });
                let slack = 1e-6 * size.into_iter().fold(0.0, f64::max);
                let mut above = affine(&|(o, _)| n.dot(o) + plane.w);
                above.0[0] += slack;
                [above, affine(&|(_, d)| n.dot(d))]
            })
            .collect();
        let clip = super::matrix(&p.draw.clip_from_object);
        let rows = [clip.row(2), clip.row(3)];
        let depth = [
            rows.map(|r| affine(&|(o, _)| r.dot(o.extend(1.0)))),
            rows.map(|r| affine(&|(_, d)| r.dot(d.extend(0.0)))),
        ];
        let mut affine_rays = AffineRays { origin, dir, planes, start: 0.0, depth };
        affine_rays.start = affine_rays.beginning(p, &corners);
        affine_rays
    }

    /// The parameter at which the bounds start along the rays, when they are so far away that f32
    /// would lose bits. Otherwise 0. The parameter is clip w, or the fraction of the distance from
    /// the near plane to the far plane. Both are equal for all points of a plane parallel to the
    /// image.
    fn beginning(&self, p: &Prepared<'_>, corners: &[(f64, f64); 4]) -> f64 {
        let bounds = p.draw.geometry.bounds();
        let (middle, radius) =
            (bounds.center().as_dvec3() - p.world.origin(), f64::from(bounds.radius()));
        let clip = super::matrix(&p.draw.clip_from_object);
        let (z, w) = (clip.row(2), clip.row(3));
        let parallel = w.truncate() == DVec3::ZERO;
        // Rays of an eye share their origin, which is exact. Parallel ones have an origin each, and
        // its rounding is what they miss the edges of triangles by.
        let far = |(x, y): (f64, f64)| {
            let o = DVec3::from_array(self.origin.map(|a| a.at(x, y)));
            (o - middle).abs().max_element() > 64.0 * radius
        };
        if !parallel && !corners.iter().any(|c| far(*c)) {
            return 0.0;
        }
        let (x, y) = corners[0];
        let origin = DVec3::from_array(self.origin.map(|a| a.at(x, y)));
        let dir = DVec3::from_array(self.dir.map(|a| a.at(x, y)));
        // Along a ray, the parameter is w itself or (z + w) / w.
        let row = if parallel { (z + w) / w.w } else { w };
        let at = |v: DVec3| row.truncate().dot(v + p.world.origin()) + row.w;
        debug_assert!(dir.is_finite() && origin.is_finite(), "cameras are finite");
        let nearest = at(middle) - row.truncate().length() * radius;
        (nearest - nearest.abs() * 1e-6).max(0.0)
    }

    /// The rays of one block, whose pixels start at (`x`, `y`). `used` has a bit for each lane that
    /// is needed.
    #[inline(always)]
    fn block<S: Simd>(
        &self,
        simd: S,
        [x, y]: [f64; 2],
        used: u16,
        out: &mut RayBlock,
        shift: &mut [f64; LANES],
    ) {
        let [a, b] = [self.half(simd, x, y), self.half(simd, x, y + 2.0)];
        a.back.store_slice(&mut shift[..8]);
        b.back.store_slice(&mut shift[8..]);
        for (k, o) in [&mut out.ox, &mut out.oy, &mut out.oz].into_iter().enumerate() {
            a.origin[k].narrow(b.origin[k]).store_slice(o);
        }
        for (k, d) in [&mut out.dx, &mut out.dy, &mut out.dz].into_iter().enumerate() {
            a.dir[k].narrow(b.dir[k]).store_slice(d);
        }
        let zero = f32x16::splat(simd, 0.0);
        let least = a.from.narrow(b.from);
        least.simd_gt(zero).select(least, zero).store_slice(&mut out.t_min);
        // Slightly larger, as `next_up` would make it.
        let most = a.to.narrow(b.to);
        let more = most + most.abs() * 1.2e-7;
        let finite = most.simd_lt(f32x16::splat(simd, f32::MAX));
        let most = finite.select(more, f32x16::splat(simd, f32::INFINITY));
        let wanted = u64::from(used) & (a.some | b.some << 8);
        mask32x16::from_bitmask(simd, wanted)
            .select(most, f32x16::splat(simd, -1.0))
            .store_slice(&mut out.t_max);
    }

    /// Two rows of a block.
    #[inline(always)]
    fn half<S: Simd>(&self, simd: S, x: f64, y: f64) -> HalfBlock<S> {
        let splat = |v: f64| f64x8::splat(simd, v);
        let px = splat(x) + f64x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0]);
        let py = splat(y) + f64x8::from_slice(simd, &[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
        let (zero, before_all) = (splat(0.0), splat(f64::NEG_INFINITY));
        let (mut t0, mut t1) = (before_all, splat(f64::INFINITY));
        let mut none = 0;
        for [above, along] in &self.planes {
            let (a, b) = (above.row(px, py), along.row(px, py));
            let t = -a / b;
            t0 = (b.simd_gt(zero) & t.simd_gt(t0)).select(t, t0);
            t1 = (b.simd_lt(zero) & t.simd_lt(t1)).select(t, t1);
            none |= (b.simd_eq(zero) & a.simd_lt(zero)).to_bitmask();
        }
        // Rays of a parallel projection start at the program's near plane. Another plane in front
        // of it may come first, also by the slack of the near plane itself. That counts only where
        // the scene does not begin far behind all of them.
        let before = t0.simd_lt(zero) & t0.simd_gt(before_all);
        let start = splat(self.start);
        let back = (before & start.simd_eq(zero)).select(t0, start);
        let (mut origin, mut dir) = ([zero; 3], [zero; 3]);
        for k in 0..3 {
            dir[k] = self.dir[k].row(px, py);
            origin[k] = self.origin[k].row(px, py) + dir[k] * back;
        }
        HalfBlock {
            origin,
            dir,
            back,
            from: t0 - back,
            to: t1 - back,
            some: t0.simd_lt(t1).to_bitmask() & !none,
        }
    }

    /// The parameter, measured from the ray's own origin, at which the ray through (`x`, `y`) has
    /// this z/w.
    #[inline]
    fn parameter(&self, x: f64, y: f64, z_by_w: f64, shift: f64) -> f32 {
        let [[z, w], [dz, dw]] = self.depth.map(|d| d.map(|a| a.at(x, y)));
        ((z_by_w * w - z) / (dz - z_by_w * dw) - shift) as f32
    }
}

/// The rays and hits of a tile. Pixel (x, y) of the tile is lane `x % 4 + 4 (y % 4)` of block `x /
/// 4 + 4 (y / 4)`.
pub(super) struct TileRays {
    level: Level,
    pub(super) blocks: Vec<RayBlock>,
    pub(super) hits: Vec<HitBlock>,
    shift: [[f64; LANES]; BLOCKS],
    /// The rays that look for candidates behind the first hits.
    behind: Vec<RayBlock>,
    pub(super) offset_candidates: Vec<HitBlock>,
}

impl TileRays {
    pub(super) fn new() -> TileRays {
        TileRays {
            level: Level::new(),
            blocks: vec![RayBlock::INACTIVE; BLOCKS],
            hits: vec![HitBlock::MISS; BLOCKS],
            shift: [[0.0; LANES]; BLOCKS],
            behind: vec![RayBlock::INACTIVE; BLOCKS],
            offset_candidates: vec![HitBlock::MISS; BLOCKS],
        }
    }

    /// Traces rays through the pixels of `area`, which is no larger than a tile. Returns false when
    /// no ray hits anything.
    pub(super) fn send(&mut self, p: &Prepared<'_>, area: Rect) -> bool {
        let (level, blocks, shift) = (self.level, &mut self.blocks, &mut self.shift);
        dispatch!(level, simd => make(simd, &p.affine_rays, area, blocks, shift));
        self.hits.fill(HitBlock::MISS);
        p.world
            .closest_coherent(&self.blocks, &mut self.hits)
            .expect("one block of hits for each of rays");
        p.rays.fetch_add(area.w as u64 * area.h as u64, Relaxed);
        self.hits.iter().any(|h| h.prim.iter().any(|p| *p != rt_core::ray::NO_HIT))
    }

    /// The ray of lane `l` of block `b`, and how far it starts behind the camera's own.
    pub(super) fn ray(&self, b: usize, l: usize) -> (Ray, f64) {
        (self.blocks[b].get(l), self.shift[b][l])
    }

    /// Traces the range behind first hits that polygon offset moved back, up to the depth of the
    /// moved fragment. `depth` is that depth (z/w) for each pixel. It is NaN for pixels whose
    /// fragment did not move.
    pub(super) fn trace_offset_candidates(
        &mut self,
        p: &Prepared<'_>,
        area: Rect,
        z_by_w: &[f64; 256],
    ) -> bool {
        let mut any = false;
        for y in 0..area.h {
            for x in 0..area.w {
                let (b, l) = slot(x, y);
                let z = z_by_w[b * LANES + l];
                let hit = self.hits[b].t[l];
                self.behind[b].t_max[l] = -1.0;
                if !z.is_nan() {
                    let (px, py) = (f64::from(area.x + x) + 0.5, f64::from(area.y + y) + 0.5);
                    let limit = p.affine_rays.parameter(px, py, z, self.shift[b][l]);
                    let ray = self.blocks[b].get(l);
                    let (from, to) = (hit.next_up(), limit.min(ray.t_max));
                    if from < to {
                        self.behind[b].set(l, &Ray { t_min: from, t_max: to, ..ray });
                        any = true;
                    }
                }
            }
        }
        if any {
            self.offset_candidates.fill(HitBlock::MISS);
            p.world
                .closest_coherent(&self.behind, &mut self.offset_candidates)
                .expect("one block of hits for each of rays");
        }
        self.behind.iter_mut().for_each(|b| b.t_max = [-1.0; LANES]);
        any
    }
}

#[inline(always)]
fn make<S: Simd>(
    simd: S,
    affine_rays: &AffineRays,
    area: Rect,
    blocks: &mut [RayBlock],
    shift: &mut [[f64; LANES]; BLOCKS],
) {
    for (b, (out, shift)) in blocks.iter_mut().zip(shift).enumerate() {
        let (x, y) = (4 * (b as i32 % 4), 4 * (b as i32 / 4));
        let mut used = 0_u16;
        for l in 0..LANES as i32 {
            used |= u16::from(x + l % 4 < area.w && y + l / 4 < area.h) << l;
        }
        if used == 0 {
            *out = RayBlock::INACTIVE;
        } else {
            let at = [f64::from(area.x + x) + 0.5, f64::from(area.y + y) + 0.5];
            affine_rays.block(simd, at, used, out, shift);
        }
    }
}

/// Two planes of constant clip z that enclose the whole draw.
pub(super) fn slab(draw: &Draw, z: DVec4) -> [[f64; 4]; 2] {
    let b = draw.geometry.bounds();
    let at = |corner: i32| {
        let pick =
            |bit: i32, k: usize| f64::from(if corner & bit == 0 { b.min[k] } else { b.max[k] });
        z.dot(DVec4::new(pick(1, 0), pick(2, 1), pick(4, 2), 1.0))
    };
    let (lo, hi) =
        (0..8).map(at).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let more = 1e-3 * (hi - lo) + 1e-6 * (hi.abs() + lo.abs());
    [(z - DVec4::W * (lo - more)).to_array(), (DVec4::W * (hi + more) - z).to_array()]
}

/// The block and lane of a pixel of a tile.
#[inline]
pub(super) fn slot(x: i32, y: i32) -> (usize, usize) {
    debug_assert!((0..TILE).contains(&x) && (0..TILE).contains(&y), "a pixel of the tile");
    ((x / 4 + 4 * (y / 4)) as usize, (x % 4 + 4 * (y % 4)) as usize)
}
