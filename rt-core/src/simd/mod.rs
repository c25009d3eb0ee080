//! Instruction sets, and the few operations whose speed needs `unsafe`.
#![allow(
    unsafe_code,
    reason = "one of the workspace's rooms for unsafe code: each block says why it is sound"
)]

#[cfg(feature = "render")]
pub(crate) mod exponential;
#[cfg(feature = "render")]
pub(crate) mod gather;
pub(crate) mod huge_pages;
mod prefetch;
mod stack;
#[cfg(feature = "render")]
pub(crate) mod vectors;

use fearless_simd::Level;
pub(crate) use prefetch::prefetch;
#[cfg(feature = "render")]
pub(crate) use prefetch::prefetch_item;
pub(crate) use stack::{Stack, StackMemory};

/// An instruction set to which the kernels can be limited, for tests and for comparisons with other
/// ray tracers at the same level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum SimdLevel {
    /// 128-bit, the x86-64 baseline.
    Sse2,
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
    /// The levels that this machine supports, lowest first. Empty if it supports none.
    pub fn available() -> Vec<SimdLevel> {
        let _level = Level::new();
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            [
                (SimdLevel::Sse2, _level.as_sse2().is_some()),
                (SimdLevel::Sse42, _level.as_sse4_2().is_some()),
                (SimdLevel::Avx2, _level.as_avx2().is_some()),
                (SimdLevel::Avx512, _level.as_avx512().is_some()),
            ]
            .into_iter()
            .filter_map(|(l, ok)| ok.then_some(l))
            .collect()
        }
        #[cfg(target_arch = "aarch64")]
        {
            vec![SimdLevel::Neon]
        }
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
        {
            Vec::new()
        }
    }

    /// The name used on command lines and in records.
    pub fn name(self) -> &'static str {
        match self {
            SimdLevel::Sse2 => "sse2",
            SimdLevel::Sse42 => "sse4.2",
            SimdLevel::Avx2 => "avx2",
            SimdLevel::Avx512 => "avx512",
            SimdLevel::Neon => "neon",
        }
    }

    /// The level as fearless_simd represents it; `None` gives the machine's best.
    pub(crate) fn resolve(wanted: Option<SimdLevel>) -> Result<Level, UnavailableLevel> {
        let best = Level::new();
        let Some(wanted) = wanted else { return Ok(best) };
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        let found = match wanted {
            SimdLevel::Sse2 => best.as_sse2().map(Level::Sse2),
            SimdLevel::Sse42 => best.as_sse4_2().map(Level::Sse4_2),
            SimdLevel::Avx2 => best.as_avx2().map(Level::Avx2),
            SimdLevel::Avx512 => best.as_avx512().map(Level::Avx512),
            SimdLevel::Neon => None,
        };
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let found = SimdLevel::available().contains(&wanted).then_some(best);
        found.ok_or(UnavailableLevel { wanted })
    }
}

/// An instruction set that this machine lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "this machine has no {}; ask for {}, or for none to get the best there is",
    wanted.name(), available_names()
)]
#[non_exhaustive]
pub struct UnavailableLevel {
    /// The requested level.
    pub wanted: SimdLevel,
}

fn available_names() -> String {
    let names: Vec<_> = SimdLevel::available().into_iter().map(SimdLevel::name).collect();
    if names.is_empty() { "no level by name".into() } else { names.join(", ") }
}
