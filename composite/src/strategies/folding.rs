//! Code shared by tree, binary swap and radix-k: slots instead of ranks, and bounds of what a block
//! of slots drew.
//!
//! If the number of ranks is not a power of two, some ranks first send their image to a neighbour;
//! each such pair is one slot.
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::{Layer, View};
use crate::merge::{Merge, MergeInput, Scratch};
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;

/// What a slot holds between rounds.
pub(crate) enum SlotImage<'a, P: Composite> {
    /// The rendered frame, as long as nothing has been merged into it.
    Frame(View<'a, P>),
    Merged(Layer<P>),
}

impl<P: Composite> SlotImage<'_, P> {
    pub(crate) fn view(&self) -> View<'_, P> {
        match self {
            Self::Frame(view) => *view,
            Self::Merged(layer) => layer.view(),
        }
    }

    pub(crate) fn recycle(self, scratch: &mut Scratch<P>) {
        if let Self::Merged(layer) = self {
            scratch.layers.push(layer);
        }
    }

    /// Converts it to a layer of exactly `bounds`, to be submitted.
    pub(crate) fn into_layer(self, bounds: Rect, scratch: &mut Scratch<P>) -> Layer<P> {
        match self {
            Self::Merged(layer) if layer.bounds == bounds => layer,
            other => {
                let mut merge = Merge::new(bounds, 1, |_| true);
                merge.put(0, MergeInput::View(other.view()), scratch);
                let layer = merge.finish(scratch);
                layer.unwrap_or_else(|| Layer::empty(bounds, None))
            }
        }
    }
}

/// The rectangle around everything that the slots `first..first + count` have drawn.
pub(crate) fn bounds_of_slots(
    drawn: &[Rect],
    folding: &Folding,
    first: usize,
    count: usize,
) -> Rect {
    // Slots are in order of order indices, so a block of slots is a block of order indices.
    let last = folding.leader(first + count - 1);
    let end = folding.partner(last).unwrap_or(last) + 1;
    drawn[folding.leader(first)..end].iter().fold(Rect::EMPTY, |all, rect| all.around(rect))
}

/// Merges pairs. Leaders get their slot and its image; ranks that have sent theirs away get `None`.
pub(crate) fn fold<'a, P: Composite>(
    exchange: &mut FrameExchange<'_>,
    frame: &View<'a, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<Option<(usize, SlotImage<'a, P>)>, CompositeError> {
    let folding = Folding::new(exchange.num_ranks());
    let slot = folding.slot(exchange.order_index);
    let leader = folding.leader(slot);
    if exchange.order_index != leader {
        if !frame.bounds.is_empty() {
            exchange.send(leader, Tag::Fold, frame, frame.bounds, true)?;
        }
        return Ok(None);
    }
    let held = SlotImage::Frame(*frame);
    let Some(partner) = folding.partner(leader) else { return Ok(Some((slot, held))) };
    let theirs = exchange.drawn[partner];
    if theirs.is_empty() {
        return Ok(Some((slot, held)));
    }
    exchange.post::<P>(partner, Tag::Fold, &theirs)?;
    let members = [leader, partner];
    let rects = [frame.bounds, theirs];
    let bounds = frame.bounds.around(&theirs);
    let layer =
        merge_members(exchange, &held, 0, &members, bounds, |i| rects[i], collector, scratch)?;
    Ok(Some((slot, SlotImage::Merged(layer))))
}

/// Merges what `members` (order indices) have in `bounds` as it arrives; their receives are posted.
/// `own` is this rank's number among them, and `rect_of` gives the rectangle that each member
/// sends.
pub(crate) fn merge_members<P: Composite>(
    exchange: &mut FrameExchange<'_>,
    held: &SlotImage<'_, P>,
    own: usize,
    members: &[usize],
    bounds: Rect,
    rect_of: impl Fn(usize) -> Rect,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<Layer<P>, CompositeError> {
    let view = held.view();
    let mut merge = Merge::new(bounds, members.len(), |member| !rect_of(member).is_empty());
    let begin = exchange.comm.working_secs();
    let mine = rect_of(own);
    if !mine.is_empty() {
        if matches!(held, SlotImage::Frame(_)) {
            exchange.count_nan(&view, mine);
        }
        merge.put(own, MergeInput::View(View { bounds: mine, ..view }), scratch);
    }
    exchange.report.blend_secs += exchange.comm.working_secs() - begin;
    while !merge.is_complete() {
        let Some((order_index, is_collect, bytes)) = exchange.next(true)? else { continue };
        let member = members.iter().position(|&member| member == order_index);
        let (false, Some(member)) = (is_collect, member) else {
            collector.take(exchange, order_index, bytes)?;
            continue;
        };
        let begin = exchange.comm.working_secs();
        let message = exchange.check::<P>(order_index, bytes, rect_of(member), true)?;
        merge.put(member, MergeInput::Message(message), scratch);
        for read in scratch.read.drain(..) {
            exchange.comm.recycle(read);
        }
        exchange.report.blend_secs += exchange.comm.working_secs() - begin;
    }
    Ok(merge.finish(scratch).unwrap_or_else(|| Layer::empty(bounds, scratch.layers.pop())))
}
