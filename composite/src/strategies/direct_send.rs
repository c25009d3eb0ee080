//! Direct send: every rank owns a balanced band and gets it from all ranks that drew something there.
//!
//! One exchange instead of log p rounds. Before it, ranks tell each other how many pixels they drew where; from that all ranks
//! derive the same bands and the same list of messages, so nobody waits for a rank that has nothing to give.
use super::bands::{active_per_chunk, balanced, chunk_px};
use crate::error::CompositeError;
use crate::frame::{Frame, Piece};
use crate::pixel::Composite;
use crate::rank_order::reduce_ranks;
use crate::session::{Session, Tag};
use std::ops::Range;

pub(crate) fn run<P: Composite>(
    session: &mut Session<'_>,
    frame: &Frame<'_, P>,
) -> Result<Piece<P>, CompositeError> {
    let (place, places) = (session.place, session.places());
    let chunk = chunk_px(frame.len(), places);
    let active = session.all_gather(&active_per_chunk(frame, chunk))?;
    let bands = balanced(&active, frame.len(), chunk);
    // Bands begin at chunks, so the counts say exactly whether a rank drew anything in a band.
    let gives = |from: usize, band: &Range<usize>| {
        !band.is_empty() && active[from][band.start / chunk..band.end.div_ceil(chunk)].iter().any(|&n| n > 0)
    };

    for step in 1..places {
        let owner = (place + step) % places;
        if gives(place, &bands[owner]) {
            session.send(owner, Tag::Exchange, bands[owner].clone(), |index| frame.pixel(index))?;
        }
    }

    let own = &bands[place];
    let mut layers: Vec<Option<Vec<P>>> = Vec::with_capacity(places);
    for from in 0..places {
        layers.push(if !gives(from, own) {
            None
        } else if from == place {
            Some(frame.pixels_of(own.clone()))
        } else {
            Some(session.recv::<P, _>(from, Tag::Exchange, Some(own.clone()), |part| part.to_pixels())?)
        });
    }

    let mut column = vec![P::EMPTY; places];
    let pixels = (0..own.len())
        .map(|offset| {
            for (value, layer) in column.iter_mut().zip(&layers) {
                *value = layer.as_ref().map_or(P::EMPTY, |layer| layer[offset]);
            }
            reduce_ranks(&mut column)
        })
        .collect();
    Ok(Piece { start: own.start, pixels })
}
