//! Sample points in the unit square. They depend only on seed, pixel, sample and dimension, for any
//! number of threads.
//!
//! [`Sampling::Sobol`] is the (0,2)-sequence made of Sobol's first two dimensions, shuffled and
//! Owen-scrambled per pixel and per dimension by hashing (Burley, "Practical Hash-based Owen
//! Scrambling", JCGT 2020). Every aligned run of 2^k points has one point in each of the 2^k
//! elementary intervals, so k can grow without starting again. [`Sampling::Random`] has independent
//! points: the baseline that the accuracy experiments compare with.

use crate::ray::LANES;
use crate::simd::vectors::Row;
use fearless_simd::Simd;

/// How sample points are distributed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Sampling {
    /// Owen-scrambled (0,2)-sequence: the error decreases nearly as 1/n where the integrand is
    /// smooth.
    #[default]
    Sobol,
    /// Independent uniform points: the error decreases as 1/√n.
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
    /// Points for sample `index` of the pixel at (`x`, `y`) of the whole image.
    #[inline]
    pub fn new(kind: Sampling, seed: u64, x: u32, y: u32, index: u32) -> Sampler {
        Sampler { kind, pixel: pixel_key(seed, x, y), index }
    }

    /// The point of dimension `dimension` (a pair of axes; each use needs its own number).
    #[inline]
    pub fn square(&self, dimension: u32) -> [f32; 2] {
        self.point(self.index, dimension)
    }

    /// Point `k` of `count` in dimension `dimension`: the points of all k and all samples together
    /// are one sequence.
    #[inline]
    pub fn square_of(&self, dimension: u32, k: u32, count: u32) -> [f32; 2] {
        self.point(self.index.wrapping_mul(count).wrapping_add(k), dimension)
    }

    #[inline]
    fn point(&self, index: u32, dimension: u32) -> [f32; 2] {
        match self.kind {
            Sampling::Sobol => sobol_point(self.pixel, index, dimension),
            Sampling::Random => random_point(self.pixel, index, dimension),
        }
    }
}

/// Points for sixteen uses at once: the functions of [`Sampler`] in loops that the compiler
/// vectorizes.
#[repr(C, align(64))]
pub(crate) struct SamplerBlock {
    pixel: [u32; LANES],
    index: [u32; LANES],
    dimension: [u32; LANES],
    kind: Sampling,
}

impl SamplerBlock {
    pub(crate) fn new(kind: Sampling) -> SamplerBlock {
        SamplerBlock { kind, pixel: [0; LANES], index: [0; LANES], dimension: [0; LANES] }
    }

    /// Requests [`Sampler::square_of`]`(dimension, k, count)` for lane `lane`.
    #[inline]
    pub(crate) fn set(
        &mut self,
        lane: usize,
        sampler: &Sampler,
        dimension: u32,
        k: u32,
        count: u32,
    ) {
        self.pixel[lane] = sampler.pixel;
        self.index[lane] = sampler.index.wrapping_mul(count).wrapping_add(k);
        self.dimension[lane] = dimension;
    }

    /// Requests [`Sampler::square`]`(dimension)` of sample `index` for all lanes, each of its own
    /// pixel.
    #[inline(never)]
    pub(crate) fn set_pixels<S: Simd>(
        &mut self,
        simd: S,
        seed: u64,
        (x, y): (&[u32; LANES], &[u32; LANES]),
        index: u32,
        dimension: u32,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                (self.index, self.dimension) = ([index; LANES], [dimension; LANES]);
                for lane in 0..LANES {
                    self.pixel[lane] = pixel_key(seed, x[lane], y[lane]);
                }
            },
        );
    }

    /// Points of the unit square.
    #[inline(never)]
    pub(crate) fn squares<S: Simd>(&self, simd: S) -> [Row; 2] {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut out = [[0.0; LANES]; 2];
                match self.kind {
                    Sampling::Sobol => {
                        for lane in 0..LANES {
                            let p = sobol_point(
                                self.pixel[lane],
                                self.index[lane],
                                self.dimension[lane],
                            );
                            (out[0][lane], out[1][lane]) = (p[0], p[1]);
                        }
                    }
                    Sampling::Random => {
                        for lane in 0..LANES {
                            let p = random_point(
                                self.pixel[lane],
                                self.index[lane],
                                self.dimension[lane],
                            );
                            (out[0][lane], out[1][lane]) = (p[0], p[1]);
                        }
                    }
                }
                out
            },
        )
    }

    /// As [`SamplerBlock::cosine_hemispheres`] for `count` points in a row of each lane, the first
    /// of which was [requested](SamplerBlock::set): calls `give(k, directions)` for each of them.
    #[inline(never)]
    pub(crate) fn cosine_hemispheres_in_a_row<S: Simd>(
        &mut self,
        simd: S,
        count: u32,
        mut give: impl FnMut(usize, [Row; 3]),
    ) {
        if self.kind != Sampling::Sobol {
            for k in 0..count {
                give(k as usize, self.cosine_hemispheres(simd));
                self.index.iter_mut().for_each(|i| *i = i.wrapping_add(1));
            }
            return;
        }
        simd.vectorize(
            #[inline(always)]
            || {
                // What does not depend on the point is computed once.
                let mut seeds = [[0; LANES]; 3];
                for lane in 0..LANES {
                    let s = sobol_seeds(self.pixel[lane], self.dimension[lane]);
                    (seeds[0][lane], seeds[1][lane], seeds[2][lane]) = (s[0], s[1], s[2]);
                }
                for k in 0..count {
                    let mut out = [[0.0; LANES]; 3];
                    for lane in 0..LANES {
                        let seeds = [seeds[0][lane], seeds[1][lane], seeds[2][lane]];
                        let at = sobol_point_of(seeds, self.index[lane].wrapping_add(k));
                        let d = cosine_hemisphere(at);
                        (out[0][lane], out[1][lane], out[2][lane]) = (d.x, d.y, d.z);
                    }
                    give(k as usize, out);
                }
            },
        );
    }

    /// Directions by [`cosine_hemisphere`].
    #[inline(never)]
    pub(crate) fn cosine_hemispheres<S: Simd>(&self, simd: S) -> [Row; 3] {
        let [a, b] = self.squares(simd);
        simd.vectorize(
            #[inline(always)]
            || {
                let mut out = [[0.0; LANES]; 3];
                for lane in 0..LANES {
                    let d = cosine_hemisphere([a[lane], b[lane]]);
                    (out[0][lane], out[1][lane], out[2][lane]) = (d.x, d.y, d.z);
                }
                out
            },
        )
    }
}

/// Hash that distinguishes pixels (and images).
#[inline(always)]
fn pixel_key(seed: u64, x: u32, y: u32) -> u32 {
    hash(hash(x ^ seed as u32).wrapping_add(y)) ^ hash((seed >> 32) as u32 ^ 0x5bd1_e995)
}

#[inline(always)]
fn sobol_point(pixel: u32, index: u32, dimension: u32) -> [f32; 2] {
    sobol_point_of(sobol_seeds(pixel, dimension), index)
}

/// Seeds of the shuffle and of the two axes' scrambles.
#[inline(always)]
fn sobol_seeds(pixel: u32, dimension: u32) -> [u32; 3] {
    let seed = hash(pixel.wrapping_add(dimension.wrapping_mul(0x9e37_79b9)));
    [seed, hash(seed ^ 0x68bc_21eb), hash(seed ^ 0x02e5_be93)]
}

#[inline(always)]
fn sobol_point_of([shuffle, x, y]: [u32; 3], index: u32) -> [f32; 2] {
    let i = owen_scramble(index, shuffle);
    [to_unit(owen_scramble(i.reverse_bits(), x)), to_unit(owen_scramble(sobol_second(i), y))]
}

#[inline(always)]
fn random_point(pixel: u32, index: u32, dimension: u32) -> [f32; 2] {
    let seed = hash(pixel.wrapping_add(dimension.wrapping_mul(0x9e37_79b9)));
    let a = hash(seed ^ hash(index));
    [to_unit(a), to_unit(hash(a ^ 0x3c6e_f372))]
}

/// The top 24 bits as a number in 0..1 (1 excluded: every value is exact in f32).
#[inline(always)]
fn to_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Sobol's second dimension as a 32-bit fraction. Its generator matrix is Pascal's triangle mod 2,
/// which by Lucas' theorem is a Kronecker power: five masked shifts do the work of 32 conditional
/// exclusive-ors.
#[inline(always)]
fn sobol_second(i: u32) -> u32 {
    let mut v = i;
    v ^= (v & 0xaaaa_aaaa) >> 1;
    v ^= (v & 0xcccc_cccc) >> 2;
    v ^= (v & 0xf0f0_f0f0) >> 4;
    v ^= (v & 0xff00_ff00) >> 8;
    v ^= (v & 0xffff_0000) >> 16;
    v.reverse_bits()
}

/// Nested uniform scrambling: each bit is flipped by a hash of the bits above it (Laine and Karras
/// 2011, with Burley's constants, on reversed bits).
#[inline(always)]
fn owen_scramble(v: u32, seed: u32) -> u32 {
    let mut x = v.reverse_bits().wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// 32 bits to 32 well-mixed bits, one to one (the "lowbias32" constants of Wellons' hash
/// prospector).
#[inline(always)]
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

/// Uniform point in the unit disk: the concentric map of Shirley and Chiu (1997), which keeps
/// neighbours together.
#[inline]
pub fn unit_disk([a, b]: [f32; 2]) -> [f32; 2] {
    let (x, y) = (2.0 * a - 1.0, 2.0 * b - 1.0);
    // Angles are counted from the nearer axis, x or y. No branches, so that the compiler vectorizes
    // loops over this.
    let near_x = x.abs() > y.abs();
    let (r, across) = if near_x { (x, y) } else { (y, x) };
    let ratio = across / if r == 0.0 { 1.0 } else { r };
    let (sin, cos) = sin_cos_to_45_degrees(std::f32::consts::FRAC_PI_4 * ratio);
    if near_x { [r * cos, r * sin] } else { [r * sin, r * cos] }
}

/// Sine and cosine of angles within ±π/4 to 1·10⁻⁷, with the same bits on every platform
/// (polynomials of Moshier's Cephes library, sinf.c).
#[inline(always)]
fn sin_cos_to_45_degrees(x: f32) -> (f32, f32) {
    let z = x * x;
    let sin = x + x * z * (-0.166_666_55 + z * (0.008_332_161 + z * -0.000_195_152_96));
    let cos =
        1.0 - 0.5 * z + z * z * (0.041_666_646 + z * (-0.001_388_731_6 + z * 0.000_024_433_157));
    (sin, cos)
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
    fn blocks_have_the_points_of_single_samplers_at_every_level() {
        use crate::simd::SimdLevel;
        for level in SimdLevel::available().into_iter().map(Some).chain([None]) {
            for kind in Sampling::ALL {
                let one = |lane: u32| Sampler::new(kind, 77 << 20, lane * 37, 5 + lane, lane / 3);
                let mut block = SamplerBlock::new(kind);
                for lane in 0..LANES as u32 {
                    block.set(lane as usize, &one(lane), lane % 4, 2 * lane, 9);
                }
                let pixels = (
                    &std::array::from_fn(|l| 7 * l as u32),
                    &std::array::from_fn(|l| 100 + l as u32),
                );
                let mut same_sample = SamplerBlock::new(kind);
                let level = SimdLevel::resolve(level).expect("a level of this machine");
                let (squares, domes, camera) = fearless_simd::dispatch!(level, simd => {
                    same_sample.set_pixels(simd, 12 << 33, pixels, 3, 1);
                    (block.squares(simd), block.cosine_hemispheres(simd), same_sample.squares(simd))
                });
                for lane in 0..LANES {
                    let l = lane as u32;
                    let p = one(l).square_of(l % 4, 2 * l, 9);
                    let d = cosine_hemisphere(p);
                    assert_eq!([squares[0][lane], squares[1][lane]], p);
                    assert_eq!([domes[0][lane], domes[1][lane], domes[2][lane]], d.to_array());
                    let c =
                        Sampler::new(kind, 12 << 33, pixels.0[lane], pixels.1[lane], 3).square(1);
                    assert_eq!([camera[0][lane], camera[1][lane]], c);
                }
            }
        }
    }

    #[test]
    fn directions_in_a_row_are_those_of_single_points_at_every_level() {
        use crate::simd::SimdLevel;
        for level in SimdLevel::available().into_iter().map(Some).chain([None]) {
            for kind in Sampling::ALL {
                let one = |lane: u32| Sampler::new(kind, 5 << 34, 3 + lane, 91 * lane, lane % 3);
                let mut block = SamplerBlock::new(kind);
                for lane in 0..LANES as u32 {
                    block.set(lane as usize, &one(lane), 4 + lane % 2, 0, 11);
                }
                let level = SimdLevel::resolve(level).expect("a level of this machine");
                let mut given = Vec::new();
                fearless_simd::dispatch!(level, simd => {
                    block.cosine_hemispheres_in_a_row(simd, 11, |k, rows| given.push((k, rows)))
                });
                assert_eq!(given.len(), 11);
                for (k, rows) in given {
                    for lane in 0..LANES {
                        let l = lane as u32;
                        let p = one(l).square_of(4 + l % 2, k as u32, 11);
                        let expected = cosine_hemisphere(p).to_array();
                        assert_eq!(rows.map(|row| row[lane]), expected, "point {k} of lane {lane}");
                    }
                }
            }
        }
    }

    #[test]
    fn disk_points_are_where_sine_and_cosine_say() {
        use std::f64::consts::FRAC_PI_4;
        for k in 0..=100_000 {
            let x = (k as f32 / 50_000.0 - 1.0) * FRAC_PI_4 as f32;
            let (sin, cos) = sin_cos_to_45_degrees(x);
            assert!(
                (sin as f64 - (x as f64).sin()).abs() < 1e-7
                    && (cos as f64 - (x as f64).cos()).abs() < 1e-7,
                "{x}"
            );
        }
        assert_eq!(unit_disk([0.5, 0.5]), [0.0, 0.0]);
        assert_eq!(unit_disk([1.0, 0.5]), [1.0, 0.0]);
        assert_eq!(unit_disk([0.5, 0.0]), [0.0, -1.0]);
        let [x, y] = unit_disk([0.0, 0.0]);
        assert!((x + 0.5f32.sqrt()).abs() < 1e-7 && (x - y).abs() < 1e-7, "{x} {y}");
    }

    #[test]
    fn every_elementary_interval_has_one_point() {
        // The (0,2) property after scrambling: 64 points, all 7 ways to cut the square into 64
        // boxes.
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
                        assert!(
                            !std::mem::replace(&mut seen[cell], true),
                            "two points in one {nx}x{ny} box"
                        );
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
            .map(|i| {
                cosine_hemisphere(Sampler::new(Sampling::Sobol, 0, 0, 0, i).square(0)).z as f64
            })
            .sum::<f64>()
            / n as f64;
        assert!((mean - 2.0 / 3.0).abs() < 2e-3, "{mean}");
    }
}
