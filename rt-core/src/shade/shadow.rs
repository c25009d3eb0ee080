//! Which light rays arrive. Opaque instances end a ray: the any-hit kernels say whether one is in the way. Only what is left of the rays is
//! taken through the instances that may let light through, layer by layer.

use super::microfacet::fresnel_dielectric;
use super::stage::Stage;
use super::wave::{Answers, LightRays, Passage};
use crate::accel::{Among, Coherence};
use crate::effects::Effects;
use crate::material::{Material, SurfaceModel};
use crate::ray::{HitBlock, LANES, Ray};
use crate::ray_stats::RayStats;
use crate::surface::{SurfacePoint, length};
use glam::Vec3;

/// Rays traced and rays that met something.
#[derive(Default, Clone, Copy)]
pub(crate) struct Blocking {
    pub(crate) rays: u64,
    pub(crate) blocked: u64,
    /// See [`crate::ray_stats::RayStats::light_closest`].
    pub(crate) closest: u64,
    /// See [`crate::ray_stats::RayStats::light_lookups`].
    pub(crate) lookups: u64,
}

impl Blocking {
    /// Adds what is counted for rays of all kinds together.
    pub(crate) fn add_to(&self, stats: &mut RayStats) {
        stats.light_closest += self.closest;
        stats.light_lookups += self.lookups;
    }
}

/// Calls `arrived(point, radiance)` for what reaches its point of each light ray, in order.
pub(crate) fn trace_light_rays(
    stage: &Stage<'_>,
    rays: &mut LightRays,
    coherence: Coherence,
    mut arrived: impl FnMut(u32, Vec3),
) -> Blocking {
    let mut counts = Blocking { rays: rays.targets.len() as u64, ..Blocking::default() };
    if rays.targets.is_empty() {
        return counts;
    }
    match &mut rays.answers {
        Answers::World => {}
        Answers::Recording(_) => {
            rays.record();
            return Blocking::default();
        }
        Answers::Given(given) => {
            for (&(point, radiance), p) in rays.targets.iter().zip(given) {
                counts.rays += p.continued as u64;
                counts.blocked += p.met as u64;
                if p.left != Vec3::ZERO {
                    arrived(point, radiance * p.left);
                }
            }
            return counts;
        }
    }
    let world = &stage.scene.world;
    rays.blocked.clear();
    rays.blocked.resize(rays.blocks.len(), 0);
    if !stage.light_passes_surfaces() {
        world.occluded_stream(&rays.blocks, &mut rays.blocked, coherence, Among::All);
        for (i, &(point, radiance)) in rays.targets.iter().enumerate() {
            if rays.is_blocked(i) {
                counts.blocked += 1;
            } else {
                arrived(point, radiance);
            }
        }
        return counts;
    }

    // ---- Anything opaque ends a ray, wherever it is.
    let marks = stage.see_through.as_slice();
    let mut followed: Vec<_> = rays.targets.iter().map(|(_, light)| Following::new(stage, *light)).collect();
    let mut open = rays.targets.len();
    if marks.contains(&false) {
        let opaque = Among::Unmarked(marks);
        world.occluded_stream(&rays.blocks, &mut rays.blocked, coherence, opaque);
        for i in 0..rays.targets.len() {
            if rays.is_blocked(i) {
                followed[i] = Following::BLOCKED;
                rays.blocks[i / LANES].t_max[i % LANES] = -1.0;
                open -= 1;
            }
        }
    }

    // ---- The others through their layers; transmittance is a product, so only the set of layers matters.
    while open > 0 {
        counts.closest += open as u64;
        rays.hits.clear();
        rays.hits.resize(rays.blocks.len(), HitBlock::MISS);
        world.closest_stream(&rays.blocks, &mut rays.hits, coherence, Among::Marked(marks));
        open = 0;
        for i in 0..rays.targets.len() {
            let (block, lane) = (&mut rays.blocks[i / LANES], i % LANES);
            if block.t_max[lane] < block.t_min[lane] {
                continue;
            }
            let ray = block.get(lane);
            let behind = rays.hits[i / LANES].get(lane).and_then(|hit| {
                counts.lookups += 1;
                let placed = stage.placed(&hit);
                followed[i].pass(stage, placed.material, &placed.surface(&ray, &hit), &ray, hit.t)
            });
            match behind {
                Some(t_min) => {
                    block.t_min[lane] = t_min;
                    open += 1;
                }
                None => block.t_max[lane] = -1.0,
            }
        }
        counts.rays += open as u64;
    }
    for (&(point, radiance), f) in rays.targets.iter().zip(&followed) {
        let p = f.passage();
        counts.blocked += p.met as u64;
        if p.left != Vec3::ZERO {
            arrived(point, radiance * p.left);
        }
    }
    counts
}

/// A light ray on its way through layers; transmittance is a product, so only the set of layers matters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Following {
    left: Vec3,
    /// Optical depth inside dielectrics.
    depth: Vec3,
    met: bool,
    continued: u32,
    /// What is not more than this is no longer followed.
    least: f32,
}

impl Following {
    /// A ray that brings `radiance` if nothing is in its way. Missing may be less than the options'
    /// smallest contribution, both as a share of it and as radiance; paths, whose mean must be
    /// right, are followed until nothing is left.
    pub(crate) fn new(stage: &Stage<'_>, radiance: Vec3) -> Following {
        let exact = stage.effects.contains(Effects::PATH_TRACING);
        let least =
            if exact { 0.0 } else { stage.options.min_contribution / radiance.max_element().max(1.0) };
        Following { left: Vec3::ONE, depth: Vec3::ZERO, met: false, continued: 0, least }
    }

    /// Something opaque is in its way.
    pub(crate) const BLOCKED: Following =
        Following { left: Vec3::ZERO, depth: Vec3::ZERO, met: true, continued: 0, least: 0.0 };

    /// Meets a surface at `t`; returns from where `ray` goes on, if it does.
    pub(crate) fn pass(
        &mut self,
        stage: &Stage<'_>,
        material: &Material,
        surface: &SurfacePoint,
        ray: &Ray,
        t: f32,
    ) -> Option<f32> {
        self.met = true;
        let behind = pass(stage, material, surface, ray, t, &mut self.left, &mut self.depth);
        let goes_on = self.left.max_element() > self.least && behind < ray.t_max;
        self.continued += goes_on as u32;
        goes_on.then_some(behind)
    }

    /// What has become of it.
    pub(crate) fn passage(&self) -> Passage {
        let Following { left, depth, met, continued, least } = *self;
        let followed = left.max_element() > least;
        let left = if followed { left * (-depth.max(Vec3::ZERO)).exp() } else { Vec3::ZERO };
        Passage { left, met, continued }
    }
}

/// Light through `surface`, met at `t`: multiplies `left`, adds to the optical `depth`, and returns where the ray goes on. Light is
/// taken straight through dielectrics (no caustics): Fresnel loss at each interface and absorption in between.
fn pass(
    stage: &Stage<'_>,
    material: &Material,
    surface: &SurfacePoint,
    ray: &Ray,
    t: f32,
    left: &mut Vec3,
    depth: &mut Vec3,
) -> f32 {
    match material.model {
        SurfaceModel::Dielectric { ior, absorption } if stage.effects.contains(Effects::REFRACTION) => {
            let length = length(ray.dir);
            let cos = surface.face_normal.dot(ray.dir).abs() / length;
            let eta = if surface.outside { 1.0 / ior } else { ior };
            let reflected =
                if stage.effects.contains(Effects::REFLECTION) { fresnel_dielectric(cos, eta) } else { 0.0 };
            *left *= surface.color * (1.0 - reflected);
            // The way inside is where it leaves minus where it enters.
            let sign = if surface.outside { -1.0 } else { 1.0 };
            *depth += Vec3::from(absorption) * (sign * t * length);
        }
        _ if stage.effects.contains(Effects::TRANSPARENCY) => *left *= 1.0 - surface.opacity,
        _ => *left = Vec3::ZERO,
    }
    surface.t_behind(ray, t)
}

#[cfg(test)]
mod tests;
