//! Kernels over rows of pixels: active masks, compression to active pixels, depth tests and
//! blending.
//!
//! Each is written once, generic over the vector type, and compiled for every instruction set; the
//! best one is chosen at run time. [`SimdLevel::Scalar`] processes pixel by pixel with
//! [`combine`](crate::combine) and is the reference in the tests of the others: all levels give the
//! same bits.
pub(crate) mod compress;
pub(crate) mod expand;
pub(crate) mod mask;
pub(crate) mod opaque;
pub(crate) mod runs;

use fearless_simd::Level;

/// An instruction set to which the kernels can be limited, for tests and measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SimdLevel {
    /// One pixel after the other, on every machine.
    Scalar,
    /// 128-bit with the instructions of x86-64-v2.
    Sse42,
    /// 256-bit (x86-64-v3).
    Avx2,
    /// 512-bit (Ice Lake and Zen 4 onwards).
    Avx512,
    /// 128-bit on ARM.
    Neon,
}

impl SimdLevel {
    /// The levels that this machine supports, lowest first.
    pub fn available() -> Vec<Self> {
        let levels = [Self::Scalar, Self::Sse42, Self::Avx2, Self::Avx512, Self::Neon];
        levels
            .into_iter()
            .filter(|level| *level == Self::Scalar || level.token().is_some())
            .collect()
    }

    /// The best level of this machine.
    pub fn best() -> Self {
        Self::available().into_iter().next_back().unwrap_or(Self::Scalar)
    }

    /// The name used on command lines and in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Sse42 => "sse4.2",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
        }
    }

    /// The level in fearless_simd; `None` for [`SimdLevel::Scalar`] and if the machine lacks it.
    fn token(self) -> Option<Level> {
        let _best = Level::new();
        #[cfg(target_arch = "x86_64")]
        return match self {
            Self::Sse42 => _best.as_sse4_2().map(Level::Sse4_2),
            Self::Avx2 => _best.as_avx2().map(Level::Avx2),
            Self::Avx512 => _best.as_avx512().map(Level::Avx512),
            Self::Scalar | Self::Neon => None,
        };
        #[cfg(target_arch = "aarch64")]
        return (self == Self::Neon).then_some(_best);
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        return None;
    }
}

/// Which kernels to use: `None` is the scalar reference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kernels(pub(crate) Option<Level>);

impl Kernels {
    /// The requested level, or the best one if none is requested or the machine lacks it.
    pub(crate) fn new(wanted: Option<SimdLevel>) -> Self {
        match wanted {
            Some(SimdLevel::Scalar) => Self(None),
            Some(level) => Self(level.token().or_else(|| SimdLevel::best().token())),
            None => Self(SimdLevel::best().token()),
        }
    }
}

/// Runs one expression compiled for the vectors of the chosen level, or the scalar one.
///
/// Not `fearless_simd::dispatch!`, which makes one more copy of every kernel, for processors before
/// 2008, without SSE4.2.
macro_rules! at_level {
    ($kernels:expr, $simd:ident => $vectors:expr, $scalar:expr) => {
        match $kernels.0 {
            #[cfg(target_arch = "x86_64")]
            Some(fearless_simd::Level::Avx512($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $vectors,
            ),
            #[cfg(target_arch = "x86_64")]
            Some(fearless_simd::Level::Avx2($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $vectors,
            ),
            #[cfg(target_arch = "x86_64")]
            Some(fearless_simd::Level::Sse4_2($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $vectors,
            ),
            #[cfg(target_arch = "aarch64")]
            Some(fearless_simd::Level::Neon($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $vectors,
            ),
            _ => $scalar,
        }
    };
}
pub(crate) use at_level;

/// Calls `visit(first, length)` for every run of ones in `word`.
#[inline(always)]
pub(crate) fn for_runs(mut word: u64, mut visit: impl FnMut(usize, usize)) {
    while word != 0 {
        let first = word.trailing_zeros();
        let length = (word >> first).trailing_ones();
        visit(first as usize, length as usize);
        // Adding the lowest one carries through the run; the bit that it sets after the run must be
        // cleared.
        word &= !(u64::MAX >> (64 - length) << first);
    }
}

/// 64 bytes from `at` on, padded with zeros after the end of `bytes`.
#[inline(always)]
pub(crate) fn load_64(bytes: &[u8], at: usize) -> [u8; 64] {
    if let Some(Ok(whole)) = bytes.get(at..at + 64).map(TryInto::try_into) {
        return whole;
    }
    let rest = bytes.get(at..).unwrap_or(&[]);
    let mut padded = [0; 64];
    padded[..rest.len()].copy_from_slice(rest);
    padded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_a_word_are_all_of_its_ones() {
        for word in
            [0, 1, u64::MAX, 1 << 63, 0xff00_0000_0000_00f1, 0x5555_5555_5555_5555, u64::MAX - 1]
        {
            let mut again = 0_u64;
            for_runs(word, |first, length| {
                for bit in first..first + length {
                    assert_eq!(again >> bit & 1, 0);
                    again |= 1 << bit;
                }
            });
            assert_eq!(again, word);
        }
    }

    #[test]
    fn scalar_is_always_there_and_the_best_level_is_available() {
        let levels = SimdLevel::available();
        assert_eq!(levels[0], SimdLevel::Scalar);
        assert!(levels.contains(&SimdLevel::best()));
        assert!(Kernels::new(Some(SimdLevel::Scalar)).0.is_none());
    }
}
