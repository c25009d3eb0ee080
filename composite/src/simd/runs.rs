//! Merges runs of consecutive pixels: the nearest one wins, or one colour is composited over
//! another.
use crate::color::Color;
use crate::simd::load_64;
use bytemuck::{cast_slice, cast_slice_mut, pod_read_unaligned};
use fearless_simd::{
    Bytes, Select, Simd, SimdBase, SimdInt, SimdMask, SimdNarrow, SimdWiden, f32x16, mask32x16,
    u8x64, u16x32, u32x16,
};

/// Sixteen colours of four bytes.
#[inline(always)]
pub(crate) fn colors_16<S: Simd>(simd: S, bytes: &[u8]) -> u32x16<S> {
    u8x64::from_slice(simd, bytes).bitcast()
}

/// Takes the pixels that are nearer than those held; equal depths too if `wins_ties`. Held depths
/// are at most 1.
///
/// `colors` and `depths` are raw values, one for each of `held_colors`. NaN and depths of 1 or more
/// are never taken.
#[inline(always)]
pub(crate) fn nearest_run<C: Color, S: Simd>(
    simd: S,
    colors: &[u8],
    depths: &[u8],
    held_colors: &mut [C],
    held_depths: &mut [f32],
    wins_ties: bool,
) {
    let mut done = 0;
    if C::BYTES == 4 {
        let held_bytes: &mut [u8] = cast_slice_mut(held_colors);
        let ours =
            held_bytes.as_chunks_mut::<64>().0.iter_mut().zip(held_depths.as_chunks_mut::<16>().0);
        let theirs = colors.as_chunks::<64>().0.iter().zip(depths.as_chunks::<64>().0);
        for ((held_color, held_depth), (color, depth)) in ours.zip(theirs) {
            let depth: f32x16<S> = u8x64::from_slice(simd, depth).bitcast();
            take_nearer(
                simd,
                #[inline(always)]
                || colors_16(simd, color),
                depth,
                held_color,
                held_depth,
                wins_ties,
                u64::MAX,
            );
            done += 16;
        }
    }
    nearest_rest(colors, depths, held_colors, held_depths, wins_ties, done);
}

/// [`nearest_run`] without vector types: sixteen depths and colours of 32 bits at a time, as masks
/// of all ones or zeros, which compilers turn into the vectors that every machine has.
pub(crate) fn nearest_run_scalar<C: Color>(
    colors: &[u8],
    depths: &[u8],
    held_colors: &mut [C],
    held_depths: &mut [f32],
    wins_ties: bool,
) {
    if C::BYTES == 4 {
        let held_bytes: &mut [u8] = cast_slice_mut(held_colors);
        let ours =
            held_bytes.as_chunks_mut::<64>().0.iter_mut().zip(held_depths.as_chunks_mut::<16>().0);
        let theirs = colors.as_chunks::<64>().0.iter().zip(depths.as_chunks::<64>().0);
        for ((held_color, held_depth), (color, depth)) in ours.zip(theirs) {
            let depth: [f32; 16] = bytemuck::cast(*depth);
            let mut wins = [0_u32; 16];
            let mut any = 0;
            for ((win, depth), held) in wins.iter_mut().zip(&depth).zip(&*held_depth) {
                let wins = if wins_ties { (depth <= held) & (*depth < 1.0) } else { depth < held };
                *win = u32::from(wins).wrapping_neg();
                any |= *win;
            }
            if any == 0 {
                continue;
            }
            let color: [u32; 16] = bytemuck::cast(*color);
            let mut merged: [u32; 16] = bytemuck::cast(*held_color);
            for (((held, color), win), (held_depth, depth)) in
                merged.iter_mut().zip(&color).zip(&wins).zip(held_depth.iter_mut().zip(&depth))
            {
                *held = color & win | *held & !win;
                *held_depth = f32::from_bits(depth.to_bits() & win | held_depth.to_bits() & !win);
            }
            *held_color = bytemuck::cast(merged);
        }
    }
    let done = if C::BYTES == 4 { held_depths.len() / 16 * 16 } else { 0 };
    nearest_rest(colors, depths, held_colors, held_depths, wins_ties, done);
}

/// Pixel by pixel from `done` on.
#[inline(always)]
fn nearest_rest<C: Color>(
    colors: &[u8],
    depths: &[u8],
    held_colors: &mut [C],
    held_depths: &mut [f32],
    wins_ties: bool,
    done: usize,
) {
    let rest =
        colors[done * C::BYTES..].chunks_exact(C::BYTES).zip(depths[done * 4..].chunks_exact(4));
    let held = held_colors[done..].iter_mut().zip(&mut held_depths[done..]);
    for ((color, depth), (held_color, held_depth)) in rest.zip(held) {
        let depth: f32 = pod_read_unaligned(depth);
        if depth < *held_depth || (wins_ties && depth == *held_depth && depth < 1.0) {
            *held_color = pod_read_unaligned(color);
            *held_depth = depth;
        }
    }
}

/// The depth test of sixteen pixels, limited to `lanes`. Colours that lose are not even read: of
/// eight layers in any order only a third are.
#[inline(always)]
pub(crate) fn take_nearer<S: Simd>(
    simd: S,
    color: impl FnOnce() -> u32x16<S>,
    depth: f32x16<S>,
    held_color: &mut [u8; 64],
    held_depth: &mut [f32; 16],
    wins_ties: bool,
    lanes: u64,
) {
    let held = f32x16::from_slice(simd, held_depth);
    let mut wins = if wins_ties {
        depth.simd_le(held) & depth.simd_lt(f32x16::splat(simd, 1.0))
    } else {
        depth.simd_lt(held)
    };
    if lanes != u64::MAX {
        wins &= fearless_simd::mask32x16::from_bitmask(simd, lanes);
    }
    // Most blocks of an image are taken entirely or not at all.
    if wins.any_true() {
        wins.select(depth, held).store_slice(held_depth);
        let merged = wins.select(color(), colors_16(simd, held_color));
        merged.bitcast::<u8x64<S>>().store_slice(held_color);
    }
}

/// `over` with inactive pixels as identities, one pixel after the other.
#[inline(always)]
pub(crate) fn over_one_by_one<C: Color>(others: &[u8], held: &mut [C], others_in_front: bool) {
    for (other, held) in others.chunks_exact(C::BYTES).zip(held) {
        let other: C = pod_read_unaligned(other);
        if held.is_zero() {
            *held = other;
        } else if !other.is_zero() {
            *held = if others_in_front { C::over(other, *held) } else { C::over(*held, other) };
        }
    }
}

/// Sixteen pixels at a time in 16-bit lanes.
///
/// A colour of zeros is the identity of this operator on either side, so nothing needs to be
/// masked. `x / 255` for `x < 65535` is `(x + 1 + (x >> 8)) >> 8` (J. Blinn, "Three Wrongs Make a
/// Right", IEEE CG&A 15(6), 1995).
#[inline(always)]
pub(crate) fn over_rgba8<S: Simd>(
    simd: S,
    others: &[u8],
    held: &mut [[u8; 4]],
    others_in_front: bool,
) {
    let alpha_of: [u8; 64] = std::array::from_fn(|i| (i % 16 / 4 * 4 + 3) as u8);
    let alpha_of = u8x64::from_slice(simd, &alpha_of);
    let held_bytes: &mut [u8] = cast_slice_mut(held);
    let blocks = held_bytes.len() / 64;
    for block in 0..blocks {
        let range = 64 * block..64 * block + 64;
        let ours = u8x64::from_slice(simd, &held_bytes[range.clone()]);
        let theirs = u8x64::from_slice(simd, &others[range.clone()]);
        let (front, back) = if others_in_front { (theirs, ours) } else { (ours, theirs) };
        let see_through = !front.swizzle_dyn_within_blocks(alpha_of);
        let (back_low, back_high) = back.widen();
        let (through_low, through_high) = see_through.widen();
        let behind = divided_by_255(simd, back_low * through_low)
            .narrow(divided_by_255(simd, back_high * through_high));
        front.saturating_add(behind).store_slice(&mut held_bytes[range]);
    }
    over_one_by_one(&others[64 * blocks..], &mut held[16 * blocks..], others_in_front);
}

#[inline(always)]
fn divided_by_255<S: Simd>(simd: S, product: u16x32<S>) -> u16x32<S> {
    let x = product + u16x32::splat(simd, 127);
    (x + u16x32::splat(simd, 1) + (x >> 8)) >> 8
}

/// Four pixels at a time; inactive ones are the identity.
#[inline(always)]
pub(crate) fn over_f32<S: Simd>(
    simd: S,
    others: &[u8],
    held: &mut [[f32; 4]],
    others_in_front: bool,
) {
    let alpha_of: [u8; 64] = std::array::from_fn(|i| (12 + i % 4) as u8);
    let alpha_of = u8x64::from_slice(simd, &alpha_of);
    let zero = u32x16::splat(simd, 0);
    let blocks = held.len() / 4;
    for block in 0..blocks {
        let four = &mut held[4 * block..4 * block + 4];
        let theirs = colors_16(simd, &others[64 * block..64 * block + 64]);
        let empty_theirs = lanes_of_empty_pixels(theirs.simd_eq(zero).to_bitmask());
        if empty_theirs == 0xffff {
            continue;
        }
        let ours = colors_16(simd, cast_slice(four));
        let empty_ours = lanes_of_empty_pixels(ours.simd_eq(zero).to_bitmask());
        let (front, back) = if others_in_front { (theirs, ours) } else { (ours, theirs) };
        let alpha: f32x16<S> =
            front.bitcast::<u8x64<S>>().swizzle_dyn_within_blocks(alpha_of).bitcast();
        let (front, back): (f32x16<S>, f32x16<S>) = (front.bitcast(), back.bitcast());
        let merged: f32x16<S> = front + (f32x16::splat(simd, 1.0) - alpha) * back;
        let mut merged: u32x16<S> = merged.bitcast();
        if empty_theirs | empty_ours != 0 {
            merged = mask32x16::from_bitmask(simd, empty_theirs).select(ours, merged);
            merged = mask32x16::from_bitmask(simd, empty_ours).select(theirs, merged);
        }
        merged.bitcast::<f32x16<S>>().store_slice(cast_slice_mut(four));
    }
    over_one_by_one(&others[64 * blocks..], &mut held[4 * blocks..], others_in_front);
}

/// A mask of all lanes of those of four pixels whose four lanes are all zero; `zero_lanes` has a
/// bit for each zero lane.
#[inline(always)]
fn lanes_of_empty_pixels(zero_lanes: u64) -> u64 {
    let pairs = zero_lanes & (zero_lanes >> 1);
    (pairs & (pairs >> 2) & 0x1111) * 0xf
}

/// Loads up to sixteen colours or depths that may extend past the end of a message.
#[inline(always)]
pub(crate) fn padded_16<S: Simd>(simd: S, bytes: &[u8], at: usize) -> u32x16<S> {
    colors_16(simd, &load_64(bytes, at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn division_by_255_without_dividing_is_exact_for_all_products() {
        for x in 0..65535_u32 {
            assert_eq!((x + 1 + (x >> 8)) >> 8, x / 255);
        }
    }

    #[test]
    fn a_pixel_is_empty_only_if_its_own_four_lanes_are_zero() {
        for (zero, empty) in
            [(0x000f, 0x000f), (0x0f00, 0x0f00), (0xf3c1, 0xf000), (0xffff, 0xffff)]
        {
            assert_eq!(lanes_of_empty_pixels(zero), empty);
        }
        for zero in [0x0000, 0x00f0 >> 2, 0x7777] {
            assert_eq!(lanes_of_empty_pixels(zero), 0);
        }
    }
}
