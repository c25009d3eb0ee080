//! Radix-k (T. Peterka, D. Goodell, R. Ross, H.-W. Shen, R. Thakur, "A Configurable Algorithm for Parallel Image-Compositing
//! Applications", SC09): the number of slots is a product of group sizes; in each round the members of a group divide the
//! part they all hold, and each gets its share from all others at once.
//!
//! Fewer rounds than binary swap, more messages in each. Here group sizes are powers of two and the members of a group are
//! joined as a balanced tree, so that the grouping is that of [`crate::rank_order`] for every k.
use super::folding::fold;
use crate::error::CompositeError;
use crate::frame::{Frame, Piece};
use crate::pixel::Composite;
use crate::rank_order::{Folding, reduce_slots};
use crate::session::{Session, Tag};
use std::ops::Range;

pub(crate) fn run<P: Composite>(
    session: &mut Session<'_>,
    frame: &Frame<'_, P>,
    k: usize,
) -> Result<Piece<P>, CompositeError> {
    let folding = Folding::new(session.places());
    let Some((slot, mut held)) = fold(session, frame)? else {
        return Ok(Piece::nothing());
    };
    let mut part = 0..held.len();
    let mut stride = 1;
    while stride < folding.slots {
        let members = k.min(folding.slots / stride);
        let digit = (slot / stride) % members;
        let first = slot - digit * stride;
        let place = |member: usize| folding.leader(first + member * stride);

        // Give each member its share, beginning with the next one, so that nobody gets all first messages.
        for step in 1..members {
            let member = (digit + step) % members;
            let give = share(&part, member, members);
            if !give.is_empty() {
                session.send(place(member), Tag::Exchange, give, |index| held[index])?;
            }
        }

        // Join the own share of all members.
        let keep = share(&part, digit, members);
        if !keep.is_empty() {
            let mut layers = Vec::with_capacity(members);
            for member in 0..members {
                layers.push(if member == digit {
                    held[keep.clone()].to_vec()
                } else {
                    session
                        .recv::<P, _>(place(member), Tag::Exchange, Some(keep.clone()), |p| p.to_pixels())?
                });
            }
            let mut column = vec![P::EMPTY; members];
            for (offset, pixel) in held[keep.clone()].iter_mut().enumerate() {
                for (value, layer) in column.iter_mut().zip(&layers) {
                    *value = layer[offset];
                }
                *pixel = reduce_slots(&mut column);
            }
        }
        part = keep;
        stride *= members;
    }
    Ok(Piece { start: part.start, pixels: held[part].to_vec() })
}

/// Share number `member` of `part`, cut into `members` shares that differ by at most one pixel.
fn share(part: &Range<usize>, member: usize, members: usize) -> Range<usize> {
    // In u128 because the product may pass 64 bits before it is divided.
    let cut = |i: usize| part.start + (part.len() as u128 * i as u128 / members as u128) as usize;
    cut(member)..cut(member + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_a_part_without_gap_even_when_there_are_more_members_than_pixels() {
        for length in [0, 1, 3, 8, 1001] {
            for members in [1, 2, 8, 16] {
                let mut next = 10;
                for member in 0..members {
                    let share = share(&(10..10 + length), member, members);
                    assert_eq!(share.start, next);
                    assert!(share.len() <= length / members + 1);
                    next = share.end;
                }
                assert_eq!(next, 10 + length);
            }
        }
        assert_eq!(share(&(0..usize::MAX), 15, 16).end, usize::MAX);
    }
}
