//! Rays that are traced together, and what each is worth.

use crate::ray::{HitBlock, LANES, Ray, RayBlock};
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

/// A ray's part in its pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayState {
    /// What radiance met by this ray is multiplied by.
    pub(crate) throughput: Vec3,
    /// Absorption per world unit of the medium it travels in.
    pub(crate) absorption: Vec3,
    /// Share of the pixel's alpha it decides; 0 for rays that left the line of sight.
    pub(crate) coverage: f32,
    /// First sampler dimension of this ray: different for all rays of a pixel.
    pub(crate) stream: u32,
    /// Pixel within the tile.
    pub(crate) slot: u16,
    /// Surfaces scattered at so far.
    pub(crate) bounce: u16,
    pub(crate) kind: RayKind,
    /// A camera ray that has met nothing yet.
    pub(crate) first: bool,
}

/// Rays in blocks, each with its state.
#[derive(Default)]
pub(crate) struct Wavefront {
    pub(crate) blocks: Vec<RayBlock>,
    /// One per ray, in lane order; blocks are filled without gaps except in the camera's wave.
    pub(crate) states: Vec<RayState>,
}

impl Wavefront {
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
        self.states.clear();
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
        self.states.push(state);
    }

    #[inline]
    pub(crate) fn ray(&self, i: usize) -> Ray {
        self.blocks[i / LANES].get(i % LANES)
    }
}

/// Rays towards light, each with the point and the radiance it brings there if nothing is in the
/// way.
#[derive(Default)]
pub(crate) struct LightRays {
    pub(crate) blocks: Vec<RayBlock>,
    pub(crate) targets: Vec<(u32, Vec3)>,
    /// Bit per lane: blocked.
    pub(crate) blocked: Vec<u16>,
    /// For rays that pass through surfaces.
    pub(crate) hits: Vec<HitBlock>,
    /// Who says what is in their way.
    pub(crate) source: OcclusionSource,
    /// Point of the wave that the batch's points are counted from.
    pub(crate) first_point: u32,
    /// While recording: of each ray, its number among the light rays that its point could send.
    numbers: Vec<u32>,
}

/// Who says what is in the way of light rays.
#[derive(Default)]
pub(crate) enum OcclusionSource {
    /// The scene's own world.
    #[default]
    World,
    /// Nobody yet: the rays are written down, and no light arrives.
    Recording(Vec<RecordedRay>),
    /// Somebody has said it for every recorded ray, in the order they were recorded.
    Given(std::vec::IntoIter<LightRayResult>),
}

/// A light ray that waits for an answer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordedRay {
    pub(crate) ray: Ray,
    /// Point of the wave.
    pub(crate) point: u32,
    /// Its number among the light rays that a point could send.
    pub(crate) number: u32,
    /// What it brings if nothing is in the way.
    pub(crate) radiance: Vec3,
}

/// What a light ray met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightRayResult {
    /// Share of the light that is left.
    pub(crate) transmittance: Vec3,
    /// Whether anything was in the way.
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

    /// Point and number of each ray, unless the world answers.
    pub(crate) fn numbered(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.targets.iter().map(|(point, _)| *point).zip(self.numbers.iter().copied())
    }

    /// Writes the batch down for somebody else to trace.
    pub(crate) fn record(&mut self) {
        let OcclusionSource::Recording(list) = &mut self.source else { return };
        for (i, (&(point, radiance), &number)) in self.targets.iter().zip(&self.numbers).enumerate()
        {
            let ray = self.blocks[i / LANES].get(i % LANES);
            list.push(RecordedRay { ray, point: self.first_point + point, number, radiance });
        }
    }

    #[inline]
    pub(crate) fn is_blocked(&self, i: usize) -> bool {
        self.blocked[i / LANES] >> (i % LANES) & 1 != 0
    }
}
