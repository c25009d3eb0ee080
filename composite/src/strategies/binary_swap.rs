//! Binary swap (K.-L. Ma, J. S. Painter, C. D. Hansen, M. F. Krogh, "Parallel Volume Rendering Using Binary-Swap
//! Compositing", IEEE CG&A 14(4), 1994).
//!
//! In round l a slot and the slot that differs in bit l hold the same part of the image; the lower one keeps the first half,
//! the other the second half. Nearest slots come first, which is the balanced tree of [`crate::rank_order`].
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
    let mut part = 0..held.len();
    let mut stride = 1;
    while stride < folding.slots {
        let middle = part.start + part.len() / 2;
        let is_lower = slot & stride == 0;
        let (keep, give, side) = if is_lower {
            (part.start..middle, middle..part.end, Side::Higher)
        } else {
            (middle..part.end, part.start..middle, Side::Lower)
        };
        let partner = folding.leader(slot ^ stride);
        // Both sides know the parts, so parts without pixels cost no message.
        if !give.is_empty() {
            session.send(partner, Tag::Exchange, give, |index| held[index])?;
        }
        if !keep.is_empty() {
            session.recv_joined(partner, Tag::Exchange, keep.clone(), &mut held[keep.clone()], side)?;
        }
        part = keep;
        stride *= 2;
    }
    Ok(Piece { start: part.start, pixels: held[part].to_vec() })
}
