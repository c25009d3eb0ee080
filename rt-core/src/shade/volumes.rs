//! Media between a ray's origin and the surface that it hits.

use super::frame_context::FrameContext;
use super::wavefront::{RayState, Wavefront};
use crate::ray::{HitBlock, LANES, Ray};
use crate::ray_stats::RayStats;
use crate::volume::{VolumeSample, integrate_overlapping};
use glam::DAffine3;

/// The ray in a volume's object space. Not normalised: the parameter is the same in every space.
pub(super) fn in_object_space(ray: &Ray, object_from_render: &DAffine3) -> Ray {
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    Ray {
        origin: object_from_render.transform_point3(origin).as_vec3(),
        dir: object_from_render.transform_vector3(dir).as_vec3(),
        ..*ray
    }
}

/// The radiance that `ray` collects in the frame's volumes up to `t_end`. `object_rays` is a
/// buffer.
pub(super) fn integrate_volumes(
    context: &FrameContext<'_>,
    ray: &Ray,
    t_end: f32,
    object_rays: &mut Vec<Ray>,
) -> VolumeSample {
    object_rays.clear();
    object_rays.extend(
        context
            .volumes
            .iter()
            .map(|(_, object_from_render)| in_object_space(ray, object_from_render)),
    );
    let quality = &context.options.volume_quality;
    if let [(volume, _)] = context.volumes[..] {
        volume.integrate(&object_rays[0], ray.t_min, t_end, quality)
    } else {
        let pairs: Vec<_> =
            context.volumes.iter().zip(object_rays.iter()).map(|((v, _), r)| (*v, *r)).collect();
        integrate_overlapping(&pairs, ray.t_min, t_end, quality)
    }
}

/// What the rays of a wavefront collect in a volume that takes samples.
#[derive(Default)]
pub(super) struct SampledRays {
    rays: Vec<(Ray, [f32; 2])>,
    found: Vec<VolumeSample>,
}

impl SampledRays {
    /// Computes them up to the rays' hits. Nothing where the frame has another volume too, where
    /// the volume is integrated, or where others have sent what rays collect (`is_known`).
    pub(super) fn take(
        &mut self,
        context: &FrameContext<'_>,
        front: &Wavefront,
        hits: &[HitBlock],
        is_known: bool,
    ) {
        self.found.clear();
        let [(volume, object_from_render)] = &context.volumes[..] else { return };
        if is_known || !volume.takes_samples() {
            return;
        }
        self.rays.clear();
        for i in 0..front.states.len() {
            let ray = front.blocks[i / LANES].get(i % LANES);
            let t_end = hits[i / LANES].get(i % LANES).map_or(ray.t_max, |h| h.t);
            self.rays.push((in_object_space(&ray, object_from_render), [ray.t_min, t_end]));
        }
        volume.sample_rays(&self.rays, &mut self.found);
    }

    /// What ray number `i` collects, if it was computed.
    pub(super) fn get(&self, i: usize) -> Option<&VolumeSample> {
        self.found.get(i)
    }
}

/// Adds the radiance that a ray has collected, and attenuates everything behind it.
pub(super) fn composite_volume(
    sample: &VolumeSample,
    state: &mut RayState,
    pixels: &mut [[f32; 4]],
    stats: &mut RayStats,
) {
    stats.volume += (sample.samples > 0) as u64;
    let [r, g, b, a] = sample.rgba;
    let pixel = &mut pixels[state.slot as usize];
    let t = state.throughput;
    pixel[0] += t.x * r;
    pixel[1] += t.y * g;
    pixel[2] += t.z * b;
    pixel[3] += state.coverage * a;
    state.throughput *= 1.0 - a;
    state.coverage *= 1.0 - a;
}
