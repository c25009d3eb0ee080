//! What tree, binary swap and radix-k share: slots instead of places, and what a block of slots can have drawn.
//!
//! Ranks beyond a power of two hand their image to a neighbour first; each pair is one slot.
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::join::{Item, Join, Scratch};
use crate::layer::{Layer, View};
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;
use crate::session::{Session, Tag};

/// What a slot holds between rounds.
pub(crate) enum Held<'a, P: Composite> {
    /// The rendered frame, as long as nothing has been joined to it.
    Frame(View<'a, P>),
    Joined(Layer<P>),
}

impl<P: Composite> Held<'_, P> {
    pub(crate) fn view(&self) -> View<'_, P> {
        match self {
            Self::Frame(view) => *view,
            Self::Joined(layer) => layer.view(),
        }
    }

    pub(crate) fn recycle(self, scratch: &mut Scratch<P>) {
        if let Self::Joined(layer) = self {
            scratch.layers.push(layer);
        }
    }

    /// As a layer of exactly `bounds`, to be handed in.
    pub(crate) fn into_layer(self, bounds: Rect, scratch: &mut Scratch<P>) -> Layer<P> {
        match self {
            Self::Joined(layer) if layer.bounds == bounds => layer,
            other => {
                let mut join = Join::new(bounds, 1, |_| true);
                join.put(0, Item::View(other.view()), scratch);
                let layer = join.finish(scratch);
                layer.unwrap_or_else(|| Layer::empty(bounds, None))
            }
        }
    }
}

/// The rectangle around all that the slots `first..first + count` have drawn.
pub(crate) fn reach(drawn: &[Rect], folding: &Folding, first: usize, count: usize) -> Rect {
    // Slots keep the order of places, so a block of slots is a block of places.
    let last = folding.leader(first + count - 1);
    let end = folding.partner(last).unwrap_or(last) + 1;
    drawn[folding.leader(first)..end].iter().fold(Rect::EMPTY, |all, rect| all.around(rect))
}

/// Pairs are joined; returns the slot and what it holds on leaders, `None` on ranks that have handed theirs over.
pub(crate) fn fold<'a, P: Composite>(
    session: &mut Session<'_>,
    frame: &View<'a, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<Option<(usize, Held<'a, P>)>, CompositeError> {
    let folding = Folding::new(session.places());
    let slot = folding.slot(session.place);
    let leader = folding.leader(slot);
    if session.place != leader {
        if !frame.bounds.is_empty() {
            session.send(leader, Tag::Fold, frame, frame.bounds, true)?;
        }
        return Ok(None);
    }
    let held = Held::Frame(*frame);
    let Some(partner) = folding.partner(leader) else { return Ok(Some((slot, held))) };
    let theirs = session.drawn[partner];
    if theirs.is_empty() {
        return Ok(Some((slot, held)));
    }
    session.post::<P>(partner, Tag::Fold, &theirs)?;
    let members = [leader, partner];
    let rects = [frame.bounds, theirs];
    let bounds = frame.bounds.around(&theirs);
    let layer = join_members(session, &held, 0, &members, bounds, |i| rects[i], collector, scratch)?;
    Ok(Some((slot, Held::Joined(layer))))
}

/// Joins what `members` (places) have in `bounds`, as it comes; their receives are posted. `own` is the number of this rank, and
/// `rect_of` says what each member brings.
pub(crate) fn join_members<P: Composite>(
    session: &mut Session<'_>,
    held: &Held<'_, P>,
    own: usize,
    members: &[usize],
    bounds: Rect,
    rect_of: impl Fn(usize) -> Rect,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<Layer<P>, CompositeError> {
    let view = held.view();
    let mut join = Join::new(bounds, members.len(), |member| !rect_of(member).is_empty());
    let begin = session.comm.working_secs();
    let mine = rect_of(own);
    if !mine.is_empty() {
        if matches!(held, Held::Frame(_)) {
            session.count_nan(&view, mine);
        }
        join.put(own, Item::View(View { bounds: mine, ..view }), scratch);
    }
    session.report.blend_secs += session.comm.working_secs() - begin;
    while !join.is_complete() {
        let Some((place, is_collect, bytes)) = session.next(true)? else { continue };
        let member = members.iter().position(|&member| member == place);
        let (false, Some(member)) = (is_collect, member) else {
            collector.take(session, place, bytes)?;
            continue;
        };
        let begin = session.comm.working_secs();
        let message = session.check::<P>(place, bytes, rect_of(member), true)?;
        join.put(member, Item::Message(message), scratch);
        for read in scratch.read.drain(..) {
            session.comm.recycle(read);
        }
        session.report.blend_secs += session.comm.working_secs() - begin;
    }
    Ok(join.finish(scratch).unwrap_or_else(|| Layer::empty(bounds, scratch.layers.pop())))
}
