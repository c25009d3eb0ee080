//! Messages: part of an image as a bit mask of active pixels followed by those pixels.
//!
//! | bytes | content |
//! |---|---|
//! | 0..8 | `COMPOS01` |
//! | 8..16 | checksum of everything behind it |
//! | 16..24 | fingerprint of what is composited: sizes, format, strategy, rank order |
//! | 24..40 | first pixel and number of pixels of the part |
//! | 40..56 | first pixel, relative to the part, and length of the *span* from the first to the last active pixel |
//! | 56..64 | number of active pixels |
//! | then | mask of the span, 64 pixels a word, lowest bit first; left out if all of the span is active |
//! | then | the active pixels in order |
//!
//! All numbers are little-endian `u64`, also in arithmetic: no size is cut to 32 bits. The decoder trusts nothing.
use crate::pixel::Composite;
use std::ops::Range;

const MAGIC: u64 = u64::from_le_bytes(*b"COMPOS01");
/// Bytes in front of the mask.
pub const HEADER_BYTES: usize = 64;

/// Length in bytes of the longest message about a part of `pixels` pixels.
pub fn longest<P: Composite>(pixels: usize) -> usize {
    HEADER_BYTES + 8 * pixels.div_ceil(64) + pixels.saturating_mul(P::BYTES)
}

/// What is wrong with a message.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
pub enum WireError {
    /// Fewer or more bytes than its header announces.
    #[error("{found} bytes where {expected} were expected")]
    Length {
        /// Bytes needed.
        expected: u64,
        /// Bytes there.
        found: u64,
    },
    /// Not a message of this library or of this version of it.
    #[error("it does not begin with COMPOS01")]
    Magic,
    /// Bits changed on the way.
    #[error("its checksum is {found:#018x} instead of {expected:#018x}")]
    Checksum {
        /// As stored in the message.
        expected: u64,
        /// As computed.
        found: u64,
    },
    /// The sender composites something else.
    #[error(
        "its sender composites another size, pixel format, strategy or rank order: use the same on every rank"
    )]
    Fingerprint,
    /// Another part of the image than agreed.
    #[error("it holds pixels {start}..{end} instead of {expected_start}..{expected_end}")]
    Part {
        /// First pixel it holds.
        start: u64,
        /// End of the pixels it holds.
        end: u64,
        /// First pixel it should hold.
        expected_start: u64,
        /// End of the pixels it should hold.
        expected_end: u64,
    },
    /// Span, mask and count contradict each other.
    #[error("its numbers of active pixels contradict each other")]
    Mask,
}

/// Every step is a bijection of the state and of the word, so a change within a single word never goes unnoticed.
pub(crate) fn checksum(bytes: &[u8]) -> u64 {
    bytes.chunks(8).fold(bytes.len() as u64, |state, chunk| mix(state, word(chunk)))
}

/// One step of [`checksum`] and of fingerprints.
pub(crate) fn mix(state: u64, value: u64) -> u64 {
    (state ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

/// Up to eight bytes as a number; missing ones are zero.
fn word(bytes: &[u8]) -> u64 {
    let mut whole = [0; 8];
    whole[..bytes.len()].copy_from_slice(bytes);
    u64::from_le_bytes(whole)
}

/// Encodes the pixels of the part `range`, of which `pixel` gives the one at an index of the whole image.
pub fn encode<P: Composite>(fingerprint: u64, range: Range<usize>, pixel: impl Fn(usize) -> P) -> Vec<u8> {
    // Extent and number of active pixels.
    let mut active = 0_usize;
    let mut span = range.start..range.start;
    for index in range.clone() {
        if pixel(index).is_active() {
            if active == 0 {
                span.start = index;
            }
            span.end = index + 1;
            active += 1;
        }
    }
    if active == 0 {
        span = range.start..range.start;
    }
    let mask_words = if active == span.len() { 0 } else { span.len().div_ceil(64) };

    // Header; the checksum comes last.
    let mut message = Vec::with_capacity(HEADER_BYTES + 8 * mask_words + active * P::BYTES);
    let numbers = [
        MAGIC,
        0,
        fingerprint,
        range.start as u64,
        range.len() as u64,
        (span.start - range.start) as u64,
        span.len() as u64,
        active as u64,
    ];
    for number in numbers {
        message.extend_from_slice(&number.to_le_bytes());
    }

    // Mask and pixels in one walk.
    message.resize(HEADER_BYTES + 8 * mask_words, 0);
    for (bit, index) in span.enumerate() {
        let value = pixel(index);
        if value.is_active() {
            if mask_words > 0 {
                message[HEADER_BYTES + bit / 8] |= 1 << (bit % 8);
            }
            value.write(&mut message);
        }
    }
    let sum = checksum(&message[16..]);
    message[8..16].copy_from_slice(&sum.to_le_bytes());
    message
}

/// A message whose every number has been checked.
#[derive(Debug)]
pub struct Part<'a> {
    /// The pixels of the whole image that it speaks of.
    pub range: Range<usize>,
    /// First active pixel, relative to the part.
    first: usize,
    span: usize,
    /// Active pixels in it.
    pub active: usize,
    mask: &'a [u8],
    pixels: &'a [u8],
}

/// Checks a message. `image_pixels` is the size of the whole image; `expected`, if known, the part it must hold.
///
/// # Errors
/// [`WireError`], for any input that [`encode`] would not have made.
pub fn decode<P: Composite>(
    bytes: &[u8],
    fingerprint: u64,
    image_pixels: usize,
    expected: Option<Range<usize>>,
) -> Result<Part<'_>, WireError> {
    let found = bytes.len() as u64;
    if bytes.len() < HEADER_BYTES {
        return Err(WireError::Length { expected: HEADER_BYTES as u64, found });
    }
    let number = |i: usize| word(&bytes[8 * i..8 * i + 8]);
    if number(0) != MAGIC {
        return Err(WireError::Magic);
    }
    let sum = checksum(&bytes[16..]);
    if sum != number(1) {
        return Err(WireError::Checksum { expected: number(1), found: sum });
    }
    if number(2) != fingerprint {
        return Err(WireError::Fingerprint);
    }

    // The part lies within the image and is the expected one.
    let (start, end) = (number(3), number(3).saturating_add(number(4)));
    let agreed =
        expected.unwrap_or(start.min(image_pixels as u64) as usize..end.min(image_pixels as u64) as usize);
    if (start, end) != (agreed.start as u64, agreed.end as u64) {
        return Err(WireError::Part {
            start,
            end,
            expected_start: agreed.start as u64,
            expected_end: agreed.end as u64,
        });
    }

    // Span and count fit the part, and the length fits them.
    let (first, span, active) = (number(5), number(6), number(7));
    if first.checked_add(span).is_none_or(|last| last > agreed.len() as u64) || active > span {
        return Err(WireError::Mask);
    }
    let mask_bytes = if active == span { 0 } else { 8 * span.div_ceil(64) };
    let pixel_bytes = active.checked_mul(P::BYTES as u64).ok_or(WireError::Mask)?;
    let needed = (HEADER_BYTES as u64).saturating_add(mask_bytes).saturating_add(pixel_bytes);
    if needed != found {
        return Err(WireError::Length { expected: needed, found });
    }
    let (mask, pixels) = bytes[HEADER_BYTES..].split_at(mask_bytes as usize);
    let ones: u64 = mask.iter().map(|byte| u64::from(byte.count_ones())).sum();
    let past_the_end = (span..8 * mask_bytes).any(|bit| (mask[(bit / 8) as usize] >> (bit % 8)) & 1 == 1);
    if mask_bytes > 0 && (ones != active || past_the_end) {
        return Err(WireError::Mask);
    }
    Ok(Part {
        range: agreed,
        first: first as usize,
        span: span as usize,
        active: active as usize,
        mask,
        pixels,
    })
}

impl Part<'_> {
    /// Calls `visit` with every active pixel and its index within the part.
    pub fn for_each_active<P: Composite>(&self, mut visit: impl FnMut(usize, P)) {
        let mut pixels = self.pixels.chunks_exact(P::BYTES).map(P::read);
        if self.mask.is_empty() {
            for (index, pixel) in (self.first..self.first + self.span).zip(pixels) {
                visit(index, pixel);
            }
            return;
        }
        for (word_index, bytes) in self.mask.chunks_exact(8).enumerate() {
            let mut bits = word(bytes);
            while bits != 0 {
                let bit = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                if let Some(pixel) = pixels.next() {
                    visit(self.first + 64 * word_index + bit, pixel);
                }
            }
        }
    }

    /// All pixels of the part, [`EMPTY`](crate::PixelFormat::EMPTY) where nothing is active.
    pub fn to_pixels<P: Composite>(&self) -> Vec<P> {
        let mut all = vec![P::EMPTY; self.range.len()];
        self.for_each_active(|index, pixel| all[index] = pixel);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixel::{DepthPixel, PixelFormat};

    type P = DepthPixel<[u8; 4]>;

    fn pattern(active: impl Fn(usize) -> bool) -> impl Fn(usize) -> P {
        move |i| {
            let depth = if active(i) { 0.5 } else { 1.0 };
            if active(i) { P::from_parts([i as u8, 1, 2, 3], depth) } else { P::EMPTY }
        }
    }

    fn random(state: &mut u64) -> u64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        *state
    }

    #[test]
    fn every_pattern_of_runs_survives() {
        let mut seed = 1;
        for length in [0, 1, 2, 63, 64, 65, 127, 129, 300] {
            for kind in 0..6 {
                let salt = random(&mut seed);
                let pixel = pattern(|i| match kind {
                    0 => false,
                    1 => true,
                    2 => i % 3 == 0,
                    3 => i == 10 + length / 2,
                    4 => i > 10 + length / 3,
                    _ => (salt >> (i % 64)) & 1 == 1,
                });
                let message = encode(9, 10..10 + length, &pixel);
                let part = decode::<P>(&message, 9, 400, Some(10..10 + length)).unwrap();
                let pixels: Vec<P> = (10..10 + length).map(&pixel).collect();
                assert_eq!(part.to_pixels::<P>(), pixels, "length {length}, kind {kind}");
                assert_eq!(part.active, pixels.iter().filter(|p| p.is_active()).count());
            }
        }
    }

    #[test]
    fn an_empty_part_costs_its_header_and_a_dense_one_no_mask() {
        assert_eq!(encode(0, 0..1000, pattern(|_| false)).len(), HEADER_BYTES);
        assert_eq!(encode(0, 0..1000, pattern(|_| true)).len(), HEADER_BYTES + 1000 * P::BYTES);
    }

    #[test]
    fn no_truncation_and_no_flipped_bit_goes_unnoticed() {
        let good = encode(3, 5..105, pattern(|i| i % 3 != 0));
        for length in 0..good.len() {
            assert!(decode::<P>(&good[..length], 3, 200, Some(5..105)).is_err(), "cut to {length} bytes");
        }
        for bit in 0..8 * good.len() {
            let mut bad = good.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(decode::<P>(&bad, 3, 200, Some(5..105)).is_err(), "bit {bit}");
        }
    }

    /// Lies with a right checksum: the decoder must find the contradiction itself.
    #[test]
    fn consistent_checksums_do_not_make_the_decoder_trust_the_numbers() {
        let good = encode(3, 5..105, pattern(|i| i % 3 != 0));
        let mut seed = 77;
        let mut refused = 0;
        for _ in 0..20_000 {
            let mut bad = good.clone();
            for _ in 0..1 + random(&mut seed) % 3 {
                let field = 3 + (random(&mut seed) % 8) as usize;
                let value = match random(&mut seed) % 4 {
                    0 => u64::MAX - random(&mut seed) % 200,
                    1 => random(&mut seed) % 200,
                    _ => random(&mut seed) >> (random(&mut seed) % 64),
                };
                bad[8 * field..8 * field + 8].copy_from_slice(&value.to_le_bytes());
            }
            let sum = checksum(&bad[16..]);
            bad[8..16].copy_from_slice(&sum.to_le_bytes());
            match decode::<P>(&bad, 3, 200, None) {
                // Whatever is accepted must be readable without panic and keep its own count.
                Ok(part) => {
                    let mut count = 0;
                    part.for_each_active::<P>(|index, _| {
                        assert!(index < part.range.len());
                        count += 1;
                    });
                    assert_eq!(count, part.active);
                }
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 15_000, "only {refused} of 20000 lies were refused");
    }

    #[test]
    fn another_fingerprint_or_part_is_named() {
        let good = encode(3, 0..4, pattern(|_| true));
        assert_eq!(decode::<P>(&good, 4, 200, None).unwrap_err(), WireError::Fingerprint);
        let error = decode::<P>(&good, 3, 200, Some(0..5)).unwrap_err();
        assert_eq!(error.to_string(), "it holds pixels 0..4 instead of 0..5");
        assert!(matches!(decode::<P>(&good, 3, 3, None), Err(WireError::Part { .. })));
    }
}
