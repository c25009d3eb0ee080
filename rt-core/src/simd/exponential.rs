//! The exponential function in lanes.

use fearless_simd::{Select, Simd, SimdBase, f64x8};

/// Optical thickness beyond which no light passes: e⁻⁶⁴ is 10⁻²⁸.
const OPAQUE: f64 = 64.0;

/// e^(−τ) for τ ≥ 0: the Taylor polynomial of degree 7 at τ/256, squared eight times. The error is
/// below 10⁻¹³ (squaring multiplies the relative rounding error by 256). There is no table, no
/// conversion to integers and no fused operation, so every instruction set gives the same bits.
#[inline(always)]
pub(crate) fn attenuation<S: Simd>(simd: S, tau: f64x8<S>) -> f64x8<S> {
    let s = |x: f64| f64x8::splat(simd, x);
    let limit = s(OPAQUE);
    let x = tau.simd_lt(limit).select(tau, limit) * s(-1.0 / 256.0);
    let mut sum = s(1.0 / 5040.0);
    for term in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        sum = sum * x + s(term);
    }
    for _ in 0..8 {
        sum *= sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn attenuation_is_that_of_the_standard_library() {
        for k in 0..20_000 {
            let tau: [f64; 8] =
                std::array::from_fn(|lane| 1.2f64.powi(lane as i32 * 3 - 12) * 5e-4 * f64::from(k));
            dispatch!(Level::new(), simd => {
                let got = attenuation(simd, f64x8::from_slice(simd, &tau));
                for (got, tau) in got.as_slice().iter().zip(tau) {
                    assert!((got - (-tau).exp()).abs() < 1e-13, "{tau}: {got}");
                }
            });
        }
        dispatch!(Level::new(), simd => {
            let got = attenuation(simd, f64x8::splat(simd, f64::INFINITY));
            assert!(got.as_slice()[0] < 1e-27);
        });
    }
}
