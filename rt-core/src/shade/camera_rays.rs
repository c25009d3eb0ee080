//! Primary rays in render space: the camera's f64 rays, moved next to the scene before they are
//! rounded to f32.

use crate::camera::{Camera, Projection};
use crate::math::Aabb;
use crate::ray::{LANES, Ray, RayBlock};
use fearless_simd::Simd;
use glam::DVec3;

/// The largest distance of the eye from the scene's centre, in radii of the scene, at which rays
/// start at the eye; beyond it they start at the scene. Up to this distance the eye's f32 rounding
/// is no worse than that of the vertices; rays with one origin are traced faster.
const EYE_WITHIN_RADII: f64 = 8.0;

/// Generates the rays of one frame.
pub(crate) struct CameraRays {
    parallel: bool,
    /// Eye, or origin at NDC (0,0); render space.
    origin: DVec3,
    /// Change of origin per NDC unit (parallel projection).
    origin_x: DVec3,
    origin_y: DVec3,
    /// Direction at NDC (0,0) and its change per NDC unit (perspective).
    dir: DVec3,
    dir_x: DVec3,
    dir_y: DVec3,
    /// Parameter at which rays start: `world t = start + t`.
    start: f64,
    clip_range: ClipRange,
    /// Lens axes scaled by the aperture's radius, and the ray parameter of the plane in focus.
    lens: Option<(DVec3, DVec3, f64)>,
}

/// Where the near and the far plane clip the rays.
enum ClipRange {
    /// At the same parameter for all rays: every usual matrix.
    Same([f64; 2]),
    /// At another parameter for each ray (oblique near planes); also for panoramas, whose rays
    /// share nothing.
    PerRay(Box<(Camera, DVec3)>),
}

impl CameraRays {
    pub(crate) fn new(
        camera: &Camera,
        world_origin: DVec3,
        bounds: Aabb,
        with_lens: bool,
    ) -> CameraRays {
        let ray = |x, y| camera.world_ray([x, y]);
        let (o, d) = ray(0.0, 0.0);
        let (ox, dx) = ray(1.0, 0.0);
        let (oy, dy) = ray(0.0, 1.0);
        let parallel = matches!(camera.projection, Projection::Parallel { .. });

        // Start at the scene's bounds when the eye is far from them. Ray parameters are depths, so
        // the nearest corner is in front of everything for every pixel.
        let depth_of = |p: DVec3| {
            let m = camera.clip_from_world;
            if parallel {
                let (z, w) = (m.row(2), m.row(3).w);
                (z.truncate().dot(p) + z.w) / w + 1.0
            } else {
                m.row(3).truncate().dot(p) + m.row(3).w
            }
        };
        let corners = bounds.corners().map(|c| depth_of(world_origin + c.as_dvec3()));
        let nearest = corners.iter().copied().fold(f64::INFINITY, f64::min);
        let farthest = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let margin = 0.01 * (farthest - nearest);
        let panorama = camera.is_omnidirectional();
        let far_away = !panorama
            && (o - world_origin - bounds.center().as_dvec3()).length()
                > EYE_WITHIN_RADII * 0.5 * (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        let move_start = !bounds.is_empty()
            && nearest.is_finite()
            && (parallel || (far_away && nearest - margin > 0.0));
        let start = if move_start { nearest - margin } else { 0.0 };

        let clip_range = {
            let [a, b, c, e] = [(0.0, 0.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)].map(|(x, y)| {
                let (o, d) = ray(x, y);
                camera.near_far(o, d)
            });
            let close = |p: f64, q: f64| p == q || (p - q).abs() <= 1e-7 * p.abs();
            if !panorama && [b, c, e].iter().all(|l| close(a[0], l[0]) && close(a[1], l[1])) {
                ClipRange::Same(a)
            } else {
                ClipRange::PerRay(Box::new((*camera, world_origin)))
            }
        };
        let lens = camera.lens().filter(|l| with_lens && l.aperture_radius > 0.0).map(|l| {
            let axes = camera.world_from_view();
            // Clip w grows by this much per unit of distance along the view.
            let scale = camera.clip_from_world.row(3).truncate().length();
            (
                axes.x_axis * l.aperture_radius,
                axes.y_axis * l.aperture_radius,
                l.focus_distance * scale,
            )
        });
        CameraRays {
            parallel,
            origin: o - world_origin,
            origin_x: ox - o,
            origin_y: oy - o,
            dir: d,
            dir_x: dx - d,
            dir_y: dy - d,
            start,
            clip_range,
            lens,
        }
    }

    /// The ray through NDC (`x`, `y`); `lens` is a point of the unit disk. Hits outside the near
    /// and far planes are excluded by the ray's range.
    #[inline]
    pub(crate) fn ray(&self, x: f64, y: f64, lens: [f32; 2]) -> Ray {
        if let ClipRange::PerRay(c) = &self.clip_range
            && c.0.is_omnidirectional()
        {
            return Ray::new(self.origin.as_vec3(), c.0.world_ray([x, y]).1.as_vec3());
        }
        let mut dir = self.dir + self.dir_x * x + self.dir_y * y;
        let mut origin = self.origin;
        if self.parallel {
            origin += self.origin_x * x + self.origin_y * y;
        }
        let [near, far] = match &self.clip_range {
            ClipRange::Same(l) => *l,
            ClipRange::PerRay(c) => c.0.near_far(origin + c.1, dir),
        };
        if let Some((right, up, focus)) = self.lens {
            let offset = right * lens[0] as f64 + up * lens[1] as f64;
            origin += offset;
            dir -= offset / focus;
        }
        if self.start != 0.0 {
            origin += dir * self.start;
        }
        Ray {
            origin: origin.as_vec3(),
            dir: dir.as_vec3(),
            t_min: (near - self.start).max(0.0) as f32,
            t_max: (far - self.start) as f32,
        }
    }

    /// The rays through sixteen NDC points, see [`CameraRays::ray`]; through the middle of a lens.
    /// Returns false, without rays, where each ray has its own near and far plane.
    #[inline(never)]
    pub(crate) fn fill_block<S: Simd>(
        &self,
        simd: S,
        x: &[f64; LANES],
        y: &[f64; LANES],
        out: &mut RayBlock,
    ) -> bool {
        let ClipRange::Same([near, far]) = self.clip_range else { return false };
        simd.vectorize(
            #[inline(always)]
            || {
                let move_x = if self.parallel { self.origin_x } else { DVec3::ZERO };
                let move_y = if self.parallel { self.origin_y } else { DVec3::ZERO };
                for (c, origin, dir) in [
                    (0, &mut out.ox, &mut out.dx),
                    (1, &mut out.oy, &mut out.dy),
                    (2, &mut out.oz, &mut out.dz),
                ] {
                    // Simple loops over scalars are vectorized by the compiler.
                    let (d0, dx, dy) = (self.dir[c], self.dir_x[c], self.dir_y[c]);
                    let (o0, ox, oy, start) = (self.origin[c], move_x[c], move_y[c], self.start);
                    // Through local arrays, which no other array can overlap.
                    let (mut from, mut to) = ([o0 as f32; LANES], [0.0; LANES]);
                    if self.parallel || start != 0.0 {
                        for l in 0..LANES {
                            let d = d0 + dx * x[l] + dy * y[l];
                            to[l] = d as f32;
                            from[l] = (o0 + (ox * x[l] + oy * y[l]) + d * start) as f32;
                        }
                    } else {
                        for l in 0..LANES {
                            to[l] = (d0 + dx * x[l] + dy * y[l]) as f32;
                        }
                    }
                    (*origin, *dir) = (from, to);
                }
                out.t_min = [(near - self.start).max(0.0) as f32; LANES];
                out.t_max = [(far - self.start) as f32; LANES];
            },
        );
        true
    }
}
