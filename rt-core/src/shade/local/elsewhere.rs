//! Lights triangles at other points of the image than those through which they were hit:
//! rasterizers find out for each of a pixel's samples what covers it, but light a triangle once per
//! pixel, at the pixel's centre, in its plane also beyond its sides.

use super::super::frame_context::FrameContext;
use super::super::tile::TileArea;
use crate::ray::{HitBlock, LANES, NO_HIT, Ray, RayBlock};
use crate::surface::ResolvedInstance;

/// Replaces rays and hits of triangles by those at [`shading_points`], in the planes of the
/// triangles. Other shapes, and planes that the new ray does not meet, stay as they are.
///
/// [`shading_points`]: crate::render_options::RenderOptions::shading_points
pub(super) fn move_hits(
    context: &FrameContext<'_>,
    area: &TileArea,
    rays: &mut [RayBlock],
    hits: &mut [HitBlock],
) {
    let Some(points) = &context.options.shading_points else { return };
    for (b, (rays, hits)) in rays.iter_mut().zip(hits).enumerate() {
        for lane in (0..LANES).filter(|l| hits.prim[*l] != NO_HIT) {
            let Some([x, y]) = area.pixel((b * LANES + lane) as u16) else { continue };
            let at = y as usize * context.options.width as usize + x as usize;
            let Some(&[nx, ny]) = points.get(at) else { continue };
            let resolved = &context.instances[hits.instance[lane] as usize];
            let ray = context.camera_rays.ray(nx, ny, [0.0; 2]);
            if let Some([t, u, v]) = meet_plane(resolved, hits.prim[lane], &ray) {
                (hits.t[lane], hits.u[lane], hits.v[lane]) = (t, u, v);
                rays.set(lane, &ray);
            }
        }
    }
}

/// Parameter of the ray and weights of the second and third vertex where it meets the triangle's
/// plane.
fn meet_plane(resolved: &ResolvedInstance<'_>, primitive: u32, ray: &Ray) -> Option<[f32; 3]> {
    let [a, b, c] = resolved.triangle(primitive)?;
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    // Möller and Trumbore (1997).
    let (to_b, to_c) = (b - a, c - a);
    let p = dir.cross(to_c);
    let scale = to_b.dot(p).recip();
    let from_a = origin - a;
    let q = from_a.cross(to_b);
    let [t, u, v] = [to_c.dot(q), from_a.dot(p), dir.dot(q)].map(|n| (n * scale) as f32);
    (t > 0.0 && [t, u, v].iter().all(|n| n.is_finite())).then_some([t, u, v])
}
