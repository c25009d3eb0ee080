//! Nodes with several ranks in one process: their frames are merged in its memory, and nodes
//! composite the results.
use crate::comm::Communicator;
use crate::compositor::{CompositeOutput, Compositor};
use crate::error::CompositeError;
use crate::frame::Frame;
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::shared::merge;
use crate::simd::Kernels;
use std::num::NonZeroUsize;

impl<P: Composite> Compositor<P> {
    /// Composites the frames of all ranks of this node in one memory with `threads` threads, and
    /// then the result with those of the other nodes, by messages. Ranks of `comm` are nodes here;
    /// every node calls this once per frame.
    ///
    /// The ranks of node 0 come first, then those of node 1, and so on. Images with depth have the
    /// bits of the serial reference over all ranks. For blended formats nodes are the outer
    /// grouping: the bits are those of the reference over the nodes' references. They equal those
    /// over all ranks if nodes have the same size and all counts are powers of two.
    ///
    /// # Errors
    /// As [`Compositor::composite`], and as [`crate::composite_shared`].
    pub fn composite_node(
        &mut self,
        comm: &mut dyn Communicator,
        frames: &[Frame<'_, P>],
        threads: NonZeroUsize,
    ) -> Result<CompositeOutput<P>, CompositeError> {
        let begin = comm.now();
        let spare = self.node_image.take();
        let merged = merge(frames, threads, true, spare, Kernels::new(self.options().simd));
        let merged = merged.inspect_err(|error| crate::compositor::abort_group(comm, error))?;
        let (merged, nan) = (merged.image, merged.nan_depths.iter().sum());
        let merge_secs = comm.now() - begin;
        let bounds = frames.iter().fold(Rect::EMPTY, |all, frame| all.around(&frame.bounds()));
        let frame = Frame::of_image(&merged).with_bounds(bounds)?;
        let mut composited = self.composite(comm, &frame)?;
        composited.report.nan_depths = nan;
        composited.report.blend_secs += merge_secs;
        composited.report.total_secs += merge_secs;
        self.node_image = Some(merged);
        Ok(composited)
    }
}
