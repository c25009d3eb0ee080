//! Binary swap (K.-L. Ma, J. S. Painter, C. D. Hansen, M. F. Krogh, "Parallel Volume Rendering
//! Using Binary-Swap Compositing", IEEE CG&A 14(4), 1994).
//!
//! In round l a slot exchanges with the slot that differs in bit l, which holds the same part of
//! the image. The lower slot keeps the first half, the other the second half. Nearest slots come
//! first, which is the balanced tree of [`crate::rank_order`]. This is radix-k with groups of two.
use super::radix_k;
use crate::collect::Collector;
use crate::error::CompositeError;
use crate::frame_exchange::FrameExchange;
use crate::layer::View;
use crate::merge::Scratch;
use crate::pixel::Composite;
use crate::rect::Rect;

pub(crate) fn pieces(drawn: &[Rect]) -> Vec<(usize, Rect)> {
    radix_k::pieces(drawn, 2)
}

pub(crate) fn run<P: Composite>(
    exchange: &mut FrameExchange<'_>,
    frame: &View<'_, P>,
    collector: &mut Collector<P>,
    scratch: &mut Scratch<P>,
) -> Result<(), CompositeError> {
    radix_k::run(exchange, frame, 2, collector, scratch)
}
