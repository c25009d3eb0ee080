//! Computes powers for highlights as loops over lanes. `powf` would be one call per lane.

use fearless_simd::{Simd, SimdBase, SimdNarrow, SimdWiden, f32x16, f64x8};
use rt_core::ray::LANES;

/// The base-two logarithm of a positive normal number: exponent, and a series in (m - 1) / (m + 1)
/// for the mantissa.
#[inline(always)]
fn log2(x: f32) -> f64 {
    let bits = x.to_bits();
    // Mantissas from sqrt(1/2) to sqrt(2).
    let shifted = bits.wrapping_sub(0x3f35_04f3);
    let exponent = (shifted.cast_signed() >> 23) as f64;
    let m = f64::from(f32::from_bits((shifted & 0x007f_ffff).wrapping_add(0x3f35_04f3)));
    let t = (m - 1.0) / (m + 1.0);
    let s = t * t;
    // 2 / ln 2 · (t + t³/3 + t⁵/5 + …), |t| < 0.172
    let series =
        1.0 + s * (1.0 / 3.0 + s * (0.2 + s * (1.0 / 7.0 + s * (1.0 / 9.0 + s * (1.0 / 11.0)))));
    exponent + 2.885_390_081_777_926_8 * t * series
}

/// Two to a power; 0 below the smallest normal number.
#[inline(always)]
fn exp2(x: f64) -> f32 {
    let x = x.clamp(-127.0, 127.0);
    let whole = (x + 128.5) as i32 - 128;
    let f = (x - f64::from(whole)) * std::f64::consts::LN_2;
    // e^f, |f| < 0.35
    let e = 1.0
        + f * (1.0
            + f * (0.5
                + f * (1.0 / 6.0
                    + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0 + f / 5040.0))))));
    let scale = f64::from(f32::from_bits(((whole + 127).max(0).cast_unsigned()) << 23));
    (e * scale) as f32
}

/// `x.powf(e)` for x from 0 on, with anything to the 0 as 1.
#[inline(always)]
fn power(x: f32, e: f32) -> f32 {
    let positive = x >= f32::MIN_POSITIVE;
    let p = exp2(f64::from(e) * log2(if positive { x } else { 1.0 }));
    let p = if positive { p } else { 0.0 };
    if e == 0.0 { 1.0 } else { p }
}

/// Powers of whole exponents by squaring, in f64.
#[inline(always)]
fn whole_powers<S: Simd>(simd: S, x: f32x16<S>, e: u32) -> f32x16<S> {
    let (mut low, mut high) = x.widen();
    let one = f64x8::splat(simd, 1.0);
    let (mut p, mut q) = (one, one);
    let mut left = e;
    while left > 0 {
        if left & 1 != 0 {
            p *= low;
            q *= high;
        }
        low *= low;
        high *= high;
        left >>= 1;
    }
    p.narrow(q)
}

/// Powers from 0 on, of one whole exponent where there is such.
#[inline(always)]
pub(super) fn powers<S: Simd>(
    simd: S,
    x: f32x16<S>,
    e: f32x16<S>,
    whole: Option<u32>,
) -> f32x16<S> {
    if let Some(whole) = whole {
        return whole_powers(simd, x, whole);
    }
    let mut out = [0.0; LANES];
    for l in 0..LANES {
        out[l] = power(x[l], e[l]);
    }
    f32x16::from_slice(simd, &out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn powers_are_exact_to_a_millionth() {
        for i in 0..=1000 {
            let x = i as f32 / 1000.0;
            for e in [0.0, 0.5, 1.0, 2.0, 17.3, 40.0, 128.0] {
                let (ours, libms) = (power(x, e), if e == 0.0 { 1.0 } else { x.powf(e) });
                assert!(
                    (ours - libms).abs() <= 1e-6 * libms + 1e-37,
                    "{x}^{e}: {ours} for {libms}"
                );
                if e.fract() == 0.0 {
                    let whole = dispatch!(Level::new(), simd => whole_powers(simd, f32x16::splat(simd, x), e as u32)[0]);
                    assert!(
                        (whole - libms).abs() <= 1e-6 * libms + 1e-37,
                        "{x}^{e}: {whole} for {libms}"
                    );
                }
            }
        }
    }
}
