//! Expands the active pixels of a message to rows: merges them with the held pixels, or copies
//! them.
use crate::color::Color;
use crate::pixel::Composite;
use crate::simd::for_runs;
use crate::simd::runs::{nearest_run, nearest_run_scalar, over_one_by_one};
#[cfg(target_arch = "x86_64")]
use crate::simd::runs::{padded_16, take_nearer};
use fearless_simd::Simd;

/// Active pixels of one row of a message.
#[derive(Clone, Copy)]
pub(crate) struct SparseRow<'a> {
    /// Words of eight bytes; empty if every pixel of the row is active.
    pub(crate) mask: &'a [u8],
    pub(crate) colors: &'a [u8],
    /// Empty if the message has no depths.
    pub(crate) depths: &'a [u8],
    /// The whole message from the colours and from the depths on: bytes that may be read though
    /// they are not used.
    pub(crate) behind_colors: &'a [u8],
    pub(crate) behind_depths: &'a [u8],
}

/// How incoming pixels are merged with the held ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// They come from ranks before those held: in front, or the loser of ties.
    Lower,
    /// They come from ranks after those held.
    Higher,
}

/// Merges consecutive pixels, active or not, into those held.
#[inline(always)]
pub(crate) fn merge_run<P: Composite, S: Simd>(
    simd: S,
    colors: &[u8],
    depths: &[u8],
    held_colors: &mut [P::Color],
    held_depths: &mut [f32],
    side: Side,
) {
    if P::HAS_DEPTH {
        nearest_run(simd, colors, depths, held_colors, held_depths, side == Side::Higher);
    } else {
        P::Color::over_run(simd, colors, held_colors, side == Side::Lower);
    }
}

/// [`merge_run`] without vector types.
pub(crate) fn merge_run_scalar<P: Composite>(
    colors: &[u8],
    depths: &[u8],
    held_colors: &mut [P::Color],
    held_depths: &mut [f32],
    side: Side,
) {
    if P::HAS_DEPTH {
        nearest_run_scalar(colors, depths, held_colors, held_depths, side == Side::Higher);
    } else {
        over_one_by_one(colors, held_colors, side == Side::Lower);
    }
}

/// Makes inactive pixels of a depth format [empty](crate::PixelFormat::EMPTY).
#[inline(always)]
pub(crate) fn clean_run<P: Composite, S: Simd>(
    simd: S,
    colors: &mut [P::Color],
    depths: &mut [f32],
) {
    use fearless_simd::{SimdBase, SimdMask, f32x16};
    let whole = depths.len() / 16 * 16;
    for first in (0..whole).step_by(16) {
        let active =
            f32x16::from_slice(simd, &depths[first..first + 16]).simd_lt(f32x16::splat(simd, 1.0));
        if !active.all_true() {
            clean_run_scalar::<P>(&mut colors[first..first + 16], &mut depths[first..first + 16]);
        }
    }
    clean_run_scalar::<P>(&mut colors[whole..], &mut depths[whole..]);
}

/// [`clean_run`] without vector types.
#[inline(always)]
pub(crate) fn clean_run_scalar<P: Composite>(colors: &mut [P::Color], depths: &mut [f32]) {
    for (colors, depths) in colors.chunks_mut(64).zip(depths.chunks_mut(64)) {
        // Most blocks are entirely active: testing all of them is done four at a time, branching
        // for each is not.
        if depths.iter().fold(true, |all, depth| all & (*depth < 1.0)) {
            continue;
        }
        for (color, depth) in colors.iter_mut().zip(depths) {
            let active = *depth < 1.0;
            *color = if active { *color } else { P::EMPTY.color() };
            *depth = if active { *depth } else { 1.0 };
        }
    }
}

/// Merges a row of a message into the row held.
#[inline(always)]
pub(crate) fn merge_row<P: Composite, S: Simd>(
    simd: S,
    row: SparseRow<'_>,
    held_colors: &mut [P::Color],
    held_depths: &mut [f32],
    side: Side,
) {
    if row.mask.is_empty() {
        merge_run::<P, S>(simd, row.colors, row.depths, held_colors, held_depths, side);
        return;
    }
    let mut taken = 0;
    for (index, word) in words(row.mask).enumerate() {
        if word == 0 {
            continue;
        }
        let first = 64 * index;
        // Rows that end within the word, as those of slabs do, have fewer lanes for vectors.
        let mut word = word;
        if word != u64::MAX {
            let lanes = merge_by_vectors::<P, S>(
                simd,
                row,
                taken,
                word,
                first,
                held_colors,
                held_depths,
                side,
            );
            let done = if lanes == 64 { word } else { word & !(u64::MAX << lanes) };
            taken += done.count_ones() as usize;
            word ^= done;
        }
        for_runs(
            word,
            #[inline(always)]
            |start, length| {
                let (colors, depths) = taken_run::<P>(row, taken, length);
                let at = first + start;
                let held_depths =
                    if P::HAS_DEPTH { &mut held_depths[at..at + length] } else { &mut [] };
                merge_run::<P, S>(
                    simd,
                    colors,
                    depths,
                    &mut held_colors[at..at + length],
                    held_depths,
                    side,
                );
                taken += length;
            },
        );
    }
}

/// [`merge_row`] without vector types: run by run.
pub(crate) fn merge_row_scalar<P: Composite>(
    row: SparseRow<'_>,
    held_colors: &mut [P::Color],
    held_depths: &mut [f32],
    side: Side,
) {
    if row.mask.is_empty() {
        merge_run_scalar::<P>(row.colors, row.depths, held_colors, held_depths, side);
        return;
    }
    let mut taken = 0;
    for (index, word) in words(row.mask).enumerate() {
        for_runs(word, |start, length| {
            let (colors, depths) = taken_run::<P>(row, taken, length);
            let at = 64 * index + start;
            let held_depths =
                if P::HAS_DEPTH { &mut held_depths[at..at + length] } else { &mut [] };
            merge_run_scalar::<P>(
                colors,
                depths,
                &mut held_colors[at..at + length],
                held_depths,
                side,
            );
            taken += length;
        });
    }
}

/// Overwrites `colors` and, if it is not empty, `depths` with a row of a message, including its
/// background. A message for rows with depths must have depths.
#[inline(always)]
pub(crate) fn copy_row<P: Composite, S: Simd>(
    simd: S,
    row: SparseRow<'_>,
    colors: &mut [P::Color],
    depths: &mut [f32],
) {
    copy_words::<P>(
        row,
        colors,
        depths,
        #[inline(always)]
        |taken, word, held| copy_by_vectors::<P, S>(simd, row, taken, word, held),
    );
}

/// [`copy_row`] run by run.
pub(crate) fn copy_row_scalar<P: Composite>(
    row: SparseRow<'_>,
    colors: &mut [P::Color],
    depths: &mut [f32],
) {
    copy_words::<P>(row, colors, depths, |_, _, _| false);
}

/// `copy` may write the colours of a word of 64 pixels; it gets the number of colours read before,
/// and returns whether it has written them.
#[inline(always)]
fn copy_words<P: Composite>(
    row: SparseRow<'_>,
    colors: &mut [P::Color],
    depths: &mut [f32],
    copy: impl Fn(usize, u64, &mut [P::Color]) -> bool,
) {
    let with_depths = !depths.is_empty();
    if row.mask.is_empty() {
        bytemuck::cast_slice_mut::<_, u8>(colors).copy_from_slice(row.colors);
        if with_depths {
            bytemuck::cast_slice_mut::<_, u8>(depths).copy_from_slice(row.depths);
        }
        return;
    }
    let mut taken = 0;
    for (index, word) in words(row.mask).enumerate() {
        let first = 64 * index;
        let last = (first + 64).min(colors.len());
        if word == 0 {
            colors[first..last].fill(P::EMPTY.color());
            if with_depths {
                depths[first..last].fill(1.0);
            }
            continue;
        }
        if !with_depths && word != u64::MAX && copy(taken, word, &mut colors[first..last]) {
            taken += word.count_ones() as usize;
            continue;
        }
        if word != u64::MAX {
            colors[first..last].fill(P::EMPTY.color());
            if with_depths {
                depths[first..last].fill(1.0);
            }
        }
        for_runs(word, |start, length| {
            let at = first + start;
            let from = taken * P::Color::BYTES..(taken + length) * P::Color::BYTES;
            bytemuck::cast_slice_mut::<_, u8>(&mut colors[at..at + length])
                .copy_from_slice(&row.colors[from]);
            if with_depths {
                bytemuck::cast_slice_mut::<_, u8>(&mut depths[at..at + length])
                    .copy_from_slice(&row.depths[4 * taken..4 * (taken + length)]);
            }
            taken += length;
        });
    }
}

#[inline(always)]
fn taken_run<'a, P: Composite>(
    row: SparseRow<'a>,
    taken: usize,
    length: usize,
) -> (&'a [u8], &'a [u8]) {
    let colors = &row.colors[taken * P::Color::BYTES..(taken + length) * P::Color::BYTES];
    (colors, if P::HAS_DEPTH { &row.depths[4 * taken..4 * (taken + length)] } else { &[] })
}

#[inline(always)]
fn words(mask: &[u8]) -> impl Iterator<Item = u64> {
    mask.chunks_exact(8).map(bytemuck::pod_read_unaligned)
}

/// Merges as many of the 64 pixels of a word as there are vectors for: none, or all whole sixteens
/// of a depth format with colours of four bytes. Returns the number of pixels merged.
#[inline(always)]
fn merge_by_vectors<P: Composite, S: Simd>(
    simd: S,
    row: SparseRow<'_>,
    taken: usize,
    word: u64,
    first: usize,
    held_colors: &mut [P::Color],
    held_depths: &mut [f32],
    side: Side,
) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if P::Color::BYTES == 4
        && P::HAS_DEPTH
        && let Some(avx512) = simd.level().as_avx512()
    {
        use fearless_simd::{Bytes, SimdInto, u32x16};
        let end = (first + 64).min(held_depths.len());
        let held_bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut held_colors[first..end]);
        let held_depths = &mut held_depths[first..end];
        let mut taken = taken;
        let mut done = 0;
        let quarters =
            held_bytes.as_chunks_mut::<64>().0.iter_mut().zip(held_depths.as_chunks_mut::<16>().0);
        for (held_color, held_depth) in quarters {
            let lanes = (word >> done) as u16;
            done += 16;
            if lanes == 0 {
                continue;
            }
            let depth = padded_16(avx512, row.behind_depths, 4 * taken);
            let depth: u32x16<_> = expand_16(avx512, depth.into(), lanes).simd_into(avx512);
            let ties = side == Side::Higher;
            take_nearer(
                avx512,
                #[inline(always)]
                || -> u32x16<_> {
                    let packed = padded_16(avx512, row.behind_colors, 4 * taken);
                    expand_16(avx512, packed.into(), lanes).simd_into(avx512)
                },
                depth.bitcast(),
                held_color,
                held_depth,
                ties,
                u64::from(lanes),
            );
            taken += lanes.count_ones() as usize;
        }
        return done;
    }
    let _ = (simd, row, taken, word, first, held_colors, held_depths, side);
    0
}

/// Writes up to 64 pixels with colours of four bytes, background where `word` has no bit. Returns
/// whether there is an instruction for it.
#[inline(always)]
fn copy_by_vectors<P: Composite, S: Simd>(
    simd: S,
    row: SparseRow<'_>,
    taken: usize,
    word: u64,
    held: &mut [P::Color],
) -> bool {
    #[cfg(target_arch = "x86_64")]
    if P::Color::BYTES == 4
        && let Some(avx512) = simd.level().as_avx512()
    {
        use fearless_simd::{Bytes, SimdBase, SimdInto, u8x64, u32x16};
        let mut taken = taken;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(held);
        for (quarter, held) in bytes.chunks_mut(64).enumerate() {
            let lanes = (word >> (16 * quarter)) as u16;
            let packed = padded_16(avx512, row.behind_colors, 4 * taken);
            // The empty colour of a depth or a premultiplied format is all zeros.
            let colors: u32x16<_> = expand_16(avx512, packed.into(), lanes).simd_into(avx512);
            let colors = colors.bitcast::<u8x64<_>>();
            if held.len() == 64 {
                colors.store_slice(held);
            } else {
                let mut last = [0; 64];
                colors.store_slice(&mut last);
                held.copy_from_slice(&last[..held.len()]);
            }
            taken += lanes.count_ones() as usize;
        }
        return true;
    }
    let _ = (simd, row, taken, word, held);
    false
}

#[cfg(target_arch = "x86_64")]
fearless_simd::kernel!(
    #[inline]
    fn expand_16(
        avx512: Avx512,
        values: std::arch::x86_64::__m512i,
        lanes: u16,
    ) -> std::arch::x86_64::__m512i {
        std::arch::x86_64::_mm512_maskz_expand_epi32(lanes, values)
    }
);
