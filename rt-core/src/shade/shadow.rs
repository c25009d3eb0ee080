//! Decides which light rays arrive. Opaque instances end a ray: the any-hit kernels test whether
//! one blocks it. Only the remaining rays are traced through the transmissive instances, layer by
//! layer.

use super::frame_context::FrameContext;
use super::microfacet::fresnel_dielectric;
use super::wavefront::{LightRayResult, LightRays, OcclusionSource};
use crate::bvh::{Coherence, InstanceFilter};
use crate::effects::Effects;
use crate::material::{Material, SurfaceModel};
use crate::math::length;
use crate::ray::{HitBlock, LANES, Ray};
use crate::ray_stats::RayStats;
use crate::surface::SurfacePoint;
use glam::Vec3;

/// Number of rays traced and of rays that hit something.
#[derive(Default, Clone, Copy)]
pub(crate) struct LightRayCounts {
    pub(crate) rays: u64,
    pub(crate) blocked: u64,
    /// See [`crate::ray_stats::RayStats::light_closest`].
    pub(crate) closest: u64,
    /// See [`crate::ray_stats::RayStats::light_lookups`].
    pub(crate) lookups: u64,
}

impl LightRayCounts {
    /// Adds the counters that all kinds of rays share.
    pub(crate) fn add_to(&self, stats: &mut RayStats) {
        stats.light_closest += self.closest;
        stats.light_lookups += self.lookups;
    }
}

/// Finds which of the light rays in blocks are blocked, in frames where light does not pass
/// surfaces.
pub(crate) fn trace_blocks(
    context: &FrameContext<'_>,
    rays: &mut LightRays,
    coherence: Coherence,
) -> LightRayCounts {
    rays.blocked.clear();
    rays.blocked.resize(rays.blocks.len(), 0);
    let world = &context.scene.world;
    world.occluded_stream(&rays.blocks, &mut rays.blocked, coherence, InstanceFilter::All);
    LightRayCounts::default()
}

/// Calls `arrived(point, radiance)` for the light that reaches the point of each light ray, in
/// order.
pub(crate) fn trace_light_rays(
    context: &FrameContext<'_>,
    rays: &mut LightRays,
    coherence: Coherence,
    mut arrived: impl FnMut(u32, Vec3),
) -> LightRayCounts {
    let mut counts =
        LightRayCounts { rays: rays.targets.len() as u64, ..LightRayCounts::default() };
    if rays.targets.is_empty() {
        return counts;
    }
    match &mut rays.source {
        OcclusionSource::World => {}
        OcclusionSource::Recording(_) => {
            rays.record();
            return LightRayCounts::default();
        }
        OcclusionSource::Given(given) => {
            for (&(point, radiance), p) in rays.targets.iter().zip(given) {
                counts.rays += p.continued as u64;
                counts.blocked += p.hit as u64;
                if p.transmittance != Vec3::ZERO {
                    arrived(point, radiance * p.transmittance);
                }
            }
            return counts;
        }
    }
    let world = &context.scene.world;
    rays.blocked.clear();
    rays.blocked.resize(rays.blocks.len(), 0);
    if !context.light_passes_surfaces() {
        world.occluded_stream(&rays.blocks, &mut rays.blocked, coherence, InstanceFilter::All);
        for (i, &(point, radiance)) in rays.targets.iter().enumerate() {
            if rays.is_blocked(i) {
                counts.blocked += 1;
            } else {
                arrived(point, radiance);
            }
        }
        return counts;
    }

    // ---- Any opaque surface along a ray ends it.
    let marks = context.transmissive.as_slice();
    let mut states: Vec<_> =
        rays.targets.iter().map(|(_, light)| LightRayState::new(context, *light)).collect();
    let mut open = rays.targets.len();
    if marks.contains(&false) {
        let opaque = InstanceFilter::Unmarked(marks);
        world.occluded_stream(&rays.blocks, &mut rays.blocked, coherence, opaque);
        for i in 0..rays.targets.len() {
            if rays.is_blocked(i) {
                states[i] = LightRayState::BLOCKED;
                rays.blocks[i / LANES].t_max[i % LANES] = -1.0;
                open -= 1;
            }
        }
    }

    // ---- The others through their layers; transmittance is a product, so only the set of layers
    // matters.
    while open > 0 {
        counts.closest += open as u64;
        rays.hits.clear();
        rays.hits.resize(rays.blocks.len(), HitBlock::MISS);
        world.closest_stream(
            &rays.blocks,
            &mut rays.hits,
            coherence,
            InstanceFilter::Marked(marks),
        );
        open = 0;
        for i in 0..rays.targets.len() {
            let (block, lane) = (&mut rays.blocks[i / LANES], i % LANES);
            if block.t_max[lane] < block.t_min[lane] {
                continue;
            }
            let ray = block.get(lane);
            let behind = rays.hits[i / LANES].get(lane).and_then(|hit| {
                counts.lookups += 1;
                let resolved = context.instance_at(&hit);
                states[i].pass(
                    context,
                    resolved.material,
                    &resolved.surface(&ray, &hit),
                    &ray,
                    hit.t,
                )
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
    for (&(point, radiance), f) in rays.targets.iter().zip(&states) {
        let p = f.result();
        counts.blocked += p.hit as u64;
        if p.transmittance != Vec3::ZERO {
            arrived(point, radiance * p.transmittance);
        }
    }
    counts
}

/// A light ray through layers; transmittance is a product, so only the set of layers matters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightRayState {
    transmittance: Vec3,
    /// Optical depth inside dielectrics.
    optical_depth: Vec3,
    hit: bool,
    continued: u32,
    /// A transmittance up to this is no longer followed.
    cutoff: f32,
}

impl LightRayState {
    /// A ray that contributes `radiance` if unblocked. The light left out may be less than the
    /// options' smallest contribution, both as a share of it and as radiance. Paths, whose mean
    /// must be correct, are followed until nothing is left.
    pub(crate) fn new(context: &FrameContext<'_>, radiance: Vec3) -> LightRayState {
        let exact = context.effects.contains(Effects::PATH_TRACING);
        let cutoff = if exact {
            0.0
        } else {
            context.options.min_contribution / radiance.max_element().max(1.0)
        };
        LightRayState {
            transmittance: Vec3::ONE,
            optical_depth: Vec3::ZERO,
            hit: false,
            continued: 0,
            cutoff,
        }
    }

    /// An opaque surface blocks the ray.
    pub(crate) const BLOCKED: LightRayState = LightRayState {
        transmittance: Vec3::ZERO,
        optical_depth: Vec3::ZERO,
        hit: true,
        continued: 0,
        cutoff: 0.0,
    };

    /// Passes through a surface at `t`; returns the parameter at which `ray` continues, if it does.
    pub(crate) fn pass(
        &mut self,
        context: &FrameContext<'_>,
        material: &Material,
        surface: &SurfacePoint,
        ray: &Ray,
        t: f32,
    ) -> Option<f32> {
        self.hit = true;
        let behind = pass(
            context,
            material,
            surface,
            ray,
            t,
            &mut self.transmittance,
            &mut self.optical_depth,
        );
        let goes_on = self.transmittance.max_element() > self.cutoff && behind < ray.t_max;
        self.continued += goes_on as u32;
        goes_on.then_some(behind)
    }

    /// The result of the ray.
    pub(crate) fn result(&self) -> LightRayResult {
        let LightRayState { transmittance, optical_depth, hit, continued, cutoff } = *self;
        let followed = transmittance.max_element() > cutoff;
        let transmittance = if followed {
            transmittance * (-optical_depth.max(Vec3::ZERO)).exp()
        } else {
            Vec3::ZERO
        };
        LightRayResult { transmittance, hit, continued }
    }
}

/// Light through `surface`, hit at `t`: multiplies `transmittance`, adds to the `optical_depth`,
/// and returns the parameter at which the ray continues. Light passes straight through dielectrics
/// (no caustics), with Fresnel loss at each interface and absorption in between.
fn pass(
    context: &FrameContext<'_>,
    material: &Material,
    surface: &SurfacePoint,
    ray: &Ray,
    t: f32,
    transmittance: &mut Vec3,
    optical_depth: &mut Vec3,
) -> f32 {
    match material.model {
        SurfaceModel::Dielectric { ior, absorption }
            if context.effects.contains(Effects::REFRACTION) =>
        {
            let length = length(ray.dir);
            let cos = surface.face_normal.dot(ray.dir).abs() / length;
            let eta = if surface.outside { 1.0 / ior } else { ior };
            let reflected = if context.effects.contains(Effects::REFLECTION) {
                fresnel_dielectric(cos, eta)
            } else {
                0.0
            };
            *transmittance *= surface.color * (1.0 - reflected);
            // The length inside is the exit parameter minus the entry parameter.
            let sign = if surface.outside { -1.0 } else { 1.0 };
            *optical_depth += Vec3::from(absorption) * (sign * t * length);
        }
        _ if context.effects.contains(Effects::TRANSPARENCY) => {
            *transmittance *= 1.0 - surface.opacity
        }
        _ => *transmittance = Vec3::ZERO,
    }
    surface.t_behind(ray, t)
}

#[cfg(test)]
mod tests;
