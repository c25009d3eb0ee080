//! Hits, and the points whose light is requested.
use rt_core::deferred::{LightHit, LightPoint, ShadingHit, SurfacePoint};
use rt_core::glam::Vec3;

/// Words of a hit.
pub(in crate::render) const HIT_WORDS: usize = 20;

/// The words of a hit.
pub(in crate::render) fn encode_hit(hit: &ShadingHit) -> [u32; HIT_WORDS] {
    let s = &hit.surface;
    let mut out = [0; HIT_WORDS];
    let numbers = [
        [hit.t, hit.depth, hit.distance, s.point_error],
        [s.point.x, s.point.y, s.point.z, s.opacity],
        [s.face_normal.x, s.face_normal.y, s.face_normal.z, s.normal.x],
        [s.normal.y, s.normal.z, s.color.x, s.color.y],
    ];
    for (word, number) in out.iter_mut().zip(numbers.iter().flatten()) {
        *word = number.to_bits();
    }
    out[16] = s.color.z.to_bits();
    out[17] = s.outside as u32;
    (out[18], out[19]) = (hit.instance, hit.primitive);
    out
}

/// Decodes the words of [`encode_hit`]. [`TileState::process_hits`] refuses hits that no scene can
/// have produced.
///
/// [`TileState::process_hits`]: rt_core::deferred::TileState::process_hits
pub(in crate::render) fn decode_hit(words: &[u32; HIT_WORDS]) -> ShadingHit {
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

/// Stands for [`LightHit::Blocked`] in place of the parameter of a hit.
const BLOCKED: f32 = f32::NEG_INFINITY;

/// The words of what a light ray hits, as many as those of a hit.
pub(in crate::render) fn encode_light_hit(hit: &LightHit) -> [u32; HIT_WORDS] {
    match hit {
        LightHit::Blocked => {
            let mut out = [0; HIT_WORDS];
            out[0] = BLOCKED.to_bits();
            out
        }
        LightHit::Surface(hit) => encode_hit(hit),
    }
}

/// Decodes the words of [`encode_light_hit`].
pub(in crate::render) fn decode_light_hit(words: &[u32; HIT_WORDS]) -> LightHit {
    let hit = decode_hit(words);
    if hit.t == BLOCKED { LightHit::Blocked } else { LightHit::Surface(hit) }
}

/// Least words of a point: of a flat surface that the camera sees.
pub(in crate::render) const LEAST_POINT_WORDS: usize = 9;

const LAMPS: u32 = 1;
const SKY: u32 = 2;
/// The shading normal is the face normal.
const FLAT: u32 = 4;
/// The stream is 0: a camera ray hit it.
const FROM_CAMERA: u32 = 8;

/// Encodes a point: [`LEAST_POINT_WORDS`] to thirteen words.
pub(in crate::render) fn write_point(point: &LightPoint, out: &mut Vec<u32>) {
    let flat =
        point.normal.to_array().map(f32::to_bits) == point.face_normal.to_array().map(f32::to_bits);
    let flag = |on: bool, bit: u32| if on { bit } else { 0 };
    let flags = flag(point.lamps, LAMPS)
        | flag(point.sky, SKY)
        | flag(flat, FLAT)
        | flag(point.stream == 0, FROM_CAMERA);
    // Pixel coordinates are below 65536.
    out.extend([flags, point.pixel[0] | point.pixel[1] << 16, point.point_error.to_bits()]);
    out.extend(point.point.to_array().map(f32::to_bits));
    out.extend(point.face_normal.to_array().map(f32::to_bits));
    if !flat {
        out.extend(point.normal.to_array().map(f32::to_bits));
    }
    if point.stream != 0 {
        out.push(point.stream);
    }
}

/// Decodes one point of [`write_point`] and returns it with the remaining words; `None` when the
/// words are too few or invalid.
pub(in crate::render) fn read_point(words: &[u32]) -> Option<(LightPoint, &[u32])> {
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
    let point = LightPoint { pixel, lamps, sky, stream, point, point_error, face_normal, normal };
    Some((point, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit() -> ShadingHit {
        let surface = SurfacePoint {
            point: Vec3::new(1.0, -0.0, f32::MIN_POSITIVE),
            point_error: 1e-7,
            face_normal: Vec3::new(0.0, 0.6, 0.8),
            normal: Vec3::new(0.6, 0.0, 0.8),
            outside: true,
            color: Vec3::new(0.1, 0.2, 0.3),
            opacity: 0.4,
        };
        ShadingHit { t: 2.5, instance: 3, primitive: u32::MAX, depth: 0.7, distance: 9.0, surface }
    }

    #[test]
    fn hits_survive_with_all_their_bits() {
        let outside = hit();
        let mut inside = outside;
        (inside.surface.outside, inside.t) = (false, f32::INFINITY);
        for hit in [outside, inside] {
            let words = encode_hit(&hit);
            assert_eq!(decode_hit(&words), hit);
            assert_eq!(encode_hit(&decode_hit(&words)), words, "the sign of zero, too");
        }
        // Any bits are a hit with the same bits, a NaN as well as others.
        let mut words = std::array::from_fn(|i| 0x7fc0_0001 + 0x0012_3457 * i as u32);
        words[17] = 1;
        assert_eq!(encode_hit(&decode_hit(&words)), words);
    }

    #[test]
    fn blocked_light_is_told_from_surfaces() {
        for hit in [LightHit::Blocked, LightHit::Surface(hit())] {
            assert_eq!(decode_light_hit(&encode_light_hit(&hit)), hit);
        }
    }

    /// Points of curved and flat surfaces, hit by the camera's rays and by others.
    fn points() -> Vec<LightPoint> {
        let surface = hit().surface;
        let mut points = Vec::new();
        for (flat, stream) in [(true, 0), (true, 7), (false, 0), (false, u32::MAX)] {
            for (lamps, sky) in [(true, false), (false, true), (true, true)] {
                points.push(LightPoint {
                    pixel: [65535, 4711],
                    lamps,
                    sky,
                    stream,
                    point: surface.point,
                    point_error: surface.point_error,
                    face_normal: surface.face_normal,
                    normal: if flat { surface.face_normal } else { surface.normal },
                });
            }
        }
        points
    }

    #[test]
    fn points_survive_one_behind_the_other_and_are_short_where_they_can_be() {
        let (points, mut words) = (points(), Vec::new());
        let mut lengths = Vec::new();
        for point in &points {
            let before = words.len();
            write_point(point, &mut words);
            lengths.push(words.len() - before);
        }
        assert_eq!(
            [lengths[0], lengths[3], lengths[6], lengths[9]],
            [LEAST_POINT_WORDS, 10, 12, 13]
        );
        let (mut read, mut rest) = (Vec::new(), &words[..]);
        while !rest.is_empty() {
            let (point, behind) = read_point(rest).unwrap();
            read.push(point);
            rest = behind;
        }
        assert_eq!(read, points);
    }

    #[test]
    fn points_that_are_cut_short_or_have_unknown_flags_are_refused() {
        for point in points() {
            let mut words = Vec::new();
            write_point(&point, &mut words);
            for length in 0..words.len() {
                assert!(read_point(&words[..length]).is_none(), "{length} words");
            }
            words[0] |= 16;
            assert!(read_point(&words).is_none());
        }
    }
}
