//! Rays through pixel centres: which triangle each pixel sees, and its colour and depth as the driver would have made them.
//!
//! Rays only find the triangle. Depth and attributes are then evaluated on it at the pixel centre with the rasterizer's own arithmetic
//! (homogeneous edge functions after Olano and Greer 1997), so they agree with what the driver makes of neighbouring lines and text.

use crate::capture::{Draw, Shading};
use crate::config::{Mode, Settings};
use crate::effects::{Place, Surroundings, Visibility, vector};
use crate::enums::*;
use crate::lighting::{Lit, Setup, transform};
use crate::texturing::{self, Image};
use rayon::prelude::*;
use rt_core::accel::World;
use rt_core::camera::Camera;
use rt_core::glam::{DMat4, DVec3};
use rt_core::ray::{HitBlock, Ray, RayBlock};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A rectangle of window pixels, y up.
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
        Rect { x, y, w: (self.x + self.w).max(o.x + o.w) - x, h: (self.y + self.h).max(o.y + o.h) - y }
    }
}

/// Fragments, at most one a pixel.
pub(crate) struct Layer {
    pub(crate) rect: Rect,
    pub(crate) color: Vec<[u8; 4]>,
    /// Window depth; [`UNCOVERED`] where there is no fragment.
    pub(crate) depth: Vec<f32>,
    pub(crate) covered: usize,
}

/// Depth where there is no fragment.
pub(crate) const UNCOVERED: f32 = 2.0;

/// Side of the tiles that rays are sent in: a packet of 256.
const TILE: i32 = 16;
/// A depth buffer of 24 bits.
const DEPTH_STEPS: f64 = 16_777_215.0;

/// Share of w by which a point may be beyond the near or far plane: the driver clips in f32, and a plane that lies in the far plane is seen.
const SLACK: f64 = 1e-6;

/// A draw made ready for rays.
pub(crate) struct Prepared<'a> {
    pub(crate) draw: &'a Draw,
    pub(crate) world: Arc<World>,
    places: Vec<Place>,
    camera: Camera,
    /// Rows of planes in object space that points must be above: near, far, the user's.
    planes: Vec<[f64; 4]>,
    /// The user's alone.
    clip_planes: Vec<[f64; 4]>,
    pub(crate) rect: Rect,
    lighting: Setup<'a>,
    lit: Option<Vec<Lit>>,
    image: Option<Arc<Image>>,
    /// A mirrored projection or `glFrontFace` changes what counts as front.
    pub(crate) rays: AtomicU64,
}

/// A fragment.
#[derive(Debug, Clone, Copy)]
struct Fragment {
    /// Perspective-correct weights of the corners.
    weights: [f64; 3],
    depth: f64,
    /// The depth without polygon offset.
    plain_depth: f64,
    front: bool,
}

#[derive(Clone, Copy)]
struct Seen {
    depth_bits: u32,
    depth: f32,
    draw: u32,
    prim: u32,
}

const NOTHING: Seen = Seen { depth_bits: u32::MAX, depth: UNCOVERED, draw: u32::MAX, prim: 0 };

fn matrix(m: &[f32; 16]) -> DMat4 {
    DMat4::from_cols_array(&m.map(f64::from))
}

/// True when rays can be made for this matrix.
pub(crate) fn has_rays(clip_from_object: &[f32; 16]) -> bool {
    Camera::from_matrix(matrix(clip_from_object)).is_ok()
}

impl<'a> Prepared<'a> {
    /// `None` when nothing of it can be seen.
    pub(crate) fn new(draw: &'a Draw, image: Option<Arc<Image>>, builds: &mut u64) -> Option<Prepared<'a>> {
        let s = &*draw.state;
        let clip = matrix(&draw.clip_from_object);
        let camera = Camera::from_matrix(clip).ok()?;
        let rect = screen_bounds(draw, clip);
        if rect.is_empty() {
            return None;
        }
        let world = draw.geometry.world(builds)?;
        let row = |i: usize| clip.row(i);
        let mut planes = Vec::new();
        if s.depth_clamp {
            planes.push(row(3).to_array());
        } else {
            planes.push((row(3) * (1.0 + SLACK) + row(2)).to_array());
            planes.push((row(3) * (1.0 + SLACK) - row(2)).to_array());
        }
        let eye_from_object = matrix(&s.model_view);
        let object = |p: &[f64; 4]| (eye_from_object.transpose() * rt_core::glam::DVec4::from_array(*p)).to_array();
        let clip_planes: Vec<[f64; 4]> = s.clip_planes.iter().map(object).collect();
        planes.extend(&clip_planes);
        let lighting = Setup::new(s);
        let places = match &draw.shading {
            Shading::Fixed => lighting.places(),
            Shading::Program(program) => program.places(),
        };
        let mut out =
            Prepared { draw, world, places, camera, planes, clip_planes, rect, lighting, lit: None, image, rays: AtomicU64::new(0) };
        let positions = &draw.geometry.mesh.positions;
        // Fewer vertices than pixels: light them all once. Else only those that are seen.
        let fixed = matches!(draw.shading, Shading::Fixed);
        if fixed && positions.len() <= 2 * rect.w as usize * rect.h as usize {
            let light = |(i, p): (usize, &rt_core::glam::Vec3)| out.lighting.vertex(&draw.attributes, i, p.to_array());
            out.lit = Some(positions.par_iter().enumerate().map(light).collect());
        }
        Some(out)
    }

    /// The ray through a point of the window, with the part of it that is not clipped; `None` when all of it is.
    fn ray(&self, x: f64, y: f64) -> Option<(Ray, f64)> {
        let [vx, vy, vw, vh] = self.draw.state.viewport.map(f64::from);
        let ndc = [2.0 * (x - vx) / vw - 1.0, 2.0 * (y - vy) / vh - 1.0];
        let (origin, dir) = self.camera.world_ray(ndc);
        let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
        for p in &self.planes {
            let terms = [p[0] * origin.x, p[1] * origin.y, p[2] * origin.z, p[3]];
            // A little more than is visible: the exact test is that of the fragment.
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
        // Rays of a parallel projection begin where the program's near plane is; a plane before it may be the first.
        let back = if t0 < 0.0 && t0.is_finite() { t0 } else { 0.0 };
        let origin = origin + dir * back;
        let (ray, moved) = self.world.ray_from_world(origin, dir);
        let shift = back + moved;
        let t_min = ((t0 - shift) as f32).max(0.0);
        let t_max = (t1 - shift) as f32;
        Some((Ray { t_min, t_max: if t_max.is_finite() { t_max.next_up() } else { f32::INFINITY }, ..ray }, shift))
    }

    fn corners(&self, prim: usize) -> [[f32; 4]; 3] {
        let mesh = &self.draw.geometry.mesh;
        mesh.triangle(prim).map(|p| transform(&self.draw.clip_from_object, p.to_array()))
    }

    /// The fragment of triangle `prim` at the centre of pixel (`x`, `y`), if the rasterizer makes one.
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
        // Clipped at the centre, whatever ray found the triangle.
        for p in &self.clip_planes {
            let corner = |i: usize| {
                let v = self.draw.geometry.mesh.triangle(prim)[i].as_dvec3();
                p[0] * v.x + p[1] * v.y + p[2] * v.z + p[3]
            };
            if (0..3).map(|i| weights[i] * corner(i)).sum::<f64>() < 0.0 {
                return None;
            }
        }
        let z = (0..3).map(|i| l[i] * f64::from(c[i][2])).sum::<f64>();
        let w = (0..3).map(|i| l[i] * f64::from(c[i][3])).sum::<f64>();
        let [n, f] = s.depth_range;
        let mut depth = n + (f - n) * (z / w * 0.5 + 0.5);
        let plain_depth = depth;
        // The unit of polygon offset is two steps of the depth buffer (Mesa).
        if let Some((factor, units)) = s.polygon_offset {
            depth += f64::from(factor) * steepness(&c, s.viewport, f - n) + 2.0 * f64::from(units) / DEPTH_STEPS;
        }
        if !s.depth_clamp && z.abs() > w.abs() * (1.0 + SLACK) {
            return None;
        }
        let (lo, hi) = if n < f { (n, f) } else { (f, n) };
        let depth = if s.depth_clamp { depth.clamp(lo, hi) } else { depth.clamp(0.0, 1.0) };
        Some(Fragment { weights, depth, plain_depth, front })
    }

    /// What the pixel sees first. `ray` and `hit` are those of its centre.
    fn resolve(&self, mut ray: Ray, hit: Option<rt_core::ray::Hit>, x: i32, y: i32) -> Option<(usize, Fragment)> {
        let mut hit = hit;
        for step in 0..MOST_STEPS {
            let h = hit?;
            if let Some(f) = self.fragment(h.prim as usize, x, y) {
                let found = (h.prim as usize, f);
                return Some(if f.depth > f.plain_depth { self.overtaken(found, ray, h.t, x, y) } else { found });
            }
            // On an edge the rule of the rasterizer may give the pixel to a neighbour that the ray saw beside it.
            if step == 0
                && let Some(found) = self.beside(h.t, x, y)
            {
                return Some(found);
            }
            ray.t_min = h.t.next_up();
            self.rays.fetch_add(1, Relaxed);
            hit = self.world.closest(&ray);
        }
        None
    }

    /// Polygon offset pushes steep triangles far back, at silhouettes behind others of the same draw: the nearest *with* offset counts.
    fn overtaken(&self, first: (usize, Fragment), mut ray: Ray, t: f32, x: i32, y: i32) -> (usize, Fragment) {
        let mut best = first;
        let mut t = t;
        for _ in 0..8 {
            let Some(limit) = self.parameter_at_depth(best.1.depth, x, y) else { break };
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

    /// Where the ray through a pixel's centre has a depth.
    fn parameter_at_depth(&self, depth: f64, x: i32, y: i32) -> Option<f32> {
        let s = &*self.draw.state;
        let [n, f] = s.depth_range;
        let [vx, vy, vw, vh] = s.viewport.map(f64::from);
        let ndc = [2.0 * (f64::from(x) + 0.5 - vx) / vw - 1.0, 2.0 * (f64::from(y) + 0.5 - vy) / vh - 1.0];
        let (origin, dir) = self.camera.world_ray(ndc);
        let clip = matrix(&self.draw.clip_from_object);
        let z = ((depth - n) / (f - n) - 0.5) * 2.0;
        let (o, d) = (origin.extend(1.0), dir.extend(0.0));
        let (a, b, aw, bw) = (clip.row(2).dot(o), clip.row(2).dot(d), clip.row(3).dot(o), clip.row(3).dot(d));
        let t = (z * aw - a) / (b - z * bw);
        let (_, shift) = self.ray(f64::from(x) + 0.5, f64::from(y) + 0.5)?;
        let t = (t - shift) as f32;
        t.is_finite().then_some(t)
    }

    fn beside(&self, t: f32, x: i32, y: i32) -> Option<(usize, Fragment)> {
        const OFF: f64 = 1.0 / 200.0;
        let mut best: Option<(usize, Fragment)> = None;
        for (dx, dy) in [(-OFF, -OFF), (OFF, -OFF), (-OFF, OFF), (OFF, OFF)] {
            let (ray, _) = self.ray(f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy)?;
            self.rays.fetch_add(1, Relaxed);
            let Some(h) = self.world.closest(&ray) else { continue };
            if (h.t - t).abs() > 1e-3 * t.abs() {
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

    fn color(&self, prim: usize, f: &Fragment, per_pixel: bool, reaches: &Visibility) -> [f32; 4] {
        let mesh = &self.draw.geometry.mesh;
        let corners = mesh.indices[prim].map(|i| i as usize);
        if let Shading::Program(program) = &self.draw.shading {
            return program.color(&self.draw.attributes, mesh, prim, f.weights.map(|w| w as f32), f.front, reaches);
        }
        let s = &*self.draw.state;
        let side = usize::from(!f.front && s.lighting && s.two_side);
        let lit = corners.map(|i| match &self.lit {
            _ if per_pixel && s.lighting => Lit::default(),
            Some(all) => all[i],
            None => self.lighting.vertex(&self.draw.attributes, i, mesh.positions[i].to_array()),
        });
        let w = f.weights.map(|w| w as f32);
        let (mut color, secondary) = match s.flat {
            _ if per_pixel && s.lighting => {
                let (eye, normal) = self.eye_point(prim, w);
                let color = if s.flat { self.draw.attributes.colors.at(corners[2]) } else { mixed(corners.map(|i| self.draw.attributes.colors.at(i)), w) };
                let materials = self.draw.attributes.materials_at(corners[2]);
                self.lighting.point(materials, color, eye, normal, !f.front, reaches)
            }
            true => (lit[2].primary[side], lit[2].secondary[side]),
            false => (mixed(lit.map(|l| l.primary[side]), w), mixed(lit.map(|l| l.secondary[side]), w)),
        };
        if let (Some(unit), Some(image)) = (&s.texture, &self.image) {
            let coords = corners.map(|i| {
                texturing::coordinates(unit, s, &self.draw.attributes, &self.lighting, i, mesh.positions[i].to_array())
            });
            color = texturing::apply(unit, image, color, mixed(coords, w));
        }
        for k in 0..3 {
            color[k] = (color[k] + secondary[k]).clamp(0.0, 1.0);
        }
        if let Some(fog) = &s.fog {
            let m = &s.model_view;
            let z = corners.map(|i| [transform(m, mesh.positions[i].to_array())[2].abs()]);
            let d = mixed(z, w)[0];
            let factor = match fog.mode {
                EXP => (-fog.density * d).exp(),
                EXP2 => (-(fog.density * d) * (fog.density * d)).exp(),
                _ => (fog.end - d) / (fog.end - fog.start),
            };
            let factor = if factor.is_nan() { 0.0 } else { factor.clamp(0.0, 1.0) };
            for k in 0..3 {
                color[k] = fog.color[k].clamp(0.0, 1.0) * (1.0 - factor) + color[k] * factor;
            }
        }
        color
    }
}

impl Prepared<'_> {
    /// Eye-space position and shading normal of a fragment.
    fn eye_point(&self, prim: usize, w: [f32; 3]) -> ([f32; 3], [f32; 3]) {
        let mesh = &self.draw.geometry.mesh;
        let corners = mesh.indices[prim].map(|i| i as usize);
        let matrix = match &self.draw.shading {
            Shading::Fixed => &self.draw.state.model_view,
            Shading::Program(program) => &program.view_from_object,
        };
        let eye = corners.map(|i| {
            let v = transform(matrix, mesh.positions[i].to_array());
            [v[0] / v[3], v[1] / v[3], v[2] / v[3]]
        });
        let normal = |i: usize| self.lighting.eye_normal(self.draw.attributes.normals.at(i));
        let normal = if self.draw.state.flat { normal(corners[2]) } else { mixed(corners.map(normal), w) };
        (mixed(eye, w), crate::lighting::normalized(normal))
    }

    /// The colour that the mode gives a fragment.
    fn shaded(&self, prim: usize, f: &Fragment, mode: Mode, around: Option<&Surroundings<'_>>, pixel: (i32, i32)) -> [f32; 4] {
        let per_pixel = matches!(mode, Mode::Phong | Mode::Rich | Mode::Path);
        let lit = match &self.draw.shading {
            Shading::Fixed => self.draw.state.lighting,
            Shading::Program(_) => true,
        };
        let (Some(around), true) = (around, lit) else {
            return self.color(prim, f, per_pixel, &Visibility::FULL);
        };
        // The plane of the triangle, turned to the viewer: what is in front of it is what the eye sees.
        let weights = f.weights.map(|w| w as f32);
        let (eye, _) = self.eye_point(prim, weights);
        let at = |w| vector(self.eye_point(prim, w).0);
        let [a, b, c] = [at([1.0, 0.0, 0.0]), at([0.0, 1.0, 0.0]), at([0.0, 0.0, 1.0])];
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let clip = matrix(&self.draw.state.projection);
        let parallel = matches!(self.draw.shading, Shading::Fixed) && clip.row(3).truncate() == DVec3::ZERO;
        let towards = if parallel { DVec3::Z } else { -vector(eye) };
        let normal = if normal.dot(towards) < 0.0 { -normal } else { normal };
        let reaches = around.at(vector(eye), normal, &self.places, pixel);
        if mode != Mode::Enhance {
            // Lights at the eye cast no shadow that it could see; corners dim them all the same.
            let mut r = reaches;
            r.lights.iter_mut().for_each(|l| *l *= 0.5 + 0.5 * reaches.ambient);
            return self.color(prim, f, per_pixel, &r);
        }
        let color = self.color(prim, f, per_pixel, &Visibility::FULL);
        let n = self.places.len().clamp(1, crate::effects::MOST_LIGHTS);
        let light = reaches.lights[..n].iter().sum::<f32>() / n as f32;
        let dim = (0.4 + 0.6 * light) * (0.3 + 0.7 * reaches.ambient);
        [color[0] * dim, color[1] * dim, color[2] * dim, color[3]]
    }
}

/// Culled and fill-rule rejected triangles that a ray may pass through before it is given up.
const MOST_STEPS: usize = 4096;

pub(crate) fn mixed<const N: usize>(v: [[f32; N]; 3], w: [f32; 3]) -> [f32; N] {
    std::array::from_fn(|k| v[0][k] * w[0] + v[1][k] * w[1] + v[2][k] * w[2])
}

fn to_bytes(c: [f32; 4]) -> [u8; 4] {
    c.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// Window coordinates of a corner in units of 1/256 pixel, as the driver's rasterizer takes them.
fn snapped(c: &[f32; 4], viewport: [i32; 4]) -> [i64; 2] {
    let [vx, vy, vw, vh] = viewport.map(|v| v as f32);
    let inverse = 1.0 / c[3];
    let x = c[0] * inverse * (0.5 * vw) + (0.5 * vw + vx);
    let y = c[1] * inverse * (0.5 * vh) + (0.5 * vh + vy);
    [x, y].map(|v| (f64::from(v) * 256.0).round().clamp(-1e12, 1e12) as i64)
}

/// Whether the triangle covers the pixel's centre. A centre on an edge belongs to the triangle above or to the right of it.
fn covers(c: &[[f32; 4]; 3], viewport: [i32; 4], x: i32, y: i32) -> bool {
    let p = c.each_ref().map(|v| snapped(v, viewport));
    let (cx, cy) = (i64::from(x) * 256 + 128, i64::from(y) * 256 + 128);
    let edge = |a: [i64; 2], b: [i64; 2], x: i64, y: i64| {
        i128::from(b[0] - a[0]) * i128::from(y - a[1]) - i128::from(b[1] - a[1]) * i128::from(x - a[0])
    };
    let area = edge(p[0], p[1], p[2][0], p[2][1]);
    if area == 0 {
        return false;
    }
    let p = if area > 0 { p } else { [p[0], p[2], p[1]] };
    (0..3).all(|i| {
        let (a, b) = (p[i], p[(i + 1) % 3]);
        let e = edge(a, b, cx, cy);
        // Counter-clockwise: an edge that goes down has the triangle on its right side in x, one that goes right has it above.
        let inclusive = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
        e > 0 || (e == 0 && inclusive)
    })
}

/// The greater of |dz/dx| and |dz/dy| in window coordinates, for polygon offset.
fn steepness(c: &[[f32; 4]; 3], viewport: [i32; 4], depth_scale: f64) -> f64 {
    let w = c.map(|v| {
        let i = 1.0 / f64::from(v[3]);
        let half = |size: i32| f64::from(size) * 0.5;
        [
            f64::from(v[0]) * i * half(viewport[2]),
            f64::from(v[1]) * i * half(viewport[3]),
            f64::from(v[2]) * i * 0.5 * depth_scale,
        ]
    });
    let d = |a: usize, k: usize| w[a][k] - w[0][k];
    let det = d(1, 0) * d(2, 1) - d(2, 0) * d(1, 1);
    if det == 0.0 {
        return 0.0;
    }
    let dx = (d(1, 2) * d(2, 1) - d(2, 2) * d(1, 1)) / det;
    let dy = (d(2, 2) * d(1, 0) - d(1, 2) * d(2, 0)) / det;
    dx.abs().max(dy.abs())
}

/// The pixels that a draw may cover: its box on the screen within viewport and scissor.
fn screen_bounds(draw: &Draw, clip: DMat4) -> Rect {
    let s = &*draw.state;
    let [x, y, w, h] = s.viewport;
    let mut rect = Rect { x, y, w, h };
    if let Some([x, y, w, h]) = s.scissor {
        rect = rect.and(Rect { x, y, w, h });
    }
    let b = draw.geometry.bounds();
    if b.is_empty() {
        return Rect::default();
    }
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in 0..8 {
        let pick = |bit: i32, k: usize| if corner & bit == 0 { b.min[k] } else { b.max[k] };
        let p = DVec3::new(f64::from(pick(1, 0)), f64::from(pick(2, 1)), f64::from(pick(4, 2)));
        let c = clip * p.extend(1.0);
        if c.w <= 0.0 || !c.is_finite() {
            return rect;
        }
        for k in 0..2 {
            lo[k] = lo[k].min(c[k] / c.w);
            hi[k] = hi[k].max(c[k] / c.w);
        }
    }
    let pixel = |ndc: f64, at: i32, size: i32| {
        (f64::from(at) + (ndc + 1.0) * 0.5 * f64::from(size)).clamp(-1e9, 1e9)
    };
    let (x0, y0) = (pixel(lo[0], x, w).floor() as i32 - 1, pixel(lo[1], y, h).floor() as i32 - 1);
    let (x1, y1) = (pixel(hi[0], x, w).ceil() as i32 + 1, pixel(hi[1], y, h).ceil() as i32 + 1);
    rect.and(Rect { x: x0, y: y0, w: x1.saturating_sub(x0), h: y1.saturating_sub(y0) })
}

/// The hits of a tile's rays: pixel (x, y) of the tile is lane `x % 4 + 4 (y % 4)` of block `x / 4 + 4 (y / 4)`.
struct TileRays {
    blocks: Vec<RayBlock>,
    hits: Vec<HitBlock>,
}

impl TileRays {
    fn new() -> TileRays {
        TileRays { blocks: vec![RayBlock::INACTIVE; 16], hits: vec![HitBlock::MISS; 16] }
    }

    /// Sends rays through the pixels of `area`, which lies in the tile at (`x`, `y`).
    fn send(&mut self, p: &Prepared<'_>, area: Rect) {
        self.blocks.fill(RayBlock::INACTIVE);
        let mut sent = 0;
        for y in 0..area.h {
            for x in 0..area.w {
                let center = |a: i32, d: i32| f64::from(a + d) + 0.5;
                if let Some((ray, _)) = p.ray(center(area.x, x), center(area.y, y)) {
                    let (b, l) = slot(x, y);
                    self.blocks[b].set(l, &ray);
                    sent += 1;
                }
            }
        }
        self.hits.fill(HitBlock::MISS);
        p.world.closest_coherent(&self.blocks, &mut self.hits);
        p.rays.fetch_add(sent, Relaxed);
    }
}

fn slot(x: i32, y: i32) -> (usize, usize) {
    ((x / 4 + 4 * (y / 4)) as usize, (x % 4 + 4 * (y % 4)) as usize)
}

/// The nearest fragment of all draws at every pixel.
pub(crate) fn nearest(draws: &[Prepared<'_>], settings: &Settings) -> (Layer, [u64; 2]) {
    let around = Surroundings::new(draws, settings);
    let mode = settings.mode;
    let rect = draws.iter().fold(Rect::default(), |r, d| r.or(d.rect));
    let (w, h) = (rect.w.max(0) as usize, rect.h.max(0) as usize);
    let mut layer = Layer { rect, color: vec![[0; 4]; w * h], depth: vec![UNCOVERED; w * h], covered: 0 };
    if w * h == 0 {
        return (layer, [0; 2]);
    }
    let band = w * TILE as usize;
    let covered = AtomicU64::new(0);
    let bands = layer.color.par_chunks_mut(band).zip(layer.depth.par_chunks_mut(band)).enumerate();
    bands.for_each_init(TileRays::new, |rays, (i, (color, depth))| {
        let y = rect.y + i as i32 * TILE;
        let area = Rect { x: rect.x, y, w: rect.w, h: (color.len() / w) as i32 };
        let mut seen = vec![NOTHING; color.len()];
        for (d, p) in draws.iter().enumerate() {
            see(p, d as u32, area, rays, &mut seen);
        }
        let mut n = 0;
        for (k, s) in seen.iter().enumerate().filter(|(_, s)| s.draw != u32::MAX) {
            let (px, py) = (rect.x + (k % w) as i32, y + (k / w) as i32);
            let p = &draws[s.draw as usize];
            if let Some(f) = p.fragment(s.prim as usize, px, py) {
                color[k] = to_bytes(p.shaded(s.prim as usize, &f, mode, around.as_ref(), (px, py)));
                depth[k] = s.depth;
                n += 1;
            }
        }
        covered.fetch_add(n, Relaxed);
    });
    layer.covered = covered.into_inner() as usize;
    let extra = around.map_or([0; 2], |a| [a.shadow_rays.into_inner(), a.occlusion_rays.into_inner()]);
    (layer, extra)
}

/// One draw against what was seen so far.
fn see(p: &Prepared<'_>, index: u32, area: Rect, rays: &mut TileRays, seen: &mut [Seen]) {
    let part = area.and(p.rect);
    if part.is_empty() {
        return;
    }
    let later_wins_ties = p.draw.state.depth_func == LEQUAL;
    for x in (part.x..part.x + part.w).step_by(TILE as usize) {
        let tile = Rect { x, y: part.y, w: TILE.min(part.x + part.w - x), h: part.h };
        rays.send(p, tile);
        for y in 0..tile.h {
            for x in 0..tile.w {
                let (b, l) = slot(x, y);
                let Some(hit) = rays.hits[b].get(l) else { continue };
                let (px, py) = (tile.x + x, tile.y + y);
                let Some((prim, f)) = p.resolve(rays.blocks[b].get(l), Some(hit), px, py) else { continue };
                let at = &mut seen[((py - area.y) * area.w + px - area.x) as usize];
                let bits = (f.depth * DEPTH_STEPS).round() as u32;
                if bits < at.depth_bits || (later_wins_ties && bits == at.depth_bits) {
                    *at = Seen { depth_bits: bits, depth: f.depth as f32, draw: index, prim: prim as u32 };
                }
            }
        }
    }
}

/// Every fragment of one draw, as layers: the n-th layer has the n-th fragment of each pixel in the order of the triangles.
pub(crate) fn in_order(p: &Prepared<'_>) -> Vec<Layer> {
    let rect = p.rect;
    let (w, h) = (rect.w.max(0) as usize, rect.h.max(0) as usize);
    let fragments: Vec<Vec<(u32, [u8; 4], f32)>> = (0..w * h)
        .into_par_iter()
        .map(|k| {
            let (x, y) = (rect.x + (k % w) as i32, rect.y + (k / w) as i32);
            let mut found: Vec<(u32, [u8; 4], f32)> = Vec::new();
            let mut keep = |prim: usize| {
                if found.iter().all(|(o, ..)| *o != prim as u32)
                    && let Some(f) = p.fragment(prim, x, y)
                {
                    found.push((prim as u32, to_bytes(p.color(prim, &f, false, &Visibility::FULL)), f.depth as f32));
                }
            };
            const OFF: f64 = 1.0 / 200.0;
            // The centre, and beside it for edges that go through it.
            for (dx, dy) in [(0.0, 0.0), (-OFF, -OFF), (OFF, OFF), (OFF, -OFF), (-OFF, OFF)] {
                let Some((mut ray, _)) = p.ray(f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy) else { continue };
                for _ in 0..MOST_STEPS {
                    p.rays.fetch_add(1, Relaxed);
                    let Some(hit) = p.world.closest(&ray) else { break };
                    keep(hit.prim as usize);
                    ray.t_min = hit.t.next_up();
                }
            }
            found.sort_unstable_by_key(|f| f.0);
            found
        })
        .collect();
    let layers = fragments.iter().map(Vec::len).max().unwrap_or(0);
    (0..layers)
        .map(|n| {
            let mut layer = Layer { rect, color: vec![[0; 4]; w * h], depth: vec![UNCOVERED; w * h], covered: 0 };
            for (k, f) in fragments.iter().enumerate() {
                if let Some((_, c, d)) = f.get(n) {
                    (layer.color[k], layer.depth[k]) = (*c, *d);
                    layer.covered += 1;
                }
            }
            layer
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_of_a_square_cover_each_pixel_once_and_the_far_edges_not_at_all() {
        let viewport = [0, 0, 4, 4];
        // Corners on pixel centres: (0.5, 0.5) to (2.5, 2.5) of a 4 x 4 window.
        let at = |x: f32, y: f32| [x / 2.0 - 1.0, y / 2.0 - 1.0, 0.0, 1.0];
        let [a, b, c, d] = [at(0.5, 0.5), at(2.5, 0.5), at(2.5, 2.5), at(0.5, 2.5)];
        for (first, second) in [([a, b, c], [a, c, d]), ([c, b, a], [d, a, c])] {
            for y in 0..4 {
                for x in 0..4 {
                    let n = u32::from(covers(&first, viewport, x, y)) + u32::from(covers(&second, viewport, x, y));
                    assert_eq!(n, u32::from(x < 2 && y < 2), "pixel ({x}, {y})");
                }
            }
        }
    }

    #[test]
    fn steepness_is_that_of_the_plane() {
        let viewport = [0, 0, 100, 50];
        // z_window rises by 0.1 per 50 pixels in x, falls by 0.4 per 25 in y.
        let c = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.2, 1.0], [0.0, 1.0, -0.8, 1.0]];
        assert!((steepness(&c, viewport, 1.0) - 0.4 / 25.0).abs() < 1e-9);
    }
}
