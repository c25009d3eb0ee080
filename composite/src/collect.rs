//! Brings the pieces of a finished image to one rank. Pieces travel as sparse messages, so background costs no bytes.
use crate::error::CompositeError;
use crate::frame::Piece;
use crate::pixel::Composite;
use crate::session::{Session, Tag};

/// The whole image at the place `root`, `None` elsewhere.
pub(crate) fn collect<P: Composite>(
    session: &mut Session<'_>,
    piece: &Piece<P>,
    root: usize,
) -> Result<Option<Vec<P>>, CompositeError> {
    let own = piece.start..piece.start + piece.pixels.len();
    if session.place != root {
        session.send(root, Tag::Collect, own.clone(), |index| piece.pixels[index - own.start])?;
        return Ok(None);
    }
    let mut image = vec![P::EMPTY; session.image_pixels()];
    image[own.clone()].copy_from_slice(&piece.pixels);
    let mut parts = vec![(own, root)];
    for place in (0..session.places()).filter(|&place| place != root) {
        let range = session.recv::<P, _>(place, Tag::Collect, None, |part| {
            part.for_each_active(|index, pixel| image[part.range.start + index] = pixel);
            part.range.clone()
        })?;
        parts.push((range, place));
    }

    // Every pixel exactly once.
    parts.retain(|(range, _)| !range.is_empty());
    parts.sort_by_key(|(range, _)| range.start);
    let mut next = 0;
    for (range, place) in &parts {
        if range.start != next {
            return Err(CompositeError::Pieces { pixel: next as u64, rank: session.rank_at(*place) });
        }
        next = range.end;
    }
    if next != image.len() {
        return Err(CompositeError::Pieces { pixel: next as u64, rank: session.rank_at(root) });
    }
    Ok(Some(image))
}
