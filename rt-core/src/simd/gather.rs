//! Loads from sixteen places at once.
//!
//! Pairs of neighbours are what an interpolant reads, and one load of eight bytes costs as much as
//! one of four.

use fearless_simd::{Bytes, Simd, SimdBase, SimdFrom, f32x16, i32x16, u32x16};

/// Numbers that can be gathered: at least two, and few enough for indices of 32 bits.
#[derive(Clone, Copy)]
pub(crate) struct GatherSlice<'a> {
    values: &'a [f32],
    /// Index of the last pair.
    last: u32,
}

impl<'a> GatherSlice<'a> {
    /// `None` for fewer than two numbers, or more than an index of 32 bits counts.
    #[inline]
    pub(crate) fn new(values: &'a [f32]) -> Option<Self> {
        let last = i32::try_from(values.len()).ok()?.checked_sub(2)?;
        Some(GatherSlice { values, last: u32::try_from(last).ok()? })
    }

    /// `values[i]` and `values[i + 1]` for each index, which is clamped to the last pair.
    #[inline(always)]
    pub(crate) fn pairs<S: Simd>(self, simd: S, index: i32x16<S>) -> [f32x16<S>; 2] {
        let index = index.bitcast::<u32x16<S>>().min(u32x16::splat(simd, self.last));
        let index: [u32; 16] = index.into();
        #[cfg(target_arch = "x86_64")]
        if simd.level().as_avx512().is_some() {
            // SAFETY: the processor has AVX-512, and every index is at most `last`, so both
            // numbers of the pair are in `values`.
            let [a, b] = unsafe { pairs_avx512(self.values.as_ptr(), &index) };
            return [f32x16::simd_from(simd, a), f32x16::simd_from(simd, b)];
        }
        let [a, b] = self.pairs_four_at_a_time(&index);
        [f32x16::simd_from(simd, a), f32x16::simd_from(simd, b)]
    }

    /// `values[i]` for each index, which is clamped to the first of the last pair.
    #[inline(always)]
    pub(crate) fn numbers<S: Simd>(self, simd: S, index: i32x16<S>) -> f32x16<S> {
        let index = index.bitcast::<u32x16<S>>().min(u32x16::splat(simd, self.last));
        let index: [u32; 16] = index.into();
        #[cfg(target_arch = "x86_64")]
        if simd.level().as_avx512().is_some() {
            // SAFETY: the processor has AVX-512, and every index is at most `last`.
            let a = unsafe { numbers_avx512(self.values.as_ptr(), &index) };
            return f32x16::simd_from(simd, a);
        }
        f32x16::simd_from(simd, self.numbers_one_by_one(&index))
    }

    // Not inlined: a gradient reads sixteen pairs of sixteen lanes, and with all of their loads in
    // one function rt-core took three times as long to compile.
    #[inline(never)]
    fn pairs_four_at_a_time(self, index: &[u32; 16]) -> [[f32; 16]; 2] {
        let pair = |lane: usize| {
            let i = index[lane].min(self.last) as usize;
            // SAFETY: the index is at most `last`, which is two less than the length.
            unsafe { self.values.get_unchecked(i..i + 2) }
        };
        let mut out = [[0.0; 16]; 2];
        #[cfg(target_arch = "x86_64")]
        for (k, lane) in (0..16).step_by(4).enumerate() {
            let pairs = [0, 1, 2, 3].map(|i| pair(lane + i).as_ptr().cast());
            // SAFETY: every pointer is to two numbers; the loads need no alignment.
            let (a, b) = unsafe { four_pairs(pairs) };
            out[0].as_chunks_mut::<4>().0[k] = a;
            out[1].as_chunks_mut::<4>().0[k] = b;
        }
        #[cfg(not(target_arch = "x86_64"))]
        for lane in 0..16 {
            let pair = pair(lane);
            (out[0][lane], out[1][lane]) = (pair[0], pair[1]);
        }
        out
    }

    #[inline(never)]
    fn numbers_one_by_one(self, index: &[u32; 16]) -> [f32; 16] {
        // SAFETY: the index is at most `last`, which is less than the length.
        index.map(|i| unsafe { *self.values.get_unchecked(i.min(self.last) as usize) })
    }
}

/// The first and the second numbers of four pairs: one load of eight bytes for each pair.
///
/// # Safety
/// Each pointer is to two numbers of four bytes.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
unsafe fn four_pairs(pairs: [*const f64; 4]) -> ([f32; 4], [f32; 4]) {
    use std::arch::x86_64::*;
    // SAFETY: the caller's promise for the loads; SSE2, which every such processor has.
    unsafe {
        let low = _mm_castpd_ps(_mm_loadh_pd(_mm_load_sd(pairs[0]), pairs[1]));
        let high = _mm_castpd_ps(_mm_loadh_pd(_mm_load_sd(pairs[2]), pairs[3]));
        let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
        _mm_storeu_ps(a.as_mut_ptr(), _mm_shuffle_ps::<0b10_00_10_00>(low, high));
        _mm_storeu_ps(b.as_mut_ptr(), _mm_shuffle_ps::<0b11_01_11_01>(low, high));
        (a, b)
    }
}

/// Sixteen loads. Two gathers of eight pairs take twice as long on a Zen 4 (16 ns against 8, in
/// the first and in the second cache), whose gathers are many small steps.
///
/// # Safety
/// The processor has AVX-512, and `values` is readable at each index and behind it.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn pairs_avx512(values: *const f32, index: &[u32; 16]) -> [[f32; 16]; 2] {
    use std::arch::x86_64::*;
    // SAFETY: the caller's promise for the loads, which need no alignment, and stores to arrays of
    // this size.
    unsafe {
        let pair = |lane: usize| values.add(index[lane] as usize).cast::<f64>();
        let two = |lane: usize| _mm_loadh_pd(_mm_load_sd(pair(lane)), pair(lane + 1));
        let four = |lane: usize| {
            _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(two(lane)), two(lane + 2))
        };
        let eight = |lane: usize| {
            let low = _mm512_castpd256_pd512(four(lane));
            _mm512_castpd_ps(_mm512_insertf64x4::<1>(low, four(lane + 4)))
        };
        let (low, high) = (eight(0), eight(8));
        let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        let odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
        let mut out = [[0.0; 16]; 2];
        _mm512_storeu_ps(out[0].as_mut_ptr(), _mm512_permutex2var_ps(low, even, high));
        _mm512_storeu_ps(out[1].as_mut_ptr(), _mm512_permutex2var_ps(low, odd, high));
        out
    }
}

/// # Safety
/// The processor has AVX-512, and `values` is readable at each index. Indices are less than 2³¹.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn numbers_avx512(values: *const f32, index: &[u32; 16]) -> [f32; 16] {
    use std::arch::x86_64::*;
    // SAFETY: as above.
    unsafe {
        let index = _mm512_loadu_si512(index.as_ptr().cast());
        let mut out = [0.0; 16];
        _mm512_storeu_ps(out.as_mut_ptr(), _mm512_i32gather_ps::<4>(index, values));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::SimdLevel;
    use fearless_simd::dispatch;

    #[test]
    fn gathers_read_the_same_with_every_instruction_set_and_stay_inside() {
        let values: Vec<f32> = (0..37).map(|i| i as f32).collect();
        let slice = GatherSlice::new(&values).expect("two or more");
        let index =
            [0, 35, 36, 37, -1, i32::MIN, i32::MAX, 3, 1, 34, 33, 2, 17, 18, 1 << 20, -1000];
        for level in SimdLevel::available() {
            let level = SimdLevel::resolve(Some(level)).expect("available");
            dispatch!(level, simd => {
                let index = i32x16::simd_from(simd, index);
                let [a, b] = slice.pairs(simd, index);
                let one = slice.numbers(simd, index);
                for lane in 0..16 {
                    let i = (index[lane] as u32).min(35) as f32;
                    assert_eq!((a[lane], b[lane], one[lane]), (i, i + 1.0, i), "{level:?} {lane}");
                }
            });
        }
        assert!(GatherSlice::new(&values[..1]).is_none() && GatherSlice::new(&[]).is_none());
    }
}
