//! Ranks that are threads of one process, each with its own call: frames are published to each
//! other instead of sent.
//!
//! Every rank publishes its image (an `Arc`: nothing is copied), and all wait for each other. The
//! rank that arrives last merges all images straight from their planes, on at most as many threads
//! as there are processors, while the others sleep: waking eight ranks to merge bands of rows on
//! two processors cost as much as merging. The communicator is only used to wait, so errors name
//! lost and stalled ranks as they do with messages.
use crate::codec::MessageError;
use crate::comm::Communicator;
use crate::compositor::{
    CompositeOutput, CompositingOrder, Destination, Options, abort_group, fingerprint,
};
use crate::error::CompositeError;
use crate::frame::{Frame, Image};
use crate::pixel::Composite;
use crate::rect::Rect;
use crate::report::Report;
use crate::shared::merge;
use crate::simd::Kernels;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes that one thread reads in about a third of a millisecond.
const WORTH_A_THREAD_BYTES: usize = 8 << 20;

/// What one rank has published: its image, where it drew, and the fingerprint of its options.
type PublishedFrame<P> = (Arc<Image<P>>, Rect, u64);

struct GroupState<P: Composite> {
    published_frames: Vec<Option<PublishedFrame<P>>>,
    /// An image of the collecting rank that may be overwritten.
    spare: Option<Image<P>>,
    /// Number of frames whose merge has begun.
    merges_begun: u64,
    /// The last merged frame, until it is collected.
    image: Option<Image<P>>,
    /// Its number of NaN depths, by rank.
    nan_depths: Vec<u64>,
}

/// One rank of a group of threads that merge their images in shared memory.
pub struct SharedMemoryRank<P: Composite> {
    rank: usize,
    state: Arc<Mutex<GroupState<P>>>,
    spare: Option<Image<P>>,
    /// Frames composited so far.
    frames: u64,
    processors: NonZeroUsize,
}

/// A group of `ranks` ranks; pass each element to the thread of that rank.
pub fn shared_memory_group<P: Composite>(ranks: usize) -> Vec<SharedMemoryRank<P>> {
    let published_frames = (0..ranks).map(|_| None).collect();
    let state = GroupState {
        published_frames,
        spare: None,
        merges_begun: 0,
        image: None,
        nan_depths: Vec::new(),
    };
    let state = Arc::new(Mutex::new(state));
    // Asked once, because the answer costs reading files on some systems.
    let processors = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let shared_rank = |rank| SharedMemoryRank {
        rank,
        state: Arc::clone(&state),
        spare: None,
        frames: 0,
        processors,
    };
    (0..ranks).map(shared_rank).collect()
}

impl<P: Composite> SharedMemoryRank<P> {
    /// Composites the images of all ranks of the group; this rank drew within `bounds` of `image`.
    /// Every rank calls this once per frame, with a communicator of the same ranks. The result has
    /// the bits of [`composite_serial`](crate::composite_serial) in the order of `options`.
    ///
    /// # Errors
    /// [`CompositeError::SizesDiffer`]; [`CompositeError::Options`] for an image that is to stay
    /// distributed, which needs messages ([`composite`](crate::composite)), or an invalid order;
    /// errors of the communicator.
    pub fn composite(
        &mut self,
        comm: &mut dyn Communicator,
        image: &Arc<Image<P>>,
        bounds: Rect,
        options: &Options,
    ) -> Result<CompositeOutput<P>, CompositeError> {
        let result = self.composite_or_fail(comm, image, bounds, options);
        if let Err(error) = &result {
            abort_group(comm, error);
        }
        result
    }

    /// Takes back an image that is no longer needed, so that its memory is used for the next one.
    pub fn recycle(&mut self, image: Image<P>) {
        self.spare = Some(image);
    }

    fn state(&self) -> MutexGuard<'_, GroupState<P>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn composite_or_fail(
        &mut self,
        comm: &mut dyn Communicator,
        image: &Arc<Image<P>>,
        bounds: Rect,
        options: &Options,
    ) -> Result<CompositeOutput<P>, CompositeError> {
        let begin = comm.now();
        let ranks = self.state().published_frames.len();
        let root = match options.destination {
            Destination::Rank(root) if root < ranks && comm.size() == ranks => root,
            _ => {
                return Err(CompositeError::Options(format!(
                    "a table of {ranks} ranks composites to one of them, over a communicator of as \
                     many ranks: use composite for \
                     anything else"
                )));
            }
        };
        let order = CompositingOrder::new(comm, options)?;
        // Without the size: images of different sizes get an error that names both sizes.
        let own_fingerprint = fingerprint::<P>((0, 0), options, &order, None);
        let order = order.ranks;
        Rect::of_size(image.width_px, image.height_px).must_contain(&bounds)?;

        // Publish the image and wait for the others.
        let spare = if self.rank == root { self.spare.take() } else { None };
        {
            let mut state = self.state();
            state.published_frames[self.rank] = Some((Arc::clone(image), bounds, own_fingerprint));
            if spare.is_some() {
                state.spare = spare;
            }
        }
        comm.barrier(options.timeout)?;
        let published_secs = comm.now();

        // The first rank to continue, which arrived last, merges.
        let frame = self.frames;
        self.frames += 1;
        let work = {
            let mut state = self.state();
            (state.merges_begun == frame).then(|| {
                state.merges_begun += 1;
                let published_frames: Vec<PublishedFrame<P>> =
                    order.iter().filter_map(|&rank| state.published_frames[rank].take()).collect();
                (published_frames, state.spare.take())
            })
        };
        if let Some((published_frames, spare)) = work {
            for (&from, (.., theirs)) in order.iter().zip(&published_frames) {
                if *theirs != own_fingerprint {
                    let reason = MessageError::Fingerprint;
                    return Err(CompositeError::Message { rank: self.rank, from, reason });
                }
            }
            let frames: Vec<Frame<'_, P>> = published_frames
                .iter()
                .map(|(image, bounds, _)| Frame::of_image(image).with_bounds(*bounds))
                .collect::<Result<_, _>>()?;
            // Where other ranks work too, a new thread may start later than this one would finish.
            let bytes: usize = frames.iter().map(|frame| frame.bounds().pixels() * P::BYTES).sum();
            let threads =
                self.processors.min(NonZeroUsize::MIN.saturating_add(bytes / WORTH_A_THREAD_BYTES));
            let merged = merge(&frames, threads, options.depth, spare, Kernels::new(options.simd))?;
            // Release the images before their ranks draw the next ones.
            drop(frames);
            drop(published_frames);
            let mut state = self.state();
            state.image = Some(merged.image);
            state.nan_depths.resize(ranks, 0);
            for (&rank, nan) in order.iter().zip(&merged.nan_depths) {
                state.nan_depths[rank] = *nan;
            }
        }
        let merged_secs = comm.now();

        // No rank publishes the next frame before all have arrived here, and none merges it before
        // this one has been taken.
        comm.barrier(options.timeout)?;
        let mut state = self.state();
        let nan_depths = state.nan_depths.get(self.rank).copied().unwrap_or(0);
        let image = if self.rank == root { state.image.take() } else { None };
        drop(state);
        if self.rank == root && image.is_none() {
            let reason = "the ranks of this table have left a frame before its end: make a new \
                          group with shared_memory_group";
            return Err(CompositeError::Options(reason.to_string()));
        }
        let report = Report {
            exchange_secs: published_secs - begin,
            blend_secs: merged_secs - published_secs,
            collect_secs: comm.now() - merged_secs,
            total_secs: comm.now() - begin,
            nan_depths,
            in_memory: true,
            machines: 1,
            ..Report::default()
        };
        Ok(CompositeOutput { image, piece: None, report })
    }
}
