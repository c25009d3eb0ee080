//! Which instruction sets the kernels are compiled for.

/// Calls a kernel with the token of a level. Kernels open the instruction set themselves
/// (`Simd::vectorize`).
///
/// Unlike fearless_simd's own `dispatch!`, machines with SSE4.2 but no AVX2 use the SSE2 kernels:
/// they are a quarter of what there is to compile, for processors from before 2013.
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
