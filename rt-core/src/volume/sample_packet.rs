//! Sixteen rays through a volume, a sample of each at a time.
//!
//! Positions and colours are in f32, as in OpenGL. A position is computed from the number of its
//! sample, not from the one before, so errors do not add up: among 2,048 cells it is off by 10⁻⁴ of
//! a cell. No lane reads another one: a ray has the same bits alone and among others. There is no
//! fused arithmetic, so it has the same bits with every instruction set.

use super::MACROCELL;
use super::sample_gradient::gradient;
use super::sample_medium::{Cells, Gradients, Medium};
use crate::ray::LANES;
use crate::simd::gather::GatherSlice;
use crate::simd::vectors::{Row, Rows3, Vec3x16};
#[cfg(not(target_arch = "x86_64"))]
use fearless_simd::dispatch;
use fearless_simd::{Level, Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, i32x16};
use glam::UVec3;

/// The share of the light behind below which a ray ends: what follows adds less than a level of
/// 255. VTK ends rays there as well.
const OPAQUE_BELOW: f32 = 1.0 / 255.0;
/// Samples after which a packet looks for empty space again.
const SAMPLES_PER_LOOK: u32 = 4;

/// Sixteen rays, in cells of the grid.
pub(super) struct Packet {
    /// Where each enters the grid, and the step to the next sample.
    pub(super) origin: Rows3,
    pub(super) step: Rows3,
    /// Unit directions from the viewer, in the volume's axes and world lengths.
    pub(super) view: Rows3,
    /// Numbers of the first and the last sample; an unused lane has none.
    pub(super) first: Row,
    pub(super) last: Row,
    /// The share of the light behind that passes what is in front of the first sample.
    pub(super) through: Row,
}

impl Packet {
    pub(super) const EMPTY: Packet = Packet {
        origin: Rows3::ZERO,
        step: Rows3::ZERO,
        view: Rows3::ZERO,
        first: [1.0; LANES],
        last: [0.0; LANES],
        through: [1.0; LANES],
    };
}

/// What sixteen rays collected.
pub(super) struct Collected {
    /// Multiplied by opacity.
    pub(super) color: [Row; 3],
    pub(super) transmittance: Row,
    /// Number of the sample with which the opacity reaches one half; 0 where it does not.
    pub(super) half: Row,
    /// Samples with an opacity.
    pub(super) samples: Row,
}

impl Collected {
    const NOTHING: Collected = Collected {
        color: [[0.0; LANES]; 3],
        transmittance: [1.0; LANES],
        half: [0.0; LANES],
        samples: [0.0; LANES],
    };
}

/// Marches all rays to their ends.
pub(super) fn march(level: Level, medium: &Medium<'_>, packet: &Packet) -> Collected {
    // SSE4.2 takes SSE2's: processors between it and AVX2 are older than 2013, and a third of the
    // code would be for them.
    #[cfg(target_arch = "x86_64")]
    let level = match level {
        Level::Sse4_2(_) => level.as_sse2().map_or(level, Level::Sse2),
        level => level,
    };
    #[cfg(target_arch = "x86_64")]
    return match level {
        Level::Avx512(simd) => march_with(simd, medium, packet),
        Level::Avx2(simd) => march_with(simd, medium, packet),
        Level::Sse2(simd) => march_with(simd, medium, packet),
        // No further level exists on this architecture.
        _ => Collected::NOTHING,
    };
    #[cfg(not(target_arch = "x86_64"))]
    dispatch!(level, simd => march_with(simd, medium, packet))
}

#[inline(never)]
fn march_with<S: Simd>(simd: S, medium: &Medium<'_>, packet: &Packet) -> Collected {
    simd.vectorize(
        #[inline(always)]
        || medium.march(simd, packet),
    )
}

impl Medium<'_> {
    #[inline(always)]
    fn march<S: Simd>(&self, simd: S, packet: &Packet) -> Collected {
        let s = |x: f32| f32x16::splat(simd, x);
        let (zero, one) = (s(0.0), s(1.0));
        let origin = Vec3x16::load(simd, &packet.origin);
        let step = Vec3x16::load(simd, &packet.step);
        let view = Vec3x16::load(simd, &packet.view);
        let last = f32x16::from_slice(simd, &packet.last);
        let mut number = f32x16::from_slice(simd, &packet.first);
        let mut through = f32x16::from_slice(simd, &packet.through);
        let mut active = number.simd_le(last) & through.simd_ge(s(OPAQUE_BELOW));
        let mut color = [zero; 3];
        let (mut half, mut samples) = (zero, zero);
        let mut until_look = 0;
        while active.any_true() {
            let place = origin.add(step.scale(number));
            if let Some((distances, blocks)) = self.empty {
                if until_look == 0 {
                    let empty = self.empty_apart(simd, distances, blocks, place, step);
                    let least = active.select(empty, s(f32::INFINITY)).reduce_min();
                    if least > 0.0 {
                        number += empty;
                        active &= number.simd_le(last);
                        continue;
                    }
                    until_look = SAMPLES_PER_LOOK;
                }
                until_look -= 1;
            }

            // ---- Scalar and opacity.
            let cells = self.cells(simd, place);
            let scalar = self.scalar(simd, &cells);
            let (entry, part) = self.entries(simd, scalar);
            let [a, b] = self.opacity.pairs(simd, entry);
            // NaN is not less either.
            let seen = active & scalar.abs().simd_lt(s(f32::INFINITY));
            let mut opacity = seen.select(a + (b - a) * part, zero);
            let mut is_seen = opacity.simd_gt(zero);

            if is_seen.any_true() {
                // ---- Colour and light.
                let mut rgb = [zero; 3];
                for (c, channel) in rgb.iter_mut().zip(self.color) {
                    let [a, b] = channel.pairs(simd, entry);
                    *c = a + (b - a) * part;
                }
                if let Some(gradients) = &self.gradients {
                    let g = self.gradient_apart(simd, gradients, &cells);
                    let steepness = g.dot(g).sqrt();
                    if let Some(factors) = &gradients.factors {
                        opacity *= factors.at(simd, steepness);
                        is_seen = opacity.simd_gt(zero);
                    }
                    if let Some(lights) = gradients.lights {
                        rgb = lights.on_apart(simd, g, steepness, view, rgb);
                    }
                }

                // ---- In front of what follows.
                let weight = through * opacity;
                for (sum, c) in color.iter_mut().zip(rgb) {
                    *sum = is_seen.select(*sum + weight * c, *sum);
                }
                let behind = is_seen.select(through * (one - opacity), through);
                let crosses = through.simd_gt(s(0.5)) & behind.simd_le(s(0.5));
                half = crosses.select(number, half);
                samples += is_seen.select(one, zero);
                through = behind;
                active &= through.simd_ge(s(OPAQUE_BELOW));
            }
            number += one;
            active &= number.simd_le(last);
        }
        let mut out = Collected::NOTHING;
        for (row, sum) in out.color.iter_mut().zip(color) {
            sum.store_slice(row);
        }
        through.store_slice(&mut out.transmittance);
        half.store_slice(&mut out.half);
        samples.store_slice(&mut out.samples);
        out
    }

    // Functions of their own, with the instruction set of the caller: inlined into the march, they
    // took the compiler ten minutes. What they call is inlined always, because a closure or a
    // function that is not has no instruction set, and a call for each operation.
    #[inline(never)]
    fn gradient_apart<S: Simd>(
        &self,
        simd: S,
        gradients: &Gradients<'_>,
        cells: &Cells<S>,
    ) -> Vec3x16<S> {
        simd.vectorize(
            #[inline(always)]
            || gradient(simd, self, gradients, cells),
        )
    }

    #[inline(never)]
    fn empty_apart<S: Simd>(
        &self,
        simd: S,
        distances: GatherSlice<'_>,
        blocks: UVec3,
        place: Vec3x16<S>,
        step: Vec3x16<S>,
    ) -> f32x16<S> {
        simd.vectorize(
            #[inline(always)]
            || self.empty_samples(simd, distances, blocks, place, step),
        )
    }

    /// How many samples from here on lie in empty blocks: all of them have no opacity. 0 in other
    /// blocks, and at least 1 in empty ones.
    #[inline(always)]
    fn empty_samples<S: Simd>(
        &self,
        simd: S,
        distances: GatherSlice<'_>,
        blocks: UVec3,
        place: Vec3x16<S>,
        step: Vec3x16<S>,
    ) -> f32x16<S> {
        let (x, bx) = self.block(simd, place.x, self.dims.x);
        let (y, by) = self.block(simd, place.y, self.dims.y);
        let (z, bz) = self.block(simd, place.z, self.dims.z);
        let whole = |v: f32x16<S>| v.to_int::<i32x16<S>>();
        let row = whole(bz) * i32x16::splat(simd, blocks.y as i32) + whole(by);
        let index = row * i32x16::splat(simd, blocks.x as i32) + whole(bx);
        let distance = distances.numbers(simd, index);
        let until = steps_in_box(simd, [x, bx, step.x], distance)
            .min(steps_in_box(simd, [y, by, step.y], distance))
            .min(steps_in_box(simd, [z, bz, step.z], distance));
        // One less than all of them, for rounding; the one here is empty in any case.
        let count = until.floor().max(f32x16::splat(simd, 1.0));
        let zero = f32x16::splat(simd, 0.0);
        distance.simd_gt(zero).select(count, zero)
    }

    /// Places along an axis, inside the grid, and the blocks that they are in. With nearest values
    /// blocks begin half a spacing before their first point, and places are counted from there.
    #[inline(always)]
    fn block<S: Simd>(&self, simd: S, place: f32x16<S>, points: u32) -> (f32x16<S>, f32x16<S>) {
        let s = |x: f32| f32x16::splat(simd, x);
        let place = place.max(s(0.0)).min(s((points - 1) as f32));
        let (place, last) =
            if self.nearest { (place + s(0.5), points - 1) } else { (place, points - 2) };
        let cell = place.floor().min(s(last as f32));
        (place, (cell * s(1.0 / MACROCELL as f32)).floor())
    }
}

/// Samples until a ray leaves the box of empty blocks around its own one, along one axis.
#[inline(always)]
fn steps_in_box<S: Simd>(
    simd: S,
    [place, block, step]: [f32x16<S>; 3],
    distance: f32x16<S>,
) -> f32x16<S> {
    let s = |x: f32| f32x16::splat(simd, x);
    let size = s(MACROCELL as f32);
    let low = (block - distance + s(1.0)) * size;
    let high = (block + distance) * size;
    let left = step.simd_gt(s(0.0)).select(high - place, place - low);
    left / step.abs().max(s(1e-30))
}
