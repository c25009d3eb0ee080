//! The children of a node that a ray enters, nearest first, without a branch.
//!
//! How many of them there are and which is nearest is unpredictable, so code with a branch for each
//! case is guessed wrong at most nodes. A sorting network (Batcher 1968, bitonic) has none: six
//! layers, in each of which a lane keeps the smaller or the larger of itself and one other lane.

use crate::bvh::layout::wide::{STACK_SIZE, WIDTH};
use crate::simd::Stack;
use fearless_simd::{Bytes, Select, Simd, SimdBase, SimdMask, f32x8, mask32x8, u8x32, u32x8};

/// The bits of a distance that hold the number of its slot while distances are sorted. Without
/// them, a distance is smaller by at most 2⁻²⁰ of itself: what is on the stack is never skipped
/// though it is near enough.
const SLOT: u32 = WIDTH as u32 - 1;

/// Pushes the children in `mask`, which the ray enters at the distances `near`, the nearest last:
/// the distance in the high half of an entry, the reference in the low half.
#[inline(always)]
pub(super) fn push_by_distance<S: Simd>(
    simd: S,
    refs: &[u32; WIDTH],
    near: f32x8<S>,
    mask: u32,
    stack: &mut Stack<'_, u64, STACK_SIZE>,
) {
    let splat = |x: u32| u32x8::splat(simd, x);
    let hit = mask32x8::from_bitmask(simd, u64::from(mask));
    // Distances are not negative, so their bits have their order. What is not hit comes last.
    let distance = near.bitcast::<u32x8<S>>() & splat(!SLOT);
    let keys = hit.select(distance | u32x8::from_slice(simd, &[0, 1, 2, 3, 4, 5, 6, 7]), splat(0));
    let keys = sort_descending(simd, keys);
    let (distance, slots) = (keys & splat(!SLOT), keys & splat(SLOT));
    // The four bytes of the slot of each lane.
    let bytes = slots * splat(0x0404_0404) + splat(0x0302_0100);
    let refs = u32x8::from_slice(simd, refs).swizzle_dyn(bytes.to_bytes());
    let [low, high] =
        if cfg!(target_endian = "little") { [refs, distance] } else { [distance, refs] };
    let mut entries = [0; 2 * WIDTH];
    low.zip_low(high).store_slice(&mut entries[..WIDTH]);
    low.zip_high(high).store_slice(&mut entries[WIDTH..]);
    stack.push_first(bytemuck::cast(entries), mask.count_ones() as usize);
}

/// The lanes of `v`, the largest first.
#[inline(always)]
fn sort_descending<S: Simd>(simd: S, v: u32x8<S>) -> u32x8<S> {
    let v = keep(simd, v, exchanged::<S, 1>(simd, v), 0b0101_0101);
    let v = keep(simd, v, exchanged::<S, 3>(simd, v), 0b0011_0011);
    let v = keep(simd, v, exchanged::<S, 1>(simd, v), 0b0101_0101);
    let v = keep(simd, v, v.reverse(), 0b0000_1111);
    let v = keep(simd, v, exchanged::<S, 2>(simd, v), 0b0011_0011);
    keep(simd, v, exchanged::<S, 1>(simd, v), 0b0101_0101)
}

/// The larger of both vectors in the lanes `larger`, the smaller in the others.
#[inline(always)]
fn keep<S: Simd>(simd: S, v: u32x8<S>, other: u32x8<S>, larger: u64) -> u32x8<S> {
    mask32x8::from_bitmask(simd, larger).select(v.max(other), v.min(other))
}

/// Lane `i ^ WITH` of `v` in lane `i`. `WITH` is at most 3.
#[inline(always)]
fn exchanged<S: Simd, const WITH: u8>(simd: S, v: u32x8<S>) -> u32x8<S> {
    v.swizzle_dyn_within_blocks(u8x32::from_slice(simd, const { &exchange(WITH) }))
}

/// The numbers of the bytes, within sixteen, that lanes of four bytes get from lane `i ^ with`.
const fn exchange(with: u8) -> [u8; 32] {
    let mut bytes = [0; 32];
    let mut i = 0;
    while i < 32 {
        bytes[i as usize] = 4 * ((i / 4 % 4) ^ with) + i % 4;
        i += 1;
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{SimdLevel, StackMemory};
    use crate::test_shapes::Random;
    use fearless_simd::dispatch;

    #[test]
    fn children_leave_the_stack_by_distance_at_every_level() {
        let refs = [3, 1 << 28, 0, 7, 1 << 29, 9, 11, u32::MAX >> 1];
        let mut r = Random::new(11);
        for level in SimdLevel::available() {
            let name = level.name();
            let level = SimdLevel::resolve(Some(level)).expect("listed as available");
            for mask in 0..256u32 {
                // Some distances are equal, some zero.
                let near: [f32; WIDTH] = std::array::from_fn(|slot| match slot {
                    0 | 5 if mask % 3 == 0 => 0.0,
                    _ => (r.unit() * 40.0).floor() / 8.0,
                });
                let mut memory = StackMemory::new();
                let mut stack = Stack::empty(&mut memory);
                stack.push(42);
                dispatch!(level, simd => {
                    let near = f32x8::from_slice(simd, &near);
                    push_by_distance(simd, &refs, near, mask, &mut stack)
                });
                let mut popped: Vec<u64> = std::iter::from_fn(|| stack.pop()).collect();
                assert_eq!(popped.pop(), Some(42), "{name}: {mask:08b}");
                let distances: Vec<f32> =
                    popped.iter().map(|e| f32::from_bits((e >> 32) as u32)).collect();
                assert!(distances.is_sorted(), "{name}: {mask:08b}, {distances:?}");
                let slots = popped.iter().zip(&distances).map(|(entry, distance)| {
                    let slot = refs.iter().position(|r| *r == *entry as u32).expect("a child");
                    let exact = near[slot];
                    assert!(*distance <= exact && *distance >= exact * (1.0 - 1e-6), "{name}");
                    1 << slot
                });
                assert_eq!(slots.sum::<u32>(), mask, "{name}");
            }
        }
    }
}
