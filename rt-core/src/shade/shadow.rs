//! Which light rays arrive: hard blocking by the any-hit kernels, or what opacity and glass leave of the light.

use super::microfacet::fresnel_dielectric;
use super::stage::Stage;
use super::wave::LightRays;
use crate::effects::Effects;
use crate::material::SurfaceModel;
use crate::ray::{Hit, HitBlock, LANES, Ray};
use crate::surface::length;
use glam::Vec3;

/// Rays traced and rays that met something.
#[derive(Default, Clone, Copy)]
pub(crate) struct Blocking {
    pub(crate) rays: u64,
    pub(crate) blocked: u64,
}

/// How alike the rays of a batch are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coherence {
    /// To one light.
    Alike,
    /// Over a hemisphere.
    Scattered,
}

/// Below this, what is left of a light ray is no longer followed through further layers: a quarter of an 8-bit step of full white.
const DARK: f32 = 1.0 / 1024.0;

/// Calls `arrived(point, radiance)` for what reaches its point of each light ray, in order.
pub(crate) fn trace_light_rays(
    stage: &Stage<'_>,
    rays: &mut LightRays,
    coherence: Coherence,
    mut arrived: impl FnMut(u32, Vec3),
) -> Blocking {
    let mut counts = Blocking { rays: rays.targets.len() as u64, blocked: 0 };
    if rays.targets.is_empty() {
        return counts;
    }
    let world = &stage.scene.world;
    if !stage.light_passes_surfaces() {
        rays.blocked.clear();
        rays.blocked.resize(rays.blocks.len(), 0);
        match coherence {
            Coherence::Alike => world.occluded_coherent(&rays.blocks, &mut rays.blocked),
            Coherence::Scattered => world.occluded_incoherent(&rays.blocks, &mut rays.blocked),
        }
        for (i, &(point, radiance)) in rays.targets.iter().enumerate() {
            if rays.is_blocked(i) {
                counts.blocked += 1;
            } else {
                arrived(point, radiance);
            }
        }
        return counts;
    }

    // Follow each ray through its layers; transmittance is a product, so only the set of layers matters.
    let mut transmittance = vec![(Vec3::ONE, Vec3::ZERO); rays.targets.len()];
    let mut open = rays.targets.len();
    let mut met = vec![false; rays.targets.len()];
    while open > 0 {
        rays.hits.clear();
        rays.hits.resize(rays.blocks.len(), HitBlock::MISS);
        match coherence {
            Coherence::Alike => world.closest_coherent(&rays.blocks, &mut rays.hits),
            Coherence::Scattered => world.closest_incoherent(&rays.blocks, &mut rays.hits),
        }
        open = 0;
        for i in 0..rays.targets.len() {
            let (block, lane) = (&mut rays.blocks[i / LANES], i % LANES);
            if block.t_max[lane] < block.t_min[lane] {
                continue;
            }
            let ray = block.get(lane);
            let behind = rays.hits[i / LANES].get(lane).and_then(|hit| {
                met[i] = true;
                let (left, depth) = &mut transmittance[i];
                let t = pass(stage, &ray, &hit, left, depth);
                (left.max_element() > DARK).then_some(t)
            });
            match behind {
                Some(t_min) if t_min < ray.t_max => {
                    block.t_min[lane] = t_min;
                    open += 1;
                }
                _ => block.t_max[lane] = -1.0,
            }
        }
        counts.rays += open as u64;
    }
    for (i, &(point, radiance)) in rays.targets.iter().enumerate() {
        let (left, depth) = transmittance[i];
        counts.blocked += met[i] as u64;
        let left = if left.max_element() > DARK { left * (-depth.max(Vec3::ZERO)).exp() } else { Vec3::ZERO };
        if left != Vec3::ZERO {
            arrived(point, radiance * left);
        }
    }
    counts
}

/// Light through the surface at `hit`: multiplies `left`, adds to the optical `depth`, and returns where the ray goes on. Light is
/// taken straight through dielectrics (no caustics): Fresnel loss at each interface and absorption in between.
fn pass(stage: &Stage<'_>, ray: &Ray, hit: &Hit, left: &mut Vec3, depth: &mut Vec3) -> f32 {
    let placed = stage.placed(hit);
    let surface = placed.surface(ray, hit);
    match placed.material.model {
        SurfaceModel::Dielectric { ior, absorption } if stage.effects.contains(Effects::REFRACTION) => {
            let length = length(ray.dir);
            let cos = surface.face_normal.dot(ray.dir).abs() / length;
            let eta = if surface.outside { 1.0 / ior } else { ior };
            let reflected =
                if stage.effects.contains(Effects::REFLECTION) { fresnel_dielectric(cos, eta) } else { 0.0 };
            *left *= surface.color * (1.0 - reflected);
            // The way inside is where it leaves minus where it enters.
            let sign = if surface.outside { -1.0 } else { 1.0 };
            *depth += Vec3::from(absorption) * (sign * hit.t * length);
        }
        _ if stage.effects.contains(Effects::TRANSPARENCY) => *left *= 1.0 - surface.opacity,
        _ => *left = Vec3::ZERO,
    }
    surface.t_behind(ray, hit.t)
}
