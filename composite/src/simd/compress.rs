//! Compresses a row of pixels to its active pixels.
use crate::simd::for_runs;
#[cfg(target_arch = "x86_64")]
use crate::simd::runs::{colors_16, padded_16};
use fearless_simd::Simd;

/// Appends the values of `SIZE` bytes in `row` whose bits are set in the mask words at `mask_at` of
/// `out`.
#[inline(always)]
pub(crate) fn append_active<const SIZE: usize, S: Simd>(
    simd: S,
    out: &mut Vec<u8>,
    mask_at: usize,
    row: &[u8],
) {
    // Capacity for the whole row and one vector more, so that the buffer need not grow below.
    out.reserve(row.len() + 64);
    for (index, block) in row.chunks(64 * SIZE).enumerate() {
        let word = word_at(out, mask_at + 8 * index);
        if word == 0 {
            continue;
        }
        if word == u64::MAX {
            out.extend_from_slice(block);
        } else if !append_by_vectors::<SIZE, S>(simd, out, word, block) {
            append_by_runs::<SIZE>(out, word, block);
        }
    }
}

/// [`append_active`] without vector types: run by run.
pub(crate) fn append_active_scalar<const SIZE: usize>(
    out: &mut Vec<u8>,
    mask_at: usize,
    row: &[u8],
) {
    out.reserve(row.len() + 64);
    for (index, block) in row.chunks(64 * SIZE).enumerate() {
        match word_at(out, mask_at + 8 * index) {
            0 => {}
            u64::MAX => out.extend_from_slice(block),
            word => append_by_runs::<SIZE>(out, word, block),
        }
    }
}

#[inline(always)]
fn append_by_runs<const SIZE: usize>(out: &mut Vec<u8>, word: u64, block: &[u8]) {
    for_runs(word, |first, length| {
        // Short runs are common in fragmented images, and a copy of fixed length costs less than
        // one of variable length.
        let (from, bytes) = (first * SIZE, length * SIZE);
        if bytes <= 16 && from + 16 <= block.len() {
            out.extend_from_slice(&block[from..from + 16]);
            out.truncate(out.len() - 16 + bytes);
        } else {
            out.extend_from_slice(&block[from..from + bytes]);
        }
    });
}

/// Returns whether there is an instruction for it.
#[inline(always)]
fn append_by_vectors<const SIZE: usize, S: Simd>(
    simd: S,
    out: &mut Vec<u8>,
    word: u64,
    block: &[u8],
) -> bool {
    #[cfg(target_arch = "x86_64")]
    if SIZE == 4
        && let Some(avx512) = simd.level().as_avx512()
    {
        use fearless_simd::{Bytes, SimdBase, SimdInto, u8x64, u32x16};
        for quarter in 0..4 {
            let lanes = (word >> (16 * quarter)) as u16;
            if lanes == 0 {
                continue;
            }
            let at = 64 * quarter;
            let values = match block.get(at..at + 64) {
                Some(whole) => colors_16(avx512, whole),
                None => padded_16(avx512, block, at),
            };
            let packed: u32x16<_> = compress_16(avx512, values.into(), lanes).simd_into(avx512);
            let mut bytes = [0; 64];
            packed.bitcast::<u8x64<_>>().store_slice(&mut bytes);
            out.extend_from_slice(&bytes);
            out.truncate(out.len() - 64 + 4 * lanes.count_ones() as usize);
        }
        return true;
    }
    let _ = (simd, out, word, block);
    false
}

#[cfg(target_arch = "x86_64")]
fearless_simd::kernel!(
    #[inline]
    fn compress_16(
        avx512: Avx512,
        values: std::arch::x86_64::__m512i,
        lanes: u16,
    ) -> std::arch::x86_64::__m512i {
        std::arch::x86_64::_mm512_maskz_compress_epi32(lanes, values)
    }
);

#[inline(always)]
fn word_at(bytes: &[u8], at: usize) -> u64 {
    bytemuck::pod_read_unaligned(&bytes[at..at + 8])
}
