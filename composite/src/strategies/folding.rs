//! First step of tree, binary swap and radix-k: ranks beyond a power of two hand their image to a neighbour.
use crate::error::CompositeError;
use crate::frame::Frame;
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::session::{Session, Side, Tag};

/// Pairs are joined; returns the slot and its whole image on leaders, `None` on ranks that have handed theirs over.
pub(crate) fn fold<P: Composite>(
    session: &mut Session<'_>,
    frame: &Frame<'_, P>,
) -> Result<Option<(usize, Vec<P>)>, CompositeError> {
    let folding = Folding::new(session.places());
    let slot = folding.slot(session.place);
    let leader = folding.leader(slot);
    let whole = 0..frame.len();
    if session.place != leader {
        session.send(leader, Tag::Fold, whole, |index| frame.pixel(index))?;
        return Ok(None);
    }
    let mut held = frame.pixels();
    if let Some(partner) = folding.partner(leader) {
        session.recv_joined(partner, Tag::Fold, whole, &mut held, Side::Higher)?;
    }
    Ok(Some((slot, held)))
}
