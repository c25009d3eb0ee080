//! Frames of several ranks in one memory: merged straight from their planes, without messages.
//!
//! Rows of the result are worked on by several threads; each row is read once from every frame that drew there and written once,
//! so this costs what reading the frames costs. Messages cost that and several times more: on a node, use this; between nodes,
//! messages ([`Compositor::composite_node`]). TOD-Tree (A. V. P. Grosset, M. Prasad, C. Christensen, A. Knoll, C. Hansen, PGV15)
//! found the same for its mixture of OpenMP and MPI.
use crate::comm::Communicator;
use crate::compositor::{Composited, Compositor};
use crate::error::CompositeError;
use crate::frame::{Frame, Image};
use crate::layer::View;
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;
use crate::reference::check_sizes;
use crate::simd::expand::{Side, join_run, join_run_scalar};
use crate::simd::{Kernels, at_level};
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Rows that a thread takes at a time.
pub(crate) const BAND_ROWS: usize = 16;

/// Composites frames of one memory, in rank order, with `threads` threads. The bits are those of
/// [`composite_serial`](crate::composite_serial).
///
/// `spare` is an image to write over; without `depth` the result has colours only.
///
/// # Errors
/// [`CompositeError::NoFrames`], [`CompositeError::SizesDiffer`].
pub fn composite_shared<P: Composite>(
    frames: &[Frame<'_, P>],
    threads: NonZeroUsize,
    depth: bool,
    spare: Option<Image<P>>,
) -> Result<Image<P>, CompositeError> {
    merge(frames, threads, depth, spare, Kernels::new(None))
}

impl<P: Composite> Compositor<P> {
    /// Composites the frames of all ranks of this node with each other, in one memory and with `threads` threads, and the result
    /// with those of the other nodes, by messages. Ranks of `comm` are nodes here; every node calls this once a frame.
    ///
    /// The ranks of node 0 come first, then those of node 1, and so on. Images with depth have the bits of the serial reference
    /// over all ranks. For blended formats nodes are the outer grouping: the bits are those of the reference over the nodes'
    /// references, which are also those over all ranks where nodes are equally large and all numbers are powers of two.
    ///
    /// # Errors
    /// As [`Compositor::composite`], and as [`composite_shared`].
    pub fn composite_node(
        &mut self,
        comm: &mut dyn Communicator,
        frames: &[Frame<'_, P>],
        threads: NonZeroUsize,
    ) -> Result<Composited<P>, CompositeError> {
        let begin = comm.now();
        let spare = self.node_image.take();
        let merged = merge(frames, threads, true, spare, Kernels::new(self.options().simd));
        let merged = merged.inspect_err(|error| crate::compositor::give_up(comm, error))?;
        let merge_secs = comm.now() - begin;
        let bounds = frames.iter().fold(Rect::EMPTY, |all, frame| all.around(&frame.bounds()));
        let frame = Frame::of_image(&merged).bounded(bounds)?;
        let mut composited = self.composite(comm, &frame)?;
        let nan: u64 = if P::HAS_DEPTH { frames.iter().map(Frame::nan_depths).sum() } else { 0 };
        composited.report.nan_depths = nan;
        composited.report.blend_secs += merge_secs;
        composited.report.total_secs += merge_secs;
        self.node_image = Some(merged);
        Ok(composited)
    }
}

fn merge<P: Composite>(
    frames: &[Frame<'_, P>],
    threads: NonZeroUsize,
    depth: bool,
    spare: Option<Image<P>>,
    kernels: Kernels,
) -> Result<Image<P>, CompositeError> {
    let (width_px, height_px) = check_sizes(frames)?;
    let (width, pixels) = (width_px as usize, frames[0].len());
    let depth = depth && P::HAS_DEPTH;
    let depth_pixels = if depth { pixels } else { 0 };
    let spare = spare.filter(|image| image.colors.len() == pixels && image.depths.len() == depth_pixels);
    let (mut colors, mut depths) = match spare {
        Some(image) => (image.colors, image.depths),
        None => (vec![P::EMPTY.color(); pixels], vec![1.0; depth_pixels]),
    };
    let views: Vec<View<'_, P>> = frames.iter().map(|frame| frame.view(frame.bounds())).collect();

    // Bands of rows, in a list from which each thread takes the next.
    let band_pixels = (BAND_ROWS * width).max(1);
    let depth_bands = depths.chunks_mut(band_pixels).map(Some).chain(std::iter::repeat_with(|| None));
    let bands = colors.chunks_mut(band_pixels).zip(depth_bands).enumerate();
    let bands = Mutex::new(bands);
    let work = || {
        let mut rows = Rows::<P>::new(width);
        loop {
            let next = bands.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((index, (colors, depths))) = next else { break };
            let first = (index * BAND_ROWS) as u32;
            let depths = depths.unwrap_or(&mut []);
            merge_band(kernels, &mut rows, &views, first, colors, depths);
        }
    };
    let most = pixels.div_ceil(band_pixels).max(1);
    std::thread::scope(|scope| {
        for _ in 1..threads.get().min(most) {
            scope.spawn(work);
        }
        work();
    });
    Ok(Image { width_px, height_px, colors, depths })
}

/// Rows `first_row…` of all views into `colors` and, if it is not empty, `depths`.
pub(crate) fn merge_band<P: Composite>(
    kernels: Kernels,
    rows: &mut Rows<P>,
    views: &[View<'_, P>],
    first_row: u32,
    colors: &mut [P::Color],
    depths: &mut [f32],
) {
    at_level!(
        kernels,
        simd => rows.merge_band(views, first_row, colors, depths,
            #[inline(always)]
            |c, d, held_c, held_d, side| join_run::<P, _>(simd, c, d, held_c, held_d, side)),
        rows.merge_band(views, first_row, colors, depths, join_run_scalar::<P>)
    );
}

/// Rows in which one thread works.
pub(crate) struct Rows<P: Composite> {
    width: usize,
    depth: Vec<f32>,
    /// For blended formats: the groups of the balanced tree that wait for their other half, by the logarithm of their size.
    waiting: Vec<Group<P>>,
    spare: Vec<Vec<P::Color>>,
}

/// A row of a group of ranks: pixels outside `columns` are unset.
struct Group<P: Composite> {
    columns: Range<usize>,
    colors: Vec<P::Color>,
}

impl<P: Composite> Rows<P> {
    pub(crate) fn new(width: usize) -> Self {
        Self { width, depth: Vec::new(), waiting: Vec::new(), spare: Vec::new() }
    }

    /// Rows `first_row…` of all frames into `colors` and, if it is not empty, `depths`.
    #[inline(always)]
    fn merge_band(
        &mut self,
        views: &[View<'_, P>],
        first_row: u32,
        colors: &mut [P::Color],
        depths: &mut [f32],
        join: impl Fn(&[u8], &[u8], &mut [P::Color], &mut [f32], Side),
    ) {
        let width = self.width;
        if width == 0 {
            return;
        }
        if !P::HAS_DEPTH {
            for (index, row) in colors.chunks_exact_mut(width).enumerate() {
                self.blend_row(views, first_row + index as u32, row, &join);
            }
            return;
        }
        let depths = if depths.is_empty() {
            self.depth.resize(colors.len(), 1.0);
            &mut self.depth
        } else {
            depths
        };
        colors.fill(P::EMPTY.color());
        depths.fill(1.0);
        // All rows of one frame before those of the next: what is joined stays in the second cache, and each frame is read in one
        // piece, which processors foresee. Row by row through all frames every row begins with misses.
        let end_row = first_row + (colors.len() / width) as u32;
        for view in views {
            let (x0, x1) = (view.bounds.x0, view.bounds.x1);
            for y in view.bounds.y0.max(first_row)..view.bounds.y1.min(end_row) {
                let (from_colors, from_depths) = view.row(y, x0, x1);
                let start = (y - first_row) as usize * width;
                let pixels = start + x0 as usize..start + x1 as usize;
                join(
                    bytemuck::cast_slice(from_colors),
                    bytemuck::cast_slice(from_depths),
                    &mut colors[pixels.clone()],
                    &mut depths[pixels],
                    Side::Higher,
                );
            }
        }
    }

    /// One row in the canonical grouping: pairs first, then as a binary counter carries.
    #[inline(always)]
    fn blend_row(
        &mut self,
        views: &[View<'_, P>],
        y: u32,
        row: &mut [P::Color],
        join: &impl Fn(&[u8], &[u8], &mut [P::Color], &mut [f32], Side),
    ) {
        let folding = Folding::new(views.len());
        for slot in 0..folding.slots {
            let leader = folding.leader(slot);
            let mut group = self.row_of(&views[leader], y);
            if let Some(partner) = folding.partner(leader) {
                let other = self.row_of(&views[partner], y);
                group = self.joined(group, other, join);
            }
            let mut carry = slot;
            while carry & 1 == 1 {
                if let Some(lower) = self.waiting.pop() {
                    group = self.joined(lower, group, join);
                }
                carry >>= 1;
            }
            self.waiting.push(group);
        }
        if let Some(whole) = self.waiting.pop() {
            let columns = whole.columns.clone();
            row[..columns.start].fill(P::EMPTY.color());
            row[columns.clone()].copy_from_slice(&whole.colors[columns.clone()]);
            row[columns.end..].fill(P::EMPTY.color());
            self.spare.push(whole.colors);
        }
    }

    fn row_of(&mut self, view: &View<'_, P>, y: u32) -> Group<P> {
        let mut colors = self.spare.pop().unwrap_or_else(|| vec![P::EMPTY.color(); self.width]);
        if !(view.bounds.y0..view.bounds.y1).contains(&y) {
            return Group { columns: 0..0, colors };
        }
        let columns = view.bounds.x0 as usize..view.bounds.x1 as usize;
        colors[columns.clone()].copy_from_slice(view.row(y, view.bounds.x0, view.bounds.x1).0);
        Group { columns, colors }
    }

    #[inline(always)]
    fn joined(
        &mut self,
        mut lower: Group<P>,
        higher: Group<P>,
        join: &impl Fn(&[u8], &[u8], &mut [P::Color], &mut [f32], Side),
    ) -> Group<P> {
        if higher.columns.is_empty() {
            self.spare.push(higher.colors);
            return lower;
        }
        if lower.columns.is_empty() {
            self.spare.push(lower.colors);
            return higher;
        }
        // What neither has set becomes background.
        let all = lower.columns.start.min(higher.columns.start)..lower.columns.end.max(higher.columns.end);
        lower.colors[all.start..lower.columns.start].fill(P::EMPTY.color());
        lower.colors[lower.columns.end..all.end].fill(P::EMPTY.color());
        let other = bytemuck::cast_slice(&higher.colors[higher.columns.clone()]);
        join(other, &[], &mut lower.colors[higher.columns.clone()], &mut [], Side::Higher);
        self.spare.push(higher.colors);
        Group { columns: all, colors: lower.colors }
    }
}
