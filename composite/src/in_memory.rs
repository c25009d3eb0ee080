//! Merging for ranks that are processes of one machine: shared memory instead of messages. Where
//! the ranks are on several machines, each machine merges what its ranks drew.
//!
//! Each rank copies what it drew into its segment of shared memory. After a barrier, ranks take
//! bands of rows of the image as long as there are any, and merge them straight from the segments.
//! The collecting rank reads the bands of the others. A pixel is copied twice, whereas with
//! messages it is read, encoded, copied by the system, read again, merged, encoded and sent once
//! more. Any rank that has a processor works, wherever the pixels are.
use crate::codec::MessageError;
use crate::comm::SharedSegments;
use crate::error::CompositeError;
use crate::frame::Image;
use crate::frame_exchange::FrameExchange;
use crate::layer::View;
use crate::machine_groups::MachineGroup;
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::shared::{BAND_ROWS, Rows, merge_band};
use crate::simd::Kernels;
use std::ops::Range;

/// Most bytes of all segments together; larger images are sent in messages.
const MOST_BYTES: usize = 4 << 30;

/// Planes of types other than bytes begin at multiples of this.
const ALIGNMENT: usize = 64;

/// Where the planes of a rectangle are in a segment, colours first.
struct Planes {
    colors: usize,
    depths: Range<usize>,
}

impl Planes {
    fn of<P: Composite>(rect: &Rect) -> Self {
        let colors = rect.pixels() * size_of::<P::Color>();
        let begin = colors.next_multiple_of(ALIGNMENT);
        let end = begin + if P::HAS_DEPTH { 4 * rect.pixels() } else { 0 };
        Self { colors, depths: begin..end }
    }
}

/// Where the bands of the image are, in the segment of the rank that collects.
struct Bands {
    width: usize,
    /// Rows of the image that are merged.
    rows: Range<usize>,
    first: usize,
    depths: bool,
    row_bytes: usize,
}

impl Bands {
    fn rows(&self, band: usize) -> Range<usize> {
        let first = self.rows.start + band * BAND_ROWS;
        first..(first + BAND_ROWS).min(self.rows.end)
    }

    fn count(&self) -> usize {
        self.rows.len().div_ceil(BAND_ROWS)
    }

    /// Offset and length in bytes.
    fn offset_and_len(&self, band: usize) -> (usize, usize) {
        let begin = self.first + band * (BAND_ROWS * self.row_bytes).next_multiple_of(ALIGNMENT);
        (begin, self.rows(band).len() * self.row_bytes)
    }

    fn end(&self) -> usize {
        self.offset_and_len(self.count()).0
    }

    /// Colours and depths of a band.
    fn split<'a, P: Composite>(
        &self,
        band: usize,
        bytes: &'a mut [u8],
    ) -> (&'a mut [P::Color], &'a mut [f32]) {
        let colors = self.rows(band).len() * self.width * size_of::<P::Color>();
        let (colors, depths) = bytes.split_at_mut(colors);
        (bytemuck::cast_slice_mut(colors), bytemuck::cast_slice_mut(depths))
    }
}

/// Whether the ranks of each machine can merge this frame in shared memory; the same on all ranks.
/// The handshake must be complete.
pub(crate) fn is_possible<P: Composite>(
    exchange: &mut FrameExchange<'_>,
    (width_px, height_px): (u32, u32),
    groups: &[MachineGroup],
) -> bool {
    let image = Rect::of_size(width_px, height_px).pixels() * P::BYTES;
    let bytes = |group: &MachineGroup| {
        let drawn = &exchange.drawn[group.members.clone()];
        drawn.iter().map(|rect| rect.pixels() * P::BYTES).fold(image, usize::saturating_add)
    };
    groups.iter().all(|group| bytes(group) <= MOST_BYTES)
        && exchange.comm.shared_segments().is_some()
}

/// What [`run`] merges.
pub(crate) struct Merging<'a, P: Composite> {
    /// What this rank drew.
    pub(crate) view: View<'a, P>,
    /// Columns and rows of the image.
    pub(crate) size_px: (u32, u32),
    /// The ranks of this machine.
    pub(crate) group: &'a MachineGroup,
    /// The rows of the image to merge.
    pub(crate) rows: Range<u32>,
    /// Whether the merged image has depths.
    pub(crate) depths: bool,
}

impl<'a, P: Composite> Merging<'a, P> {
    /// The whole image, which all ranks of the group make.
    pub(crate) fn whole(
        view: View<'a, P>,
        size_px: (u32, u32),
        group: &'a MachineGroup,
        depths: bool,
    ) -> Self {
        Self { view, size_px, group, rows: 0..size_px.1, depths }
    }

    /// The rows in which ranks of the group drew. `drawn` has the rectangles of all ranks.
    pub(crate) fn part(
        view: View<'a, P>,
        size_px: (u32, u32),
        group: &'a MachineGroup,
        drawn: &[Rect],
    ) -> Self {
        let part = group.drawn(drawn);
        Self { view, size_px, group, rows: part.y0..part.y1, depths: true }
    }

    /// The bands of the image, in the segment of the leader who drew in `drawn`.
    fn bands(&self, drawn: &Rect) -> Bands {
        let depths = self.depths && P::HAS_DEPTH;
        let width = self.size_px.0 as usize;
        Bands {
            width,
            rows: self.rows.start as usize..self.rows.end as usize,
            first: Planes::of::<P>(drawn).depths.end.next_multiple_of(ALIGNMENT),
            depths,
            row_bytes: width * (size_of::<P::Color>() + if depths { 4 } else { 0 }),
        }
    }

    /// Bytes of the segment of a rank who drew in `drawn`.
    pub(crate) fn segment_bytes(&self, order_index: usize, drawn: &Rect) -> usize {
        match order_index == self.group.leader {
            true => self.bands(drawn).end(),
            false => Planes::of::<P>(drawn).depths.end,
        }
    }
}

/// The image at the leader of the group, of which the given rows are merged; returns after a
/// barrier of the machine. The outer `None` is returned on all ranks of the machine if there was
/// not enough memory.
pub(crate) fn run<P: Composite>(
    exchange: &mut FrameExchange<'_>,
    merging: &Merging<'_, P>,
    spare: Option<Image<P>>,
    kernels: Kernels,
) -> Result<Option<Option<Image<P>>>, CompositeError> {
    let Merging { view, size_px: (width_px, height_px), group, .. } = merging;
    let root = group.leader;
    let bands = merging.bands(&exchange.drawn[root]);
    let (width, depths) = (bands.width, bands.depths);

    // Publish what this rank drew.
    let begin = exchange.comm.working_secs();
    exchange.count_nan(view, view.bounds);
    let own = Planes::of::<P>(&view.bounds);
    let bytes = merging.segment_bytes(exchange.order_index, &view.bounds);
    if let Some(memory) = exchange.comm.shared_segments() {
        memory.publish(bytes, own.depths.end, &mut |segment| copy_rows(view, &own, segment));
    }
    exchange.report.compress_secs += exchange.comm.working_secs() - begin;
    let span = exchange.begin_span();
    exchange.machine_barrier()?;
    let Some(memory) = exchange.comm.shared_segments() else { return Ok(None) };
    match memory.attach() {
        Ok(true) => {}
        Ok(false) => return Ok(None),
        Err(error) => return Err(exchange.comm.root_cause(error).into()),
    }
    exchange.end_span(span, |report| &mut report.exchange_secs);

    // Merge bands, as long as there are any.
    let begin = exchange.comm.working_secs();
    let own_index = exchange.order_index;
    let is_root = own_index == root;
    let mut image = is_root.then(|| blank(*width_px, *height_px, depths, spare));
    let mut own_bands = vec![false; if is_root { bands.count() } else { 0 }];
    let own_rank = exchange.rank_of(own_index);
    let root_rank = exchange.rank_of(root);
    let members: Vec<(Rect, usize)> = group
        .members
        .clone()
        .map(|order_index| (exchange.drawn[order_index], exchange.rank_of(order_index)))
        .collect();
    let Some(memory) = exchange.comm.shared_segments() else { return Ok(None) };
    let memory: &dyn SharedSegments = memory;
    let mut views: Vec<View<'_, P>> = Vec::with_capacity(members.len());
    for (rect, from) in &members {
        match published_view(memory, *from, rect) {
            Ok(view) => views.push(view),
            Err(reason) => {
                return Err(CompositeError::Message { rank: own_rank, from: *from, reason });
            }
        }
    }
    let mut rows = Rows::<P>::new(width);
    loop {
        let band = memory.next_band();
        if band >= bands.count() {
            break;
        }
        let first = bands.rows(band).start;
        if let Some(image) = &mut image {
            let (colors, depths) = band_of(image, &bands, band);
            merge_band(kernels, &mut rows, &views, first as u32, colors, depths);
            own_bands[band] = true;
        } else {
            let (from, bytes) = bands.offset_and_len(band);
            memory.write_band(root_rank, from, bytes, &mut |bytes| {
                let (colors, depths) = bands.split::<P>(band, bytes);
                merge_band(kernels, &mut rows, &views, first as u32, colors, depths);
            });
        }
    }
    exchange.report.blend_secs += exchange.comm.working_secs() - begin;
    let span = exchange.begin_span();
    exchange.machine_barrier()?;
    exchange.end_span(span, |report| &mut report.exchange_secs);

    // Copy the bands of the other ranks.
    let begin = exchange.comm.working_secs();
    if let (Some(image), Some(memory)) = (&mut image, exchange.comm.shared_segments()) {
        for band in (0..bands.count()).filter(|&band| !own_bands[band]) {
            let (from, bytes) = bands.offset_and_len(band);
            let bytes = memory.band(root_rank, from, bytes);
            let (colors, depths) = band_of(image, &bands, band);
            let (merged_colors, merged_depths) = bytes.split_at(size_of_val(colors));
            bytemuck::cast_slice_mut(colors).copy_from_slice(merged_colors);
            bytemuck::cast_slice_mut(depths).copy_from_slice(merged_depths);
        }
    }
    exchange.report.collect_secs += exchange.comm.working_secs() - begin;
    Ok(Some(image))
}

fn copy_rows<P: Composite>(view: &View<'_, P>, planes: &Planes, segment: &mut [u8]) {
    let rect = view.bounds;
    if rect.is_empty() {
        return;
    }
    let (colors, rest) = segment.split_at_mut(planes.colors);
    let row_bytes = rect.width() * size_of::<P::Color>();
    let depths = &mut rest[planes.depths.start - planes.colors..];
    for (y, to) in (rect.y0..rect.y1).zip(colors.chunks_exact_mut(row_bytes)) {
        to.copy_from_slice(bytemuck::cast_slice(view.row(y, rect.x0, rect.x1).0));
    }
    if P::HAS_DEPTH {
        for (y, to) in (rect.y0..rect.y1).zip(depths.chunks_exact_mut(4 * rect.width())) {
            to.copy_from_slice(bytemuck::cast_slice(view.row(y, rect.x0, rect.x1).1));
        }
    }
}

fn published_view<'a, P: Composite>(
    memory: &'a dyn SharedSegments,
    rank: usize,
    rect: &Rect,
) -> Result<View<'a, P>, MessageError> {
    let planes = Planes::of::<P>(rect);
    let segment = memory.segment(rank, planes.depths.end);
    if segment.len() < planes.depths.end {
        return Err(MessageError::Length {
            expected: planes.depths.end as u64,
            found: segment.len() as u64,
        });
    }
    Ok(View {
        bounds: *rect,
        origin: (rect.x0, rect.y0),
        stride: rect.width(),
        colors: bytemuck::cast_slice(&segment[..planes.colors]),
        depths: bytemuck::cast_slice(&segment[planes.depths]),
    })
}

/// An image whose every pixel will be written.
fn blank<P: Composite>(
    width_px: u32,
    height_px: u32,
    depths: bool,
    spare: Option<Image<P>>,
) -> Image<P> {
    let pixels = Rect::of_size(width_px, height_px).pixels();
    let depth_pixels = if depths { pixels } else { 0 };
    let fitting =
        spare.filter(|image| image.colors.len() == pixels && image.depths.len() == depth_pixels);
    let (colors, depths) = match fitting {
        Some(image) => (image.colors, image.depths),
        None => (vec![P::EMPTY.color(); pixels], vec![1.0; depth_pixels]),
    };
    Image { width_px, height_px, colors, depths }
}

fn band_of<'a, P: Composite>(
    image: &'a mut Image<P>,
    bands: &Bands,
    band: usize,
) -> (&'a mut [P::Color], &'a mut [f32]) {
    let rows = bands.rows(band);
    let pixels = rows.start * bands.width..rows.end * bands.width;
    let depths = if bands.depths { &mut image.depths[pixels.clone()] } else { &mut [] };
    (&mut image.colors[pixels], depths)
}
