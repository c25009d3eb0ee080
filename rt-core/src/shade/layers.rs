//! Depth, distance and ids of sixteen hits at once: [`TileLayers::record`] in loops over plain f64
//! arrays, which the compiler vectorizes. Same functions, same bits.

use super::frame_context::{FrameContext, point_on_ray};
use super::tile::{TileArea, TileLayers, block_place, lane_pixel};
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use crate::surface::Planes;
use fearless_simd::Simd;
use glam::DVec3;

/// Fills depth, distance and ids of block `b` at its hits. The rays go through the pixels' centres;
/// the caller fills the normals.
pub(super) fn record_block<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    area: &TileArea,
    b: usize,
    rays: &RayBlock,
    hits: &HitBlock,
    out: &mut TileLayers,
) {
    let slots = b * LANES..(b + 1) * LANES;
    let hit = (0..LANES).fold(0u16, |m, l| m | ((hits.prim[l] != NO_HIT) as u16) << l);
    if hit == 0 {
        return;
    }
    if let (Some(instance), Some(primitive)) =
        (out.instance.get_mut(slots.clone()), out.primitive.get_mut(slots.clone()))
    {
        // A miss has the ids of a blank pixel.
        instance.copy_from_slice(&hits.instance);
        primitive.copy_from_slice(&hits.prim);
    }
    if out.depth.is_empty() && out.distance.is_empty() {
        return;
    }
    if context.camera.is_omnidirectional() {
        return panorama(context, area, b, rays, hits, out);
    }
    let mut planes = Planes::new();
    let mut left = hit;
    while left != 0 {
        let instance = hits.instance[left.trailing_zeros() as usize];
        let same = (0..LANES).fold(0u16, |m, l| m | ((hits.instance[l] == instance) as u16) << l);
        let lanes = left & same;
        left &= !lanes;
        context.instances[instance as usize].plane_block(
            simd,
            lanes,
            rays,
            hits,
            context.origin,
            &mut planes,
        );
    }
    let (depth, distance) = depth_and_distance(simd, context, area, b, &planes);
    for (layer, values) in [(&mut out.depth, &depth), (&mut out.distance, &distance)] {
        if let Some(layer) = layer.get_mut(slots.clone()) {
            for lane in 0..LANES {
                layer[lane] = if hit >> lane & 1 != 0 { values[lane] } else { layer[lane] };
            }
        }
    }
}

/// Depth and distance of panoramas, pixel by pixel.
#[cold]
fn panorama(
    context: &FrameContext<'_>,
    area: &TileArea,
    b: usize,
    rays: &RayBlock,
    hits: &HitBlock,
    out: &mut TileLayers,
) {
    for lane in 0..LANES {
        let slot = b * LANES + lane;
        let (Some(hit), Some([x, y])) = (hits.get(lane), area.pixel(slot as u16)) else { continue };
        let (depth, distance) =
            context.depth_and_distance(context.ndc(x, y, [0.5; 2]), &rays.get(lane), &hit);
        for (layer, value) in [(&mut out.depth, depth), (&mut out.distance, distance)] {
            if let Some(v) = layer.get_mut(slot) {
                *v = value;
            }
        }
    }
}

#[inline(never)]
fn depth_and_distance<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    area: &TileArea,
    b: usize,
    planes: &Planes,
) -> ([f32; LANES], [f32; LANES]) {
    let [column, row] = block_place(b).map(|v| 4 * v);
    let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let [i, j] = lane_pixel(lane);
        [x[lane], y[lane]] =
            context.ndc(area.x + (column + i) as u32, area.y + (row + j) as u32, [0.5; 2]);
    }
    // A local copy, whose fields no store can change.
    let camera = context.camera;
    simd.vectorize(
        #[inline(always)]
        || {
            // ---- The rays, as Camera::world_ray computes them; perspective ones are written out,
            // because a loop with a branch is not vectorized.
            let (mut origins, mut dirs) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            if let Some(eye) = camera.eye() {
                let m = camera.inverse;
                for c in 0..3 {
                    origins[c] = [eye[c]; LANES];
                    for l in 0..LANES {
                        dirs[c][l] = m.x_axis[c] * x[l] + m.y_axis[c] * y[l] + m.z_axis[c];
                    }
                }
            } else {
                for l in 0..LANES {
                    let (o, d) = camera.world_ray([x[l], y[l]]);
                    for c in 0..3 {
                        (origins[c][l], dirs[c][l]) = (o[c], d[c]);
                    }
                }
            }
            // ---- Their intersections with the planes.
            let at = |v: &[[f64; LANES]; 3], l: usize| DVec3::new(v[0][l], v[1][l], v[2][l]);
            let (mut depth, mut distance) = ([0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                let (origin, dir) = (at(&origins, l), at(&dirs, l));
                let point =
                    point_on_ray((origin, dir), at(&planes.point, l), at(&planes.normal, l));
                depth[l] = camera.window_depth(point) as f32;
                distance[l] = (point - origin).length() as f32;
            }
            (depth, distance)
        },
    )
}
