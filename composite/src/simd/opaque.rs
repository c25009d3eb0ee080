//! Colours of four bytes with full alpha, packed into three bytes and back: a quarter fewer bytes
//! in the messages that collect the image.
use crate::simd::runs::colors_16;
use fearless_simd::{Bytes, Simd, SimdBase, u8x64, u32x16};

/// Packs the colours in `out` from `start` on into three bytes each, in place. Returns false, and
/// changes nothing, if an alpha is not full.
#[inline(always)]
pub(crate) fn drop_full_alpha<S: Simd>(simd: S, out: &mut Vec<u8>, start: usize) -> bool {
    let length = out.len() - start;
    let blocks = length / 64;
    let mut all = u32x16::splat(simd, u32::MAX);
    for block in out[start..].as_chunks::<64>().0 {
        all &= colors_16(simd, block);
    }
    let mut lanes = [0_u8; 64];
    all.bitcast::<u8x64<S>>().store_slice(&mut lanes);
    let rest = &out[start + 64 * blocks..];
    if !lanes.as_chunks::<4>().0.iter().chain(rest.as_chunks::<4>().0).all(|color| color[3] == 255)
    {
        return false;
    }

    // Sixteen bytes at a time are moved down by a quarter; the next write overwrites the four
    // superfluous bytes.
    let packed: [u8; 64] =
        std::array::from_fn(|i| if i % 16 < 12 { (i % 16 / 3 * 4 + i % 16 % 3) as u8 } else { 0 });
    let packed = u8x64::from_slice(simd, &packed);
    let (mut from, mut to) = (start, start);
    for _ in 0..blocks {
        let mut moved = [0_u8; 64];
        u8x64::from_slice(simd, &out[from..from + 64])
            .swizzle_dyn_within_blocks(packed)
            .store_slice(&mut moved);
        for (index, four) in moved.as_chunks::<16>().0.iter().enumerate() {
            out[to + 12 * index..to + 12 * index + 16].copy_from_slice(four);
        }
        (from, to) = (from + 64, to + 48);
    }
    drop_rest(out, from, to);
    true
}

/// [`drop_full_alpha`] without vector types: two colours in a word of 64 bits.
pub(crate) fn drop_full_alpha_scalar(out: &mut Vec<u8>, start: usize) -> bool {
    let all = out[start..]
        .as_chunks::<4>()
        .0
        .iter()
        .fold(u32::MAX, |all, color| all & u32::from_le_bytes(*color));
    if all >> 24 != 255 {
        return false;
    }
    let (mut from, mut to) = (start, start);
    while from + 8 <= out.len() {
        let mut two = [0; 8];
        two.copy_from_slice(&out[from..from + 8]);
        let two = u64::from_le_bytes(two);
        let six = two & 0xff_ffff | two >> 8 & 0xffff_ff00_0000;
        // The next write overwrites the two superfluous bytes.
        out[to..to + 8].copy_from_slice(&six.to_le_bytes());
        (from, to) = (from + 8, to + 6);
    }
    drop_rest(out, from, to);
    true
}

fn drop_rest(out: &mut Vec<u8>, mut from: usize, mut to: usize) {
    while let Some(&[red, green, blue, _]) = out[from..].first_chunk::<4>() {
        out[to..to + 3].copy_from_slice(&[red, green, blue]);
        (from, to) = (from + 4, to + 3);
    }
    out.truncate(to);
}

/// Unpacks colours of three bytes to four, with full alpha, replacing the content of `wide`.
#[inline(always)]
pub(crate) fn give_full_alpha<S: Simd>(simd: S, narrow: &[u8], wide: &mut Vec<u8>) {
    let colors = narrow.len() / 3;
    wide.resize(4 * colors, 0);
    let spread: [u8; 64] =
        std::array::from_fn(|i| if i % 4 < 3 { (i % 16 / 4 * 3 + i % 4) as u8 } else { 0 });
    let spread = u8x64::from_slice(simd, &spread);
    let mut done = 0;
    for block in wide.as_chunks_mut::<64>().0 {
        // Sixteen bytes are loaded for twelve.
        let Some(bytes) = narrow.get(3 * done..3 * done + 52) else { break };
        let mut loaded = [0_u8; 64];
        for (index, four) in loaded.as_chunks_mut::<16>().0.iter_mut().enumerate() {
            four.copy_from_slice(&bytes[12 * index..12 * index + 16]);
        }
        let colors: u32x16<S> =
            u8x64::from_slice(simd, &loaded).swizzle_dyn_within_blocks(spread).bitcast();
        let opaque = colors | u32x16::splat(simd, 0xff00_0000);
        opaque.bitcast::<u8x64<S>>().store_slice(block);
        done += 16;
    }
    give_rest(narrow, wide, done);
}

/// [`give_full_alpha`] without vector types: two colours in a word of 64 bits.
pub(crate) fn give_full_alpha_scalar(narrow: &[u8], wide: &mut Vec<u8>) {
    wide.resize(narrow.len() / 3 * 4, 0);
    let mut done = 0;
    for two in wide.as_chunks_mut::<8>().0 {
        // Eight bytes are loaded for six.
        let Some(bytes) =
            narrow.get(3 * done..3 * done + 8).and_then(|bytes| bytes.first_chunk::<8>())
        else {
            break;
        };
        let six = u64::from_le_bytes(*bytes);
        *two = (six & 0xff_ffff | six << 8 & 0xff_ffff << 32 | 0xff00_0000_ff00_0000).to_le_bytes();
        done += 2;
    }
    give_rest(narrow, wide, done);
}

fn give_rest(narrow: &[u8], wide: &mut [u8], done: usize) {
    let pairs = wide.as_chunks_mut::<4>().0.iter_mut().zip(narrow.as_chunks::<3>().0).skip(done);
    for (wide, narrow) in pairs {
        *wide = [narrow[0], narrow[1], narrow[2], 255];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernels, SimdLevel, at_level};

    #[test]
    fn opaque_colours_come_back_at_every_length_and_level_and_others_stay() {
        for level in SimdLevel::available() {
            let kernels = Kernels::new(Some(level));
            for colors in 0..70_usize {
                let mut bytes = vec![7_u8; 5];
                bytes.extend((0..colors).flat_map(|i| [i as u8, 2 * i as u8, 3 * i as u8, 255]));
                let (before, mut again) = (bytes.clone(), Vec::new());
                let mut narrow = bytes.clone();
                assert!(at_level!(
                    kernels,
                    simd => drop_full_alpha(simd, &mut narrow, 5),
                    drop_full_alpha_scalar(&mut narrow, 5)
                ));
                assert_eq!(narrow.len(), 5 + 3 * colors);
                at_level!(
                    kernels,
                    simd => give_full_alpha(simd, &narrow[5..], &mut again),
                    give_full_alpha_scalar(&narrow[5..], &mut again)
                );
                assert_eq!(again, before[5..], "{colors} colours, {level:?}");

                for clear in 0..colors {
                    bytes.clone_from(&before);
                    bytes[5 + 4 * clear + 3] = 254;
                    let kept = bytes.clone();
                    assert!(!at_level!(
                        kernels,
                        simd => drop_full_alpha(simd, &mut bytes, 5),
                        drop_full_alpha_scalar(&mut bytes, 5)
                    ));
                    assert_eq!(bytes, kept);
                }
            }
        }
    }
}
