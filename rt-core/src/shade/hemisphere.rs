//! Directions over the hemisphere of a point: cosine-weighted samples, and where they lead.

use super::frame_context::FrameContext;
use crate::math::orthonormal_basis;
use crate::ray::{LANES, Ray};
use crate::sampler::{Sampler, SamplerBlock};
use crate::surface::SurfacePoint;
use fearless_simd::Simd;
use glam::Vec3;

/// Rays of one point that are made at once.
pub(super) const WIDE: usize = 8;

/// The hemisphere of a point's rays.
pub(super) struct Hemisphere {
    pub(super) axes: [Vec3; 3],
    pub(super) origin: Vec3,
    pub(super) face_normal: Vec3,
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

    /// The ray in direction `sample` of `samples`.
    #[inline]
    pub(super) fn ray(
        &self,
        samples: &HemisphereSamples,
        sample: usize,
        distance: f64,
    ) -> Option<Ray> {
        let [dx, dy, dz] = [samples.0[0][sample], samples.0[1][sample], samples.0[2][sample]];
        let [x, y, normal] = self.axes;
        let dir = x * dx + y * dy + normal * dz;
        // The hemisphere of a smooth normal extends below the face, where no sky can be occluded.
        (dir.dot(self.face_normal) > 0.0)
            .then(|| Ray::new(self.origin, dir).with_t_max(distance as f32))
    }
}

/// Directions over +z: a list for each component, with room for one more vector behind the last.
#[derive(Default)]
pub(super) struct HemisphereSamples(pub(super) [Vec<f32>; 3]);

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
    HemisphereSamples(out): &mut HemisphereSamples,
) {
    let len = open.len() * count as usize;
    out.iter_mut().for_each(|out| out.resize(len + WIDE, 0.0));
    let mut block = SamplerBlock::new(context.options.sampling);
    for (b, open) in open.chunks(LANES).enumerate() {
        for (lane, o) in open.iter().enumerate() {
            block.set(lane, &o.sampler, o.dimension, 0, count);
        }
        let first = b * LANES * count as usize;
        block.cosine_hemispheres_in_a_row(simd, count, |k, rows| {
            for (out, row) in out.iter_mut().zip(rows) {
                let of_points = out[first + k..].iter_mut().step_by(count as usize);
                of_points.zip(&row[..open.len()]).for_each(|(out, x)| *out = *x);
            }
        });
    }
}
