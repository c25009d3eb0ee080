//! Direct send: every rank owns a tile of the image and receives it from all ranks that drew
//! something there.
//!
//! This takes one exchange instead of log p rounds. All ranks derive the tiles and the messages
//! from the rectangles that ranks drew in, so no rank waits for one that has nothing to send, and
//! every receive is posted before the first message is encoded. Tiles are cut into slices: one
//! slice is encoded while another is in flight, and a complete slice goes to the collecting rank
//! while others are still being merged. [`crate::stream`] submits slices while the frame is still
//! being rendered.
use crate::codec;
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::View;
use crate::merge::{Merge, MergeInput, Scratch};
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::tiles::{Owner, balanced_among, slices};

/// Slices of every rank's tile by order index, in the order in which they are sent.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) slices: Vec<Vec<Rect>>,
}

impl Plan {
    /// `root` is the order index of the rank that collects the image over a wire of its own.
    pub(crate) fn new<P: Composite>(
        drawn: &[Rect],
        slice_pixels: usize,
        root: Option<usize>,
    ) -> Self {
        let cut =
            |tile: Rect| if tile.is_empty() { Vec::new() } else { slices(tile, slice_pixels) };
        let mut owners = owners::<P>(drawn, root);
        Self { slices: balanced_among(drawn, &mut owners).into_iter().map(cut).collect() }
    }

    /// What each rank holds in the end. Pixels that nobody drew are in no piece.
    pub(crate) fn pieces(&self, drawn: &[Rect]) -> Vec<(usize, Rect)> {
        let mut pieces = Vec::new();
        for (order_index, slices) in self.slices.iter().enumerate() {
            for slice in slices {
                if drawn.iter().any(|rect| !rect.intersection(slice).is_empty()) {
                    pieces.push((order_index, *slice));
                }
            }
        }
        pieces
    }
}

/// Least pixels of a tile: the messages of smaller tiles cost more than they carry.
const OWNER_PX: usize = 32_768;
/// The share of a rank that does not collect.
const FULL_SHARE: u64 = 256;

/// Which ranks own tiles, and of what size.
///
/// The collecting rank also receives the finished image, over the same wire. With a share `x` of
/// the exchange `e` and of the image `g` (bytes received), it receives `x e + (1 - x) g` while each
/// other rank receives `(1 - x) e / (p - 1)`. They are equal for
/// `x = (e / (p - 1) - g) / (e p / (p - 1) - g)`, which is zero for more than a handful of ranks.
/// Two ranks get equal shares: what one does not merge the other must, and both work all the time.
/// So do ranks that share one memory, where every byte costs time of the same processors.
fn owners<P: Composite>(drawn: &[Rect], root: Option<usize>) -> Vec<Owner> {
    let num_ranks = drawn.len();
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect)).pixels();
    let layers: usize = drawn.iter().map(Rect::pixels).sum();
    // As many owners as there are tiles worth a message, and enough that each receives no more than
    // the root does.
    let (drawn_bytes, image_bytes) = (layers * P::BYTES, whole * size_of::<P::Color>());
    let wanted =
        (whole / OWNER_PX).max(drawn_bytes.div_ceil(image_bytes.max(1))).clamp(1, num_ranks);

    let share = match root {
        Some(_) if num_ranks > 2 => {
            let others = (num_ranks - 1) as f64;
            let exchange_bytes = drawn_bytes as f64 * others / num_ranks as f64;
            let image = image_bytes as f64;
            let x = (exchange_bytes / others - image)
                / (exchange_bytes * num_ranks as f64 / others - image).max(1.0);
            // Convert to a share where each other rank has FULL_SHARE.
            let x = x.clamp(0.0, 1.0 / num_ranks as f64);
            (x / (1.0 - x) * others * FULL_SHARE as f64) as u64
        }
        _ => FULL_SHARE,
    };
    // Spread owners evenly among all ranks, so that they are close to what they drew.
    let candidates: Vec<Owner> = (0..num_ranks)
        .map(|order_index| Owner {
            order_index,
            share: if root == Some(order_index) { share } else { FULL_SHARE },
        })
        .filter(|owner| owner.share > 0)
        .collect();
    let wanted = wanted.min(candidates.len());
    (0..wanted).map(|i| candidates[i * candidates.len() / wanted]).collect()
}

pub(crate) fn run<P: Composite>(
    plan: &Plan,
    exchange: &mut FrameExchange<'_>,
    view: &View<'_, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<(), CompositeError> {
    let (order_index, num_ranks) = (exchange.order_index, exchange.num_ranks());
    let mut tile_exchange = TileExchange::new(plan, exchange)?;

    // Send everybody's first slices, then everybody's second …, beginning with the next rank in
    // order so that no rank gets all first messages. At most two rounds are in flight. Messages
    // share the wire, so with all of them in flight the first slices would be complete, and begin
    // to be collected, no sooner than the last. With only a few slices there is nothing to gain.
    let most = plan.slices.iter().map(Vec::len).max().unwrap_or(0);
    let mut last_round = 0;
    for index in 0..most {
        if most > 3 && index > 1 {
            exchange.throttle_sends(last_round);
        }
        last_round = 0;
        for step in 1..num_ranks {
            let owner = (order_index + step) % num_ranks;
            if let Some(slice) = plan.slices[owner].get(index) {
                let part = view.bounds.intersection(slice);
                if !part.is_empty() {
                    exchange.send(owner, Tag::Exchange, view, part, true)?;
                    last_round += 1;
                }
            }
        }
        // Merge own pixels, and what has arrived meanwhile.
        if let Some(slice) = plan.slices[order_index].get(index) {
            let part = view.bounds.intersection(slice);
            if !part.is_empty() {
                exchange.count_nan(view, part);
                let item = MergeInput::View(View { bounds: part, ..*view });
                tile_exchange.put(index, order_index, item, exchange, collector, scratch)?;
            }
        }
        tile_exchange.take_arrived(exchange, collector, scratch)?;
    }
    tile_exchange.finish(exchange, collector, scratch)
}

/// The slices of this rank's tile and their progress.
pub(crate) struct TileExchange<'a, P: Composite> {
    own: Vec<Rect>,
    merges: Vec<Option<Merge<'a, P>>>,
    /// By order index, the parts of own slices that have not arrived from that rank.
    outstanding: Vec<Vec<(usize, Rect)>>,
}

impl<'a, P: Composite> TileExchange<'a, P> {
    /// Posts the receives of this rank.
    pub(crate) fn new(
        plan: &Plan,
        exchange: &mut FrameExchange<'_>,
    ) -> Result<Self, CompositeError> {
        let (order_index, num_ranks) = (exchange.order_index, exchange.num_ranks());
        let own = plan.slices[order_index].clone();
        let drawn = exchange.drawn.clone();
        let mut outstanding = vec![Vec::new(); num_ranks];
        for (from, parts) in
            outstanding.iter_mut().enumerate().filter(|(from, _)| *from != order_index)
        {
            for (index, slice) in own.iter().enumerate() {
                let part = drawn[from].intersection(slice);
                if !part.is_empty() {
                    parts.push((index, part));
                }
            }
            // A renderer submits slices in any order, so each receive has the capacity of the
            // largest.
            let largest = parts.iter().map(|part| part.1).max_by_key(codec::longest::<P>);
            for _ in 0..parts.len() {
                exchange.post::<P>(from, Tag::Exchange, &largest.unwrap_or(Rect::EMPTY))?;
            }
        }
        let merge = |slice: &Rect| {
            Some(Merge::new(*slice, num_ranks, |from| !drawn[from].intersection(slice).is_empty()))
        };
        let merges = own.iter().map(merge).collect();
        Ok(Self { own, merges, outstanding })
    }

    /// Merges what `from` drew in the own slice `index`, and submits the slice if it is complete.
    pub(crate) fn put(
        &mut self,
        index: usize,
        from: usize,
        item: MergeInput<'a, P>,
        exchange: &mut FrameExchange<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        let begin = exchange.comm.working_secs();
        if let Some(merge) = &mut self.merges[index] {
            merge.put(from, item, scratch);
        }
        for read in scratch.read.drain(..) {
            exchange.comm.recycle(read);
        }
        exchange.report.blend_secs += exchange.comm.working_secs() - begin;
        let complete = self.merges[index].take_if(|merge| merge.is_complete());
        match complete.and_then(|merge| merge.finish(scratch)) {
            Some(layer) => collector.submit(exchange, layer, scratch),
            None => Ok(()),
        }
    }

    /// Number of slices that are complete.
    pub(crate) fn complete(&self) -> usize {
        self.merges.iter().filter(|merge| merge.is_none()).count()
    }

    pub(crate) fn take_arrived(
        &mut self,
        exchange: &mut FrameExchange<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        while let Some(arrival) = exchange.next(false)? {
            self.take(arrival, exchange, collector, scratch)?;
        }
        Ok(())
    }

    /// Waits for all messages of other ranks.
    pub(crate) fn finish(
        &mut self,
        exchange: &mut FrameExchange<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        while exchange.is_receiving_for(Tag::Exchange) {
            if let Some(arrival) = exchange.next(true)? {
                self.take(arrival, exchange, collector, scratch)?;
            }
        }
        Ok(())
    }

    fn take(
        &mut self,
        (from, is_collect, bytes): (usize, bool, Vec<u8>),
        exchange: &mut FrameExchange<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        if is_collect {
            return collector.take(exchange, from, bytes);
        }
        // The header of the message says which of the expected slices it is for.
        let said = codec::rect_of(&bytes);
        let parts = &mut self.outstanding[from];
        let position = parts.iter().position(|part| Some(part.1) == said).unwrap_or(0);
        let (index, part) =
            if parts.is_empty() { (0, Rect::EMPTY) } else { parts.remove(position) };
        let begin = exchange.comm.working_secs();
        let message = exchange.check::<P>(from, bytes, part, true)?;
        exchange.report.blend_secs += exchange.comm.working_secs() - begin;
        if index < self.own.len() {
            self.put(index, from, MergeInput::Message(message), exchange, collector, scratch)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixel::DepthPixel;

    type P = DepthPixel<[u8; 4]>;

    fn owning(drawn: &[Rect], root: Option<usize>) -> usize {
        let plan = Plan::new::<P>(drawn, usize::MAX, root);
        plan.slices.iter().filter(|slices| !slices.is_empty()).count()
    }

    #[test]
    fn the_rank_that_collects_joins_less_or_nothing() {
        let dense = vec![Rect::of_size(1024, 1024); 8];
        let tiles = Plan::new::<P>(&dense, usize::MAX, Some(3)).slices;
        assert!(tiles[3][0].pixels() < tiles[2][0].pixels() * 2 / 3, "{tiles:?}");
        let corner = |i: u32| Rect { x0: 128 * i, y0: 0, x1: 128 * i + 128, y1: 1024 };
        let apart: Vec<Rect> = (0..8).map(corner).collect();
        assert!(Plan::new::<P>(&apart, usize::MAX, Some(3)).slices[3].is_empty());
        assert_eq!((owning(&apart, Some(3)), owning(&apart, None)), (7, 8));
        // Two ranks get equal shares.
        let halves = Plan::new::<P>(&dense[..2], usize::MAX, Some(0)).slices;
        assert_eq!(halves[0][0].pixels(), halves[1][0].pixels());
    }

    #[test]
    fn many_ranks_with_little_to_join_leave_it_to_some_and_with_much_all_work() {
        let apart: Vec<Rect> = (0..64)
            .map(|i| {
                let (x0, y0) = (i % 8 * 128, i / 8 * 128);
                Rect { x0, y0, x1: x0 + 128, y1: y0 + 128 }
            })
            .collect();
        assert_eq!(owning(&apart, Some(0)), 32);
        assert_eq!(owning(&vec![Rect::of_size(1024, 1024); 64], None), 64);
    }
}
