//! Binary tree: in round l, slots with bit l set hand their whole image to the slot 2^l below and are done.
//!
//! Half of the ranks fall idle in every round and the last one moves a whole image, so it pays only for two ranks or for
//! very sparse images; there is nothing left to collect.
use super::folding::fold;
use crate::error::CompositeError;
use crate::frame::{Frame, Piece};
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::session::{Session, Side, Tag};

pub(crate) fn run<P: Composite>(
    session: &mut Session<'_>,
    frame: &Frame<'_, P>,
) -> Result<Piece<P>, CompositeError> {
    let folding = Folding::new(session.places());
    let Some((slot, mut held)) = fold(session, frame)? else {
        return Ok(Piece::nothing());
    };
    let whole = 0..held.len();
    let mut stride = 1;
    while stride < folding.slots {
        if slot & stride != 0 {
            session.send(folding.leader(slot - stride), Tag::Exchange, whole, |index| held[index])?;
            return Ok(Piece::nothing());
        }
        let other = folding.leader(slot + stride);
        session.recv_joined(other, Tag::Exchange, whole.clone(), &mut held, Side::Higher)?;
        stride *= 2;
    }
    Ok(Piece { start: 0, pixels: held })
}
