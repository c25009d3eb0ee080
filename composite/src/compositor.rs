//! The entry point: one call on every rank composites one frame.
use crate::collect::collect;
use crate::comm::{CommError, Communicator};
use crate::error::CompositeError;
use crate::frame::{Frame, Image, Piece};
use crate::pixel::Composite;
use crate::report::Report;
use crate::session::Session;
use crate::strategies::Strategy;
use crate::wire::mix;
use std::time::Duration;

/// Where the finished image goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Destination {
    /// To one rank of the communicator, whole.
    Rank(usize),
    /// Nowhere: every rank keeps its piece, to save it or to show its part of a wall.
    Distributed,
}

/// How to composite; the same on every rank. Ranks that differ get [`WireError::Fingerprint`](crate::WireError::Fingerprint),
/// or a timeout where their strategies do not even exchange the same messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Which way the pixels take; changes the time, never the image.
    pub strategy: Strategy,
    /// Where the image goes.
    pub destination: Destination,
    /// Ranks from front to back, for premultiplied colours; each exactly once. `None` means rank 0 is in front. For images with
    /// depth it only says who wins a tie: the last one.
    pub order: Option<Vec<usize>>,
    /// Longest wait for one message. Must allow for the slowest rank's rendering if ranks do not meet at a barrier first.
    pub timeout: Duration,
    /// Whether all ranks meet at the end, so that success on one rank means success on all. Without it a rank that has sent its
    /// part returns at once and hears of a fault of others only with its next frame.
    pub confirm: bool,
}

impl Default for Options {
    /// Direct send to rank 0, ranks in order, 60 seconds, confirmed.
    fn default() -> Self {
        Self {
            strategy: Strategy::default(),
            destination: Destination::Rank(0),
            order: None,
            timeout: Duration::from_secs(60),
            confirm: true,
        }
    }
}

/// What one rank gets.
#[derive(Clone, Debug, PartialEq)]
pub struct Composited<P> {
    /// The whole image, on the rank it was to go to.
    pub image: Option<Image<P>>,
    /// The piece this rank holds, with [`Destination::Distributed`].
    pub piece: Option<Piece<P>>,
    /// What it cost.
    pub report: Report,
}

/// Composites the frames of all ranks. Every rank of `comm` calls this once per frame with a frame of the same size.
///
/// The result has the bits of [`composite_serial`](crate::composite_serial) over the frames in `options.order`, whatever the
/// strategy, the transport and the order in which messages arrive.
///
/// # Errors
/// [`CompositeError`]. A rank that fails aborts the communicator, so all other ranks get an error too
/// ([`CommError::Aborted`] with the reason) instead of waiting; the communicator cannot be used afterwards.
pub fn composite<P: Composite>(
    comm: &mut dyn Communicator,
    frame: &Frame<'_, P>,
    options: &Options,
) -> Result<Composited<P>, CompositeError> {
    let result = composite_or_fail(comm, frame, options);
    if let Err(error) = &result
        && !matches!(error, CompositeError::Comm(CommError::Aborted { .. }))
    {
        comm.abort(&error.to_string());
    }
    result
}

fn composite_or_fail<P: Composite>(
    comm: &mut dyn Communicator,
    frame: &Frame<'_, P>,
    options: &Options,
) -> Result<Composited<P>, CompositeError> {
    let begin = comm.now();

    // Options that can be refused before any message.
    let size = comm.size();
    options.strategy.check()?;
    let order = front_to_back(options.order.as_deref(), size)?;
    let place_of = |rank: usize| order.iter().position(|&other| other == rank);
    let place = place_of(comm.rank()).ok_or(CommError::NoSuchRank { peer: comm.rank(), size })?;
    let root = match options.destination {
        Destination::Distributed => None,
        Destination::Rank(rank) => Some(place_of(rank).ok_or_else(|| {
            CompositeError::Options(format!("the image is to go to rank {rank} of a group of {size} ranks"))
        })?),
    };

    // The strategy.
    let fingerprint = fingerprint::<P>(frame, options.strategy, &order, root);
    let mut session = Session::new(comm, &order, place, fingerprint, frame.len(), options.timeout);
    session.report.nan_depths = frame.nan_depths();
    let piece = options.strategy.run(&mut session, frame)?;

    // Where the pieces go. What collecting costs is its own column and not part of the others.
    let before = session.report;
    let collecting = session.now();
    let (image, piece) = match root {
        None => (None, Some(piece)),
        Some(root) => {
            let pixels = collect(&mut session, &piece, root)?;
            let (width_px, height_px) = (frame.width_px(), frame.height_px());
            (pixels.map(|pixels| Image { width_px, height_px, pixels }), None)
        }
    };
    let collect_secs = session.now() - collecting;
    let report = Report {
        compress_secs: before.compress_secs,
        blend_secs: before.blend_secs,
        exchange_secs: before.exchange_secs,
        collect_secs,
        ..session.report
    };
    if options.confirm {
        // Longer than a wait for a message: the rank that misses one shall be the first to say so, because it knows which.
        comm.barrier(options.timeout.saturating_mul(2))?;
    }
    let report = Report { total_secs: comm.now() - begin, ..report };
    Ok(Composited { image, piece, report })
}

fn front_to_back(order: Option<&[usize]>, size: usize) -> Result<Vec<usize>, CompositeError> {
    let Some(order) = order else {
        return Ok((0..size).collect());
    };
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    if sorted.iter().copied().eq(0..size) {
        return Ok(order.to_vec());
    }
    Err(CompositeError::Options(format!(
        "the order of compositing must name each of the {size} ranks exactly once, but is {order:?}"
    )))
}

/// Differs (but for one chance in 2^64) between ranks that do not composite the same thing in the same way.
fn fingerprint<P: Composite>(
    frame: &Frame<'_, P>,
    strategy: Strategy,
    order: &[usize],
    root: Option<usize>,
) -> u64 {
    let fixed = [
        u64::from(P::CODE),
        u64::from(frame.width_px()),
        u64::from(frame.height_px()),
        strategy.code(),
        root.map_or(u64::MAX, |root| root as u64),
    ];
    let all = fixed.into_iter().chain(order.iter().map(|&rank| rank as u64));
    all.fold(order.len() as u64, mix)
}
