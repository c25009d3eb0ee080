//! Hits and points that pass between data servers and tile owners.

use super::messages::{HIT_WORDS, decode_hit, encode_hit, read_point, write_point};
use crate::surface::SurfacePoint;
use glam::Vec3;

/// A hit with all surface data that shading needs.
#[derive(Debug, Clone, Copy)]
pub struct ShadingHit {
    /// Ray parameter.
    pub t: f32,
    /// Instance, the same in every part of a scene.
    pub instance: u32,
    /// Primitive, as numbered by the data server. Code that merges parts replaces it by the number
    /// in the whole scene.
    pub primitive: u32,
    /// Window depth, where that layer is requested of a camera ray; else 0.
    pub(crate) depth: f32,
    /// Distance from the eye, likewise.
    pub(crate) distance: f32,
    pub(crate) surface: SurfacePoint,
}

impl ShadingHit {
    /// Words of [`ShadingHit::to_words`].
    pub const WORDS: usize = HIT_WORDS;

    /// Encodes the hit for sending.
    pub fn to_words(&self) -> [u32; ShadingHit::WORDS] {
        encode_hit(self)
    }

    /// Decodes the words of [`ShadingHit::to_words`].
    pub fn from_words(words: &[u32; ShadingHit::WORDS]) -> ShadingHit {
        decode_hit(words)
    }

    /// For a light ray: an opaque surface of this scene blocks it, so no other hit matters. It is
    /// ordered before every hit. `instance` is one that transmits no light.
    pub fn blocked(instance: u32) -> ShadingHit {
        let surface = SurfacePoint {
            point: Vec3::ZERO,
            point_error: 0.0,
            face_normal: Vec3::Z,
            normal: Vec3::Z,
            outside: true,
            color: Vec3::ZERO,
            opacity: 1.0,
        };
        let t = f32::NEG_INFINITY;
        ShadingHit { t, instance, primitive: 0, depth: 0.0, distance: 0.0, surface }
    }

    /// Whether this is [`ShadingHit::blocked`].
    pub fn is_blocked(&self) -> bool {
        self.t == f32::NEG_INFINITY
    }

    /// Whether this hit is ordered before another one of the same ray: nearer, or at the same
    /// distance with a lower instance and primitive.
    pub fn is_before(&self, other: &ShadingHit) -> bool {
        let key = |m: &ShadingHit| (m.instance, m.primitive);
        self.t < other.t || (self.t == other.t && key(self) < key(other))
    }
}

/// A point whose incoming light is requested. All processes generate the same rays from it and the
/// pixel's seed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightPoint {
    /// Column and row in the whole image.
    pub pixel: [u32; 2],
    /// Whether it sends rays to light sources.
    pub lamps: bool,
    /// Whether it sends ambient occlusion rays.
    pub sky: bool,
    /// Sampler stream of the ray that hit it.
    pub(crate) stream: u32,
    pub(crate) point: Vec3,
    pub(crate) point_error: f32,
    pub(crate) face_normal: Vec3,
    pub(crate) normal: Vec3,
}

impl LightPoint {
    /// Encodes the point for sending.
    pub fn write(&self, out: &mut Vec<u32>) {
        write_point(self, out);
    }

    /// Decodes one point of [`LightPoint::write`] and returns it with the remaining words; `None`
    /// when the words are too few or invalid.
    pub fn read(words: &[u32]) -> Option<(LightPoint, &[u32])> {
        read_point(words)
    }

    /// Position in render space.
    pub fn position(&self) -> Vec3 {
        self.point
    }

    /// The part of the surface that ray generation reads.
    pub(crate) fn surface(&self) -> SurfacePoint {
        let LightPoint { point, point_error, face_normal, normal, .. } = *self;
        SurfacePoint {
            point,
            point_error,
            face_normal,
            normal,
            outside: true,
            color: Vec3::ZERO,
            opacity: 1.0,
        }
    }
}
