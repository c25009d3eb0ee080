//! Messages between ranks: a rectangle of an image, encoded as a bit mask of active pixels followed
//! by these pixels, row after row.
//!
//! | bytes | content |
//! |---|---|
//! | 0..8 | `COMPOS03` |
//! | 8..16 | checksum of the rest of the header, and of the mask and pixels if flag 4 is set |
//! | 16..24 | fingerprint of what is composited: sizes, format, strategy, rank order |
//! | 24..32 | flags: 1 mask present, 2 depths present, 4 checksum covers pixels, 8 colours have three bytes and full alpha |
//! | 32..48 | `u32` each: first column, first row, end of columns, end of rows |
//! | 48..56 | number of active pixels |
//! | 56..64 | zero |
//! | then | mask: for every row words of 64 pixels, lowest bit first; omitted if all or no pixels are active |
//! | then | for every row the colours of its active pixels, then (if flag 2 is set) their depths |
//!
//! All numbers are little-endian, and pixels have the same bytes as in memory. Counts have 64 bits,
//! also in arithmetic. The decoder trusts nothing: an accepted message can be read without a
//! further check.
mod error;

pub use error::MessageError;

use crate::color::Color;
use crate::layer::{Layer, View};
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::simd::compress::{append_active, append_active_scalar};
use crate::simd::expand::{
    Side, SparseRow, copy_row, copy_row_scalar, merge_row, merge_row_scalar,
};
use crate::simd::mask::{Counts, row_words, row_words_scalar};
use crate::simd::opaque::{
    drop_full_alpha, drop_full_alpha_scalar, give_full_alpha, give_full_alpha_scalar,
};
use crate::simd::{Kernels, at_level};
use fearless_simd::Simd;

#[cfg(not(target_endian = "little"))]
compile_error!(
    "messages hold pixels as they lie in memory, and this has only been done for little-endian \
     machines"
);

const MAGIC: u64 = u64::from_le_bytes(*b"COMPOS03");
/// Bytes before the mask.
pub(crate) const HEADER_BYTES: usize = 64;
const HAS_MASK: u64 = 1;
const HAS_DEPTHS: u64 = 2;
const IS_SUMMED: u64 = 4;
const IS_OPAQUE: u64 = 8;
const ALL_FLAGS: u64 = 15;
/// Bytes of a colour whose alpha is known to be full.
const OPAQUE_BYTES: usize = 3;

/// Checksum of the bytes in eight independent chains, which a processor computes in parallel.
///
/// Every step is a bijection of the state and of the word, so a change within a single word is
/// always detected.
pub(crate) fn checksum(bytes: &[u8]) -> u64 {
    let (blocks, rest) = bytes.as_chunks::<64>();
    let mut chains: [u64; 8] = std::array::from_fn(|i| i as u64);
    for block in blocks {
        for (chain, word) in chains.iter_mut().zip(block.as_chunks::<8>().0) {
            *chain = mix(*chain, u64::from_le_bytes(*word));
        }
    }
    let state = chains.into_iter().fold(bytes.len() as u64, mix);
    rest.chunks(8).fold(state, |state, chunk| {
        let mut whole = [0; 8];
        whole[..chunk.len()].copy_from_slice(chunk);
        mix(state, u64::from_le_bytes(whole))
    })
}

/// One step of [`checksum`] and of fingerprints.
pub(crate) fn mix(state: u64, value: u64) -> u64 {
    (state ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

/// How the messages of one frame are encoded and decoded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Codec {
    pub(crate) kernels: Kernels,
    pub(crate) fingerprint: u64,
    /// Whether checksums cover the pixels too.
    pub(crate) verify: bool,
}

/// Bytes of the longest message for `rect`, dense or sparse.
pub(crate) fn longest<P: Composite>(rect: &Rect) -> usize {
    HEADER_BYTES + rect.height() * rect.width().div_ceil(64) * 8 + rect.pixels() * P::BYTES
}

/// Whether messages of colours without depths may omit full alphas. Most messages of opaque images
/// can.
fn may_be_opaque<P: Composite>(depths: bool) -> bool {
    P::HAS_DEPTH && P::Color::BYTES == 4 && !depths
}

/// The rectangle in the header of a message, not yet checked.
pub(crate) fn rect_of(bytes: &[u8]) -> Option<Rect> {
    let corner = |at: usize| bytes.get(at..at + 4).map(bytemuck::pod_read_unaligned::<u32>);
    Some(Rect { x0: corner(32)?, y0: corner(36)?, x1: corner(40)?, y1: corner(44)? })
}

impl Codec {
    /// Writes the message for the pixels of `view` in `rect` into `out`, replacing its content.
    /// Without `depths` the receiver only gets colours.
    pub(crate) fn encode<P: Composite>(
        &self,
        view: &View<'_, P>,
        rect: Rect,
        depths: bool,
        out: &mut Vec<u8>,
    ) -> Counts {
        out.clear();
        out.resize(HEADER_BYTES, 0);
        let depths = depths && P::HAS_DEPTH;
        let mut counts = Counts::default();
        let mut opaque = may_be_opaque::<P>(depths);
        while !rect.is_empty() {
            let encoded = at_level!(
                self.kernels,
                simd => encode_rows(SimdKernels(simd), view, rect, depths, opaque, out),
                encode_rows(ScalarKernels, view, rect, depths, opaque, out)
            );
            if let Some(encoded) = encoded {
                counts = encoded;
                break;
            }
            // One of the alphas was not full after all: encode again with alphas.
            opaque = false;
            out.truncate(HEADER_BYTES);
        }

        // Write the header. A rectangle with all pixels active has no mask.
        let mut flags = if depths { HAS_DEPTHS } else { 0 };
        if counts.active == 0 {
            out.truncate(HEADER_BYTES);
        } else if counts.active < rect.pixels() {
            flags |= HAS_MASK;
        }
        if self.verify {
            flags |= IS_SUMMED;
        }
        if opaque && counts.active > 0 {
            flags |= IS_OPAQUE;
        }
        let corners = |a: u32, b: u32| u64::from(a) | u64::from(b) << 32;
        let (from, to) = (corners(rect.x0, rect.y0), corners(rect.x1, rect.y1));
        for (slot, number) in [MAGIC, 0, self.fingerprint, flags, from, to, counts.active as u64]
            .into_iter()
            .enumerate()
        {
            out[8 * slot..8 * slot + 8].copy_from_slice(&number.to_le_bytes());
        }
        let end = if self.verify { out.len() } else { HEADER_BYTES };
        let sum = checksum(&out[16..end]);
        out[8..16].copy_from_slice(&sum.to_le_bytes());
        counts
    }

    /// Checks a message that must hold exactly `expected`, and `depths` or none.
    ///
    /// # Errors
    /// [`MessageError`], for any input that [`encode`](Self::encode) would not have made.
    pub(crate) fn decode<'a, P: Composite>(
        &self,
        bytes: &'a [u8],
        expected: Rect,
        depths: bool,
    ) -> Result<DecodedMessage<'a>, MessageError> {
        let found = bytes.len() as u64;
        if bytes.len() < HEADER_BYTES {
            return Err(MessageError::Length { expected: HEADER_BYTES as u64, found });
        }
        let number =
            |slot: usize| bytemuck::pod_read_unaligned::<u64>(&bytes[8 * slot..8 * slot + 8]);
        if number(0) != MAGIC {
            return Err(MessageError::Magic);
        }
        let flags = number(3);
        let end = if flags & IS_SUMMED != 0 { bytes.len() } else { HEADER_BYTES };
        let sum = checksum(&bytes[16..end]);
        if sum != number(1) {
            return Err(MessageError::Checksum { expected: number(1), found: sum });
        }
        if number(2) != self.fingerprint {
            return Err(MessageError::Fingerprint);
        }

        // The rectangle must be the expected one.
        let rect = rect_of(bytes).unwrap_or(Rect::EMPTY);
        if rect != expected {
            return Err(MessageError::Part { found: rect, expected });
        }

        // Flags and count must fit the rectangle, and the length must fit them.
        let (pixels, active) = (rect.pixels() as u64, number(6));
        let sparse = active > 0 && active < pixels;
        if flags > ALL_FLAGS
            || number(7) != 0
            || active > pixels
            || (flags & HAS_MASK != 0) != sparse
        {
            return Err(MessageError::Mask);
        }
        let has_depths = flags & HAS_DEPTHS != 0;
        if has_depths != (depths && P::HAS_DEPTH) {
            return Err(MessageError::Mask);
        }
        let is_opaque = flags & IS_OPAQUE != 0;
        if is_opaque && (active == 0 || !may_be_opaque::<P>(depths)) {
            return Err(MessageError::Mask);
        }
        let words_per_row = rect.width().div_ceil(64) as u64;
        let mask_bytes = if sparse { 8 * words_per_row * rect.height() as u64 } else { 0 };
        let color_bytes = if is_opaque { OPAQUE_BYTES } else { P::Color::BYTES };
        let pixel_bytes = color_bytes as u64 + if has_depths { 4 } else { 0 };
        let needed = active
            .checked_mul(pixel_bytes)
            .and_then(|bytes| bytes.checked_add(mask_bytes + HEADER_BYTES as u64))
            .ok_or(MessageError::Mask)?;
        if needed != found {
            return Err(MessageError::Length { expected: needed, found });
        }
        let part = DecodedMessage::open(bytes, rect, active as usize, has_depths, color_bytes);
        if sparse { part.check_mask().map(|()| part) } else { Ok(part) }
    }
}

/// Row operations of [`encode_rows`] at one instruction set.
trait RowKernels: Copy {
    fn row_words<P: Composite>(
        self,
        colors: &[P::Color],
        depths: &[f32],
        counts: &mut Counts,
        put: impl FnMut(u64),
    );
    fn append_active<const SIZE: usize>(self, out: &mut Vec<u8>, mask_at: usize, row: &[u8]);
    fn drop_full_alpha(self, out: &mut Vec<u8>, start: usize) -> bool;
}

#[derive(Clone, Copy)]
struct SimdKernels<S>(S);

impl<S: Simd> RowKernels for SimdKernels<S> {
    #[inline(always)]
    fn row_words<P: Composite>(
        self,
        colors: &[P::Color],
        depths: &[f32],
        counts: &mut Counts,
        put: impl FnMut(u64),
    ) {
        row_words::<P, S>(self.0, colors, depths, counts, put);
    }

    #[inline(always)]
    fn append_active<const SIZE: usize>(self, out: &mut Vec<u8>, mask_at: usize, row: &[u8]) {
        append_active::<SIZE, S>(self.0, out, mask_at, row);
    }

    #[inline(always)]
    fn drop_full_alpha(self, out: &mut Vec<u8>, start: usize) -> bool {
        drop_full_alpha(self.0, out, start)
    }
}

#[derive(Clone, Copy)]
struct ScalarKernels;

impl RowKernels for ScalarKernels {
    fn row_words<P: Composite>(
        self,
        colors: &[P::Color],
        depths: &[f32],
        counts: &mut Counts,
        put: impl FnMut(u64),
    ) {
        row_words_scalar::<P>(colors, depths, counts, put);
    }

    fn append_active<const SIZE: usize>(self, out: &mut Vec<u8>, mask_at: usize, row: &[u8]) {
        append_active_scalar::<SIZE>(out, mask_at, row);
    }

    fn drop_full_alpha(self, out: &mut Vec<u8>, start: usize) -> bool {
        drop_full_alpha_scalar(out, start)
    }
}

#[inline(always)]
fn encode_rows<P: Composite>(
    kernels: impl RowKernels,
    view: &View<'_, P>,
    rect: Rect,
    depths: bool,
    opaque: bool,
    out: &mut Vec<u8>,
) -> Option<Counts> {
    let mut counts = Counts::default();
    let (width, words) = (rect.width(), rect.width().div_ceil(64));
    out.reserve(rect.pixels() * P::BYTES);

    // Copy whole rows as long as all pixels are active. Most rectangles are either dense or show
    // that they are not in their first row.
    let mut y = rect.y0;
    while y < rect.y1 {
        let (colors, row_depths) = view.row(y, rect.x0, rect.x1);
        let before = counts.active;
        kernels.row_words::<P>(colors, row_depths, &mut counts, |_| {});
        if counts.active != before + width {
            break;
        }
        out.extend_from_slice(bytemuck::cast_slice(colors));
        if opaque && out.last() != Some(&255) {
            return None;
        }
        if depths {
            out.extend_from_slice(bytemuck::cast_slice(row_depths));
        }
        y += 1;
    }
    // Opaque colours have no depths between them, so they are contiguous.
    if y == rect.y1 {
        return (!opaque || kernels.drop_full_alpha(out, HEADER_BYTES)).then_some(counts);
    }

    // Otherwise start over with a mask.
    counts = Counts::default();
    out.truncate(HEADER_BYTES);
    out.resize(HEADER_BYTES + 8 * words * rect.height(), 0);
    let mut mask_at = HEADER_BYTES;
    for y in rect.y0..rect.y1 {
        let (colors, row_depths) = view.row(y, rect.x0, rect.x1);
        let before = counts.active;
        let mut word_at = mask_at;
        kernels.row_words::<P>(colors, row_depths, &mut counts, |word| {
            out[word_at..word_at + 8].copy_from_slice(&word.to_le_bytes());
            word_at += 8;
        });
        if counts.active > before {
            let colors = bytemuck::cast_slice(colors);
            match P::Color::BYTES {
                4 => kernels.append_active::<4>(out, mask_at, colors),
                8 => kernels.append_active::<8>(out, mask_at, colors),
                _ => kernels.append_active::<16>(out, mask_at, colors),
            }
            // `drop_full_alpha` checks all alphas at the end, but most images that are not opaque
            // show it in their first row.
            if opaque && out.last() != Some(&255) {
                return None;
            }
            if depths {
                kernels.append_active::<4>(out, mask_at, bytemuck::cast_slice(row_depths));
            }
        }
        mask_at = word_at;
    }
    (!opaque || kernels.drop_full_alpha(out, mask_at)).then_some(counts)
}

/// A message that has been checked completely.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DecodedMessage<'a> {
    pub(crate) rect: Rect,
    pub(crate) active: usize,
    has_depths: bool,
    color_bytes: usize,
    mask: &'a [u8],
    pixels: &'a [u8],
}

impl<'a> DecodedMessage<'a> {
    /// Opens a message that [`Codec::decode`] has accepted, with its own number of active pixels.
    pub(crate) fn reopen<P: Composite>(bytes: &'a [u8], rect: Rect, depths: bool) -> Self {
        let active = bytes.get(48..56).map_or(0, bytemuck::pod_read_unaligned::<u64>);
        let flags: u64 = bytes.get(24..32).map_or(0, bytemuck::pod_read_unaligned);
        let color_bytes = if flags & IS_OPAQUE != 0 { OPAQUE_BYTES } else { P::Color::BYTES };
        Self::open(bytes, rect, active as usize, depths && P::HAS_DEPTH, color_bytes)
    }

    fn open(
        bytes: &'a [u8],
        rect: Rect,
        active: usize,
        has_depths: bool,
        color_bytes: usize,
    ) -> Self {
        let sparse = active > 0 && active < rect.pixels();
        let mask_bytes = if sparse { 8 * rect.width().div_ceil(64) * rect.height() } else { 0 };
        let (mask, pixels) = bytes[HEADER_BYTES..].split_at(mask_bytes);
        Self { rect, active, has_depths, color_bytes, mask, pixels }
    }

    /// Checks that the mask has as many ones as announced, and none after the end of a row.
    fn check_mask(&self) -> Result<(), MessageError> {
        let width = self.rect.width();
        let outside = if width.is_multiple_of(64) { 0 } else { u64::MAX << (width % 64) };
        let row_bytes = 8 * width.div_ceil(64);
        let mut ones = 0_usize;
        for row in self.mask.chunks_exact(row_bytes) {
            let mut last = 0;
            for word in row.as_chunks::<8>().0 {
                last = u64::from_le_bytes(*word);
                ones += last.count_ones() as usize;
            }
            if last & outside != 0 {
                return Err(MessageError::Mask);
            }
        }
        if ones == self.active { Ok(()) } else { Err(MessageError::Mask) }
    }

    /// Calls `visit` for every row, top to bottom; rows may be without active pixels.
    #[inline(always)]
    fn for_each_row(&self, mut visit: impl FnMut(u32, SparseRow<'a>)) {
        if self.active == 0 {
            return;
        }
        let row_bytes = 8 * self.rect.width().div_ceil(64);
        let mut at = 0;
        for (index, y) in (self.rect.y0..self.rect.y1).enumerate() {
            let mask = if self.mask.is_empty() {
                &[]
            } else {
                &self.mask[index * row_bytes..(index + 1) * row_bytes]
            };
            let active = if mask.is_empty() {
                self.rect.width()
            } else {
                mask.as_chunks::<8>()
                    .0
                    .iter()
                    .map(|word| u64::from_le_bytes(*word).count_ones() as usize)
                    .sum()
            };
            let depths_at = at + active * self.color_bytes;
            let end = depths_at + if self.has_depths { 4 * active } else { 0 };
            visit(
                y,
                SparseRow {
                    mask,
                    colors: &self.pixels[at..depths_at],
                    depths: &self.pixels[depths_at..end],
                    behind_colors: &self.pixels[at..],
                    behind_depths: &self.pixels[depths_at..],
                },
            );
            at = end;
        }
    }

    /// Merges its pixels into `layer`, whose bounds must contain the rectangle.
    pub(crate) fn merge_into<P: Composite>(
        &self,
        kernels: Kernels,
        layer: &mut Layer<P>,
        side: Side,
    ) {
        at_level!(
            kernels,
            simd => self.for_each_row(
                #[inline(always)]
                |y, row| {
                    let (colors, depths) = layer.row_mut(y, self.rect.x0, self.rect.x1);
                    merge_row::<P, _>(simd, row, colors, depths, side);
                }
            ),
            self.for_each_row(|y, row| {
                let (colors, depths) = layer.row_mut(y, self.rect.x0, self.rect.x1);
                merge_row_scalar::<P>(row, colors, depths, side);
            })
        );
    }

    /// Overwrites its rectangle in `layer`, whose bounds must contain it. Not for messages without
    /// depths where `layer` has depths.
    pub(crate) fn copy_to_layer<P: Composite>(&self, kernels: Kernels, layer: &mut Layer<P>) {
        let (x0, x1) = (self.rect.x0, self.rect.x1);
        at_level!(
            kernels,
            simd => self.for_each_row(
                #[inline(always)]
                |y, row| {
                    let (colors, depths) = layer.row_mut(y, x0, x1);
                    copy_row::<P, _>(simd, row, colors, depths);
                }
            ),
            self.for_each_row(|y, row| {
                let (colors, depths) = layer.row_mut(y, x0, x1);
                copy_row_scalar::<P>(row, colors, depths);
            })
        );
    }

    /// Writes its rectangle into planes of `width` columns; `depths` may be empty. `wide` is a
    /// scratch buffer.
    pub(crate) fn copy_to_planes<P: Composite>(
        &self,
        kernels: Kernels,
        width: usize,
        colors: &mut [P::Color],
        depths: &mut [f32],
        wide: &mut Vec<u8>,
    ) {
        let range = |y: u32| {
            let start = y as usize * width + self.rect.x0 as usize;
            start..start + self.rect.width()
        };
        if self.active == 0 {
            for y in self.rect.y0..self.rect.y1 {
                colors[range(y)].fill(P::EMPTY.color());
                if !depths.is_empty() {
                    depths[range(y)].fill(1.0);
                }
            }
            return;
        }
        let mut part = *self;
        if self.color_bytes != P::Color::BYTES {
            // Expand all rows at once: slabs have only a few pixels per row.
            at_level!(
                kernels,
                simd => give_full_alpha(simd, self.pixels, wide),
                give_full_alpha_scalar(self.pixels, wide)
            );
            part = DecodedMessage { pixels: wide, color_bytes: P::Color::BYTES, ..*self };
        }
        at_level!(
            kernels,
            simd => part.for_each_row(
                #[inline(always)]
                |y, row| {
                    let to_depths = if depths.is_empty() { &mut [] } else { &mut depths[range(y)] };
                    copy_row::<P, _>(simd, row, &mut colors[range(y)], to_depths);
                }
            ),
            part.for_each_row(|y, row| {
                let to_depths = if depths.is_empty() { &mut [] } else { &mut depths[range(y)] };
                copy_row_scalar::<P>(row, &mut colors[range(y)], to_depths);
            })
        );
    }
}

#[cfg(test)]
mod tests;
