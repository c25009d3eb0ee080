//! Ranks that are threads of one process, each with its own call: frames are published to each other instead of sent.
//!
//! Every rank lays its image on the table (an `Arc`: nothing is copied), all wait for each other, and then each takes bands of rows until
//! there are none left and merges them straight from the planes of all. The communicator is only used to wait, so lost and stalled ranks are
//! named as with messages.
use crate::comm::Communicator;
use crate::compositor::{Composited, Destination, Options, give_up};
use crate::error::CompositeError;
use crate::frame::{Frame, Image};
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::reference::check_sizes;
use crate::report::Report;
use crate::shared::{BAND_ROWS, Rows, merge_band};
use crate::simd::Kernels;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What one rank has laid down: its image and where it drew.
type Laid<P> = (Arc<Image<P>>, Rect);

struct Table<P: Composite> {
    laid: Vec<Option<Laid<P>>>,
    /// The next band that nobody has taken.
    next_band: usize,
    /// Finished bands: number, colours, depths.
    bands: Vec<(usize, Vec<P::Color>, Vec<f32>)>,
    /// Buffers of bands that have been copied.
    spare: Vec<(Vec<P::Color>, Vec<f32>)>,
}

/// The place of one rank at a table that it shares with the other ranks of its process.
pub struct Seat<P: Composite> {
    rank: usize,
    table: Arc<Mutex<Table<P>>>,
    spare: Option<Image<P>>,
}

/// A table for `ranks` ranks; hand each seat to the thread of that rank.
pub fn seats<P: Composite>(ranks: usize) -> Vec<Seat<P>> {
    let laid = (0..ranks).map(|_| None).collect();
    let table = Table { laid, next_band: 0, bands: Vec::new(), spare: Vec::new() };
    let table = Arc::new(Mutex::new(table));
    (0..ranks).map(|rank| Seat { rank, table: Arc::clone(&table), spare: None }).collect()
}

impl<P: Composite> Seat<P> {
    /// Composites the images of all ranks of the table, of which this rank drew `bounds` of `image`. Every rank calls this once a frame, with
    /// a communicator of the same ranks. The bits are those of [`composite_serial`](crate::composite_serial) in rank order.
    ///
    /// # Errors
    /// [`CompositeError::SizesDiffer`]; [`CompositeError::Options`] for an image that is to stay distributed or an order other than that of
    /// ranks, which need messages ([`composite`](crate::composite)); errors of the communicator.
    pub fn composite(
        &mut self,
        comm: &mut dyn Communicator,
        image: &Arc<Image<P>>,
        bounds: Rect,
        options: &Options,
    ) -> Result<Composited<P>, CompositeError> {
        let result = self.composite_or_fail(comm, image, bounds, options);
        if let Err(error) = &result {
            give_up(comm, error);
        }
        result
    }

    /// Takes back an image that is no longer needed, so that the next one is written over it.
    pub fn recycle(&mut self, image: Image<P>) {
        self.spare = Some(image);
    }

    fn table(&self) -> MutexGuard<'_, Table<P>> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn composite_or_fail(
        &mut self,
        comm: &mut dyn Communicator,
        image: &Arc<Image<P>>,
        bounds: Rect,
        options: &Options,
    ) -> Result<Composited<P>, CompositeError> {
        let begin = comm.now();
        let ranks = self.table().laid.len();
        let root = match options.destination {
            Destination::Rank(root) if root < ranks && comm.size() == ranks && options.order.is_none() => {
                root
            }
            _ => {
                return Err(CompositeError::Options(format!(
                    "a table of {ranks} ranks composites in rank order to one of them, over a communicator of as many ranks: \
                     use composite for anything else"
                )));
            }
        };
        Rect::of_size(image.width_px, image.height_px).must_contain(&bounds)?;

        // Lay it down and wait for the others.
        self.table().laid[self.rank] = Some((Arc::clone(image), bounds));
        comm.barrier(options.timeout)?;
        let published = comm.now();
        let laid: Vec<Laid<P>> = self.table().laid.iter().flatten().cloned().collect();
        let frames: Vec<Frame<'_, P>> = laid
            .iter()
            .map(|(image, bounds)| Frame::of_image(image).bounded(*bounds))
            .collect::<Result<_, _>>()?;
        let (width_px, height_px) = check_sizes(&frames)?;

        // Bands, as long as there are any.
        let (width, height) = (width_px as usize, height_px as usize);
        let depth = options.depth && P::HAS_DEPTH;
        let kernels = Kernels::new(options.simd);
        let views: Vec<_> = frames.iter().map(|frame| frame.view(frame.bounds())).collect();
        let mut rows = Rows::new(width);
        let bands = if width == 0 { 0 } else { height.div_ceil(BAND_ROWS) };
        loop {
            let (band, (mut colors, mut depths)) = {
                let mut table = self.table();
                let band = table.next_band;
                if band >= bands {
                    break;
                }
                table.next_band += 1;
                (band, table.spare.pop().unwrap_or_default())
            };
            let first = band * BAND_ROWS;
            let pixels = width * BAND_ROWS.min(height - first);
            // Every value will be written, so what a buffer held before may stay.
            colors.resize(pixels, P::EMPTY.color());
            depths.resize(if depth { pixels } else { 0 }, 1.0);
            merge_band(kernels, &mut rows, &views, first as u32, &mut colors, &mut depths);
            self.table().bands.push((band, colors, depths));
        }
        let merged = comm.now();

        // One rank puts them in their places, when all are there; then the table is cleared for the next frame.
        comm.barrier(options.timeout)?;
        let mut whole = None;
        if self.rank == root {
            let depth_pixels = if depth { width * height } else { 0 };
            let spare = self.spare.take();
            let fitting =
                spare.filter(|i| i.colors.len() == width * height && i.depths.len() == depth_pixels);
            let (mut all_colors, mut all_depths) = match fitting {
                Some(image) => (image.colors, image.depths),
                None => (vec![P::EMPTY.color(); width * height], vec![1.0; depth_pixels]),
            };
            let mut table = self.table();
            while let Some((band, colors, depths)) = table.bands.pop() {
                let start = band * BAND_ROWS * width;
                all_colors[start..start + colors.len()].copy_from_slice(&colors);
                if depth {
                    all_depths[start..start + depths.len()].copy_from_slice(&depths);
                }
                table.spare.push((colors, depths));
            }
            table.next_band = 0;
            table.laid.fill_with(|| None);
            drop(table);
            whole = Some(Image { width_px, height_px, colors: all_colors, depths: all_depths });
        }
        // Nobody lays down the next frame before the table is clear.
        comm.barrier(options.timeout)?;
        let report = Report {
            exchange_secs: published - begin,
            blend_secs: merged - published,
            collect_secs: comm.now() - merged,
            total_secs: comm.now() - begin,
            nan_depths: if P::HAS_DEPTH { frames.get(self.rank).map_or(0, Frame::nan_depths) } else { 0 },
            ..Report::default()
        };
        Ok(Composited { image: whole, piece: None, report })
    }
}
