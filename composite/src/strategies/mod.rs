//! Strategies that combine the pixels of all ranks, one per file. All have the signature `fn
//! run<P>(&mut FrameExchange, &View<P>, &mut Collector<P>, &mut Scratch<P>)` (direct send also
//! takes its plan, radix-k its k), and all give the same bits as
//! [`composite_serial`](crate::composite_serial).
//!
//! Each submits the pieces of the finished image that the rank holds to the
//! [collector](crate::collect) as soon as they are finished. Its function `pieces` tells in
//! advance, identically on all ranks, which pieces these will be.
pub(crate) mod binary_swap;
pub(crate) mod direct_send;
pub(crate) mod folding;
pub(crate) mod radix_k;
pub(crate) mod tree;

use crate::collect::Collector;
use crate::error::CompositeError;
use crate::frame_exchange::FrameExchange;
use crate::layer::View;
use crate::merge::Scratch;
use crate::pixel::Composite;
use crate::rect::Rect;

/// How ranks exchange their pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Strategy {
    /// Every rank owns a tile of the image and receives it from all others at once. Tiles are
    /// balanced by what all ranks have drawn, and ranks that drew nothing in a tile send nothing to
    /// its owner.
    #[default]
    DirectSend,
    /// In each round half of the remaining ranks send their whole image to the other half, until
    /// one rank has all.
    Tree,
    /// Ma et al. 1994: partners exchange halves of what they hold, log2 p times. Other rank counts
    /// are folded first.
    BinarySwap,
    /// Peterka et al. 2009: like binary swap, in groups of up to `k` ranks. `k` is a power of two,
    /// at least 2 (IceT uses 8).
    RadixK {
        /// Largest group of a round.
        k: usize,
    },
    /// The strategy with the smallest estimated time for the rectangles of this frame, by a
    /// [model](crate::NetworkCosts) of the network that is measured before the first frame.
    Automatic,
}

impl Strategy {
    /// A number for fingerprints.
    pub(crate) fn code(self) -> u64 {
        match self {
            Self::DirectSend => 1,
            Self::Tree => 2,
            Self::BinarySwap => 3,
            Self::RadixK { k } => 4 + k as u64,
            Self::Automatic => 0,
        }
    }

    pub(crate) fn check(self) -> Result<(), CompositeError> {
        match self {
            Self::RadixK { k } if k < 2 || !k.is_power_of_two() => {
                Err(CompositeError::Options(format!(
                    "radix-k with k = {k}: the fixed grouping of ranks needs a power of two, for \
                     example 8"
                )))
            }
            _ => Ok(()),
        }
    }

    /// The plan for the rectangles that all ranks drew in, the same on every rank. `root` is the
    /// order index of the rank that collects the image.
    pub(crate) fn plan<P: Composite>(
        self,
        drawn: &[Rect],
        slice_pixels: usize,
        root: Option<usize>,
    ) -> Plan {
        match self {
            // The caller has replaced Automatic by a strategy.
            Self::DirectSend | Self::Automatic => {
                Plan::DirectSend(direct_send::Plan::new::<P>(drawn, slice_pixels, root))
            }
            Self::Tree => Plan::Tree,
            Self::BinarySwap => Plan::BinarySwap,
            Self::RadixK { k } => Plan::RadixK { k },
        }
    }
}

/// A strategy with what it has derived from the rectangles of a frame.
pub(crate) enum Plan {
    DirectSend(direct_send::Plan),
    Tree,
    BinarySwap,
    RadixK { k: usize },
}

impl Plan {
    /// Which pieces of the image are held in the end, and by which order index.
    pub(crate) fn pieces(&self, drawn: &[Rect]) -> Vec<(usize, Rect)> {
        match self {
            Self::DirectSend(plan) => plan.pieces(drawn),
            Self::Tree => tree::pieces(drawn),
            Self::BinarySwap => binary_swap::pieces(drawn),
            Self::RadixK { k } => radix_k::pieces(drawn, *k),
        }
    }

    pub(crate) fn run<P: Composite>(
        &self,
        exchange: &mut FrameExchange<'_>,
        frame: &View<'_, P>,
        collector: &mut Collector<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        match self {
            Self::DirectSend(plan) => direct_send::run(plan, exchange, frame, collector, scratch),
            Self::Tree => tree::run(exchange, frame, collector, scratch),
            Self::BinarySwap => binary_swap::run(exchange, frame, collector, scratch),
            Self::RadixK { k } => radix_k::run(exchange, frame, *k, collector, scratch),
        }
    }
}
