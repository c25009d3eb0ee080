//! Shared by the shape tests: a small deterministic generator, and the closest hit found by trying
//! every primitive.
#![allow(dead_code, reason = "each test binary uses its own part")]

use glam::Vec3;
use rt_core::math::SplitMix64;
use rt_core::ray::Ray;
use rt_core::shapes::{Shape, ShapeHit};

/// [`SplitMix64`] in single precision.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Random(SplitMix64::new(seed))
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        self.0.unit_f32()
    }

    /// Uniform in lo..hi.
    pub(crate) fn range(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.unit()
    }

    /// Uniform in a cube of -1..1.
    pub(crate) fn cube(&mut self) -> Vec3 {
        Vec3::new(self.range(-1.0, 1.0), self.range(-1.0, 1.0), self.range(-1.0, 1.0))
    }

    /// Uniform on the unit sphere.
    pub(crate) fn unit_vector(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            let n = v.length();
            if n > 0.01 && n <= 1.0 {
                return v / n;
            }
        }
    }
}

/// The closest hit over all primitives whose bounds are not empty and are hit by the ray. Ties go
/// to the lower primitive.
pub(crate) fn closest(shape: &dyn Shape, ray: &Ray) -> Option<(u32, ShapeHit)> {
    let mut best: Option<(u32, ShapeHit)> = None;
    for prim in 0..shape.num_primitives() as u32 {
        let b = shape.bounds(prim);
        if b.is_empty() || !meets_box(ray, b.min, b.max) {
            continue;
        }
        let t_max = best.map_or(ray.t_max, |(_, h)| h.t);
        if let Some(h) = shape.closest(prim, &Ray { t_max, ..*ray }) {
            best = Some((prim, h));
        }
    }
    best
}

/// Slab test in f64.
fn meets_box(ray: &Ray, min: Vec3, max: Vec3) -> bool {
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
    for a in 0..3 {
        let (lo, hi) = (f64::from(min[a]) - o[a], f64::from(max[a]) - o[a]);
        if d[a] == 0.0 {
            if lo > 0.0 || hi < 0.0 {
                return false;
            }
        } else {
            let (x, y) = (lo / d[a], hi / d[a]);
            near = near.max(x.min(y));
            far = far.min(x.max(y));
        }
    }
    near <= far
}
