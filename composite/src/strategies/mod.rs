//! Ways to bring the pixels of all ranks together, one a file, all with the signature
//! `fn run<P>(&mut Session, &Frame<P>) -> Result<Piece<P>, CompositeError>` (radix-k takes its k as well) and all
//! with the same bits as [`composite_serial`](crate::composite_serial).
//!
//! Each returns the piece of the finished image that the rank holds; [`crate::collect`] brings pieces to one rank.
pub(crate) mod bands;
pub(crate) mod binary_swap;
pub(crate) mod direct_send;
pub(crate) mod folding;
pub(crate) mod radix_k;
pub(crate) mod tree;

use crate::error::CompositeError;
use crate::frame::{Frame, Piece};
use crate::pixel::Composite;
use crate::session::Session;

/// Which way the pixels take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Strategy {
    /// Every rank owns a band of the image and gets that band from all others at once. Bands are balanced by what all ranks
    /// have drawn, and ranks that drew nothing in a band send nothing to its owner.
    #[default]
    DirectSend,
    /// Half of the ranks hand their whole image to the other half, again and again; ends whole on one rank.
    Tree,
    /// Ma et al. 1994: partners exchange halves of what they hold, log2 p times. Other rank counts are folded first.
    BinarySwap,
    /// Peterka et al. 2009: as binary swap, in groups of up to `k` ranks. `k` is a power of two, at least 2 (IceT uses 8).
    RadixK {
        /// Largest group of a round.
        k: usize,
    },
}

impl Strategy {
    /// A number for fingerprints.
    pub(crate) fn code(self) -> u64 {
        match self {
            Self::DirectSend => 1,
            Self::Tree => 2,
            Self::BinarySwap => 3,
            Self::RadixK { k } => 4 + k as u64,
        }
    }

    pub(crate) fn check(self) -> Result<(), CompositeError> {
        match self {
            Self::RadixK { k } if k < 2 || !k.is_power_of_two() => Err(CompositeError::Options(format!(
                "radix-k with k = {k}: the fixed grouping of ranks needs a power of two, for example 8"
            ))),
            _ => Ok(()),
        }
    }

    pub(crate) fn run<P: Composite>(
        self,
        session: &mut Session<'_>,
        frame: &Frame<'_, P>,
    ) -> Result<Piece<P>, CompositeError> {
        match self {
            Self::DirectSend => direct_send::run(session, frame),
            Self::Tree => tree::run(session, frame),
            Self::BinarySwap => binary_swap::run(session, frame),
            Self::RadixK { k } => radix_k::run(session, frame, k),
        }
    }
}
