//! Direct send: every rank owns a tile of the image and gets it from all ranks that drew something there.
//!
//! One exchange instead of log p rounds. All ranks know from the rectangles they drew in which tiles there are and which messages
//! will come, so nobody waits for a rank that has nothing to give, and every receive is posted before the first message is made.
//! Tiles are cut in slices: while one slice travels the next is compressed, and a slice that is complete goes to the collecting
//! rank while others are still being joined. [`crate::stream`] hands slices in while the frame is still being rendered.
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::join::{Item, Join, Scratch};
use crate::layer::View;
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::session::{Session, Tag};
use crate::tiles::{balanced, slices};
use crate::wire;

/// Slices of every place's tile, in the order in which they are sent.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) slices: Vec<Vec<Rect>>,
}

impl Plan {
    pub(crate) fn new(drawn: &[Rect], slice_pixels: usize) -> Self {
        let cut = |tile: Rect| if tile.is_empty() { Vec::new() } else { slices(tile, slice_pixels) };
        Self { slices: balanced(drawn).into_iter().map(cut).collect() }
    }

    /// What each place holds in the end. Where nobody drew anything nothing is held.
    pub(crate) fn pieces(&self, drawn: &[Rect]) -> Vec<(usize, Rect)> {
        let mut pieces = Vec::new();
        for (place, slices) in self.slices.iter().enumerate() {
            for slice in slices {
                if drawn.iter().any(|rect| !rect.intersection(slice).is_empty()) {
                    pieces.push((place, *slice));
                }
            }
        }
        pieces
    }
}

pub(crate) fn run<P: Composite>(
    plan: &Plan,
    session: &mut Session<'_>,
    view: &View<'_, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<(), CompositeError> {
    let (place, places) = (session.place, session.places());
    let mut exchange = Exchange::new(plan, session)?;

    // Everybody's first slices, then everybody's second …; the next place first, so that no rank gets all first messages.
    let most = plan.slices.iter().map(Vec::len).max().unwrap_or(0);
    for index in 0..most {
        for step in 1..places {
            let owner = (place + step) % places;
            if let Some(slice) = plan.slices[owner].get(index) {
                let part = view.bounds.intersection(slice);
                if !part.is_empty() {
                    session.send(owner, Tag::Exchange, view, part, true)?;
                }
            }
        }
    }

    // Own pixels, and what has come meanwhile.
    for (index, slice) in plan.slices[place].iter().enumerate() {
        let part = view.bounds.intersection(slice);
        if !part.is_empty() {
            session.count_nan(view, part);
            let item = Item::View(View { bounds: part, ..*view });
            exchange.put(index, place, item, session, collector, scratch)?;
        }
        exchange.take_what_has_come(session, collector, scratch)?;
    }
    exchange.finish(session, collector, scratch)
}

/// The slices of this place and how far they are.
pub(crate) struct Exchange<'a, P: Composite> {
    own: Vec<Rect>,
    joins: Vec<Option<Join<'a, P>>>,
    /// For every place the parts of own slices that have not come from it.
    outstanding: Vec<Vec<(usize, Rect)>>,
}

impl<'a, P: Composite> Exchange<'a, P> {
    /// Posts the receives of this place.
    pub(crate) fn new(plan: &Plan, session: &mut Session<'_>) -> Result<Self, CompositeError> {
        let (place, places) = (session.place, session.places());
        let own = plan.slices[place].clone();
        let drawn = session.drawn.clone();
        let mut outstanding = vec![Vec::new(); places];
        for (from, parts) in outstanding.iter_mut().enumerate().filter(|(from, _)| *from != place) {
            for (index, slice) in own.iter().enumerate() {
                let part = drawn[from].intersection(slice);
                if !part.is_empty() {
                    parts.push((index, part));
                }
            }
            // A renderer hands slices in in any order, so each receive has room for the largest.
            let largest = parts.iter().map(|part| part.1).max_by_key(wire::longest::<P>);
            for _ in 0..parts.len() {
                session.post::<P>(from, Tag::Exchange, &largest.unwrap_or(Rect::EMPTY))?;
            }
        }
        let join = |slice: &Rect| {
            Some(Join::new(*slice, places, |from| !drawn[from].intersection(slice).is_empty()))
        };
        let joins = own.iter().map(join).collect();
        Ok(Self { own, joins, outstanding })
    }

    /// Takes what `from` has in the own slice `index`, and hands the slice in if it is complete.
    pub(crate) fn put(
        &mut self,
        index: usize,
        from: usize,
        item: Item<'a, P>,
        session: &mut Session<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        let begin = session.now();
        if let Some(join) = &mut self.joins[index] {
            join.put(from, item, scratch);
        }
        for read in scratch.read.drain(..) {
            session.comm.recycle(read);
        }
        session.report.blend_secs += session.now() - begin;
        let complete = self.joins[index].take_if(|join| join.is_complete());
        match complete.and_then(|join| join.finish(scratch)) {
            Some(layer) => collector.hand_in(session, layer, scratch),
            None => Ok(()),
        }
    }

    /// Slices that are complete.
    pub(crate) fn complete(&self) -> usize {
        self.joins.iter().filter(|join| join.is_none()).count()
    }

    pub(crate) fn take_what_has_come(
        &mut self,
        session: &mut Session<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        while let Some(arrival) = session.next(false)? {
            self.take(arrival, session, collector, scratch)?;
        }
        Ok(())
    }

    /// Waits for all messages of other places.
    pub(crate) fn finish(
        &mut self,
        session: &mut Session<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        while session.is_waiting_for(Tag::Exchange) {
            if let Some(arrival) = session.next(true)? {
                self.take(arrival, session, collector, scratch)?;
            }
        }
        Ok(())
    }

    fn take(
        &mut self,
        (from, is_collect, bytes): (usize, bool, Vec<u8>),
        session: &mut Session<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        if is_collect {
            return collector.take(session, from, bytes);
        }
        // The message itself says which slice it is for, if it is one of those expected.
        let said = wire::rect_of(&bytes);
        let parts = &mut self.outstanding[from];
        let position = parts.iter().position(|part| Some(part.1) == said).unwrap_or(0);
        let (index, part) = if parts.is_empty() { (0, Rect::EMPTY) } else { parts.remove(position) };
        let begin = session.now();
        let message = session.check::<P>(from, bytes, part, true)?;
        session.report.blend_secs += session.now() - begin;
        if index < self.own.len() {
            self.put(index, from, Item::Message(message), session, collector, scratch)?;
        }
        Ok(())
    }
}
