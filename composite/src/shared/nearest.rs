//! Formats with depth: for 64 pixels reads first the depths of eight frames, then the colours of
//! the nearest ones.
//!
//! Merging one frame after the other would read the colours of all that are nearest for a while (a
//! third of them, for layers in any order), and read and write the result repeatedly. Here every
//! pixel of the image is written once, and only visible colours are read.
use super::columns::Columns;
use crate::color::Color;
use crate::layer::View;
use crate::pixel::Composite;
use crate::simd::mask::packed;
use crate::simd::runs::colors_16;
use crate::simd::{Kernels, at_level, for_runs};
use bytemuck::{cast_slice, cast_slice_mut};
use fearless_simd::{Bytes, Select, Simd, SimdBase, SimdMask, f32x16, mask32x16, u8x64, u32x16};

/// Pixels of a block. The costs of finding a block of a frame and of mispredicting the number of
/// frames are spread over its words. (Blocks of one word took 190 cycles each and 24 for each
/// frame.)
pub(super) const BLOCK: usize = WORD * WORDS;

/// Pixels of a word of flags: four vectors of 16.
const WORD: usize = 64;

/// Words of a block.
const WORDS: usize = 2;

/// Frames whose blocks are processed together. (With 32, sparse frames took 15 % longer, because
/// all slots are written for each block.)
const TOGETHER: usize = 8;

/// The farthest depth that is not background. It is the initial depth, so any frame that is not
/// behind it has drawn something.
const FARTHEST: f32 = f32::from_bits(1.0_f32.to_bits() - 1);

/// A block of one frame.
#[derive(Clone, Copy)]
struct Block<'a, C> {
    colors: &'a [C; BLOCK],
    depths: &'a [f32; BLOCK],
    /// The pixels within the frame's bounds.
    lanes: [u64; WORDS],
}

/// A block of the image.
struct BlockResult<'a, C> {
    colors: &'a mut [C; BLOCK],
    depths: [f32; BLOCK],
    /// Pixels that no frame drew: their colours and depths are not set.
    background: [u64; WORDS],
    /// Whether any depth was NaN.
    has_nan: bool,
}

/// Scratch buffers of a thread that merges rows.
pub(super) struct NearestRows<P: Composite> {
    /// Number of NaN depths of each frame.
    pub(super) nan: Vec<u64>,
    /// Padded copies of blocks that extend past the planes of a frame.
    edges: Vec<([P::Color; BLOCK], [f32; BLOCK])>,
}

impl<P: Composite> NearestRows<P> {
    pub(super) fn new() -> Self {
        Self { nan: Vec::new(), edges: Vec::new() }
    }

    /// Merges rows from `first_row` on into `colors` and, if it is not empty, `depths`; `columns`
    /// says which frames drew where.
    pub(super) fn merge_rows(
        &mut self,
        kernels: Kernels,
        columns: &Columns<BLOCK>,
        views: &[View<'_, P>],
        rows: (u32, usize),
        colors: &mut [P::Color],
        depths: &mut [f32],
    ) {
        self.nan.resize(views.len(), 0);
        at_level!(
            kernels,
            simd => self.merge(columns, views, rows, colors, depths,
                #[inline(always)]
                |blocks, word, held| take_nearest(simd, blocks, word, held)),
            self.merge(columns, views, rows, colors, depths, take_nearest_scalar)
        );
    }

    #[inline(always)]
    fn merge(
        &mut self,
        columns: &Columns<BLOCK>,
        views: &[View<'_, P>],
        (first_row, width): (u32, usize),
        colors: &mut [P::Color],
        depths: &mut [f32],
        take_nearest: impl Fn(&[Block<'_, P::Color>], usize, &mut BlockResult<'_, P::Color>),
    ) {
        let nothing = ([P::EMPTY.color(); BLOCK], [1.0; BLOCK]);
        // The last block of a row may have fewer pixels.
        let mut padded = [P::EMPTY.color(); BLOCK];
        for (row, colors) in colors.chunks_exact_mut(width).enumerate() {
            let y = first_row + row as u32;
            let depths = if depths.is_empty() {
                &mut [][..]
            } else {
                &mut depths[row * width..(row + 1) * width]
            };
            for (x, drawn) in columns.iter() {
                let end = (x + BLOCK).min(width);
                let colors = &mut colors[x..end];
                let depths = if depths.is_empty() { &mut [][..] } else { &mut depths[x..end] };
                if drawn.is_empty() {
                    colors.fill(P::EMPTY.color());
                    depths.fill(1.0);
                    continue;
                }
                let (target, is_whole) = match <&mut [_; BLOCK]>::try_from(&mut *colors) {
                    Ok(whole) => (whole, true),
                    Err(_) => (&mut padded, false),
                };
                let depths_before = [FARTHEST; BLOCK];
                let background = [u64::MAX; WORDS];
                let mut held = BlockResult {
                    colors: target,
                    depths: depths_before,
                    background,
                    has_nan: false,
                };
                for some in drawn.chunks(TOGETHER) {
                    self.edges.clear();
                    for &index in some {
                        fill_up(&views[index], x, y, &mut self.edges);
                    }
                    let mut edges = self.edges.iter();
                    let mut blocks =
                        [Block { colors: &nothing.0, depths: &nothing.1, lanes: [0; WORDS] };
                            TOGETHER];
                    for (&index, block) in some.iter().zip(&mut blocks) {
                        let lanes = lanes(&views[index], x);
                        *block = match within_planes(&views[index], x, y) {
                            Some((colors, depths)) => Block { colors, depths, lanes },
                            None => edges.next().map_or(*block, |(colors, depths)| Block {
                                colors,
                                depths,
                                lanes,
                            }),
                        };
                    }
                    for word in 0..WORDS {
                        take_nearest(&blocks[..some.len()], word, &mut held);
                    }
                    if std::mem::take(&mut held.has_nan) {
                        for (&index, block) in some.iter().zip(&blocks) {
                            let depths = block.depths.iter().enumerate();
                            let nan = depths.filter(|(i, depth)| {
                                block.lanes[i / WORD] >> (i % WORD) & 1 == 1 && depth.is_nan()
                            });
                            self.nan[index] += nan.count() as u64;
                        }
                    }
                }
                let (nearest, background) = (held.depths, held.background);
                if !depths.is_empty() {
                    depths.copy_from_slice(&nearest[..depths.len()]);
                    for (depths, background) in depths.chunks_mut(WORD).zip(background) {
                        for_runs(
                            background & (u64::MAX >> (WORD - depths.len())),
                            |first, length| {
                                depths[first..first + length].fill(1.0);
                            },
                        );
                    }
                }
                if !is_whole {
                    colors.copy_from_slice(&padded[..colors.len()]);
                }
            }
        }
    }
}

/// Which pixels of the block that begins in column `x` the frame has; at least one.
#[inline(always)]
fn lanes<P: Composite>(view: &View<'_, P>, x: usize) -> [u64; WORDS] {
    let (first, end) = (view.bounds.x0 as usize, view.bounds.x1 as usize);
    std::array::from_fn(|word| {
        let x = x + WORD * word;
        let before = first.saturating_sub(x).min(WORD) as u32;
        let inside = end.saturating_sub(x).min(WORD) as u32;
        // Shifts by 64 leave no bit.
        let from_first = u64::MAX.checked_shl(before).unwrap_or(0);
        from_first & !u64::MAX.checked_shl(inside).unwrap_or(0)
    })
}

/// The block of row `y` that begins in column `x`, if the planes extend so far. It may hold
/// anything outside the frame's bounds.
#[inline(always)]
fn within_planes<'a, P: Composite>(
    view: &View<'a, P>,
    x: usize,
    y: u32,
) -> Option<(&'a [P::Color; BLOCK], &'a [f32; BLOCK])> {
    let column = x.checked_sub(view.origin.0 as usize)?;
    if column + BLOCK > view.stride {
        return None;
    }
    let start = (y - view.origin.1) as usize * view.stride + column;
    Some((view.colors.get(start..)?.first_chunk()?, view.depths.get(start..)?.first_chunk()?))
}

/// Appends a padded copy of the block of row `y` that begins in column `x`, if it is not within the
/// planes.
#[inline(always)]
fn fill_up<P: Composite>(
    view: &View<'_, P>,
    x: usize,
    y: u32,
    edges: &mut Vec<([P::Color; BLOCK], [f32; BLOCK])>,
) {
    if within_planes(view, x, y).is_some() {
        return;
    }
    let first = x.max(view.bounds.x0 as usize);
    let last = (x + BLOCK).min(view.bounds.x1 as usize);
    let (from_colors, from_depths) = view.row(y, first as u32, last as u32);
    let (mut colors, mut depths) = ([P::EMPTY.color(); BLOCK], [1.0; BLOCK]);
    colors[first - x..last - x].copy_from_slice(from_colors);
    depths[first - x..last - x].copy_from_slice(from_depths);
    edges.push((colors, depths));
}

/// Selects for each pixel of a word the nearest of `blocks` and `held`, and the last of equally
/// near ones.
#[inline(always)]
fn take_nearest<C: Color, S: Simd>(
    simd: S,
    blocks: &[Block<'_, C>],
    word: usize,
    held: &mut BlockResult<'_, C>,
) {
    let first = WORD * word;
    let load = |quarter: usize, depths: &[f32; BLOCK]| {
        f32x16::from_slice(simd, &depths[first + 16 * quarter..first + 16 * quarter + 16])
    };
    // Which pixels of each frame are nearest so far, frame by frame.
    let mut wins = [0_u64; TOGETHER];
    let mut nearest = [f32x16::splat(simd, 0.0); 4];
    for quarter in 0..4 {
        nearest[quarter] = load(quarter, &held.depths);
    }
    let mut sums = [f32x16::splat(simd, 0.0); 4];
    let mut any = 0;
    for (block, wins) in blocks.iter().zip(&mut wins) {
        for quarter in 0..4 {
            let mut depth = load(quarter, block.depths);
            if block.lanes[word] != u64::MAX {
                let lanes =
                    mask32x16::from_bitmask(simd, block.lanes[word] >> (16 * quarter) & 0xffff);
                depth = lanes.select(depth, f32x16::splat(simd, 1.0));
            }
            sums[quarter] += depth;
            let wins_here = depth.simd_le(nearest[quarter]);
            nearest[quarter] = wins_here.select(depth, nearest[quarter]);
            *wins |= wins_here.to_bitmask() << (16 * quarter);
        }
        any |= *wins;
    }
    // A sum is no NaN if no depth is. With infinite depths it may be one, but then the depths are
    // only checked one by one.
    let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    held.has_nan |= !sum.simd_eq(sum).all_true();
    for quarter in 0..4 {
        nearest[quarter]
            .store_slice(&mut held.depths[first + 16 * quarter..first + 16 * quarter + 16]);
    }

    // The last frame that was nearest wins, so scan from the last frame until every pixel has one.
    let winners = blocks.iter().zip(&wins).rev();
    if C::BYTES == 4 {
        let held_bytes: &mut [u8] = cast_slice_mut(&mut held.colors[first..first + WORD]);
        let mut merged = [u32x16::splat(simd, 0); 4];
        // Colours are only valid if an earlier frame drew here.
        if held.background[word] != u64::MAX {
            for quarter in 0..4 {
                merged[quarter] = colors_16(simd, &held_bytes[64 * quarter..64 * quarter + 64]);
            }
        }
        for_winners(winners, any, |block, seen| {
            let bytes: &[u8] = cast_slice(&block.colors[first..first + WORD]);
            for quarter in 0..4 {
                let colors = colors_16(simd, &bytes[64 * quarter..64 * quarter + 64]);
                merged[quarter] = if seen == u64::MAX {
                    colors
                } else {
                    mask32x16::from_bitmask(simd, seen >> (16 * quarter) & 0xffff)
                        .select(colors, merged[quarter])
                };
            }
        });
        for quarter in 0..4 {
            merged[quarter]
                .bitcast::<u8x64<S>>()
                .store_slice(&mut held_bytes[64 * quarter..64 * quarter + 64]);
        }
        held.background[word] &= !any;
    } else {
        take_runs(winners, any, word, held);
    }
}

/// [`take_nearest`] without vector types: loops over flags and numbers, which compilers turn into
/// the vectors that every machine has.
fn take_nearest_scalar<C: Color>(
    blocks: &[Block<'_, C>],
    word: usize,
    held: &mut BlockResult<'_, C>,
) {
    let pixels = WORD * word..WORD * (word + 1);
    let mut wins = [0_u64; TOGETHER];
    let mut any = 0;
    for (block, wins) in blocks.iter().zip(&mut wins) {
        let mut flags = [0_u8; WORD];
        let mut depths = [0.0; WORD];
        depths.copy_from_slice(&block.depths[pixels.clone()]);
        if block.lanes[word] != u64::MAX {
            for (i, depth) in depths.iter_mut().enumerate() {
                *depth = if block.lanes[word] >> i & 1 == 1 { *depth } else { 1.0 };
            }
        }
        held.has_nan |= depths.iter().fold(false, |any, depth| any | depth.is_nan());
        for ((held, depth), flag) in
            held.depths[pixels.clone()].iter_mut().zip(&depths).zip(&mut flags)
        {
            let is_nearest = *depth <= *held;
            *flag = u8::from(is_nearest);
            *held = if is_nearest { *depth } else { *held };
        }
        *wins = packed(&flags);
        any |= *wins;
    }
    take_runs(blocks.iter().zip(&wins).rev(), any, word, held);
}

/// Copies the colours of winners run by run.
#[inline(always)]
fn take_runs<'a, 'b: 'a, C: Color>(
    winners: impl Iterator<Item = (&'a Block<'b, C>, &'a u64)>,
    any: u64,
    word: usize,
    held: &mut BlockResult<'_, C>,
) {
    let all = WORD * word..WORD * (word + 1);
    if held.background[word] == u64::MAX && any != u64::MAX {
        held.colors[all.clone()].fill(C::TRANSPARENT);
    }
    for_winners(winners, any, |block, seen| {
        for_runs(seen, |first, length| {
            let pixels = all.start + first..all.start + first + length;
            held.colors[pixels.clone()].copy_from_slice(&block.colors[pixels]);
        });
    });
    held.background[word] &= !any;
}

/// Calls for each frame with those of the pixels `any` in which it is the first with a flag.
#[inline(always)]
fn for_winners<'a, 'b: 'a, C: Color>(
    winners: impl Iterator<Item = (&'a Block<'b, C>, &'a u64)>,
    any: u64,
    mut take: impl FnMut(&Block<'b, C>, u64),
) {
    let mut unseen = any;
    for (block, wins) in winners {
        let seen = wins & unseen;
        if seen != 0 {
            take(block, seen);
            unseen ^= seen;
            if unseen == 0 {
                break;
            }
        }
    }
}
