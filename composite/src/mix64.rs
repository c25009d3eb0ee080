//! SplitMix64's mixing function. It is a copy: composite's core depends on no member, so it cannot
//! use `rt_core::math::mix64`.

/// A bijection of 64 bits that mixes well (G. Steele, D. Lea, C. Flood, OOPSLA 2014).
pub(crate) fn mix64(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
