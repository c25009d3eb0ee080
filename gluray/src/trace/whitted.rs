//! Traces rays beyond the first surface, for modes `rich` and `enhance`: mirrors, metals, glass,
//! surfaces behind translucent ones, a lens, and several samples per pixel (Whitted 1980; Cook,
//! Porter and Carpenter 1984).
//!
//! As everywhere in these modes, surfaces are lit by OpenGL's lighting at the point, with shadows
//! and occlusion. Each kind of ray is traced only where a material or a setting asks for it.

use crate::cluster::row_share::{BAND, RowShare};
use crate::enums::*;
use crate::host::config::{Mode, Settings, Surface};
use crate::trace::occlusion::{PixelRng, RayScene, eye_from_object};
use crate::trace::view::View;
use crate::trace::{Fragment, Prepared, Rect};
use rayon::prelude::*;
use rt_core::glam::{DMat4, DVec3};
use rt_core::ray::Ray;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Premultiplied colours of a rectangle of the window, and their cost.
pub(crate) struct ColorImage {
    pub(crate) rect: Rect,
    pub(crate) rgba: Vec<[f32; 4]>,
    pub(crate) rays: Vec<(&'static str, u64)>,
    pub(crate) warnings: Vec<String>,
}

/// True when a draw's surface is not opaque, because of the program or the user.
pub(crate) fn is_clear(p: &Prepared<'_>, settings: &Settings) -> bool {
    let ray_material = &p.draw.ray_material;
    let through =
        settings.effects.transparency && (ray_material.opacity < 1.0 || p.draw.state.blend);
    through || (ray_material.surface == Surface::Glass && settings.effects.refraction)
}

/// True when the settings or materials ask for more than one ray per pixel and OpenGL's lighting.
pub(crate) fn is_needed(draws: &[Prepared<'_>], settings: &Settings) -> bool {
    let (e, rich) = (&settings.effects, settings.mode == Mode::Rich);
    let answers = |p: &Prepared<'_>| {
        let ray_material = &p.draw.ray_material;
        let mirrors =
            e.reflections && (ray_material.mirror > 0.0 || ray_material.surface == Surface::Metal);
        mirrors || is_clear(p, settings)
    };
    (rich || settings.mode == Mode::Enhance) && settings.samples > 1
        || rich && (e.aperture_radius > 0.0 || draws.iter().any(answers))
}

/// The draws of one view of a frame, for rays from any origin.
struct WhittedTracer<'a> {
    ray_scene: RayScene<'a>,
    view: &'a View,
    eye_from_object: Vec<DMat4>,
    /// The radiance of rays that leave the scene.
    sky: [f32; 3],
    reflection: AtomicU64,
    refraction: AtomicU64,
    transparency: AtomicU64,
    primary: AtomicU64,
}

/// A point that a ray hit.
struct SurfaceHit {
    draw: usize,
    prim: usize,
    fragment: Fragment,
    t: f64,
    point: DVec3,
    /// The unit normal of the triangle, facing the ray's origin.
    normal: DVec3,
    outside: bool,
}

/// A ray in eye space and its history.
#[derive(Clone, Copy)]
struct WhittedRay {
    origin: DVec3,
    dir: DVec3,
    span: [f64; 2],
    bounce: u32,
    weight: f32,
    pixel: (i32, i32),
}

/// Rays with a smaller weight change no pixel of eight bits.
const LEAST_WEIGHT: f32 = 1.0 / 512.0;
/// The limit of translucent layers, and of culled or clipped triangles, on one ray.
const MOST_LAYERS: usize = 256;

/// The colours of every pixel of `rect` in the row share. `background` is the program's clear
/// colour, which mirrors and glass show.
pub(crate) fn colors(
    draws: &[Prepared<'_>],
    view: &View,
    rect: Rect,
    settings: &Settings,
    background: [f32; 3],
    share: RowShare,
) -> ColorImage {
    let mut ray_scene = RayScene::of(draws, settings);
    ray_scene.clear = draws.iter().map(|p| is_clear(p, settings)).collect();
    let sky = settings.lights.sky as f32;
    let beyond = WhittedTracer {
        view,
        eye_from_object: draws.iter().map(|p| eye_from_object(p.draw)).collect(),
        ray_scene,
        sky: background.map(|v| v + sky),
        reflection: AtomicU64::new(0),
        refraction: AtomicU64::new(0),
        transparency: AtomicU64::new(0),
        primary: AtomicU64::new(0),
    };
    let mut warnings = Vec::new();
    let lens = beyond.lens(&mut warnings);
    let (w, h) = (rect.w.max(0) as usize, rect.h.max(0) as usize);
    let rgba = (0..w * h)
        .into_par_iter()
        .map(|k| match share.has(k / w / BAND) {
            true => beyond.pixel(rect.x + (k % w) as i32, rect.y + (k / w) as i32, lens),
            false => [0.0; 4],
        })
        .collect();
    let rays = [
        ("primary", &beyond.primary),
        ("shadow", &beyond.ray_scene.shadow_rays),
        ("ambient occlusion", &beyond.ray_scene.occlusion_rays),
        ("reflection", &beyond.reflection),
        ("refraction", &beyond.refraction),
        ("transparency", &beyond.transparency),
    ];
    ColorImage {
        rect,
        rgba,
        rays: rays.map(|(name, n)| (name, n.load(Relaxed))).to_vec(),
        warnings,
    }
}

/// The distances of the nearest and the farthest point of the draws along the viewing direction.
/// Both are at least slightly in front of the eye.
pub(crate) fn distances(draws: &[Prepared<'_>]) -> [f64; 2] {
    let (mut near, mut far) = (f64::INFINITY, 0.0_f64);
    for p in draws {
        let (m, b) = (eye_from_object(p.draw), p.draw.geometry.bounds());
        for corner in 0..8 {
            let pick =
                |bit: i32, k: usize| f64::from(if corner & bit == 0 { b.min[k] } else { b.max[k] });
            let z = -m.transform_point3(DVec3::new(pick(1, 0), pick(2, 1), pick(4, 2))).z;
            (near, far) = (near.min(z), far.max(z));
        }
    }
    let far = far.max(1e-30);
    [near.clamp(1e-4 * far, far), far]
}

/// The radius and focus distance of the lens in the settings, or the reason why there can be none.
pub(crate) fn lens(
    draws: &[Prepared<'_>],
    view: &View,
    settings: &Settings,
    diagonal: f64,
) -> Result<Option<[f64; 2]>, String> {
    let e = &settings.effects;
    if e.aperture_radius == 0.0 {
        return Ok(None);
    }
    if view.parallel {
        return Err(
            "`effects.aperture_radius` is set, but a view is a parallel projection, which has no \
             lens"
                .into(),
        );
    }
    let [near, far] = distances(draws);
    Ok(Some([e.aperture_radius * diagonal, near + (far - near) * e.focus]))
}

impl WhittedTracer<'_> {
    fn lens(&self, warnings: &mut Vec<String>) -> Option<[f64; 2]> {
        let found =
            lens(self.ray_scene.draws, self.view, self.ray_scene.settings, self.ray_scene.diagonal);
        found.unwrap_or_else(|why| {
            warnings.push(why);
            None
        })
    }

    /// The mean of the samples of a pixel.
    fn pixel(&self, x: i32, y: i32, lens: Option<[f64; 2]>) -> [f32; 4] {
        let n = self.ray_scene.settings.samples.max(1);
        let side = f64::from(n).sqrt().ceil() as u32;
        let mut sum = [0.0_f32; 4];
        for sample in 0..n {
            // Sample 0 of an ordinary image goes through the centre. Other samples lie in the cells
            // of a grid.
            let seed =
                (x.wrapping_add((sample as i32).wrapping_mul(0x1_0001)), y ^ (sample as i32) << 16);
            let mut random = PixelRng::new(seed);
            let (cx, cy) = (f64::from(sample % side), f64::from(sample / side));
            let (dx, dy) = match n {
                1 => (0.5, 0.5),
                _ => (
                    (cx + random.next()) / f64::from(side),
                    (cy + random.next()) / f64::from(n.div_ceil(side)),
                ),
            };
            let Some(mut path) = self.primary(f64::from(x) + dx, f64::from(y) + dy, seed) else {
                continue;
            };
            if let Some([radius, focus]) = lens {
                // All rays through the lens meet at the point where the pinhole ray crosses the
                // plane in focus.
                let sharp = path.origin + path.dir * (focus / -path.dir.z);
                let (u, v) = random.on_disk();
                path.origin += DVec3::new(u, v, 0.0) * radius;
                path.dir = (sharp - path.origin) * (-path.dir.z / focus);
            }
            self.primary.fetch_add(1, Relaxed);
            let c = self.radiance(&path, Some((x, y)));
            (0..4).for_each(|k| sum[k] += c[k]);
        }
        sum.map(|v| v / n as f32)
    }

    /// The ray through a point of the window, between the near and the far plane.
    fn primary(&self, x: f64, y: f64, pixel: (i32, i32)) -> Option<WhittedRay> {
        let (origin, dir) = self.view.camera.world_ray(self.view.ndc(x, y));
        let m = self.view.projection;
        let mut span = [f64::NEG_INFINITY, f64::INFINITY];
        for plane in [m.row(3) + m.row(2), m.row(3) - m.row(2)] {
            let (a, b) = (plane.dot(origin.extend(1.0)), plane.dot(dir.extend(0.0)));
            if b > 0.0 {
                span[0] = span[0].max(-a / b);
            } else if b < 0.0 {
                span[1] = span[1].min(-a / b);
            } else if a < 0.0 {
                return None;
            }
        }
        let back = if span[0].is_finite() { span[0] } else { 0.0 };
        // Starts at the near plane, so that parallel projections see the part in front of their
        // origin.
        let (origin, span) = if self.view.parallel {
            (origin + dir * back, [0.0, span[1] - back])
        } else {
            (origin, span)
        };
        Some(WhittedRay {
            origin,
            dir,
            span: [span[0].max(0.0), span[1]],
            bounce: 0,
            weight: 1.0,
            pixel,
        })
    }

    /// The nearest surface on a ray. With `pixel`, only draws that may cover that pixel are tested.
    fn closest(&self, path: &WhittedRay, pixel: Option<(i32, i32)>) -> Option<SurfaceHit> {
        let mut best: Option<SurfaceHit> = None;
        for (i, p) in self.ray_scene.draws.iter().enumerate() {
            let Some(m) = self.ray_scene.object_from_eye[i] else { continue };
            if let Some((x, y)) = pixel
                && p.rect.and(Rect { x, y, w: 1, h: 1 }).is_empty()
            {
                continue;
            }
            let (origin, dir) = (m.transform_point3(path.origin), m.transform_vector3(path.dir));
            let (mut ray, moved) = p.world.ray_from_world(origin, dir);
            let most = best.as_ref().map_or(path.span[1], |b| b.t);
            ray.t_min = ((path.span[0] - moved) as f32).max(0.0);
            let t_max = (most - moved) as f32;
            ray.t_max = if t_max.is_finite() { t_max } else { f32::INFINITY };
            if let Some(hit) = self.first_visible(i, path, ray, moved) {
                best = Some(hit);
            }
        }
        best
    }

    /// The first triangle of a draw on a ray that is neither culled nor clipped.
    fn first_visible(
        &self,
        draw: usize,
        path: &WhittedRay,
        mut ray: Ray,
        moved: f64,
    ) -> Option<SurfaceHit> {
        let p = &self.ray_scene.draws[draw];
        for _ in 0..MOST_LAYERS {
            let hit = p.world.closest(&ray)?;
            let prim = hit.prim as usize;
            let corners = p.draw.geometry.mesh.triangle(prim).map(|c| c.as_dvec3());
            let [a, b, c] = corners.map(|v| self.eye_from_object[draw].transform_point3(v));
            let across = (b - a).cross(c - a).normalize_or_zero();
            let left = across.dot(path.dir) < 0.0;
            let s = &*p.draw.state;
            let front = (left != self.view.mirrored) == s.front_is_ccw;
            let culled = match s.cull {
                None => false,
                Some(FRONT) => front,
                Some(BACK) => !front,
                Some(_) => true,
            };
            let (u, v) = (f64::from(hit.u), f64::from(hit.v));
            let weights = [1.0 - u - v, u, v];
            let point = a * weights[0] + b * weights[1] + c * weights[2];
            let clipped = || {
                let [a, b, c] = corners;
                let at = a * weights[0] + b * weights[1] + c * weights[2];
                p.clip_planes().iter().any(|q| q[0] * at.x + q[1] * at.y + q[2] * at.z + q[3] < 0.0)
            };
            if culled || clipped() {
                ray.t_min = hit.t.next_up();
                continue;
            }
            let normal = if left { across } else { -across };
            let fragment = Fragment { weights, depth: 0.0, plain_depth: 0.0, front };
            return Some(SurfaceHit {
                draw,
                prim,
                fragment,
                t: f64::from(hit.t) + moved,
                point,
                normal,
                outside: left,
            });
        }
        None
    }

    /// The radiance along a ray, premultiplied by the share that surfaces contribute.
    fn radiance(&self, path: &WhittedRay, pixel: Option<(i32, i32)>) -> [f32; 4] {
        let mut out = [0.0_f32; 4];
        let mut left = 1.0_f32;
        let mut path = *path;
        for _ in 0..MOST_LAYERS {
            let Some(hit) = self.closest(&path, pixel) else { break };
            let (color, opacity) = self.surface(&hit, &path, left);
            for k in 0..3 {
                out[k] += left * opacity * color[k];
            }
            out[3] += left * opacity;
            left *= 1.0 - opacity;
            if left * path.weight < LEAST_WEIGHT {
                left = 0.0;
                break;
            }
            self.transparency.fetch_add(1, Relaxed);
            path.span[0] = hit.t + self.ray_scene.diagonal * 1e-6 / path.dir.length();
            path.pixel.1 = path.pixel.1.wrapping_add(0x3331);
        }
        if path.bounce > 0 {
            (0..3).for_each(|k| out[k] += left * self.sky[k]);
            out[3] = 1.0;
        }
        out
    }

    /// The colour and opacity of a surface.
    fn surface(&self, hit: &SurfaceHit, path: &WhittedRay, left: f32) -> ([f32; 3], f32) {
        let settings = self.ray_scene.settings;
        let (e, p) = (&settings.effects, &self.ray_scene.draws[hit.draw]);
        let ray_material = &p.draw.ray_material;
        let rgb = |c: [f32; 4]| [c[0], c[1], c[2]];
        let weight = path.weight * left;
        let more =
            path.bounce < e.max_bounces && weight > LEAST_WEIGHT && settings.mode == Mode::Rich;
        let dir = path.dir.normalize();
        let cosine = -hit.normal.dot(dir);
        let eye_normal = self.shading_normal(hit);
        let mirrored = dir - eye_normal * (2.0 * dir.dot(eye_normal));
        // With shading normals, a reflected ray may point into the surface.
        let mirrored = mirrored + hit.normal * (1e-3 - mirrored.dot(hit.normal)).max(0.0);
        if ray_material.surface == Surface::Glass && e.refraction && more {
            return (self.glass(hit, path, dir, weight), 1.0);
        }
        let lit = || {
            p.shaded_from(
                hit.prim,
                &hit.fragment,
                settings.mode,
                Some(&self.ray_scene),
                path.pixel,
                -dir,
            )
        };
        if ray_material.surface == Surface::Metal && e.reflections && more {
            let base = rgb(p.base_color(hit.prim, &hit.fragment));
            let grazing = (1.0 - cosine.clamp(0.0, 1.0)).powi(5) as f32;
            let share: [f32; 3] = std::array::from_fn(|k| base[k] + (1.0 - base[k]) * grazing);
            let rays = if ray_material.roughness > 0.0 && path.bounce == 0 && settings.samples < 16
            {
                8
            } else {
                1
            };
            let mut random = PixelRng::new((path.pixel.0 ^ 0x5bd1, path.pixel.1));
            let mut sum = [0.0_f32; 3];
            for _ in 0..rays {
                // The lobe is as wide as the median of the GGX half vectors at this roughness.
                let spread = f64::from(ray_material.roughness * ray_material.roughness);
                let (u, v) = mirrored.any_orthonormal_pair();
                let (x, y) = random.on_disk();
                let d = (mirrored + (u * x + v * y) * spread).normalize();
                let d = d + hit.normal * (1e-3 - d.dot(hit.normal)).max(0.0);
                let c = self.send(hit, path, d, weight, &self.reflection);
                (0..3).for_each(|k| sum[k] += c[k] / rays as f32);
            }
            return (std::array::from_fn(|k| share[k] * sum[k]), 1.0);
        }
        let lit = lit();
        let mut color = rgb(lit);
        if ray_material.mirror > 0.0 && e.reflections && more {
            let c = self.send(hit, path, mirrored, weight * ray_material.mirror, &self.reflection);
            (0..3).for_each(|k| color[k] += ray_material.mirror * c[k]);
        }
        let opacity = if e.transparency && (settings.mode == Mode::Rich) {
            let own = if p.draw.state.blend { lit[3].clamp(0.0, 1.0) } else { 1.0 };
            own * ray_material.opacity
        } else {
            1.0
        };
        (color, opacity)
    }

    /// Fresnel's equations for unpolarised light at an interface, and the two rays that they
    /// weight.
    fn glass(&self, hit: &SurfaceHit, path: &WhittedRay, dir: DVec3, weight: f32) -> [f32; 3] {
        let ray_material = &self.ray_scene.draws[hit.draw].draw.ray_material;
        let ior = f64::from(ray_material.ior);
        let n = hit.normal;
        let eta = if hit.outside { 1.0 / ior } else { ior };
        let cos_i = -dir.dot(n);
        let sin2_t = eta * eta * (1.0 - cos_i * cos_i);
        let (share, bent) = if sin2_t >= 1.0 {
            (1.0, DVec3::ZERO)
        } else {
            let cos_t = (1.0 - sin2_t).sqrt();
            let (a, b) = (
                (eta * cos_i - cos_t) / (eta * cos_i + cos_t),
                (cos_i - eta * cos_t) / (cos_i + eta * cos_t),
            );
            (0.5 * (a * a + b * b), dir * eta + n * (eta * cos_i - cos_t))
        };
        let share = share as f32;
        let mut out = [0.0; 3];
        if self.ray_scene.settings.effects.reflections && weight * share > LEAST_WEIGHT {
            let c = self.send(hit, path, dir + n * (2.0 * cos_i), weight * share, &self.reflection);
            (0..3).for_each(|k| out[k] += share * c[k]);
        }
        if share < 1.0 {
            let inside = SurfaceHit { normal: -n, ..*hit };
            let c = self.send(&inside, path, bent, weight * (1.0 - share), &self.refraction);
            (0..3).for_each(|k| out[k] += (1.0 - share) * ray_material.tint[k] * c[k]);
        }
        out
    }

    /// The radiance from direction `dir`, on the side of the normal.
    fn send(
        &self,
        hit: &SurfaceHit,
        path: &WhittedRay,
        dir: DVec3,
        weight: f32,
        count: &AtomicU64,
    ) -> [f32; 3] {
        count.fetch_add(1, Relaxed);
        let from = WhittedRay {
            // Starts off the surface, as shadow rays do.
            origin: hit.point + hit.normal * (self.ray_scene.diagonal * 2e-5),
            dir,
            span: [0.0, f64::INFINITY],
            bounce: path.bounce + 1,
            weight,
            pixel: (path.pixel.0.wrapping_add(0x2545), path.pixel.1 ^ 0x49),
        };
        let c = self.radiance(&from, None);
        [c[0], c[1], c[2]]
    }

    /// The unit shading normal on the side that the ray came from.
    fn shading_normal(&self, hit: &SurfaceHit) -> DVec3 {
        let p = &self.ray_scene.draws[hit.draw];
        let n = p.smooth_normal(hit.prim, hit.fragment.weights.map(|w| w as f32));
        let n = DVec3::from_array(n.map(f64::from)).normalize_or_zero();
        match n.dot(hit.normal) {
            0.0 => hit.normal,
            d if d < 0.0 => -n,
            _ => n,
        }
    }
}
