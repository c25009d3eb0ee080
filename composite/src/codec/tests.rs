use super::*;
use crate::pixel::{DepthPixel, PixelFormat, PremultipliedPixel, combine};
use crate::simd::SimdLevel;
use half::f16;
use proptest::prelude::*;

type P = DepthPixel<[u8; 4]>;

fn codec(kernels: Kernels) -> Codec {
    Codec { kernels, fingerprint: 3, verify: false }
}

fn all_kernels() -> Vec<Kernels> {
    SimdLevel::available().into_iter().map(|level| Kernels::new(Some(level))).collect()
}

/// Planes of an image in which `active` pixels are drawn.
fn planes<F: Composite>(width: u32, height: u32, active: impl Fn(u32, u32) -> bool) -> Layer<F> {
    let bounds = Rect::of_size(width, height);
    let mut layer = Layer::empty(bounds, None);
    for y in 0..height {
        for x in 0..width {
            let index = (y * width + x) as usize;
            if active(x, y) {
                let value = |salt: u32| (x * 7 + y * 13 + salt) % 97 + 1;
                layer.colors[index] =
                    F::Color::from_f32([1, 2, 3, 4].map(|salt| value(salt) as f32 / 100.0));
                if F::HAS_DEPTH {
                    layer.depths[index] = value(5) as f32 / 100.0;
                }
            }
        }
    }
    layer
}

fn pattern(kind: u32, x: u32, y: u32) -> bool {
    match kind {
        0 => false,
        1 => true,
        2 => (x + y).is_multiple_of(3),
        3 => x == 70 && y == 1,
        4 => x > 20 + y,
        5 => y > 0,
        _ => (x.wrapping_mul(2_654_435_761_u32.wrapping_mul(y + 1)) >> 7).is_multiple_of(2),
    }
}

/// Merges one pixel with the operator itself.
fn merge_one<F: Composite>(held: &mut Layer<F>, layer: &Layer<F>, x: u32, y: u32, side: Side) {
    let pixel = |view: View<'_, F>| {
        let (color, depth) = view.row(y, x, x + 1);
        F::from_parts(color[0], depth.first().copied().unwrap_or(1.0))
    };
    let (ours, theirs) = (pixel(held.view()), pixel(layer.view()));
    let merged = if side == Side::Higher { combine(ours, theirs) } else { combine(theirs, ours) };
    let (colors, depths) = held.row_mut(y, x, x + 1);
    colors[0] = merged.color();
    depths.iter_mut().for_each(|depth| *depth = merged.depth());
}

/// Encoding and all decoders, at every level, against the scalar ones.
fn check_format<F: Composite>() {
    let rects = [
        Rect { x0: 0, y0: 0, x1: 150, y1: 5 },
        Rect { x0: 3, y0: 1, x1: 67, y1: 4 },
        Rect { x0: 70, y0: 1, x1: 71, y1: 2 },
        Rect { x0: 1, y0: 0, x1: 130, y1: 2 },
    ];
    for kind in 0..7 {
        let layer = planes::<F>(150, 5, |x, y| pattern(kind, x, y));
        let held = planes::<F>(150, 5, |x, y| pattern(6, x + 1, y));
        for rect in rects {
            for depths in [true, false] {
                let mut expected = Vec::new();
                let scalar = codec(Kernels(None));
                let counts = scalar.encode(&layer.view(), rect, depths, &mut expected);
                assert!(expected.len() <= longest::<F>(&rect));
                for kernels in all_kernels() {
                    let mut message = vec![1, 2, 3];
                    assert_eq!(
                        codec(kernels).encode(&layer.view(), rect, depths, &mut message),
                        counts
                    );
                    assert!(message == expected, "{kernels:?}, pattern {kind}, {rect:?}");
                    let part = codec(kernels).decode::<F>(&message, rect, depths).unwrap();
                    assert_eq!(part.active, counts.active);

                    // Copied, it equals what was drawn.
                    let mut placed = planes::<F>(150, 5, |_, _| true);
                    let (colors, placed_depths) = (&mut placed.colors, &mut placed.depths);
                    let placed_depths: &mut [f32] = if depths { placed_depths } else { &mut [] };
                    part.copy_to_planes::<F>(kernels, 150, colors, placed_depths, &mut Vec::new());
                    for y in rect.y0..rect.y1 {
                        let (color, depth) = placed.view().row(y, rect.x0, rect.x1);
                        assert_eq!(color, layer.view().row(y, rect.x0, rect.x1).0);
                        assert!(!depths || depth == layer.view().row(y, rect.x0, rect.x1).1);
                    }
                    if !depths && F::HAS_DEPTH {
                        continue;
                    }

                    // Merged from either side, as a message or as a view, it has the bits of the
                    // operator, pixel by pixel.
                    for side in [Side::Lower, Side::Higher] {
                        let mut one_by_one = held.clone();
                        for y in rect.y0..rect.y1 {
                            for x in rect.x0..rect.x1 {
                                merge_one(&mut one_by_one, &layer, x, y, side);
                            }
                        }
                        let mut merged = held.clone();
                        part.merge_into(kernels, &mut merged, side);
                        assert!(
                            merged.colors == one_by_one.colors
                                && merged.depths == one_by_one.depths
                        );
                        let mut viewed = held.clone();
                        let view = View { bounds: rect, ..layer.view() };
                        viewed.merge_view(kernels, &view, side);
                        assert!(
                            viewed.colors == one_by_one.colors
                                && viewed.depths == one_by_one.depths
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn all_levels_write_and_read_the_same_bits_for_depth_formats() {
    check_format::<DepthPixel<[u8; 4]>>();
    check_format::<DepthPixel<[u16; 4]>>();
    check_format::<DepthPixel<[f16; 4]>>();
    check_format::<DepthPixel<[f32; 4]>>();
}

#[test]
fn all_levels_write_and_read_the_same_bits_for_blended_formats() {
    check_format::<PremultipliedPixel<[u8; 4]>>();
    check_format::<PremultipliedPixel<[u16; 4]>>();
    check_format::<PremultipliedPixel<[f16; 4]>>();
    check_format::<PremultipliedPixel<[f32; 4]>>();
}

#[test]
fn all_levels_blend_every_pair_of_bytes_alike() {
    for kernels in all_kernels() {
        for front in 0..=255_u8 {
            let layer = Layer::<PremultipliedPixel<[u8; 4]>> {
                bounds: Rect::of_size(256, 1),
                colors: (0..=255).map(|alpha| [front, alpha, front / 2, alpha]).collect(),
                depths: Vec::new(),
            };
            let back = Layer {
                colors: (0..=255).rev().map(|c: u8| [c, 255 - c, 255, c]).collect(),
                ..layer.clone()
            };
            let mut scalar = back.clone();
            scalar.merge_view(Kernels(None), &layer.view(), Side::Lower);
            let mut merged = back;
            merged.merge_view(kernels, &layer.view(), Side::Lower);
            assert_eq!(merged.colors, scalar.colors);
        }
    }
}

#[test]
fn an_empty_part_costs_its_header_and_a_dense_one_no_mask() {
    let rect = Rect::of_size(100, 10);
    for kernels in all_kernels() {
        let mut message = Vec::new();
        codec(kernels).encode(&planes::<P>(100, 10, |_, _| false).view(), rect, true, &mut message);
        assert_eq!(message.len(), HEADER_BYTES);
        codec(kernels).encode(&planes::<P>(100, 10, |_, _| true).view(), rect, true, &mut message);
        assert_eq!(message.len(), HEADER_BYTES + 1000 * P::BYTES);
    }
}

fn good(verify: bool) -> (Codec, Rect, Vec<u8>) {
    let rect = Rect { x0: 2, y0: 1, x1: 68, y1: 4 };
    let codec = Codec { verify, ..codec(Kernels::new(None)) };
    let mut message = Vec::new();
    codec.encode(&planes::<P>(70, 5, |x, y| pattern(2, x, y)).view(), rect, true, &mut message);
    (codec, rect, message)
}

#[test]
fn no_truncation_and_with_checksums_no_flipped_bit_goes_unnoticed() {
    let (codec, rect, good) = good(true);
    for length in 0..good.len() {
        assert!(codec.decode::<P>(&good[..length], rect, true).is_err(), "cut to {length} bytes");
    }
    for bit in 0..8 * good.len() {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        assert!(codec.decode::<P>(&bad, rect, true).is_err(), "bit {bit}");
    }
}

#[test]
fn without_checksums_of_pixels_headers_and_masks_are_still_covered() {
    let (codec, rect, good) = good(false);
    let mask_end = HEADER_BYTES + 3 * 2 * 8;
    for bit in 0..8 * mask_end {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        assert!(codec.decode::<P>(&bad, rect, true).is_err(), "bit {bit}");
    }
}

#[test]
fn another_fingerprint_or_part_is_named() {
    let (codec, rect, good) = good(false);
    let other = Codec { fingerprint: 4, ..codec };
    assert_eq!(other.decode::<P>(&good, rect, true).unwrap_err(), MessageError::Fingerprint);
    let error = codec.decode::<P>(&good, Rect::of_size(9, 9), true).unwrap_err();
    assert_eq!(error.to_string(), "it holds columns 2..68 and rows 1..4 instead of 0..9 and 0..9");
    assert_eq!(codec.decode::<P>(&good, rect, false).unwrap_err(), MessageError::Mask);
}

#[test]
fn lengths_beyond_two_to_the_31_bytes_are_counted_right() {
    // 46341^2 pixels are just above 2^31, and their messages above 2^34 bytes.
    let rect = Rect::of_size(46_341, 46_341);
    assert_eq!(longest::<P>(&rect), 64 + 46_341 * 725 * 8 + 46_341 * 46_341 * 8);
    // A header that announces as much is checked by its length, in 64 bits.
    let codec = codec(Kernels::new(None));
    let (.., mut message) = good(false);
    message.truncate(HEADER_BYTES);
    let corners = [0_u32, 0, 46_341, 46_341];
    message[32..48].copy_from_slice(bytemuck::cast_slice(&corners));
    let active = rect.pixels() as u64;
    message[24..32].copy_from_slice(&HAS_DEPTHS.to_le_bytes());
    message[48..56].copy_from_slice(&active.to_le_bytes());
    let sum = checksum(&message[16..]);
    message[8..16].copy_from_slice(&sum.to_le_bytes());
    let error = codec.decode::<P>(&message, rect, true).unwrap_err();
    assert_eq!(error, MessageError::Length { expected: 64 + 8 * active, found: 64 });
}

proptest! {
    /// Any bytes: never a panic, and almost never accepted.
    #[test]
    fn the_decoder_survives_any_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let (codec, rect, _) = good(false);
        prop_assert!(codec.decode::<P>(&bytes, rect, true).is_err());
    }

    /// Invalid headers with a correct checksum: the decoder must find the contradiction itself, and
    /// what it accepts must be readable.
    #[test]
    fn consistent_checksums_do_not_make_the_decoder_trust_the_numbers(
        changes in proptest::collection::vec((24..200_usize, any::<u8>()), 1..6),
        cut in 0..40_usize,
        verify: bool,
    ) {
        let (codec, rect, mut bad) = good(verify);
        for (at, byte) in changes {
            if let Some(slot) = bad.get_mut(at) {
                *slot = byte;
            }
        }
        bad.truncate(bad.len() - cut);
        let end = if bad[24] & IS_SUMMED as u8 != 0 { bad.len() } else { HEADER_BYTES };
        let sum = checksum(&bad[16..end]);
        bad[8..16].copy_from_slice(&sum.to_le_bytes());
        if let Ok(part) = codec.decode::<P>(&bad, rect, true) {
            for kernels in all_kernels() {
                let mut layer = planes::<P>(70, 5, |x, y| pattern(6, x, y));
                part.merge_into(kernels, &mut layer, Side::Higher);
                part.merge_into(kernels, &mut layer, Side::Lower);
            }
            let mut image = planes::<P>(70, 5, |_, _| false);
            let (colors, depths) = (&mut image.colors, &mut image.depths);
            part.copy_to_planes::<P>(Kernels::new(None), 70, colors, depths, &mut Vec::new());
        }
    }
}
