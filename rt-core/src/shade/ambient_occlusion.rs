//! Ambient and environment light, attenuated by near surfaces: cosine-weighted rays over the
//! hemisphere, limited in length.

use super::frame_context::FrameContext;
use super::lobes::ambient_albedo;
use super::point::{Maps, WithMaps, WithoutMaps};
use super::shadow::trace_light_rays;
use super::wavefront::{LightRays, RayState};
use super::{Point, SampleDimension, TileArea};
use crate::bvh::Coherence;
use crate::effects::Effects;
use crate::environment::IrradianceCoefficients;
use crate::material_maps::SurfaceParameters;
use crate::math::orthonormal_basis;
use crate::ray::{LANES, Ray};
use crate::ray_stats::RayStats;
use crate::sampler::{Sampler, SamplerBlock};
use crate::simd::vectors::Row;
use crate::surface::SurfacePoint;
use fearless_simd::{Simd, dispatch};
use glam::Vec3;

/// Rays per batch: enough for the tracer to sort them by direction, few enough to stay in the
/// second-level cache.
const BATCH_RAYS: usize = 4096;

/// Adds ambient and environment light to `points`.
pub(crate) fn add_ambient_light(
    context: &FrameContext<'_>,
    area: &TileArea,
    points: &mut [Point],
    parameters: &[SurfaceParameters],
    states: &[RayState],
    rays: &mut LightRays,
    OcclusionBuffers { open, hemisphere_samples }: &mut OcclusionBuffers,
    stats: &mut RayStats,
    mut cost: Option<&mut [f32]>,
) {
    let Some(mean) = &context.irradiance else { return };
    let ambient =
        if parameters.is_empty() { ambient_at::<WithoutMaps> } else { ambient_at::<WithMaps> };
    let ambient = |p: &Point| ambient(context, mean, parameters, p);
    let occlusion = context
        .scene
        .ambient_occlusion
        .filter(|_| context.effects.contains(Effects::AMBIENT_OCCLUSION));
    let Some(occlusion) = occlusion else {
        for p in points.iter_mut().filter(|p| p.lit) {
            p.radiance += ambient(p);
        }
        return;
    };

    let count = occlusion.rays;
    let per_batch = (BATCH_RAYS / count as usize).max(1);
    let mut start = 0;
    while start < points.len() {
        let end = (start + per_batch).min(points.len());
        // ---- Points that ambient light reaches.
        open.clear();
        for (i, p) in points[start..end].iter().enumerate().filter(|(_, p)| p.lit) {
            let light = ambient(p);
            if light == Vec3::ZERO {
                continue;
            }
            let state = &states[p.lane as usize];
            let sampler = area.sampler(context, state.slot);
            let dimension = state.stream.wrapping_add(SampleDimension::AMBIENT_OCCLUSION);
            open.push(OcclusionPoint { index: i as u32, light, sampler, dimension });
        }
        // ---- Directions over +z, sixteen at a time across points.
        dispatch!(
            context.level,
            simd => directions(simd, context, open, count, hemisphere_samples)
        );
        // ---- Rays.
        rays.clear();
        rays.first_point = start as u32;
        let mut sample = 0;
        for o in open.iter() {
            let first = rays.targets.len();
            let p = &points[start + o.index as usize];
            let over = Hemisphere::new(&p.surface);
            for k in 0..count {
                if let Some(ray) = over.ray(hemisphere_samples, sample, occlusion.distance) {
                    rays.push(&ray, o.index, o.light, context.sky_number + k);
                }
                sample += 1;
            }
            let sent = rays.targets.len() - first;
            for target in &mut rays.targets[first..] {
                target.1 = o.light / sent as f32;
            }
            if let Some(cost) = cost.as_deref_mut() {
                cost[states[p.lane as usize].slot as usize] += sent as f32;
            }
        }
        let batch = &mut points[start..end];
        let counts = trace_light_rays(context, rays, Coherence::Incoherent, |i, light| {
            batch[i as usize].radiance += light
        });
        stats.ambient_occlusion += counts.rays;
        stats.ambient_occlusion_blocked += counts.blocked;
        counts.add_to(stats);
        start = end;
    }
}

/// Ambient light that a point reflects to the eye.
fn ambient_at<M: Maps>(
    context: &FrameContext<'_>,
    mean: &IrradianceCoefficients,
    parameters: &[SurfaceParameters],
    p: &Point,
) -> Vec3 {
    let albedo =
        ambient_albedo(p.model::<M>(context, parameters), p.surface.color, context.effects);
    let light = albedo * mean.for_normal(p.surface.normal);
    p.parameters::<M>(parameters).map_or(light, |v| light * v.ambient)
}

/// The hemisphere of a point's rays.
pub(super) struct Hemisphere {
    axes: [Vec3; 3],
    origin: Vec3,
    face_normal: Vec3,
}

impl Hemisphere {
    #[inline]
    pub(super) fn new(s: &SurfacePoint) -> Hemisphere {
        // The lobe is on the visible side, whichever side the shading normal is lit from.
        let normal = if s.normal.dot(s.face_normal) < 0.0 { -s.normal } else { s.normal };
        let (x, y) = orthonormal_basis(normal);
        // A direction that leaves through the back of the face is never sent, so there is one
        // origin.
        let origin = s.point + s.face_normal * s.point_error;
        Hemisphere { axes: [x, y, normal], origin, face_normal: s.face_normal }
    }

    /// The ray in direction `sample` of `hemisphere_samples`.
    #[inline]
    pub(super) fn ray(
        &self,
        hemisphere_samples: &[HemisphereSamples],
        sample: usize,
        distance: f64,
    ) -> Option<Ray> {
        let [dx, dy, dz] = &hemisphere_samples[sample / LANES];
        let lane = sample % LANES;
        let [x, y, normal] = self.axes;
        let dir = x * dx[lane] + y * dy[lane] + normal * dz[lane];
        // The hemisphere of a smooth normal extends below the face, where no sky can be occluded.
        (dir.dot(self.face_normal) > 0.0)
            .then(|| Ray::new(self.origin, dir).with_t_max(distance as f32))
    }
}

/// Sixteen directions, one row per component.
pub(super) type HemisphereSamples = [Row; 3];

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct OcclusionBuffers {
    open: Vec<OcclusionPoint>,
    hemisphere_samples: Vec<HemisphereSamples>,
}

/// A point that sends rays.
pub(super) struct OcclusionPoint {
    pub(super) index: u32,
    pub(super) light: Vec3,
    pub(super) sampler: Sampler,
    pub(super) dimension: u32,
}

/// `count` directions for each point, one after the other.
pub(super) fn directions<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    open: &[OcclusionPoint],
    count: u32,
    out: &mut Vec<HemisphereSamples>,
) {
    out.clear();
    let mut block = SamplerBlock::new(context.options.sampling);
    let mut lane = 0;
    for o in open {
        for k in 0..count {
            block.set(lane, &o.sampler, o.dimension, k, count);
            lane += 1;
            if lane == LANES {
                out.push(block.cosine_hemispheres(simd));
                lane = 0;
            }
        }
    }
    if lane > 0 {
        out.push(block.cosine_hemispheres(simd));
    }
}
