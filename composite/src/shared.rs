//! Merges the frames of several ranks in one memory, straight from their planes, without messages.
//!
//! Several threads work on rows of the result. Each row is read once from every frame that drew
//! there and written once, so the cost is that of reading the frames. Messages cost that and
//! several times more: use this on a node, and messages between nodes
//! ([`Compositor::composite_node`]). TOD-Tree (A. V. P. Grosset, M. Prasad, C. Christensen, A.
//! Knoll, C. Hansen, PGV15) found the same for its mixture of OpenMP and MPI.
use crate::error::CompositeError;
use crate::frame::{Frame, Image};
use crate::layer::View;
use crate::pixel::Composite;
use crate::reference::check_sizes;
use crate::simd::Kernels;
use std::num::NonZeroUsize;
use std::sync::{Mutex, PoisonError};

mod blended;
mod columns;
mod nearest;

use blended::BlendedRows;
use columns::Columns;
use nearest::NearestRows;

/// Rows that a thread takes at a time.
pub(crate) const BAND_ROWS: usize = 16;

/// Composites frames in one memory, in rank order, with `threads` threads. The bits are those of
/// [`composite_serial`](crate::composite_serial).
///
/// `spare` is an image that may be overwritten; without `depth` the result has colours only.
///
/// # Errors
/// [`CompositeError::NoFrames`], [`CompositeError::SizesDiffer`].
pub fn composite_shared<P: Composite>(
    frames: &[Frame<'_, P>],
    threads: NonZeroUsize,
    depth: bool,
    spare: Option<Image<P>>,
) -> Result<Image<P>, CompositeError> {
    Ok(merge(frames, threads, depth, spare, Kernels::new(None))?.image)
}

/// The merged frames.
pub(crate) struct MergeResult<P: Composite> {
    pub(crate) image: Image<P>,
    /// Number of NaN depths of each frame.
    pub(crate) nan_depths: Vec<u64>,
}

pub(crate) fn merge<P: Composite>(
    frames: &[Frame<'_, P>],
    threads: NonZeroUsize,
    depth: bool,
    spare: Option<Image<P>>,
    kernels: Kernels,
) -> Result<MergeResult<P>, CompositeError> {
    let (width_px, height_px) = check_sizes(frames)?;
    let (width, pixels) = (width_px as usize, frames[0].len());
    let depth = depth && P::HAS_DEPTH;
    let depth_pixels = if depth { pixels } else { 0 };
    let spare =
        spare.filter(|image| image.colors.len() == pixels && image.depths.len() == depth_pixels);
    let (mut colors, mut depths) = match spare {
        Some(image) => (image.colors, image.depths),
        None => (vec![P::EMPTY.color(); pixels], vec![1.0; depth_pixels]),
    };
    let views: Vec<View<'_, P>> = frames.iter().map(|frame| frame.view(frame.bounds())).collect();

    // Bands of rows, in a list from which each thread takes the next.
    let band_pixels = (BAND_ROWS * width).max(1);
    let depth_bands =
        depths.chunks_mut(band_pixels).map(Some).chain(std::iter::repeat_with(|| None));
    let bands = colors.chunks_mut(band_pixels).zip(depth_bands).enumerate();
    let bands = Mutex::new(bands);
    let nan_depths = Mutex::new(vec![0; frames.len()]);
    let work = || {
        let mut rows = Rows::<P>::new(width);
        loop {
            let next = bands.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((index, (colors, depths))) = next else { break };
            let first = (index * BAND_ROWS) as u32;
            let depths = depths.unwrap_or(&mut []);
            merge_band(kernels, &mut rows, &views, first, colors, depths);
        }
        let mut nan_depths = nan_depths.lock().unwrap_or_else(PoisonError::into_inner);
        for (all, these) in nan_depths.iter_mut().zip(&rows.nearest.nan) {
            *all += these;
        }
    };
    let most = pixels.div_ceil(band_pixels).max(1);
    std::thread::scope(|scope| {
        for _ in 1..threads.get().min(most) {
            scope.spawn(work);
        }
        work();
    });
    let nan_depths = nan_depths.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(MergeResult { image: Image { width_px, height_px, colors, depths }, nan_depths })
}

/// Merges rows from `first_row` on of all views into `colors` and, if it is not empty, `depths`.
pub(crate) fn merge_band<P: Composite>(
    kernels: Kernels,
    rows: &mut Rows<P>,
    views: &[View<'_, P>],
    first_row: u32,
    colors: &mut [P::Color],
    depths: &mut [f32],
) {
    let Rows { width, columns, wide_columns, nearest, blended } = rows;
    if *width == 0 {
        return;
    }
    let end_row = first_row + (colors.len() / *width) as u32;
    let mut y = first_row;
    while y < end_row {
        let end = match P::HAS_DEPTH {
            true => columns.look_up(views, *width, y, end_row),
            false => wide_columns.look_up(views, *width, y, end_row),
        };
        let pixels = (y - first_row) as usize * *width..(end - first_row) as usize * *width;
        let colors = &mut colors[pixels.clone()];
        if P::HAS_DEPTH {
            let depths = if depths.is_empty() { &mut [] } else { &mut depths[pixels] };
            nearest.merge_rows(kernels, columns, views, (y, *width), colors, depths);
        } else {
            blended.merge_rows(kernels, wide_columns, views, (y, *width), colors);
        }
        y = end;
    }
}

/// Scratch buffers of a thread that merges rows.
pub(crate) struct Rows<P: Composite> {
    width: usize,
    columns: Columns<{ nearest::BLOCK }>,
    wide_columns: Columns<{ blended::BLOCK }>,
    nearest: NearestRows<P>,
    blended: BlendedRows<P>,
}

impl<P: Composite> Rows<P> {
    pub(crate) fn new(width: usize) -> Self {
        Self {
            width,
            columns: Columns::default(),
            wide_columns: Columns::default(),
            nearest: NearestRows::new(),
            blended: BlendedRows::new(),
        }
    }
}
