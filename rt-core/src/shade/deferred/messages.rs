//! Messages between data servers and tile owners, as 32-bit words.

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
    pub const WORDS: usize = 20;

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

    /// Encodes the hit for sending.
    pub fn to_words(&self) -> [u32; ShadingHit::WORDS] {
        let s = &self.surface;
        let mut out = [0; ShadingHit::WORDS];
        let numbers = [
            [self.t, self.depth, self.distance, s.point_error],
            [s.point.x, s.point.y, s.point.z, s.opacity],
            [s.face_normal.x, s.face_normal.y, s.face_normal.z, s.normal.x],
            [s.normal.y, s.normal.z, s.color.x, s.color.y],
        ];
        for (word, number) in out.iter_mut().zip(numbers.iter().flatten()) {
            *word = number.to_bits();
        }
        out[16] = s.color.z.to_bits();
        out[17] = s.outside as u32;
        (out[18], out[19]) = (self.instance, self.primitive);
        out
    }

    /// Decodes the words of [`ShadingHit::to_words`]. [`super::TileState::process_hits`] refuses
    /// hits that no scene can have produced.
    pub fn from_words(words: &[u32; ShadingHit::WORDS]) -> ShadingHit {
        let f = |i: usize| f32::from_bits(words[i]);
        ShadingHit {
            t: f(0),
            depth: f(1),
            distance: f(2),
            instance: words[18],
            primitive: words[19],
            surface: SurfacePoint {
                point_error: f(3),
                point: Vec3::new(f(4), f(5), f(6)),
                opacity: f(7),
                face_normal: Vec3::new(f(8), f(9), f(10)),
                normal: Vec3::new(f(11), f(12), f(13)),
                color: Vec3::new(f(14), f(15), f(16)),
                outside: words[17] != 0,
            },
        }
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

const LAMPS: u32 = 1;
const SKY: u32 = 2;
/// The shading normal is the face normal.
const FLAT: u32 = 4;
/// The stream is 0: a camera ray hit it.
const FROM_CAMERA: u32 = 8;

impl LightPoint {
    /// Position in render space.
    pub fn position(&self) -> Vec3 {
        self.point
    }

    /// Encodes the point for sending: nine words for a point of a flat surface that the camera
    /// sees, at most thirteen.
    pub fn write(&self, out: &mut Vec<u32>) {
        let flat = self.normal.to_array().map(f32::to_bits)
            == self.face_normal.to_array().map(f32::to_bits);
        let flag = |on: bool, bit: u32| if on { bit } else { 0 };
        let flags = flag(self.lamps, LAMPS)
            | flag(self.sky, SKY)
            | flag(flat, FLAT)
            | flag(self.stream == 0, FROM_CAMERA);
        // Pixel coordinates are below 65536.
        out.extend([flags, self.pixel[0] | self.pixel[1] << 16, self.point_error.to_bits()]);
        out.extend(self.point.to_array().map(f32::to_bits));
        out.extend(self.face_normal.to_array().map(f32::to_bits));
        if !flat {
            out.extend(self.normal.to_array().map(f32::to_bits));
        }
        if self.stream != 0 {
            out.push(self.stream);
        }
    }

    /// Decodes one point of [`LightPoint::write`] and returns it with the remaining words; `None`
    /// when the words are too few or invalid.
    pub fn read(words: &[u32]) -> Option<(LightPoint, &[u32])> {
        let (&[flags, pixel, error], mut rest) = words.split_first_chunk::<3>()?;
        let vector = |rest: &mut &[u32]| {
            let (v, r) = rest.split_first_chunk::<3>()?;
            *rest = r;
            Some(Vec3::from_array(v.map(f32::from_bits)))
        };
        let point = vector(&mut rest)?;
        let face_normal = vector(&mut rest)?;
        let normal = if flags & FLAT != 0 { face_normal } else { vector(&mut rest)? };
        let stream = if flags & FROM_CAMERA != 0 {
            0
        } else {
            let (&s, r) = rest.split_first()?;
            rest = r;
            s
        };
        if flags > (LAMPS | SKY | FLAT | FROM_CAMERA) {
            return None;
        }
        let (lamps, sky) = (flags & LAMPS != 0, flags & SKY != 0);
        let pixel = [pixel & 0xffff, pixel >> 16];
        let point_error = f32::from_bits(error);
        Some((
            LightPoint { pixel, lamps, sky, stream, point, point_error, face_normal, normal },
            rest,
        ))
    }
}

impl LightPoint {
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
