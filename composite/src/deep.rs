//! Compositing of ranks that overlap in depth: every pixel is a list of transparent fragments with
//! depths, and at most one opaque surface.
//!
//! `over` in rank order is only correct where ranks are one behind the other
//! ([`Frame::with_depth_range`](crate::Frame::with_depth_range) checks that). Here the owner of a
//! tile receives the fragments of all ranks, keeps those in front of the nearest opaque surface,
//! sorts them by depth and blends them once, in `f64`. This composites opaque geometry and
//! transparent layers of all ranks in one pass (IceT takes either depth or blending), and gives the
//! same bits for every partition of the same fragments among ranks.
use crate::codec::{Codec, MessageError, checksum};
use crate::collect::Collector;
use crate::comm::Communicator;
use crate::compositor::{CompositeOutput, CompositingOrder, Options, abort_group, fingerprint};
use crate::error::CompositeError;
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::Layer;
use crate::merge::Scratch;
use crate::pixel::PremultipliedPixel;
use crate::rect::Rect;
use crate::simd::Kernels;
use crate::tiles::balanced;

type BlendedPixel = PremultipliedPixel<[f32; 4]>;

/// A transparent layer at one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// Premultiplied colour.
    pub color: [f32; 4],
    /// Depth in any unit that all ranks share; smaller is nearer.
    pub depth: f32,
}

/// One rank's fragments and opaque surfaces.
#[derive(Clone, Copy, Debug)]
pub struct DeepFrame<'a> {
    width_px: u32,
    height_px: u32,
    fragments: &'a [Fragment],
    ends: &'a [usize],
    opaque: Option<(&'a [[f32; 4]], &'a [f32])>,
}

impl<'a> DeepFrame<'a> {
    /// Fragments pixel after pixel, in any order within a pixel; `ends[i]` is one past the index of
    /// the last fragment of pixel `i`.
    ///
    /// # Errors
    /// [`CompositeError::FrameSize`] if `ends` has another length than the image has pixels,
    /// [`CompositeError::Options`] if its numbers decrease or do not end at the number of
    /// fragments, or if a pixel has 2^31 of them.
    pub fn new(
        width_px: u32,
        height_px: u32,
        fragments: &'a [Fragment],
        ends: &'a [usize],
    ) -> Result<Self, CompositeError> {
        let expected = u64::from(width_px) * u64::from(height_px);
        check_length("fragment end", width_px, height_px, expected, ends.len())?;
        let sorted = ends.is_sorted() && ends.last().copied().unwrap_or(0) == fragments.len();
        if !sorted {
            return Err(CompositeError::Options(format!(
                "the ends of the pixels' fragments must not decrease and must end at the number of \
                 fragments, {}",
                fragments.len()
            )));
        }
        let first = ends.first().copied().unwrap_or(0);
        let most = ends.windows(2).map(|pair| pair[1] - pair[0]).fold(first, usize::max);
        if most as u64 > MOST_FRAGMENTS {
            return Err(CompositeError::Options(format!(
                "a pixel has {most} fragments, but can have at most {MOST_FRAGMENTS}"
            )));
        }
        Ok(Self { width_px, height_px, fragments, ends, opaque: None })
    }

    /// The same frame with opaque surfaces: colours (not premultiplied, alpha 1) and depths in the
    /// unit of the fragments; infinity or NaN where there is no surface. At equal depths a surface
    /// hides fragments, and the highest rank's surface wins.
    ///
    /// # Errors
    /// [`CompositeError::FrameSize`] if a slice has another length than the image has pixels.
    pub fn with_opaque(
        self,
        colors: &'a [[f32; 4]],
        depths: &'a [f32],
    ) -> Result<Self, CompositeError> {
        let expected = self.ends.len() as u64;
        check_length("colour", self.width_px, self.height_px, expected, colors.len())?;
        check_length("depth", self.width_px, self.height_px, expected, depths.len())?;
        Ok(Self { opaque: Some((colors, depths)), ..self })
    }

    fn of_pixel(&self, index: usize) -> (&'a [Fragment], Option<Fragment>) {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        let surface = self
            .opaque
            .map(|(colors, depths)| Fragment { color: colors[index], depth: depths[index] });
        (
            &self.fragments[start..self.ends[index]],
            surface.filter(|surface| surface.depth < f32::INFINITY),
        )
    }

    /// The bounding rectangle of fragments and surfaces, and the number of NaN depths.
    fn drawn(&self) -> (Rect, u64) {
        let (mut rect, mut nan) = (Rect::EMPTY, 0);
        for index in 0..self.ends.len() {
            let (fragments, surface) = self.of_pixel(index);
            nan += fragments.iter().filter(|fragment| fragment.depth.is_nan()).count() as u64;
            nan += u64::from(self.opaque.is_some_and(|(_, depths)| depths[index].is_nan()));
            if !fragments.is_empty() || surface.is_some() {
                let (x, y) = (index as u32 % self.width_px, index as u32 / self.width_px);
                rect = rect.around(&Rect { x0: x, y0: y, x1: x + 1, y1: y + 1 });
            }
        }
        (rect, nan)
    }
}

fn check_length(
    slice: &'static str,
    width_px: u32,
    height_px: u32,
    expected: u64,
    found: usize,
) -> Result<(), CompositeError> {
    let found = found as u64;
    if found == expected {
        return Ok(());
    }
    Err(CompositeError::FrameSize { slice, width_px, height_px, expected, found })
}

/// Composites deep frames; every rank of `comm` calls this once per frame. The strategy is always
/// direct send. `options.order` says which of equally deep fragments is in front (the first) and
/// which of equally deep surfaces is visible (the last). The image is premultiplied.
///
/// # Errors
/// As [`composite`](crate::composite).
pub fn composite_deep(
    comm: &mut dyn Communicator,
    frame: &DeepFrame<'_>,
    options: &Options,
) -> Result<CompositeOutput<BlendedPixel>, CompositeError> {
    let result = composite_or_fail(comm, frame, options);
    if let Err(error) = &result {
        abort_group(comm, error);
    }
    result
}

fn composite_or_fail(
    comm: &mut dyn Communicator,
    frame: &DeepFrame<'_>,
    options: &Options,
) -> Result<CompositeOutput<BlendedPixel>, CompositeError> {
    let begin = comm.now();
    let order = CompositingOrder::new(comm, options)?;
    let size_px = (frame.width_px, frame.height_px);
    let kernels = Kernels::new(options.simd);
    let fingerprint = fingerprint::<BlendedPixel>(size_px, options, &order, None)
        ^ u64::from_le_bytes(*b"DEEP____");
    let codec = Codec { kernels, fingerprint, verify: options.verify };
    let mut exchange =
        FrameExchange::new(comm, order.ranks.clone(), order.own_index, codec, options.timeout);
    let (drawn, nan) = frame.drawn();
    exchange.report.nan_depths = nan;
    exchange.handshake(size_px, drawn, [f32::NAN; 2])?;
    let totals = exchange.all_gather_number(frame.fragments.len() as u64)?;
    for (order_index, &found) in totals.iter().enumerate() {
        let most = (exchange.drawn[order_index].pixels() as u64).saturating_mul(MOST_FRAGMENTS);
        if found > most {
            return Err(exchange.unusable(order_index, MessageError::Fragments { found, most }));
        }
    }

    // Assign tiles, and post receives.
    let tiles = balanced(&exchange.drawn);
    let part_of = |order_index: usize, rects: &[Rect]| {
        rects[order_index].intersection(&tiles[order.own_index])
    };
    let everything = exchange.drawn.clone();
    let pieces: Vec<(usize, Rect)> =
        tiles.iter().copied().enumerate().filter(|(_, tile)| !tile.is_empty()).collect();
    let mut collector = Collector::<BlendedPixel>::new(
        &mut exchange,
        size_px,
        order.root_index,
        false,
        &pieces,
        None,
    )?;
    for order_index in
        (0..exchange.num_ranks()).filter(|&order_index| order_index != order.own_index)
    {
        let part = part_of(order_index, &everything);
        if !part.is_empty() {
            let most = totals[order_index]
                .saturating_add(part.pixels() as u64)
                .saturating_mul(RECORD_BYTES as u64);
            let capacity = most.saturating_add((HEADER_BYTES + 4 * part.pixels()) as u64);
            exchange.post_bytes(
                order_index,
                Tag::Exchange,
                usize::try_from(capacity).unwrap_or(usize::MAX),
            )?;
        }
    }

    // Send, in the order of direct send.
    for step in 1..exchange.num_ranks() {
        let owner = (order.own_index + step) % exchange.num_ranks();
        let part = drawn.intersection(&tiles[owner]);
        if !part.is_empty() {
            let at = exchange.now();
            let message = encode(frame, part, fingerprint);
            exchange.report.compress_secs += exchange.now() - at;
            exchange.send_bytes(owner, Tag::Exchange, message)?;
        }
    }

    // Receive, and merge when all messages have arrived.
    let mut parts: Vec<Option<Vec<u8>>> = vec![None; exchange.num_ranks()];
    let own_part = part_of(order.own_index, &everything);
    if !own_part.is_empty() {
        parts[order.own_index] = Some(encode(frame, own_part, fingerprint));
    }
    let span = exchange.begin_span();
    while exchange.is_receiving_for(Tag::Exchange) {
        match exchange.next(true)? {
            Some((order_index, true, bytes)) => {
                collector.take(&mut exchange, order_index, bytes)?
            }
            Some((order_index, false, bytes)) => {
                let checked = check(&bytes, part_of(order_index, &everything), fingerprint);
                checked.map_err(|reason| exchange.unusable(order_index, reason))?;
                parts[order_index] = Some(bytes);
            }
            None => {}
        }
    }
    exchange.end_span(span, |report| &mut report.exchange_secs);
    let tile = tiles[order.own_index];
    if !tile.is_empty() {
        let at = exchange.now();
        let readers: Vec<Reader<'_>> = (0..exchange.num_ranks())
            .filter_map(|order_index| {
                Some(Reader::new(parts[order_index].as_deref()?, part_of(order_index, &everything)))
            })
            .collect();
        let layer = merge(tile, readers);
        exchange.report.blend_secs += exchange.now() - at;
        collector.submit(&mut exchange, layer, &mut Scratch::new(kernels))?;
    }
    let span = exchange.begin_span();
    let (image, piece) = collector.finish(&mut exchange)?;
    exchange.end_span(span, |report| &mut report.collect_secs);
    if options.final_barrier {
        exchange.barrier()?;
    }
    let mut report = exchange.report;
    report.total_secs = exchange.now() - begin;
    Ok(CompositeOutput { image, piece, report })
}

// ---- Messages -----------------------------------------------------------------------------------
// Header: magic, checksum of everything after it, fingerprint, rectangle, number of fragments,
// number of surfaces. Then for every pixel its number of fragments, with the highest bit set if
// there is a surface; the fragments; the surfaces. A record is colour and depth.

const MAGIC: u64 = u64::from_le_bytes(*b"COMPDEEP");
const HEADER_BYTES: usize = 64;
const RECORD_BYTES: usize = 20;
const HAS_SURFACE: u32 = 1 << 31;
/// Fragments of a pixel that a message can hold.
const MOST_FRAGMENTS: u64 = HAS_SURFACE as u64 - 1;

fn encode(frame: &DeepFrame<'_>, part: Rect, fingerprint: u64) -> Vec<u8> {
    let (mut counts, mut records, mut surfaces): (Vec<u32>, Vec<u8>, Vec<u8>) = Default::default();
    let put = |to: &mut Vec<u8>, f: &Fragment| {
        to.extend_from_slice(bytemuck::cast_slice(&f.color));
        to.extend_from_slice(&f.depth.to_le_bytes());
    };
    for y in part.y0..part.y1 {
        for x in part.x0..part.x1 {
            let (fragments, surface) =
                frame.of_pixel(y as usize * frame.width_px as usize + x as usize);
            // Fragments behind an opaque surface of this rank are invisible; NaN is in front of
            // nothing.
            let limit = surface.map_or(f32::INFINITY, |surface| surface.depth);
            let seen = fragments
                .iter()
                .filter(|f| f.depth < limit || (f.depth == limit && surface.is_none()));
            let mut count = 0;
            for fragment in seen {
                put(&mut records, fragment);
                count += 1;
            }
            if let Some(surface) = &surface {
                put(&mut surfaces, surface);
                count |= HAS_SURFACE;
            }
            counts.push(count);
        }
    }
    let corners = |a: u32, b: u32| u64::from(a) | u64::from(b) << 32;
    let numbers = [
        MAGIC,
        0,
        fingerprint,
        corners(part.x0, part.y0),
        corners(part.x1, part.y1),
        (records.len() / RECORD_BYTES) as u64,
        (surfaces.len() / RECORD_BYTES) as u64,
        0,
    ];
    let mut message: Vec<u8> = bytemuck::cast_slice(&numbers).to_vec();
    message.extend_from_slice(bytemuck::cast_slice(&counts));
    message.append(&mut records);
    message.append(&mut surfaces);
    let sum = checksum(&message[16..]);
    message[8..16].copy_from_slice(&sum.to_le_bytes());
    message
}

/// Whether a message holds `part` and can be read without a further check.
fn check(bytes: &[u8], part: Rect, fingerprint: u64) -> Result<(), MessageError> {
    let found = bytes.len() as u64;
    if bytes.len() < HEADER_BYTES {
        return Err(MessageError::Length { expected: HEADER_BYTES as u64, found });
    }
    let number = |slot: usize| bytemuck::pod_read_unaligned::<u64>(&bytes[8 * slot..8 * slot + 8]);
    if number(0) != MAGIC {
        return Err(MessageError::Magic);
    }
    let sum = checksum(&bytes[16..]);
    if sum != number(1) {
        return Err(MessageError::Checksum { expected: number(1), found: sum });
    }
    if number(2) != fingerprint {
        return Err(MessageError::Fingerprint);
    }
    let half = |slot: usize, shift: u32| (number(slot) >> shift) as u32;
    let rect = Rect { x0: half(3, 0), y0: half(3, 32), x1: half(4, 0), y1: half(4, 32) };
    if rect != part {
        return Err(MessageError::Part { found: rect, expected: part });
    }
    let records = number(5)
        .checked_add(number(6))
        .and_then(|records| records.checked_mul(RECORD_BYTES as u64));
    let pixels = part.pixels() as u64;
    let expected = records.and_then(|bytes| bytes.checked_add(HEADER_BYTES as u64 + 4 * pixels));
    let expected = expected.ok_or(MessageError::Mask)?;
    if expected != found {
        return Err(MessageError::Length { expected, found });
    }
    let (mut fragments, mut surfaces) = (0_u64, 0_u64);
    for count in bytes[HEADER_BYTES..HEADER_BYTES + 4 * part.pixels()].as_chunks::<4>().0 {
        let count = u32::from_le_bytes(*count);
        fragments += u64::from(count & !HAS_SURFACE);
        surfaces += u64::from(count & HAS_SURFACE != 0);
    }
    if (fragments, surfaces) == (number(5), number(6)) { Ok(()) } else { Err(MessageError::Mask) }
}

/// Iterates over the pixels of a checked message in order.
struct Reader<'a> {
    part: Rect,
    counts: std::slice::Iter<'a, [u8; 4]>,
    fragments: std::slice::Iter<'a, [u8; RECORD_BYTES]>,
    surfaces: std::slice::Iter<'a, [u8; RECORD_BYTES]>,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8], part: Rect) -> Self {
        let (counts, records) = bytes[HEADER_BYTES..].split_at(4 * part.pixels());
        let fragments = bytemuck::pod_read_unaligned::<u64>(&bytes[40..48]) as usize;
        let (fragments, surfaces) = records.as_chunks::<RECORD_BYTES>().0.split_at(fragments);
        Self {
            part,
            counts: counts.as_chunks::<4>().0.iter(),
            fragments: fragments.iter(),
            surfaces: surfaces.iter(),
        }
    }

    /// Adds the fragments of the next pixel to `to`; returns its surface.
    fn next(&mut self, to: &mut Vec<Fragment>) -> Option<Fragment> {
        let count = self.counts.next().map_or(0, |count| u32::from_le_bytes(*count));
        to.extend(self.fragments.by_ref().take((count & !HAS_SURFACE) as usize).map(fragment));
        if count & HAS_SURFACE != 0 { self.surfaces.next().map(fragment) } else { None }
    }
}

fn fragment(bytes: &[u8; RECORD_BYTES]) -> Fragment {
    let [red, green, blue, alpha, depth]: [f32; 5] = bytemuck::pod_read_unaligned(bytes);
    Fragment { color: [red, green, blue, alpha], depth }
}

// ---- Merging ----------------------------------------------------------------------------------
fn merge(tile: Rect, mut readers: Vec<Reader<'_>>) -> Layer<BlendedPixel> {
    let mut layer = Layer::empty(tile, None);
    let (mut pixel, mut fragments) = (0, Vec::new());
    for y in tile.y0..tile.y1 {
        for x in tile.x0..tile.x1 {
            fragments.clear();
            let mut nearest: Option<Fragment> = None;
            for reader in &mut readers {
                let part = &reader.part;
                if part.x0 <= x && x < part.x1 && part.y0 <= y && y < part.y1 {
                    // The later rank in order wins ties.
                    if let Some(surface) = reader.next(&mut fragments)
                        && nearest.is_none_or(|held| surface.depth <= held.depth)
                    {
                        nearest = Some(surface);
                    }
                }
            }
            layer.colors[pixel] = blend(&mut fragments, nearest).map(|channel| channel as f32);
            pixel += 1;
        }
    }
    layer
}

/// Blends the fragments in front of `surface`, nearest first, and `surface` behind them. Equal
/// depths keep their order.
fn blend(fragments: &mut Vec<Fragment>, surface: Option<Fragment>) -> [f64; 4] {
    if let Some(surface) = surface {
        fragments.retain(|fragment| fragment.depth < surface.depth);
    }
    // No depth is NaN here; -0.0 and 0.0 are equal.
    fragments.sort_by(|a, b| a.depth.partial_cmp(&b.depth).unwrap_or(std::cmp::Ordering::Equal));
    let mut color = [0.0_f64; 4];
    for layer in fragments.iter().chain(&surface) {
        let see_through = 1.0 - color[3];
        for channel in 0..4 {
            color[channel] += see_through * f64::from(layer.color[channel]);
        }
    }
    color
}

/// The reference: all frames on one node, one pixel after the other, in `f64`.
///
/// # Errors
/// [`CompositeError::NoFrames`], [`CompositeError::SizesDiffer`].
pub fn composite_deep_serial(frames: &[DeepFrame<'_>]) -> Result<Vec<[f64; 4]>, CompositeError> {
    let first = frames.first().ok_or(CompositeError::NoFrames)?;
    let expected_px = (first.width_px, first.height_px);
    for (rank, frame) in frames.iter().enumerate() {
        let found_px = (frame.width_px, frame.height_px);
        if found_px != expected_px {
            return Err(CompositeError::SizesDiffer { rank, found_px, expected_px });
        }
    }
    let pixel = |index: usize| {
        let (mut all, mut nearest) = (Vec::new(), None::<Fragment>);
        for frame in frames {
            let (fragments, surface) = frame.of_pixel(index);
            all.extend(fragments.iter().filter(|fragment| !fragment.depth.is_nan()));
            if let Some(surface) = surface
                && nearest.is_none_or(|held| surface.depth <= held.depth)
            {
                nearest = Some(surface);
            }
        }
        blend(&mut all, nearest)
    };
    Ok((0..first.ends.len()).map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn message() -> (Vec<u8>, Rect) {
        let fragments =
            [0.3, 0.1, 0.2].map(|depth| Fragment { color: [0.1, 0.2, 0.3, 0.5], depth });
        let frame = DeepFrame::new(2, 2, &fragments, &[1, 1, 3, 3]).unwrap();
        let (colors, depths) = ([[1.0; 4]; 4], [f32::INFINITY, 0.5, 0.15, f32::NAN]);
        let frame = frame.with_opaque(&colors, &depths).unwrap();
        let part = Rect::of_size(2, 2);
        (encode(&frame, part, 7), part)
    }

    #[test]
    fn hidden_fragments_are_not_sent_and_changed_bytes_are_noticed() {
        let (good, part) = message();
        // One of the three fragments is behind the surface of its pixel.
        assert_eq!(good.len(), HEADER_BYTES + 4 * 4 + 2 * RECORD_BYTES + 2 * RECORD_BYTES);
        check(&good, part, 7).unwrap();
        assert_eq!(check(&good, part, 8), Err(MessageError::Fingerprint));
        for bit in 0..8 * good.len() {
            let mut bad = good.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(check(&bad, part, 7).is_err(), "bit {bit}");
        }
    }

    proptest! {
        #[test]
        fn a_deep_message_with_a_right_checksum_is_not_trusted_either(
            changes in proptest::collection::vec((40..140_usize, any::<u8>()), 1..5),
        ) {
            let (mut bad, part) = message();
            for (at, byte) in changes {
                if let Some(slot) = bad.get_mut(at) {
                    *slot = byte;
                }
            }
            let sum = checksum(&bad[16..]);
            bad[8..16].copy_from_slice(&sum.to_le_bytes());
            if check(&bad, part, 7).is_ok() {
                merge(part, vec![Reader::new(&bad, part)]);
            }
        }
    }
}
