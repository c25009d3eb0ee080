//! Direct send: every rank owns a tile of the image and gets it from all ranks that drew something there.
//!
//! One exchange instead of log p rounds. All ranks know from the rectangles they drew in which tiles there are and which messages
//! will come, so nobody waits for a rank that has nothing to give, and every receive is posted before the first message is made.
//! Tiles are cut in slices: while one slice travels the next is compressed, and a slice that is complete goes to the collecting
//! rank while others are still being joined.
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::join::{Item, Join, Scratch};
use crate::layer::View;
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::session::{Session, Tag};
use crate::tiles::{balanced, slices};

/// Slices of every place's tile, in the order in which they are sent.
pub(crate) struct Plan {
    slices: Vec<Vec<Rect>>,
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
    let drawn = session.drawn.clone();
    let own = &plan.slices[place];

    // Receives, in the order in which each sender will send.
    let mut joins = Vec::with_capacity(own.len());
    for slice in own {
        for (from, rect) in drawn.iter().enumerate() {
            let part = rect.intersection(slice);
            if from != place && !part.is_empty() {
                session.post::<P>(from, Tag::Exchange, &part)?;
            }
        }
        let contributes = |from: usize| !drawn[from].intersection(slice).is_empty();
        joins.push(Some(Join::new(*slice, places, contributes)));
    }

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
    let mut done = Progress { joins, served: vec![0; places], drawn: &drawn, own };
    for (index, slice) in own.iter().enumerate() {
        let part = view.bounds.intersection(slice);
        if !part.is_empty() {
            let begin = session.now();
            session.count_nan(view, part);
            if let Some(join) = &mut done.joins[index] {
                join.put(place, Item::View(View { bounds: part, ..*view }), scratch);
            }
            session.report.blend_secs += session.now() - begin;
            done.hand_in(index, session, collector, scratch)?;
        }
        while let Some((from, is_collect, bytes)) = session.next(false)? {
            done.take(from, is_collect, bytes, session, collector, scratch)?;
        }
    }
    while session.is_waiting_for(Tag::Exchange) {
        if let Some((from, is_collect, bytes)) = session.next(true)? {
            done.take(from, is_collect, bytes, session, collector, scratch)?;
        }
    }
    Ok(())
}

/// Slices of this place and how far they are.
struct Progress<'a, P: Composite> {
    joins: Vec<Option<Join<'a, P>>>,
    /// How many of its slices each place has served; those it has no part of count as served.
    served: Vec<usize>,
    drawn: &'a [Rect],
    own: &'a [Rect],
}

impl<P: Composite> Progress<'_, P> {
    fn take(
        &mut self,
        from: usize,
        is_collect: bool,
        bytes: Vec<u8>,
        session: &mut Session<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        if is_collect {
            return collector.take(session, from, bytes);
        }
        // Messages of one place come in the order of slices.
        let mut index = self.served[from];
        while index < self.own.len() && self.drawn[from].intersection(&self.own[index]).is_empty() {
            index += 1;
        }
        self.served[from] = index + 1;
        let Some(slice) = self.own.get(index) else { return Ok(()) };
        let begin = session.now();
        let message = session.check::<P>(from, bytes, self.drawn[from].intersection(slice), true)?;
        if let Some(join) = &mut self.joins[index] {
            join.put(from, Item::Message(message), scratch);
        }
        for read in scratch.read.drain(..) {
            session.comm.recycle(read);
        }
        session.report.blend_secs += session.now() - begin;
        self.hand_in(index, session, collector, scratch)
    }

    /// Hands a slice in if it is complete.
    fn hand_in(
        &mut self,
        index: usize,
        session: &mut Session<'_>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        let Some(join) = self.joins[index].take_if(|join| join.is_complete()) else { return Ok(()) };
        match join.finish(scratch) {
            Some(layer) => collector.hand_in(session, layer, scratch),
            None => Ok(()),
        }
    }
}
