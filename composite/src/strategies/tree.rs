//! Binary tree: in round l, slots with bit l set hand their whole image to the slot 2^l below and are done.
//!
//! Half of the ranks fall idle in every round and the last one moves a whole image, so it pays only for two ranks or for
//! very sparse images; there is nothing left to collect.
use super::folding::{Held, fold, join_members, reach};
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::join::Scratch;
use crate::layer::View;
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;
use crate::session::{Session, Tag};

/// Everything at the first place.
pub(crate) fn pieces(drawn: &[Rect]) -> Vec<(usize, Rect)> {
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
    if whole.is_empty() { Vec::new() } else { vec![(0, whole)] }
}

pub(crate) fn run<P: Composite>(
    session: &mut Session<'_>,
    frame: &View<'_, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<(), CompositeError> {
    let folding = Folding::new(session.places());
    let drawn = session.drawn.clone();
    let Some((slot, mut held)) = fold(session, frame, collector, scratch)? else {
        return Ok(());
    };
    let mut stride = 1;
    while stride < folding.slots {
        let own = reach(&drawn, &folding, slot, stride);
        if slot & stride != 0 {
            if !own.is_empty() {
                session.send(folding.leader(slot - stride), Tag::Exchange, &held.view(), own, true)?;
            }
            return Ok(());
        }
        let theirs = reach(&drawn, &folding, slot + stride, stride);
        if !theirs.is_empty() {
            let members = [session.place, folding.leader(slot + stride)];
            session.post::<P>(members[1], Tag::Exchange, &theirs)?;
            let rects = [own, theirs];
            let bounds = own.around(&theirs);
            let layer = join_members(session, &held, 0, &members, bounds, |i| rects[i], collector, scratch)?;
            std::mem::replace(&mut held, Held::Joined(layer)).recycle(scratch);
        }
        stride *= 2;
    }
    let whole = reach(&drawn, &folding, 0, folding.slots);
    if whole.is_empty() {
        return Ok(());
    }
    let layer = held.into_layer(whole, scratch);
    collector.hand_in(session, layer, scratch)
}
