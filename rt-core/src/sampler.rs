//! Sample points in the unit square: the same for the same seed, pixel, sample and dimension on any number of threads.
//!
//! [`Sampling::Sobol`] is the (0,2)-sequence made of Sobol's first two dimensions, shuffled and Owen-scrambled per pixel and per
//! dimension by hashing (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020). Every aligned run of 2^k points has one point
//! in each of the 2^k elementary intervals, so k can grow without starting again. [`Sampling::Random`] has independent points: the
//! baseline that the accuracy experiments compare with.

/// How sample points are spread.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Sampling {
    /// Owen-scrambled (0,2)-sequence: error falls nearly as 1/n where the integrand is smooth.
    #[default]
    Sobol,
    /// Independent uniform points: error falls as 1/√n.
    Random,
}

impl Sampling {
    /// Both, for experiments that compare them.
    pub const ALL: [Sampling; 2] = [Sampling::Sobol, Sampling::Random];

    /// The name used on command lines and in records.
    pub fn name(self) -> &'static str {
        match self {
            Sampling::Sobol => "sobol",
            Sampling::Random => "random",
        }
    }
}

/// The sample points of one pixel in one pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampler {
    kind: Sampling,
    pixel: u32,
    index: u32,
}

impl Sampler {
    /// Points for sample `index` of the pixel at (`x`, `y`) of the whole picture.
    #[inline]
    pub fn new(kind: Sampling, seed: u64, x: u32, y: u32, index: u32) -> Sampler {
        let pixel = hash(hash(x ^ seed as u32).wrapping_add(y)) ^ hash((seed >> 32) as u32 ^ 0x5bd1_e995);
        Sampler { kind, pixel, index }
    }

    /// The point of dimension `dimension` (a pair of axes; give each use its own number).
    #[inline]
    pub fn square(&self, dimension: u32) -> [f32; 2] {
        self.point(self.index, dimension)
    }

    /// Point `k` of `count` in dimension `dimension`: the points of all k and all samples together are one sequence.
    #[inline]
    pub fn square_of(&self, dimension: u32, k: u32, count: u32) -> [f32; 2] {
        self.point(self.index.wrapping_mul(count).wrapping_add(k), dimension)
    }

    #[inline]
    fn point(&self, index: u32, dimension: u32) -> [f32; 2] {
        let seed = hash(self.pixel.wrapping_add(dimension.wrapping_mul(0x9e37_79b9)));
        match self.kind {
            Sampling::Sobol => {
                let i = owen_scramble(index, seed);
                [
                    to_unit(owen_scramble(i.reverse_bits(), hash(seed ^ 0x68bc_21eb))),
                    to_unit(owen_scramble(sobol_second(i), hash(seed ^ 0x02e5_be93))),
                ]
            }
            Sampling::Random => {
                let a = hash(seed ^ hash(index));
                [to_unit(a), to_unit(hash(a ^ 0x3c6e_f372))]
            }
        }
    }
}

/// The top 24 bits as a number in 0..1 (1 excluded: every value is exact in f32).
#[inline]
fn to_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Sobol's second dimension as a 32-bit fraction. Its generator matrix is Pascal's triangle mod 2, which by Lucas' theorem is a
/// Kronecker power: five masked shifts do the work of 32 conditional exclusive-ors.
#[inline]
fn sobol_second(i: u32) -> u32 {
    let mut v = i;
    v ^= (v & 0xaaaa_aaaa) >> 1;
    v ^= (v & 0xcccc_cccc) >> 2;
    v ^= (v & 0xf0f0_f0f0) >> 4;
    v ^= (v & 0xff00_ff00) >> 8;
    v ^= (v & 0xffff_0000) >> 16;
    v.reverse_bits()
}

/// Nested uniform scrambling: each bit is flipped by a hash of the bits above it (Laine and Karras 2011, with Burley's constants,
/// on reversed bits).
#[inline]
fn owen_scramble(v: u32, seed: u32) -> u32 {
    let mut x = v.reverse_bits().wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// 32 bits to 32 well-mixed bits, one to one (the "lowbias32" constants of Wellons' hash prospector).
#[inline]
pub(crate) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Direction over the hemisphere around +z with density cos/π, from a point of the unit square.
#[inline]
pub fn cosine_hemisphere([a, b]: [f32; 2]) -> glam::Vec3 {
    let [x, y] = unit_disk([a, b]);
    glam::Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// Uniform point in the unit disk: the concentric map of Shirley and Chiu (1997), which keeps neighbours together.
#[inline]
pub fn unit_disk([a, b]: [f32; 2]) -> [f32; 2] {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let (x, y) = (2.0 * a - 1.0, 2.0 * b - 1.0);
    if x == 0.0 && y == 0.0 {
        return [0.0, 0.0];
    }
    let (r, angle) =
        if x.abs() > y.abs() { (x, FRAC_PI_4 * (y / x)) } else { (y, FRAC_PI_2 - FRAC_PI_4 * (x / y)) };
    let (sin, cos) = angle.sin_cos();
    [r * cos, r * sin]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sobol_second_dimension_equals_its_bit_by_bit_definition() {
        let slow = |mut i: u32| {
            let (mut v, mut r) = (1u32 << 31, 0u32);
            while i != 0 {
                if i & 1 != 0 {
                    r ^= v;
                }
                i >>= 1;
                v ^= v >> 1;
            }
            r
        };
        for i in (0..5000).chain([u32::MAX, 0x8000_0001, 0xdead_beef]) {
            assert_eq!(sobol_second(i), slow(i), "{i:#x}");
        }
    }

    #[test]
    fn every_elementary_interval_has_one_point() {
        // The (0,2) property after scrambling: 64 points, all 7 ways to cut the square into 64 boxes.
        for pixel in 0..20 {
            for start in [0, 64, 640] {
                let pts: Vec<[f32; 2]> = (0..64)
                    .map(|k| Sampler::new(Sampling::Sobol, 9, pixel, 3, start + k).square(5))
                    .collect();
                for log_x in 0..=6 {
                    let (nx, ny) = (1 << log_x, 1 << (6 - log_x));
                    let mut seen = [false; 64];
                    for p in &pts {
                        let cell = (p[0] * nx as f32) as usize * ny + (p[1] * ny as f32) as usize;
                        assert!(!std::mem::replace(&mut seen[cell], true), "two points in one {nx}x{ny} box");
                    }
                }
            }
        }
    }

    #[test]
    fn pixels_seeds_and_dimensions_differ_and_repeat() {
        let p = |seed, x, dim| Sampler::new(Sampling::Sobol, seed, x, 0, 0).square(dim);
        assert_eq!(p(1, 2, 3), p(1, 2, 3));
        assert_ne!(p(1, 2, 3), p(2, 2, 3));
        assert_ne!(p(1, 2, 3), p(1, 3, 3));
        assert_ne!(p(1, 2, 3), p(1, 2, 4));
        assert_ne!(p(1 << 40, 2, 3), p(1, 2, 3));
    }

    #[test]
    fn both_kinds_average_to_one_half() {
        for kind in Sampling::ALL {
            let n = 4096;
            let mut sum = [0.0f64; 2];
            for i in 0..n {
                let p = Sampler::new(kind, 7, 100, 200, i).square(1);
                sum = [sum[0] + p[0] as f64, sum[1] + p[1] as f64];
            }
            // 5 standard errors of a uniform mean: 5 * 0.289/sqrt(4096).
            for s in sum {
                assert!((s / n as f64 - 0.5).abs() < 0.0226, "{}: {s}", kind.name());
            }
        }
    }

    #[test]
    fn cosine_hemisphere_has_mean_cosine_two_thirds() {
        let n = 1 << 12;
        let mean = (0..n)
            .map(|i| cosine_hemisphere(Sampler::new(Sampling::Sobol, 0, 0, 0, i).square(0)).z as f64)
            .sum::<f64>()
            / n as f64;
        assert!((mean - 2.0 / 3.0).abs() < 2e-3, "{mean}");
    }
}
