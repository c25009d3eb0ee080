//! Masks of the active pixels of a row: 64 pixels per word, lowest bit first.
use crate::color::Color;
use crate::pixel::Composite;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x16, u32x16};

/// Counts of one row or several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) active: usize,
    /// NaN depths.
    pub(crate) nan: u64,
}

/// Calls `put` with every mask word of the row. `depths` is empty for formats without depth.
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
            // Slabs and small bricks have rows shorter than a word.
            let one = f32x16::splat(simd, 1.0);
            let (quarters, last) = rest.as_chunks::<16>();
            let (mut word, mut not_numbers) = (0, 0);
            for (index, quarter) in quarters.iter().enumerate() {
                let depth = f32x16::from_slice(simd, quarter);
                word |= depth.simd_lt(one).to_bitmask() << (16 * index);
                not_numbers += (!depth.simd_eq(depth).to_bitmask() & 0xffff).count_ones();
            }
            counts.active += word.count_ones() as usize;
            counts.nan += u64::from(not_numbers);
            word |=
                tail(last, counts, |depth| (*depth < 1.0, depth.is_nan())) << (16 * quarters.len());
            put(word);
        }
        return;
    }
    let (blocks, rest) = colors.as_chunks::<64>();
    for block in blocks {
        let mut word = 0;
        if P::Color::BYTES == 4 {
            let bytes: &[u8] = bytemuck::cast_slice(block);
            for quarter in 0..4 {
                let zero =
                    crate::simd::runs::colors_16(simd, &bytes[64 * quarter..64 * quarter + 64])
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

/// [`row_words`] without vector types: loops over flags of one byte, which compilers turn into the
/// vectors that every machine has.
pub(crate) fn row_words_scalar<P: Composite>(
    colors: &[P::Color],
    depths: &[f32],
    counts: &mut Counts,
    mut put: impl FnMut(u64),
) {
    let mut flags = [0_u8; 64];
    if P::HAS_DEPTH {
        let (blocks, rest) = depths.as_chunks::<64>();
        for block in blocks {
            for (flag, depth) in flags.iter_mut().zip(block) {
                *flag = u8::from(*depth < 1.0);
            }
            counts.nan +=
                u64::from(block.iter().map(|depth| u32::from(depth.is_nan())).sum::<u32>());
            let word = packed(&flags);
            counts.active += word.count_ones() as usize;
            put(word);
        }
        if !rest.is_empty() {
            put(tail(rest, counts, |depth| (*depth < 1.0, depth.is_nan())));
        }
        return;
    }
    let (blocks, rest) = colors.as_chunks::<64>();
    for block in blocks {
        for (flag, color) in flags.iter_mut().zip(block) {
            *flag = u8::from(!color.is_zero());
        }
        let word = packed(&flags);
        counts.active += word.count_ones() as usize;
        put(word);
    }
    if !rest.is_empty() {
        put(tail(rest, counts, |color| (!color.is_zero(), false)));
    }
}

/// Packs 64 flags, each 0 or 1, into bits. The product moves the flag of byte i by 7 (8 - i) bits,
/// to bit 56 + i; no two flags collide, so there is no carry.
pub(crate) fn packed(flags: &[u8; 64]) -> u64 {
    let eights = flags.as_chunks::<8>().0.iter().enumerate();
    eights.fold(0, |word, (index, eight)| {
        let bits = u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        word | bits << (8 * index)
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_become_the_bits_of_their_places() {
        for word in [0, 1, 1 << 63, u64::MAX, 0x8421_8421_1248_1248, 0xff00_0000_0000_00f1] {
            let flags: [u8; 64] = std::array::from_fn(|bit| (word >> bit & 1) as u8);
            assert_eq!(packed(&flags), word);
        }
    }
}
