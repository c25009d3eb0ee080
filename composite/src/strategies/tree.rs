//! Binary tree: in round l, slots with bit l set send their whole image to the slot 2^l below and
//! are done.
//!
//! Half of the ranks become idle in every round and the last round moves a whole image, so it pays
//! only for two ranks or for very sparse images. There is nothing left to collect.
use super::folding::{SlotImage, bounds_of_slots, fold, merge_members};
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::View;
use crate::merge::Scratch;
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;

/// Everything at the first rank in order.
pub(crate) fn pieces(drawn: &[Rect]) -> Vec<(usize, Rect)> {
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
    if whole.is_empty() { Vec::new() } else { vec![(0, whole)] }
}

pub(crate) fn run<P: Composite>(
    exchange: &mut FrameExchange<'_>,
    frame: &View<'_, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<(), CompositeError> {
    let folding = Folding::new(exchange.num_ranks());
    let drawn = exchange.drawn.clone();
    let Some((slot, mut held)) = fold(exchange, frame, collector, scratch)? else {
        return Ok(());
    };
    let mut stride = 1;
    while stride < folding.slots {
        let own = bounds_of_slots(&drawn, &folding, slot, stride);
        if slot & stride != 0 {
            if !own.is_empty() {
                exchange.send(
                    folding.leader(slot - stride),
                    Tag::Exchange,
                    &held.view(),
                    own,
                    true,
                )?;
            }
            return Ok(());
        }
        let theirs = bounds_of_slots(&drawn, &folding, slot + stride, stride);
        if !theirs.is_empty() {
            let members = [exchange.order_index, folding.leader(slot + stride)];
            exchange.post::<P>(members[1], Tag::Exchange, &theirs)?;
            let rects = [own, theirs];
            let bounds = own.around(&theirs);
            let layer = merge_members(
                exchange,
                &held,
                0,
                &members,
                bounds,
                |i| rects[i],
                collector,
                scratch,
            )?;
            std::mem::replace(&mut held, SlotImage::Merged(layer)).recycle(scratch);
        }
        stride *= 2;
    }
    let whole = bounds_of_slots(&drawn, &folding, 0, folding.slots);
    if whole.is_empty() {
        return Ok(());
    }
    let layer = held.into_layer(whole, scratch);
    collector.submit(exchange, layer, scratch)
}
