//! Traces rays through pixel centres. For each pixel this module finds the visible triangle, and
//! its colour and depth as the driver would have computed them.
//!
//! Rays only find the triangle. Depth and attributes are then evaluated on it at the pixel centre
//! with the rasterizer's own arithmetic (homogeneous edge functions after Olano and Greer 1997).
//! They therefore agree with the lines and text that the driver draws next to them.

mod fragment_batch;
mod fragments;
pub(crate) mod lighting;
mod nearest;
pub(crate) mod occlusion;
pub(crate) mod overrides;
mod painters_stack;
pub(crate) mod path_tracing;
mod primitive_order;
pub(crate) mod raster;
mod screen_bounds;
mod shading;
pub(crate) mod texturing;
pub(crate) mod thread_pool;
mod tile_mask;
mod tile_rays;
mod translucent;
pub(crate) mod view;
pub(crate) mod whitted;

use crate::capture::draw::{Draw, Shading};
use crate::capture::geometry_cache::BuildCounts;
use crate::enums::*;
use crate::state::matrix::transform;
use crate::trace::lighting::{LightingSetup, VertexColors};
use crate::trace::occlusion::{Eye, LightPosition};
use crate::trace::raster::{covers, gradient, level_depth, polygon_offset, steepness};
use crate::trace::texturing::Image;
pub(crate) use nearest::nearest;
pub(crate) use primitive_order::ordered_layers;
use rayon::prelude::*;
use rt_core::bvh::World;
use rt_core::camera::Camera;
use rt_core::glam::{DMat4, DVec3};
use rt_core::ray::Ray;
use screen_bounds::screen_bounds;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use tile_rays::{AffineRays, TileRays, slot};
pub(crate) use translucent::{DepthLimits, WeightedSums, depth_sorted, weighted_sums};

/// A rectangle of window pixels. The y axis points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Rect {
    pub(crate) x: i32,
    pub(crate) y: i32,
    pub(crate) w: i32,
    pub(crate) h: i32,
}

impl Rect {
    pub(crate) fn is_empty(&self) -> bool {
        self.w <= 0 || self.h <= 0
    }

    pub(crate) fn and(self, o: Rect) -> Rect {
        let (x, y) = (self.x.max(o.x), self.y.max(o.y));
        let w = (self.x + self.w).min(o.x + o.w) - x;
        let h = (self.y + self.h).min(o.y + o.h) - y;
        Rect { x, y, w: w.max(0), h: h.max(0) }
    }

    pub(crate) fn or(self, o: Rect) -> Rect {
        if self.is_empty() {
            return o;
        }
        if o.is_empty() {
            return self;
        }
        let (x, y) = (self.x.min(o.x), self.y.min(o.y));
        Rect {
            x,
            y,
            w: (self.x + self.w).max(o.x + o.w) - x,
            h: (self.y + self.h).max(o.y + o.h) - y,
        }
    }
}

/// Fragments, at most one per pixel.
#[derive(Clone, Default)]
pub(crate) struct Layer {
    pub(crate) rect: Rect,
    pub(crate) color: Vec<[u8; 4]>,
    /// Window depth; [`UNCOVERED`] where there is no fragment.
    pub(crate) depth: Vec<f32>,
    pub(crate) covered: usize,
}

/// The depth of a pixel that has no fragment.
pub(crate) const UNCOVERED: f32 = 2.0;

/// The side of a tile. The rays of a tile form a packet of 256.
const TILE: i32 = 16;
/// The largest value of a 24-bit depth buffer.
pub(crate) const DEPTH_STEPS: f64 = 16_777_215.0;

/// The share of w by which a point may lie outside the near or far plane. The driver clips in f32,
/// so it shows a surface that lies exactly in the far plane.
const SLACK: f64 = 1e-6;

/// A draw that is ready for tracing.
pub(crate) struct Prepared<'a> {
    pub(crate) draw: &'a Draw,
    pub(crate) world: Arc<World>,
    pub(crate) light_positions: Vec<LightPosition>,
    /// The eye, in the space of `light_positions`.
    pub(crate) eye: Eye,
    camera: Camera,
    /// Clip planes in object space. Visible points lie above all of them: near, far, then the
    /// user's.
    planes: Vec<[f64; 4]>,
    /// Only the user's clip planes.
    clip_planes: Vec<[f64; 4]>,
    /// True when a shader discards the fragments below the user's planes. Otherwise triangles are
    /// cut.
    discards: bool,
    pub(crate) rect: Rect,
    pub(crate) lighting: LightingSetup<'a>,
    pub(crate) lit: Option<Vec<VertexColors>>,
    affine_rays: AffineRays,
    /// True when OpenGL's lighting at the vertices can be computed for 16 fragments at a time.
    blocks: bool,
    pub(crate) image: Option<Arc<Image>>,
    pub(crate) rays: AtomicU64,
}

/// A fragment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fragment {
    /// Perspective-correct barycentric weights of the corners.
    pub(crate) weights: [f64; 3],
    pub(crate) depth: f64,
    /// The depth before polygon offset.
    pub(crate) plain_depth: f64,
    pub(crate) front: bool,
}

pub(crate) fn matrix(m: &[f32; 16]) -> DMat4 {
    DMat4::from_cols_array(&m.map(f64::from))
}

/// True when camera rays can be derived from this matrix.
pub(crate) fn has_rays(clip_from_object: &[f32; 16]) -> bool {
    Camera::from_matrix(matrix(clip_from_object)).is_ok()
}

impl<'a> Prepared<'a> {
    /// Returns `None` when no part of the draw is visible.
    pub(crate) fn new(
        draw: &'a Draw,
        image: Option<Arc<Image>>,
        made: &mut BuildCounts,
    ) -> Option<Prepared<'a>> {
        let s = &*draw.state;
        let clip = matrix(&draw.clip_from_object);
        let camera = Camera::from_matrix(clip).ok()?;
        let rect = screen_bounds(draw, clip);
        if rect.is_empty() {
            return None;
        }
        let world = draw.geometry.world(made)?;
        let row = |i: usize| clip.row(i);
        let mut planes = Vec::new();
        if s.depth_clamp {
            planes.push(row(3).to_array());
            if row(3).truncate() == DVec3::ZERO {
                // Nothing is clipped here, so parallel rays start in front of all geometry.
                planes.extend(tile_rays::slab(draw, row(2)));
            }
        } else {
            planes.push((row(3) * (1.0 + SLACK) + row(2)).to_array());
            planes.push((row(3) * (1.0 + SLACK) - row(2)).to_array());
        }
        let eye_from_object = matrix(&s.model_view);
        let object = |p: &[f64; 4]| {
            (eye_from_object.transpose() * rt_core::glam::DVec4::from_array(*p)).to_array()
        };
        let mut clip_planes: Vec<[f64; 4]> = s.clip_planes.iter().map(object).collect();
        let mut discards = false;
        if let Shading::Program(program) = &draw.shading {
            // A shader discards fragments by the position of the pixel centre.
            clip_planes = program.clip_planes().iter().map(|p| p.map(f64::from)).collect();
            discards = !clip_planes.is_empty();
        }
        if !discards || s.sample_place == [0.0; 2] {
            planes.extend(&clip_planes);
        }
        let lighting = LightingSetup::new(s);
        let light_positions = match &draw.shading {
            Shading::Fixed => lighting.light_positions(),
            Shading::Program(program) => program.light_positions(),
        };
        let bounds = draw.geometry.bounds();
        let middle = (bounds.min.as_dvec3() + bounds.max.as_dvec3()) / 2.0;
        let mut out = Prepared {
            draw,
            world,
            light_positions,
            eye: Eye::of(&camera, &crate::trace::occlusion::eye_from_object(draw), middle),
            camera,
            planes,
            clip_planes,
            discards,
            rect,
            lighting,
            lit: None,
            affine_rays: AffineRays::default(),
            blocks: false,
            image,
            rays: AtomicU64::new(0),
        };
        let positions = &draw.geometry.mesh.positions;
        let fixed = matches!(draw.shading, Shading::Fixed);
        out.blocks = fixed && out.lighting.lights_blocks(&draw.attributes);
        // With fewer vertices than pixels, all vertices are lit once. Otherwise only visible ones
        // are lit.
        if fixed && positions.len() <= 2 * rect.w as usize * rect.h as usize {
            let light = |(i, p): (usize, &rt_core::glam::Vec3)| {
                out.lighting.vertex(&draw.attributes, i, p.to_array())
            };
            out.lit = Some(match out.blocks {
                true => out.lighting.all(&draw.attributes, positions),
                false => positions.par_iter().enumerate().map(light).collect(),
            });
        }
        out.affine_rays = AffineRays::new(&out);
        Some(out)
    }

    /// The user's clip planes, in object space.
    pub(crate) fn clip_planes(&self) -> &[[f64; 4]] {
        &self.clip_planes
    }

    /// The ray through a point of the window, limited to the part that is not clipped. Returns
    /// `None` when all of it is clipped.
    fn ray(&self, x: f64, y: f64) -> Option<(Ray, f64)> {
        let [vx, vy, vw, vh] = self.draw.state.viewport.map(f64::from);
        let ndc = [2.0 * (x - vx) / vw - 1.0, 2.0 * (y - vy) / vh - 1.0];
        let (origin, dir) = self.camera.world_ray(ndc);
        let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
        for p in &self.planes {
            let terms = [p[0] * origin.x, p[1] * origin.y, p[2] * origin.z, p[3]];
            // The ray keeps a little more than the visible part. The fragment makes the exact test.
            let a = terms.iter().sum::<f64>() + 1e-6 * terms.iter().map(|v| v.abs()).sum::<f64>();
            let b = p[0] * dir.x + p[1] * dir.y + p[2] * dir.z;
            if b > 0.0 {
                t0 = t0.max(-a / b);
            } else if b < 0.0 {
                t1 = t1.min(-a / b);
            } else if a < 0.0 {
                return None;
            }
        }
        if t0.partial_cmp(&t1) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        // Rays of a parallel projection start at the program's near plane. Another plane in front
        // of it may come first.
        let back = if t0 < 0.0 && t0.is_finite() { t0 } else { 0.0 };
        let origin = origin + dir * back;
        let (ray, moved) = self.world.ray_from_world(origin, dir);
        let shift = back + moved;
        let t_min = ((t0 - shift) as f32).max(0.0);
        let t_max = (t1 - shift) as f32;
        Some((
            Ray {
                t_min,
                t_max: if t_max.is_finite() { t_max.next_up() } else { f32::INFINITY },
                ..ray
            },
            shift,
        ))
    }

    fn corners(&self, prim: usize) -> [[f32; 4]; 3] {
        let mesh = &self.draw.geometry.mesh;
        mesh.triangle(prim).map(|p| transform(&self.draw.clip_from_object, p.to_array()))
    }

    /// The weights of a triangle's corners at the point where its plane meets the centre of a
    /// pixel, whether that point lies inside the triangle or not. Returns `None` where there is no
    /// such point.
    pub(crate) fn weights_at(&self, prim: usize, x: i32, y: i32) -> Option<[f32; 3]> {
        let [vx, vy, vw, vh] = self.draw.state.viewport.map(f64::from);
        let [dx, dy] = self.draw.state.sample_place.map(f64::from);
        let (px, py) = (f64::from(x) + 0.5 - dx, f64::from(y) + 0.5 - dy);
        let at = DVec3::new(2.0 * (px - vx) / vw - 1.0, 2.0 * (py - vy) / vh - 1.0, 1.0);
        let h = self
            .corners(prim)
            .map(|v| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[3])));
        let l = [h[1].cross(h[2]).dot(at), h[2].cross(h[0]).dot(at), h[0].cross(h[1]).dot(at)];
        let sum = l[0] + l[1] + l[2];
        (sum != 0.0 && sum.is_finite()).then(|| l.map(|v| (v / sum) as f32))
    }

    /// The fragment as it is shaded. With multisampling, a sample takes the colour of its pixel's
    /// centre.
    pub(crate) fn centred(&self, prim: usize, f: Fragment, x: i32, y: i32) -> Fragment {
        if self.draw.state.sample_place == [0.0; 2] {
            return f;
        }
        let weights = self.weights_at(prim, x, y).map_or(f.weights, |w| w.map(f64::from));
        Fragment { weights, ..f }
    }

    /// The fragment of triangle `prim` at the centre of pixel (`x`, `y`), if the rasterizer
    /// generates one.
    fn fragment(&self, prim: usize, x: i32, y: i32) -> Option<Fragment> {
        let s = &*self.draw.state;
        let c = self.corners(prim);
        let [vx, vy, vw, vh] = s.viewport.map(f64::from);
        let (px, py) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let at = DVec3::new(2.0 * (px - vx) / vw - 1.0, 2.0 * (py - vy) / vh - 1.0, 1.0);
        let h = c.map(|v| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[3])));
        let l = [h[1].cross(h[2]).dot(at), h[2].cross(h[0]).dot(at), h[0].cross(h[1]).dot(at)];
        let area = h[0].dot(h[1].cross(h[2]));
        if area == 0.0 || !area.is_finite() {
            return None;
        }
        let front = (area > 0.0) == s.front_is_ccw;
        let culled = match s.cull {
            None => false,
            Some(FRONT) => front,
            Some(BACK) => !front,
            Some(_) => true,
        };
        if culled {
            return None;
        }
        if c.iter().all(|v| v[3] > 0.0) {
            if !covers(&c, s.viewport, x, y) {
                return None;
            }
        } else if l.iter().any(|v| v * area.signum() < 0.0) {
            return None;
        }
        let sum = l[0] + l[1] + l[2];
        if sum == 0.0 {
            return None;
        }
        let weights = l.map(|v| v / sum);
        // Clipping is decided at the pixel centre, whichever ray found the triangle.
        let middle = match self.discards && s.sample_place != [0.0; 2] {
            true => self.weights_at(prim, x, y).map_or(weights, |w| w.map(f64::from)),
            false => weights,
        };
        for p in &self.clip_planes {
            let corner = |i: usize| {
                let v = self.draw.geometry.mesh.triangle(prim)[i].as_dvec3();
                p[0] * v.x + p[1] * v.y + p[2] * v.z + p[3]
            };
            let terms = [0, 1, 2].map(|i| middle[i] * corner(i));
            let (height, slack) =
                (terms.iter().sum::<f64>(), 1e-6 * terms.iter().map(|v| v.abs()).sum::<f64>());
            if height < if self.discards { 0.0 } else { -slack } {
                return None;
            }
            if height <= slack && !self.discards {
                // The driver cuts the triangle along the plane. A pixel centre on the cut belongs
                // to the part above it or to the right of it.
                let across = [h[1].cross(h[2]), h[2].cross(h[0]), h[0].cross(h[1])];
                let slope = (0..3).map(|i| across[i] * corner(i)).sum::<DVec3>() * sum.signum();
                let upright = slope.x.abs() > 1e-9 * slope.y.abs();
                if (if upright { slope.x } else { slope.y }) < 0.0 {
                    return None;
                }
            }
        }
        let z = (0..3).map(|i| l[i] * f64::from(c[i][2])).sum::<f64>();
        let w = (0..3).map(|i| l[i] * f64::from(c[i][3])).sum::<f64>();
        let [n, f] = s.depth_range;
        let plain_depth = level_depth(&c, s.depth_range)
            .map_or_else(|| n + (f - n) * (z / w * 0.5 + 0.5), f64::from);
        let mut depth = plain_depth;
        // One unit of polygon offset is two steps of the depth buffer (as in Mesa).
        if let Some((factor, units)) = s.polygon_offset {
            let [slope, shift] = match s.offset_by_length {
                true => polygon_offset(gradient(&c, s.viewport, f - n), s.sample_place),
                false => [steepness(&c, s.viewport, f - n), 0.0],
            };
            depth += f64::from(factor) * slope + 2.0 * f64::from(units) / DEPTH_STEPS + shift;
        }
        if !s.depth_clamp && z.abs() > w.abs() * (1.0 + SLACK) {
            return None;
        }
        let (lo, hi) = if n < f { (n, f) } else { (f, n) };
        let depth = if s.depth_clamp { depth.clamp(lo, hi) } else { depth.clamp(0.0, 1.0) };
        Some(Fragment { weights, depth, plain_depth, front })
    }

    /// The first visible fragment of the pixel. `ray` and `hit` belong to the pixel's centre; the
    /// ray starts `shift` behind the camera's own, as do its parameters.
    fn resolve(
        &self,
        (mut ray, shift): (Ray, f64),
        hit: Option<rt_core::ray::Hit>,
        x: i32,
        y: i32,
    ) -> Option<(usize, Fragment)> {
        let mut hit = hit;
        for step in 0..MOST_STEPS {
            let h = hit?;
            if let Some(f) = self.fragment(h.prim as usize, x, y) {
                let found = (h.prim as usize, f);
                return Some(if f.depth > f.plain_depth {
                    self.nearest_with_offset(found, (ray, shift), h.t, x, y)
                } else {
                    found
                });
            }
            // On an edge, the fill rule may give the pixel to an adjacent triangle that the ray
            // missed.
            if step == 0
                && let Some(found) = self.hit_beside_center((ray, shift), h.t, x, y)
            {
                return Some(found);
            }
            ray.t_min = h.t.next_up();
            self.rays.fetch_add(1, Relaxed);
            hit = self.world.closest(&ray);
        }
        None
    }

    /// Polygon offset moves steep triangles far back. At silhouettes they can end up behind other
    /// triangles of the same draw. This function returns the nearest fragment *after* the offset.
    fn nearest_with_offset(
        &self,
        first: (usize, Fragment),
        (mut ray, shift): (Ray, f64),
        t: f32,
        x: i32,
        y: i32,
    ) -> (usize, Fragment) {
        let mut best = first;
        let mut t = t;
        for _ in 0..8 {
            let Some(limit) = self.parameter_at_depth(best.1.depth, shift, x, y) else { break };
            (ray.t_min, ray.t_max) = (t.next_up(), limit.min(ray.t_max));
            if ray.t_min >= ray.t_max {
                break;
            }
            self.rays.fetch_add(1, Relaxed);
            let Some(h) = self.world.closest(&ray) else { break };
            t = h.t;
            if let Some(f) = self.fragment(h.prim as usize, x, y)
                && f.depth < best.1.depth
            {
                best = (h.prim as usize, f);
            }
        }
        best
    }

    /// The parameter at which the ray through a pixel's centre reaches a depth, from `shift` on.
    fn parameter_at_depth(&self, depth: f64, shift: f64, x: i32, y: i32) -> Option<f32> {
        let s = &*self.draw.state;
        let [n, f] = s.depth_range;
        let [vx, vy, vw, vh] = s.viewport.map(f64::from);
        let ndc = [
            2.0 * (f64::from(x) + 0.5 - vx) / vw - 1.0,
            2.0 * (f64::from(y) + 0.5 - vy) / vh - 1.0,
        ];
        let (origin, dir) = self.camera.world_ray(ndc);
        let clip = matrix(&self.draw.clip_from_object);
        let z = ((depth - n) / (f - n) - 0.5) * 2.0;
        let (o, d) = (origin.extend(1.0), dir.extend(0.0));
        let (a, b, aw, bw) =
            (clip.row(2).dot(o), clip.row(2).dot(d), clip.row(3).dot(o), clip.row(3).dot(d));
        let t = (z * aw - a) / (b - z * bw);
        let t = (t - shift) as f32;
        t.is_finite().then_some(t)
    }

    /// A fragment of a triangle that rays beside the pixel's centre hit at about the parameter `t`
    /// of the ray through the centre.
    fn hit_beside_center(
        &self,
        (center, start): (Ray, f64),
        t: f32,
        x: i32,
        y: i32,
    ) -> Option<(usize, Fragment)> {
        const OFF: f64 = 1.0 / 200.0;
        // A thousandth of the way from the eye, or of the draw's size: rays that are moved up to
        // the draw have come no way.
        let radius = f64::from(self.world.bounds().radius());
        let at = f64::from(t) + start;
        let reach = 1e-3 * at.abs().max(radius / f64::from(center.dir.length()));
        let mut best: Option<(usize, Fragment)> = None;
        for (dx, dy) in [(-OFF, -OFF), (OFF, -OFF), (-OFF, OFF), (OFF, OFF)] {
            let (ray, shift) = self.ray(f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy)?;
            self.rays.fetch_add(1, Relaxed);
            let Some(h) = self.world.closest(&ray) else { continue };
            if (f64::from(h.t) + shift - at).abs() > reach {
                continue;
            }
            if let Some(f) = self.fragment(h.prim as usize, x, y)
                && best.is_none_or(|(_, b)| f.depth < b.depth)
            {
                best = Some((h.prim as usize, f));
            }
        }
        best
    }
}

/// The number of triangles that a ray may pass through, because they are culled or rejected by the
/// fill rule, before the search stops.
const MOST_STEPS: usize = 4096;

pub(crate) fn mixed<const N: usize>(v: [[f32; N]; 3], w: [f32; 3]) -> [f32; N] {
    std::array::from_fn(|k| v[0][k] * w[0] + v[1][k] * w[1] + v[2][k] * w[2])
}

fn to_bytes(c: [f32; 4]) -> [u8; 4] {
    c.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}
