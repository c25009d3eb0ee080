//! The canonical grouping in which every strategy, and the serial reference, merges the ranks.
//!
//! `over` in floating point or in eight bits is not associative, so "in rank order" alone leaves
//! the result open. Here the grouping is fixed for a given number of ranks p, and it is one that
//! tree, binary swap and radix-k can follow without extra messages:
//!
//! 1. *Folding.* With 2^k the largest power of two ≤ p and e = p - 2^k, ranks (0,1), (2,3) … (2e-2,
//!    2e-1) are merged in pairs; the others stay alone. That leaves 2^k *slots* in rank order.
//! 2. *Balanced tree.* Neighbouring slots are merged, then neighbouring pairs, and so on.
//!
//! A balanced tree also loses less precision than a chain: its rounding errors grow with log p
//! instead of p.
use crate::pixel::{Composite, combine};

/// Folding of `ranks` ranks into a power of two of slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Folding {
    /// Number of slots, a power of two (0 for 0 ranks).
    pub slots: usize,
    /// Number of slots that hold two ranks; these come first.
    pub pairs: usize,
}

impl Folding {
    /// The folding of `ranks` ranks.
    pub fn new(ranks: usize) -> Self {
        let slots = if ranks == 0 { 0 } else { 1 << ranks.ilog2() };
        Self { slots, pairs: ranks - slots }
    }

    /// The rank that works for `slot`: the lower one of a pair.
    pub fn leader(&self, slot: usize) -> usize {
        if slot < self.pairs { 2 * slot } else { slot + self.pairs }
    }

    /// The slot that `rank` belongs to.
    pub fn slot(&self, rank: usize) -> usize {
        if rank < 2 * self.pairs { rank / 2 } else { rank - self.pairs }
    }

    /// The other rank of the pair that `rank` belongs to, if it is in one.
    pub fn partner(&self, rank: usize) -> Option<usize> {
        (rank < 2 * self.pairs).then_some(rank ^ 1)
    }
}

/// Merges one pixel of every rank, in rank order, in the canonical grouping. `pixels` is used as
/// scratch space.
pub fn reduce_ranks<P: Composite>(pixels: &mut [P]) -> P {
    let folding = Folding::new(pixels.len());
    for slot in 0..folding.slots {
        let leader = folding.leader(slot);
        pixels[slot] = match folding.partner(leader) {
            Some(partner) => combine(pixels[leader], pixels[partner]),
            None => pixels[leader],
        };
    }
    reduce_slots(&mut pixels[..folding.slots])
}

/// Merges neighbouring slots as a balanced tree. The length is a power of two, or 0, which gives
/// [`EMPTY`].
///
/// [`EMPTY`]: crate::PixelFormat::EMPTY
pub(crate) fn reduce_slots<P: Composite>(pixels: &mut [P]) -> P {
    let mut count = pixels.len();
    while count > 1 {
        count /= 2;
        for i in 0..count {
            pixels[i] = combine(pixels[2 * i], pixels[2 * i + 1]);
        }
    }
    // A pixel that nobody drew must be `EMPTY`, whatever bits an inactive pixel has.
    pixels.first().copied().filter(P::is_active).unwrap_or(P::EMPTY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixel::PremultipliedPixel;

    #[test]
    fn every_rank_has_one_slot_and_slots_keep_rank_order() {
        for ranks in 1..=130 {
            let folding = Folding::new(ranks);
            let mut seen = Vec::new();
            for slot in 0..folding.slots {
                let leader = folding.leader(slot);
                seen.push(leader);
                seen.extend(folding.partner(leader));
                assert_eq!(folding.slot(leader), slot);
            }
            assert_eq!(seen, (0..ranks).collect::<Vec<_>>(), "{ranks} ranks");
        }
    }

    #[test]
    fn five_ranks_are_joined_as_pair_then_balanced_tree() {
        let layer = |i: usize| PremultipliedPixel {
            color: [0.1 * i as f32, 0.3, 0.7 / (i + 1) as f32, 0.37],
        };
        let mut pixels: Vec<_> = (0..5).map(layer).collect();
        let by_hand =
            combine(combine(combine(layer(0), layer(1)), layer(2)), combine(layer(3), layer(4)));
        assert_eq!(reduce_ranks(&mut pixels), by_hand);
    }
}
