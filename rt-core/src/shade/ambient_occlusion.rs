//! Ambient and environment light, dimmed by what is near: cosine-weighted rays over the hemisphere, limited in length.

use super::lobes::ambient_albedo;
use super::shadow::{Coherence, trace_light_rays};
use super::stage::Stage;
use super::wave::{LightRays, RayState};
use super::{Dimension, Point, TileArea};
use crate::effects::Effects;
use crate::math::orthonormal_basis;
use crate::ray::Ray;
use crate::ray_stats::RayStats;
use crate::sampler::cosine_hemisphere;
use glam::Vec3;

/// Rays per batch: enough for the tracer to sort by direction, few enough to stay in the second-level cache.
const BATCH_RAYS: usize = 4096;

/// Adds ambient and environment light to `points`.
pub(crate) fn add_ambient_light(
    stage: &Stage<'_>,
    area: &TileArea,
    points: &mut [Point],
    states: &[RayState],
    rays: &mut LightRays,
    stats: &mut RayStats,
    mut cost: Option<&mut [f32]>,
) {
    let Some(mean) = &stage.mean_radiance else { return };
    let ambient = |p: &Point| {
        let material = stage.instances[p.instance as usize].material;
        ambient_albedo(material, p.surface.color, stage.effects) * mean.for_normal(p.surface.normal)
    };
    let occlusion =
        stage.scene.ambient_occlusion.filter(|_| stage.effects.contains(Effects::AMBIENT_OCCLUSION));
    let Some(occlusion) = occlusion else {
        for p in points.iter_mut().filter(|p| p.lit) {
            p.radiance += ambient(p);
        }
        return;
    };

    let per_batch = (BATCH_RAYS / occlusion.rays as usize).max(1);
    let mut start = 0;
    while start < points.len() {
        let end = (start + per_batch).min(points.len());
        rays.clear();
        for (i, p) in points[start..end].iter().enumerate().filter(|(_, p)| p.lit) {
            let light = ambient(p);
            if light == Vec3::ZERO {
                continue;
            }
            let first = rays.targets.len();
            let state = &states[p.lane as usize];
            let sampler = area.sampler(stage, state.slot);
            let dimension = state.stream.wrapping_add(Dimension::AMBIENT_OCCLUSION);
            // The lobe stands on the side that is seen, whatever side the shading normal is lit from.
            let s = &p.surface;
            let normal = if s.normal.dot(s.face_normal) < 0.0 { -s.normal } else { s.normal };
            let (x, y) = orthonormal_basis(normal);
            for k in 0..occlusion.rays {
                let d = cosine_hemisphere(sampler.square_of(dimension, k, occlusion.rays));
                let dir = x * d.x + y * d.y + normal * d.z;
                // A smooth normal's hemisphere dips below the face: no sky there to be hidden.
                if dir.dot(s.face_normal) > 0.0 {
                    let ray = Ray::new(s.ray_origin(dir), dir).with_t_max(occlusion.distance as f32);
                    rays.push(&ray, i as u32, light);
                }
            }
            let sent = rays.targets.len() - first;
            for target in &mut rays.targets[first..] {
                target.1 = light / sent as f32;
            }
            if let Some(cost) = cost.as_deref_mut() {
                cost[state.slot as usize] += sent as f32;
            }
        }
        let batch = &mut points[start..end];
        let counts = trace_light_rays(stage, rays, Coherence::Scattered, |i, light| {
            batch[i as usize].radiance += light
        });
        stats.ambient_occlusion += counts.rays;
        stats.ambient_occlusion_blocked += counts.blocked;
        start = end;
    }
}
