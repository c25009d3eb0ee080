//! Rays that are traced together, and their contributions to pixels.

use crate::ray::{HitBlock, LANES, Ray, RayBlock};
use crate::simd::vectors::Rows3;
use glam::Vec3;

/// What a ray is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RayKind {
    /// From the camera, or the same ray behind transparent surfaces.
    Camera,
    /// Mirror or glossy reflection.
    Reflected,
    /// Through a dielectric's surface.
    Refracted,
    /// Diffuse bounce of the path tracer.
    Diffuse,
}

/// State of a ray: its contribution to its pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayState {
    /// Factor on the radiance that this ray finds.
    pub(crate) throughput: Vec3,
    /// Absorption per world unit of the medium it travels in.
    pub(crate) absorption: Vec3,
    /// Share of the pixel's alpha that it determines; 0 for rays that left the line of sight.
    pub(crate) coverage: f32,
    /// First sampler dimension of this ray: different for all rays of a pixel.
    pub(crate) stream: u32,
    /// Pixel within the tile.
    pub(crate) slot: u16,
    /// Number of scattering surfaces so far.
    pub(crate) bounce: u16,
    pub(crate) kind: RayKind,
    /// A camera ray that has hit nothing yet.
    pub(crate) first: bool,
}

/// Rays in blocks, each with its state.
#[derive(Default)]
pub(crate) struct Wavefront {
    pub(crate) blocks: Vec<RayBlock>,
    /// One per ray, in lane order; blocks are filled without gaps except in the camera rays'
    /// wavefront.
    pub(crate) states: Vec<RayState>,
    /// Some of the rays are of another kind than [`RayKind::Camera`].
    pub(crate) has_scattered: bool,
}

impl Wavefront {
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
        self.states.clear();
        self.has_scattered = false;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Appends a ray.
    #[inline]
    pub(crate) fn push(&mut self, ray: &Ray, state: RayState) {
        let lane = self.states.len() % LANES;
        if lane == 0 {
            self.blocks.push(RayBlock::INACTIVE);
        }
        let last = self.blocks.len() - 1;
        self.blocks[last].set(lane, ray);
        self.has_scattered |= state.kind != RayKind::Camera;
        self.states.push(state);
    }

    #[inline]
    pub(crate) fn ray(&self, i: usize) -> Ray {
        self.blocks[i / LANES].get(i % LANES)
    }
}

/// Rays towards light, each with its point and the radiance that it contributes if unblocked.
#[derive(Default)]
pub(crate) struct LightRays {
    pub(crate) blocks: Vec<RayBlock>,
    pub(crate) targets: Vec<(u32, Vec3)>,
    /// Bit per lane: blocked.
    pub(crate) blocked: Vec<u16>,
    /// For rays that pass through surfaces.
    pub(crate) hits: Vec<HitBlock>,
    /// Where the occlusion of these rays comes from.
    pub(crate) source: OcclusionSource,
    /// First point of the wavefront in this batch; the batch's points are counted from it.
    pub(crate) first_point: u32,
    /// While recording: the number of each ray among the light rays that its point could send.
    numbers: Vec<u32>,
}

/// Where the occlusion of light rays comes from.
#[derive(Default)]
pub(crate) enum OcclusionSource {
    /// The scene's own world.
    #[default]
    World,
    /// Not known yet: the rays are recorded, and no light arrives.
    Recording(Vec<RecordedRay>),
    /// Given by the caller for every recorded ray, in recording order.
    Given(std::vec::IntoIter<LightRayResult>),
}

/// A light ray that waits for an answer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordedRay {
    pub(crate) ray: Ray,
    /// Point of the wavefront.
    pub(crate) point: u32,
    /// Its number among the light rays that a point could send.
    pub(crate) number: u32,
    /// Radiance that it contributes if unblocked.
    pub(crate) radiance: Vec3,
}

/// The result of a light ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightRayResult {
    /// Share of the light that is transmitted.
    pub(crate) transmittance: Vec3,
    /// Whether the ray hit anything.
    pub(crate) hit: bool,
    /// How often it was continued behind a surface.
    pub(crate) continued: u32,
}

impl LightRays {
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
        self.targets.clear();
        self.numbers.clear();
        self.first_point = 0;
    }

    /// Appends the ray with the number `number` (see [`RecordedRay::number`]) of point `point`.
    #[inline]
    pub(crate) fn push(&mut self, ray: &Ray, point: u32, radiance: Vec3, number: u32) {
        if !matches!(self.source, OcclusionSource::World) {
            self.numbers.push(number);
        }
        let lane = self.targets.len() % LANES;
        if lane == 0 {
            self.blocks.push(RayBlock::INACTIVE);
        }
        let last = self.blocks.len() - 1;
        self.blocks[last].set(lane, ray);
        self.targets.push((point, radiance));
    }

    /// Says where the next ray goes whose block is in [`LightRays::blocks`] already; see
    /// [`LightRays::push`].
    #[inline]
    pub(crate) fn aim(&mut self, point: u32, radiance: Vec3, number: u32) {
        if !matches!(self.source, OcclusionSource::World) {
            self.numbers.push(number);
        }
        self.targets.push((point, radiance));
    }

    /// Appends the rays of `lanes` in order, see [`LightRays::push`]; lane 0 is that of point
    /// `first`.
    #[inline]
    pub(crate) fn push_lanes(
        &mut self,
        lanes: u16,
        rays: &RayBlock,
        first: u32,
        radiance: &Rows3,
        number: u32,
    ) {
        if lanes == u16::MAX && self.targets.len().is_multiple_of(LANES) {
            self.blocks.push(*rays);
            self.targets.extend((0..LANES).map(|l| (first + l as u32, radiance.get(l))));
            if !matches!(self.source, OcclusionSource::World) {
                self.numbers.extend([number; LANES]);
            }
            return;
        }
        for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
            self.push(&rays.get(lane), first + lane as u32, radiance.get(lane), number);
        }
    }

    /// Point and number of each ray, unless the world is the source.
    pub(crate) fn numbered(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.targets.iter().map(|(point, _)| *point).zip(self.numbers.iter().copied())
    }

    /// Records the batch so that the caller can trace it.
    pub(crate) fn record(&mut self) {
        let OcclusionSource::Recording(list) = &mut self.source else { return };
        for (i, (&(point, radiance), &number)) in self.targets.iter().zip(&self.numbers).enumerate()
        {
            let ray = self.blocks[i / LANES].get(i % LANES);
            list.push(RecordedRay { ray, point: self.first_point + point, number, radiance });
        }
    }

    /// How many of the `count` rays from ray `first` on are blocked.
    #[inline]
    pub(crate) fn count_blocked(&self, first: usize, count: usize) -> u32 {
        let (mut at, end, mut blocked) = (first, first + count, 0);
        while at < end {
            let (block, lane) = (at / LANES, at % LANES);
            let taken = (LANES - lane).min(end - at);
            let mask = (1u32 << taken) - 1;
            blocked += (u32::from(self.blocked[block]) >> lane & mask).count_ones();
            at += taken;
        }
        blocked
    }

    #[inline]
    pub(crate) fn is_blocked(&self, i: usize) -> bool {
        self.blocked[i / LANES] >> (i % LANES) & 1 != 0
    }
}
