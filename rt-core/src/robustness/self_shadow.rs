//! Counts secondary rays that hit the surface from which they start.

use super::batch_numbers;
use crate::math::{SplitMix64, orthonormal_basis};
use crate::ray::Ray;
use crate::scene::Scene;
use crate::surface::ResolvedInstance;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Counts of a self-shadow test.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SelfShadowCount {
    /// Camera rays that hit, which is also the number of secondary rays traced.
    pub rays: u64,
    /// Secondary rays that were blocked. On a convex surface, all of these are errors.
    pub blocked: u64,
}

/// A test of the first instance of a scene, which must be a convex closed surface. Cameras around
/// it find visible points. From each point a ray is traced outwards (cosine-distributed about the
/// face normal), with the same start as in shading. A ray that leaves a convex surface never hits
/// it again.
#[derive(Clone, Copy)]
pub struct SelfShadowTest<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Distance of the cameras from the surface's centre, in radii; above 1.
    pub camera_radii: f32,
    /// Seed of the rays: the same seed gives the same rays on any number of threads.
    pub seed: u64,
}

const BATCH: usize = 4096;

impl SelfShadowTest<'_> {
    /// Traces `rays` camera rays (rounded up to a multiple of 4096).
    pub fn count(&self, rays: usize) -> SelfShadowCount {
        (0..rays.div_ceil(BATCH)).into_par_iter().map(|b| self.count_batch(b as u64)).reduce(
            SelfShadowCount::default,
            |a, b| SelfShadowCount { rays: a.rays + b.rays, blocked: a.blocked + b.blocked },
        )
    }

    fn count_batch(&self, batch: u64) -> SelfShadowCount {
        let world = &self.scene.world;
        let mut count = SelfShadowCount::default();
        if world.instances().is_empty() || world.bounds().is_empty() {
            return count;
        }
        let mut random = batch_numbers(self.seed, batch);
        let resolved = ResolvedInstance::new(self.scene, 0);
        let (center, radius) = (world.bounds().center().as_dvec3(), world.bounds().radius() as f64);
        for _ in 0..BATCH {
            let eye = (center + random.direction() * radius * self.camera_radii as f64).as_vec3();
            let target = (center + random.direction() * radius * 0.6 * random.unit()).as_vec3();
            let ray = Ray::new(eye, (target - eye).normalize_or_zero());
            let Some(hit) = world.closest(&ray).filter(|h| h.instance == 0) else { continue };
            let s = resolved.surface(&ray, &hit);
            let dir = cosine_direction(s.face_normal, &mut random);
            count.rays += 1;
            count.blocked += world.occluded(&Ray::new(s.ray_origin(dir), dir)) as u64;
        }
        count
    }
}

/// A random direction in the half space of `n`, with a density proportional to the cosine.
fn cosine_direction(n: Vec3, random: &mut SplitMix64) -> Vec3 {
    let (t, b) = orthonormal_basis(n);
    let (r2, phi) = (random.unit(), std::f64::consts::TAU * random.unit());
    let d = DVec3::new(r2.sqrt() * phi.cos(), r2.sqrt() * phi.sin(), (1.0 - r2).sqrt()).as_vec3();
    t * d.x + b * d.y + n * d.z
}
