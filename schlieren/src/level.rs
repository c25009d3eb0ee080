//! Selects the instruction set that a kernel runs with.

/// Calls a kernel with the SIMD token of a level. Kernels enable the instruction set themselves
/// (`Simd::vectorize`).
///
/// Unlike fearless_simd's own `dispatch!`, this macro has no SSE4.2 kernels. Machines with SSE4.2
/// but without AVX2 date from before 2013 and use the SSE2 kernels. SSE4.2 kernels would be a
/// quarter of all kernels to compile.
#[macro_export]
#[doc(hidden)]
macro_rules! at_level {
    ($level:expr, $simd:ident => $op:expr) => {{
        #[cfg(target_arch = "x86_64")]
        match $level {
            fearless_simd::Level::Avx512($simd) => $op,
            fearless_simd::Level::Avx2($simd) => $op,
            other => match other.as_sse2() {
                Some($simd) => $op,
                None => unreachable!("SSE2 is part of x86-64"),
            },
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!($level, $simd => $op)
    }};
}
