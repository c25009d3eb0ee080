//! Local lighting of sixteen surfaces of one material: the lobes and lights of
//! [`super::radiance`], with the same bits in each lane.

use super::FrameContext;
use crate::material::{Material, SurfaceModel};
use crate::ray::RayBlock;
use crate::shade::response_block::{Lobe, ambient, incident, respond};
use crate::simd::vectors::{Row, Rows3, Vec3x16};
use crate::surface::ShadingPointBlock;
use fearless_simd::{Select, Simd, SimdBase, f32x16, mask32x16};
use glam::Vec3;

/// Radiance towards the viewer, or the rays' origins.
#[inline(never)]
pub(super) fn radiance_block<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    material: &Material,
    shading_points: &ShadingPointBlock,
    rays: &RayBlock,
    out: &mut Rows3,
) {
    simd.vectorize(
        #[inline(always)]
        || body(simd, context, material, shading_points, rays, out),
    );
}

#[inline(always)]
fn body<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    material: &Material,
    shading_points: &ShadingPointBlock,
    rays: &RayBlock,
    out: &mut Rows3,
) {
    let color = Vec3x16::load(simd, &shading_points.color);
    let mut sum = Vec3x16::splat(simd, Vec3::from(material.emission));
    if material.model == SurfaceModel::Unlit {
        sum.add(color).store(out);
        return;
    }
    let lobe = Lobe::of(&material.model);
    let normal = Vec3x16::load(simd, &shading_points.normal);
    let dir = Vec3x16::load_rows(simd, [&rays.dx, &rays.dy, &rays.dz]);
    let zero = Vec3x16::splat(simd, Vec3::ZERO);
    let towards = match context.viewer {
        Some(viewer) => {
            Vec3x16::splat(simd, viewer).sub(Vec3x16::load(simd, &shading_points.point))
        }
        None => dir.neg(),
    };
    let (unit, ok) = towards.try_normalize(simd);
    let view = unit.or_else(ok, zero);

    for light in &context.lights {
        let (l, strength) = incident(simd, light, &shading_points.point);
        let answer = respond(simd, lobe, color, normal, view, l, light);
        sum = sum.add(answer.scale(strength));
    }
    if let Some(mean) = &context.irradiance {
        sum = sum.add(ambient(simd, context.effects, &material.model, mean, color, normal));
    }
    sum.store(out);
}

/// Assembles sixteen pixels from their channels' rows.
#[inline(never)]
pub(super) fn store_pixels<S: Simd>(simd: S, rows: &[Row; 4], out: &mut [[f32; 4]]) {
    simd.vectorize(
        #[inline(always)]
        || {
            let [r, g, b, a] = rows;
            let row = |r: &Row| f32x16::from_slice(simd, r);
            let (rb_low, rb_high) = row(r).interleave(row(b));
            let (ga_low, ga_high) = row(g).interleave(row(a));
            let (first, second) = rb_low.interleave(ga_low);
            let (third, fourth) = rb_high.interleave(ga_high);
            for (quarter, out) in
                [first, second, third, fourth].into_iter().zip(out.chunks_exact_mut(4))
            {
                quarter.store_slice(out.as_flattened_mut());
            }
        },
    );
}

/// Writes the lanes `lanes` of `new` to the colour rows, opaque.
#[inline(never)]
pub(super) fn merge<S: Simd>(simd: S, lanes: u16, new: &Rows3, rows: &mut [Row; 4]) {
    simd.vectorize(
        #[inline(always)]
        || {
            use fearless_simd::SimdMask;
            let on = mask32x16::from_bitmask(simd, lanes as u64);
            for c in 0..3 {
                let (n, o) =
                    (f32x16::from_slice(simd, &new.0[c]), f32x16::from_slice(simd, &rows[c]));
                on.select(n, o).store_slice(&mut rows[c]);
            }
            let a = f32x16::from_slice(simd, &rows[3]);
            on.select(f32x16::splat(simd, 1.0), a).store_slice(&mut rows[3]);
        },
    );
}
