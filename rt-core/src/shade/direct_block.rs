//! Direct light at sixteen points: the arithmetic of [`super::direct`], with the same bits in each
//! lane.
//!
//! Point by point, lighting waited for its own chains of divisions and roots: close to a surface,
//! where rays are cheap, frames with hard shadows took 3.6 times as long as their rays.

use super::frame_context::FrameContext;
use super::lobes::response;
use super::point_block::{PointBlock, by_material};
use super::response_block::{Lobe, incident, length, respond, supports};
use crate::light::{ResolvedLight, ResolvedLightKind};
use crate::ray::{LANES, RayBlock};
use crate::simd::vectors::{Rows3, Vec3x16};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};
use glam::Vec3;

/// Light that arrives at sixteen points from one light without size, and the rays that test it.
#[repr(C, align(64))]
pub(super) struct LightBlock {
    /// What the points reflect to the eye if nothing is in between.
    pub(super) radiance: Rows3,
    /// Lanes where that is more than nothing.
    pub(super) lanes: u16,
    /// As [`super::direct::shadow_ray`].
    pub(super) rays: RayBlock,
}

/// Constants of [`super::direct::shadow_ray`].
#[derive(Clone, Copy)]
pub(super) struct ShadowErrors {
    pub(super) place_ulps: f32,
    pub(super) most_errors: f32,
}

/// Whether [`LightBlock`] knows the light: a plane that rays end above has its own arithmetic.
pub(super) fn knows(light: &ResolvedLight) -> bool {
    matches!(
        light.kind,
        ResolvedLightKind::Directional { .. }
            | ResolvedLightKind::Point { .. }
            | ResolvedLightKind::Spot { .. }
            | ResolvedLightKind::Cone { .. }
    )
}

impl LightBlock {
    pub(super) fn new() -> LightBlock {
        LightBlock { radiance: Rows3::ZERO, lanes: 0, rays: RayBlock::INACTIVE }
    }

    /// Light of `light`, which is [known](knows), at the points that are lit. `rays`, if any rays
    /// are needed, says whether they may start at the light.
    #[inline(never)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        context: &FrameContext<'_>,
        light: &ResolvedLight,
        at: &PointBlock,
        rays: Option<bool>,
        errors: ShadowErrors,
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.fill_body(simd, context, light, at, rays, errors),
        );
    }

    #[inline(always)]
    fn fill_body<S: Simd>(
        &mut self,
        simd: S,
        context: &FrameContext<'_>,
        light: &ResolvedLight,
        at: &PointBlock,
        rays: Option<bool>,
        errors: ShadowErrors,
    ) {
        self.lanes = 0;
        if at.lit == 0 {
            return;
        }
        let zero = f32x16::splat(simd, 0.0);
        let (dir, strength) = incident(simd, light, &at.point);
        let color = Vec3x16::load(simd, &at.color);
        let normal = Vec3x16::load(simd, &at.normal);
        let view = Vec3x16::load(simd, &at.view);
        let mut sum = Vec3x16::splat(simd, Vec3::ZERO);
        by_material(
            context,
            &at.instance,
            at.lit,
            #[inline(always)]
            |material, lanes| {
                let of_this = mask32x16::from_bitmask(simd, lanes as u64);
                let answer = if supports(&material.model) {
                    respond(simd, Lobe::of(&material.model), color, normal, view, dir, light)
                } else {
                    let (mut rows, mut dirs) = (Rows3::ZERO, Rows3::ZERO);
                    dir.store(&mut dirs);
                    for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                        let answer = response(
                            &material.model,
                            at.normal.get(lane),
                            at.color.get(lane),
                            at.view.get(lane),
                            dirs.get(lane),
                            light.color,
                            light.highlight,
                        );
                        rows.set(lane, answer);
                    }
                    Vec3x16::load(simd, &rows)
                };
                sum = answer.scale(strength).or_else(of_this, sum);
            },
        );
        sum.store(&mut self.radiance);
        let dark = strength.simd_le(zero)
            | sum.x.simd_eq(zero) & sum.y.simd_eq(zero) & sum.z.simd_eq(zero);
        self.lanes = at.lit & !(dark.to_bitmask() as u16);
        if let Some(from_light) = rays {
            shadow_rays(simd, at, dir, light, from_light, errors, &mut self.rays);
        }
    }
}

#[inline(always)]
fn store<S: Simd>(
    out: &mut RayBlock,
    origin: Vec3x16<S>,
    dir: Vec3x16<S>,
    t_min: f32x16<S>,
    t_max: f32x16<S>,
) {
    origin.x.store_slice(&mut out.ox);
    origin.y.store_slice(&mut out.oy);
    origin.z.store_slice(&mut out.oz);
    dir.x.store_slice(&mut out.dx);
    dir.y.store_slice(&mut out.dy);
    dir.z.store_slice(&mut out.dz);
    t_min.store_slice(&mut out.t_min);
    t_max.store_slice(&mut out.t_max);
}

/// As [`super::direct::shadow_ray`].
#[inline(always)]
fn shadow_rays<S: Simd>(
    simd: S,
    at: &PointBlock,
    dir: Vec3x16<S>,
    light: &ResolvedLight,
    from_light: bool,
    ShadowErrors { place_ulps, most_errors }: ShadowErrors,
    out: &mut RayBlock,
) {
    let v = |x: f32| f32x16::splat(simd, x);
    let error = f32x16::from_slice(simd, &at.point_error);
    let face_normal = Vec3x16::load(simd, &at.face_normal);
    let side = dir.dot(face_normal).simd_ge(v(0.0)).select(error, -error);
    let origin = Vec3x16::load(simd, &at.point).add(face_normal.scale(side));
    let place = match light.kind {
        ResolvedLightKind::Point { position }
        | ResolvedLightKind::Spot { position, .. }
        | ResolvedLightKind::Cone { position, .. } => position,
        _ => return store(out, origin, dir, v(0.0), v(f32::INFINITY)),
    };
    // The sum makes -0 a 0, as the lift of lights without a plane does.
    let place = Vec3x16::splat(simd, place + Vec3::ZERO);
    let to_light = place.sub(origin);
    let reach = place.max_norm();

    // ---- From the surface.
    let distance = length(to_light);
    let at_light = v(place_ulps * f32::EPSILON) * (reach + distance);
    let end = distance - at_light.min(v(0.5) * distance);
    let outward = to_light.div(distance);
    if !from_light {
        return store(out, origin, outward, v(0.0), end);
    }

    // ---- From the light, where it is near enough.
    let slack = v(8.0 * f32::EPSILON) * (reach + origin.max_norm());
    let share = slack / to_light.max_norm();
    let near = slack.simd_le(v(most_errors) * error) & share.simd_lt(v(0.01));
    store(
        out,
        place.or_else(near, origin),
        to_light.neg().or_else(near, outward),
        near.select(share, v(0.0)),
        near.select(v(1.0) - share, end),
    );
}
