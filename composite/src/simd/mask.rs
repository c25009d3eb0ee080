//! Which pixels of a row are active: 64 of them a word, lowest bit first.
use crate::color::Color;
use crate::pixel::Composite;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x16, u32x16};

/// What a row, or several, held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) active: usize,
    /// Depths that are not a number.
    pub(crate) nan: u64,
}

/// Calls `put` with every word of the row. `depths` is empty for formats without depth.
#[inline(always)]
pub(crate) fn row_words<P: Composite, S: Simd>(
    simd: S,
    colors: &[P::Color],
    depths: &[f32],
    counts: &mut Counts,
    mut put: impl FnMut(u64),
) {
    if P::HAS_DEPTH {
        let (blocks, rest) = depths.as_chunks::<64>();
        for block in blocks {
            let one = f32x16::splat(simd, 1.0);
            let (mut word, mut numbers) = (0, 0);
            for quarter in 0..4 {
                let depth = f32x16::from_slice(simd, &block[16 * quarter..16 * quarter + 16]);
                word |= depth.simd_lt(one).to_bitmask() << (16 * quarter);
                numbers |= depth.simd_eq(depth).to_bitmask() << (16 * quarter);
            }
            counts.active += word.count_ones() as usize;
            counts.nan += u64::from(numbers.count_zeros());
            put(word);
        }
        if !rest.is_empty() {
            put(tail(rest, counts, |depth| (*depth < 1.0, depth.is_nan())));
        }
        return;
    }
    let (blocks, rest) = colors.as_chunks::<64>();
    for block in blocks {
        let mut word = 0;
        if P::Color::BYTES == 4 {
            let bytes: &[u8] = bytemuck::cast_slice(block);
            for quarter in 0..4 {
                let zero = crate::simd::runs::colors_16(simd, &bytes[64 * quarter..64 * quarter + 64])
                    .simd_eq(u32x16::splat(simd, 0));
                word |= (!zero.to_bitmask() & 0xffff) << (16 * quarter);
            }
        } else {
            for (bit, color) in block.iter().enumerate() {
                word |= u64::from(!color.is_zero()) << bit;
            }
        }
        counts.active += word.count_ones() as usize;
        put(word);
    }
    if !rest.is_empty() {
        put(tail(rest, counts, |color| (!color.is_zero(), false)));
    }
}

/// [`row_words`] one pixel after the other.
pub(crate) fn row_words_scalar<P: Composite>(
    colors: &[P::Color],
    depths: &[f32],
    counts: &mut Counts,
    mut put: impl FnMut(u64),
) {
    if P::HAS_DEPTH {
        for block in depths.chunks(64) {
            put(tail(block, counts, |depth| (*depth < 1.0, depth.is_nan())));
        }
    } else {
        for block in colors.chunks(64) {
            put(tail(block, counts, |color| (!color.is_zero(), false)));
        }
    }
}

#[inline(always)]
fn tail<T>(block: &[T], counts: &mut Counts, active_and_nan: impl Fn(&T) -> (bool, bool)) -> u64 {
    let mut word = 0;
    for (bit, value) in block.iter().enumerate() {
        let (active, nan) = active_and_nan(value);
        word |= u64::from(active) << bit;
        counts.nan += u64::from(nan);
    }
    counts.active += word.count_ones() as usize;
    word
}
