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
use crate::tiles::{Owner, shared_out, slices};
use crate::wire;

/// Slices of every place's tile, in the order in which they are sent.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) slices: Vec<Vec<Rect>>,
}

impl Plan {
    /// `root` is the place that collects the image over a wire of its own.
    pub(crate) fn new<P: Composite>(drawn: &[Rect], slice_pixels: usize, root: Option<usize>) -> Self {
        let cut = |tile: Rect| if tile.is_empty() { Vec::new() } else { slices(tile, slice_pixels) };
        let mut owners = owners::<P>(drawn, root);
        Self { slices: shared_out(drawn, &mut owners).into_iter().map(cut).collect() }
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

/// Pixels of a tile at least: smaller ones make messages that cost more than what they carry.
const OWNER_PX: usize = 32_768;
/// The share of a place that does not collect.
const FULL_SHARE: u64 = 256;

/// Which places own tiles, and how large ones.
///
/// The collecting place gets the finished image besides, over the same wire. With a share `x` of the exchange `e` and of the image `g` (bytes
/// that come in), it receives `x e + (1 - x) g` while each other one receives `(1 - x) e / (p - 1)`. They are equal for
/// `x = (e / (p - 1) - g) / (e p / (p - 1) - g)`, which is nothing from a handful of ranks on. Two ranks share alike: there what one does not
/// join the other must, and both work all the time. So do ranks of one memory, where every byte costs the same processors.
fn owners<P: Composite>(drawn: &[Rect], root: Option<usize>) -> Vec<Owner> {
    let places = drawn.len();
    let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect)).pixels();
    let layers: usize = drawn.iter().map(Rect::pixels).sum();
    // As many as there are tiles worth a message, and enough that what comes to each is no more than what comes to the root.
    let (drawn_bytes, image_bytes) = (layers * P::BYTES, whole * size_of::<P::Color>());
    let wanted = (whole / OWNER_PX).max(drawn_bytes.div_ceil(image_bytes.max(1))).clamp(1, places);

    let share = match root {
        Some(_) if places > 2 => {
            let others = (places - 1) as f64;
            let exchange = drawn_bytes as f64 * others / places as f64;
            let image = image_bytes as f64;
            let x = (exchange / others - image) / (exchange * places as f64 / others - image).max(1.0);
            // Of shares that are FULL_SHARE for each of the others.
            let x = x.clamp(0.0, 1.0 / places as f64);
            (x / (1.0 - x) * others * FULL_SHARE as f64) as u64
        }
        _ => FULL_SHARE,
    };
    // Evenly among all, so that owners are near to what they drew.
    let candidates: Vec<Owner> = (0..places)
        .map(|place| Owner { place, share: if root == Some(place) { share } else { FULL_SHARE } })
        .filter(|owner| owner.share > 0)
        .collect();
    let wanted = wanted.min(candidates.len());
    (0..wanted).map(|i| candidates[i * candidates.len() / wanted]).collect()
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

    // Everybody's first slices, then everybody's second …; the next place first, so that no rank gets all first messages. No more than two
    // rounds are on their way: messages share the wire, and with all of them under way at once the first slices would be complete, and begin
    // to be collected, no sooner than the last. With a few slices only there is nothing to gain.
    let most = plan.slices.iter().map(Vec::len).max().unwrap_or(0);
    let mut last_round = 0;
    for index in 0..most {
        if most > 3 && index > 1 {
            session.let_leave(last_round);
        }
        last_round = 0;
        for step in 1..places {
            let owner = (place + step) % places;
            if let Some(slice) = plan.slices[owner].get(index) {
                let part = view.bounds.intersection(slice);
                if !part.is_empty() {
                    session.send(owner, Tag::Exchange, view, part, true)?;
                    last_round += 1;
                }
            }
        }
        // Own pixels, and what has come meanwhile.
        if let Some(slice) = plan.slices[place].get(index) {
            let part = view.bounds.intersection(slice);
            if !part.is_empty() {
                session.count_nan(view, part);
                let item = Item::View(View { bounds: part, ..*view });
                exchange.put(index, place, item, session, collector, scratch)?;
            }
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
        let begin = session.comm.working_secs();
        if let Some(join) = &mut self.joins[index] {
            join.put(from, item, scratch);
        }
        for read in scratch.read.drain(..) {
            session.comm.recycle(read);
        }
        session.report.blend_secs += session.comm.working_secs() - begin;
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
        let begin = session.comm.working_secs();
        let message = session.check::<P>(from, bytes, part, true)?;
        session.report.blend_secs += session.comm.working_secs() - begin;
        if index < self.own.len() {
            self.put(index, from, Item::Message(message), session, collector, scratch)?;
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
        // Two ranks share alike.
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
