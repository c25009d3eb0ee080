//! Radix-k (T. Peterka, D. Goodell, R. Ross, H.-W. Shen, R. Thakur, "A Configurable Algorithm for
//! Parallel Image-Compositing Applications", SC09). The number of slots is a product of group
//! sizes. In each round the members of a group divide the part they all hold, and each receives its
//! share from all others at once.
//!
//! There are fewer rounds than with binary swap and more messages in each. Here group sizes are
//! powers of two and the members of a group are merged as a balanced tree, so that the grouping is
//! that of [`crate::rank_order`] for every k.
use super::folding::{SlotImage, bounds_of_slots, fold, merge_members};
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::View;
use crate::merge::Scratch;
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;

/// What each leader holds after the last round.
pub(crate) fn pieces(drawn: &[Rect], k: usize) -> Vec<(usize, Rect)> {
    let folding = Folding::new(drawn.len());
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
    let mut pieces = Vec::new();
    for slot in 0..folding.slots {
        let mut part = whole;
        let mut stride = 1;
        while stride < folding.slots {
            let members = k.min(folding.slots / stride);
            part = share(&part, (slot / stride) % members, members);
            stride *= members;
        }
        if !part.is_empty() {
            pieces.push((folding.leader(slot), part));
        }
    }
    pieces
}

pub(crate) fn run<P: Composite>(
    exchange: &mut FrameExchange<'_>,
    frame: &View<'_, P>,
    k: usize,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<(), CompositeError> {
    let folding = Folding::new(exchange.num_ranks());
    let drawn = exchange.drawn.clone();
    let Some((slot, mut held)) = fold(exchange, frame, collector, scratch)? else {
        return Ok(());
    };
    let mut part = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
    let mut stride = 1;
    while stride < folding.slots {
        let members = k.min(folding.slots / stride);
        let digit = (slot / stride) % members;
        let first = slot - digit * stride;
        let order_indices: Vec<usize> =
            (0..members).map(|member| folding.leader(first + member * stride)).collect();
        // Bounds of what the slots that each member has merged so far drew.
        let base = slot / (stride * members) * (stride * members);
        let reaches: Vec<Rect> = (0..members)
            .map(|member| bounds_of_slots(&drawn, &folding, base + member * stride, stride))
            .collect();

        let keep = share(&part, digit, members);
        for (member, bounds_of_slots) in reaches.iter().enumerate() {
            let theirs = bounds_of_slots.intersection(&keep);
            if member != digit && !theirs.is_empty() {
                exchange.post::<P>(order_indices[member], Tag::Exchange, &theirs)?;
            }
        }

        // Send each member its share, beginning with the next one, so that no rank gets all first
        // messages.
        for step in 1..members {
            let member = (digit + step) % members;
            let give = reaches[digit].intersection(&share(&part, member, members));
            if !give.is_empty() {
                exchange.send(order_indices[member], Tag::Exchange, &held.view(), give, true)?;
            }
        }

        // Merge the own share of all members.
        let bounds =
            reaches.iter().fold(Rect::EMPTY, |all, rect| all.around(rect)).intersection(&keep);
        let brings = |member: usize| reaches[member].intersection(&keep);
        let layer = merge_members(
            exchange,
            &held,
            digit,
            &order_indices,
            bounds,
            brings,
            collector,
            scratch,
        )?;
        std::mem::replace(&mut held, SlotImage::Merged(layer)).recycle(scratch);
        part = keep;
        stride *= members;
    }
    if part.is_empty() {
        return Ok(());
    }
    let layer = held.into_layer(part, scratch);
    collector.submit(exchange, layer, scratch)
}

/// Share number `member` of `part`, cut into `members` shares of rows that differ by at most one
/// row.
pub(crate) fn share(part: &Rect, member: usize, members: usize) -> Rect {
    let row = |i: usize| part.y0 + (part.height() as u64 * i as u64 / members as u64) as u32;
    let share = Rect { y0: row(member), y1: row(member + 1), ..*part };
    if share.is_empty() { Rect::EMPTY } else { share }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_a_part_without_gap_even_when_there_are_more_members_than_rows() {
        for rows in [1, 3, 8, 1001, u32::MAX - 10] {
            for members in [1, 2, 8, 16] {
                let part = Rect { x0: 5, y0: 10, x1: 6, y1: 10 + rows };
                let shares: Vec<Rect> =
                    (0..members).map(|member| share(&part, member, members)).collect();
                assert_eq!(shares.iter().map(Rect::pixels).sum::<usize>(), part.pixels());
                let whole = shares.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
                assert_eq!(whole, part);
                assert!(shares.iter().all(|share| share.height() <= rows as usize / members + 1));
            }
        }
    }
}
