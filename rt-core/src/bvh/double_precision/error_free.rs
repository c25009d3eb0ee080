//! Sums and products with their rounding errors (Dekker 1971; Ogita, Rump and Oishi, "Accurate Sum
//! and Dot Product", SIAM J. Sci. Comput. 2005), and powers of two.

/// Unit roundoff of f64.
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// a + b = sum + error, exactly.
#[inline(always)]
pub(super) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// a − b = difference + error, exactly.
#[inline(always)]
pub(super) fn two_diff(a: f64, b: f64) -> (f64, f64) {
    two_sum(a, -b)
}

/// a · b = product + error, exactly unless the error underflows. The fused operation is exact on
/// every machine, in hardware or not, so results do not depend on the instruction set.
#[inline(always)]
pub(super) fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    (product, a.mul_add(b, -product))
}

/// 2ᵏ; `k` from −1022 to 1023.
#[inline(always)]
pub(super) fn power_of_two(k: i32) -> f64 {
    debug_assert!((-1022..=1023).contains(&k), "2^{k} is no normal number");
    f64::from_bits(((k + 1023) as u64) << 52)
}

/// The largest k with 2ᵏ <= |x|, for a normal number.
#[inline(always)]
pub(super) fn exponent(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}
