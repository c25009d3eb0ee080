//! Communication between ranks. Compositing needs only this trait, so any transport can
//! implement it.
pub mod collective;
#[cfg(all(unix, target_pointer_width = "64", target_endian = "little"))]
#[cfg_attr(
    not(feature = "icet"),
    allow(dead_code, reason = "functions of MPI that carry IceT's messages only")
)]
pub mod mpi;
pub mod sim;
pub mod threads;

mod error;
mod pool;

pub use error::CommError;
pub use pool::BufferPool;

use std::time::Duration;

/// Tags from here on are reserved for [`collective`] and for the transports themselves.
pub const FIRST_RESERVED_TAG: u32 = 16_384;

/// A receive that has been posted and not yet waited for. [`Communicator::post_recv`] makes it and
/// [`Communicator::wait_any`] consumes it. If it is dropped, its message stays unread.
#[derive(Debug)]
pub struct Receive {
    /// Which of the communicator's receives this is; for implementations of the trait.
    pub id: u64,
    /// Rank of the sender.
    pub source: usize,
    /// Tag of the message.
    pub tag: u32,
    /// Longest message allowed, in bytes.
    pub capacity: usize,
}

/// A message that has arrived.
#[derive(Debug, PartialEq, Eq)]
pub struct Arrival {
    /// Rank of the sender.
    pub source: usize,
    /// Its tag.
    pub tag: u32,
    /// Its bytes. Give the buffer back with [`Communicator::recycle`] after reading it.
    pub message: Vec<u8>,
}

/// Memory that the ranks of a group on one machine share, with one segment for each rank. See
/// [`Communicator::shared_segments`]. Ranks are those of the group, of which some may be on other
/// machines; these have no segment here.
///
/// For each frame all ranks call [`all_gather`](Communicator::all_gather), then each
/// [`publish`](Self::publish)es its pixels. After a
/// [barrier of the machine](Communicator::machine_barrier) each [`attach`](Self::attach)es the
/// segments of the others and takes bands until none are left, and a second such barrier ends the
/// frame. In any other order a rank may read half-written data.
pub trait SharedSegments {
    /// Makes this rank's segment `bytes` long and calls `fill` to write the first `used` of them.
    /// If there is not enough memory, [`attach`](Self::attach) tells all ranks of the machine.
    fn publish(&mut self, bytes: usize, used: usize, fill: &mut dyn FnMut(&mut [u8]));

    /// Makes this rank's segment at least `bytes` long, where there is memory for it.
    fn reserve(&mut self, bytes: usize);

    /// Length of this rank's segment now: a [`publish`](Self::publish) of so many bytes finds
    /// enough memory.
    fn reserved(&self) -> usize;

    /// Opens the segments of all ranks of the machine. Returns false on all of them if any segment
    /// could not be made.
    ///
    /// # Errors
    /// [`CommError::Transport`] if an existing segment cannot be opened here, or a rank has
    /// published nothing for this frame; [`CommError::PeerLost`] if its process has ended.
    fn attach(&mut self) -> Result<bool, CommError>;

    /// The first `bytes` of the published segment of `rank`; fewer if it is smaller.
    fn segment(&self, rank: usize, bytes: usize) -> &[u8];

    /// The next band that no rank has taken, counted from 0.
    fn next_band(&self) -> usize;

    /// Calls `write` for a band at offset `from`, `bytes` long, in the segment of `rank`. Only the
    /// rank that has taken the band may call this.
    fn write_band(&self, rank: usize, from: usize, bytes: usize, write: &mut dyn FnMut(&mut [u8]));

    /// A band that has been written; call it after the barrier.
    fn band(&self, rank: usize, from: usize, bytes: usize) -> &[u8];
}

/// A group of ranks, seen from one of them.
///
/// Messages from one rank to another with one tag arrive in the order they were sent, and receives
/// of one source and tag complete in the order they were posted. Tags are below
/// [`FIRST_RESERVED_TAG`]. Buffers are owned: sending moves the buffer, and the receiver owns the
/// message.
///
/// No call waits for longer than its timeout, and a rank that gives up tells the others with
/// [`abort`](Self::abort), so a fault becomes an error on every rank and never a hang.
pub trait Communicator {
    /// This rank, below [`size`](Self::size).
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// Seconds since some moment in the past, on the clock that costs are measured with: wall-clock
    /// time, or the virtual time of a simulated network.
    fn now(&self) -> f64;

    /// Like [`now`](Self::now), to measure spans in which this rank waits for nothing. With
    /// simulated time, reading the simulated clock may cost more than the span itself.
    fn working_secs(&self) -> f64 {
        self.now()
    }

    /// Whether all ranks share one memory and its processors, so that no message travels while its
    /// ranks do something else. Cutting images into slices has no benefit then. The same on all
    /// ranks.
    fn is_one_node(&self) -> bool {
        false
    }

    /// Memory that the ranks of this machine share although they are processes, if there is any and
    /// all of them can open it, on every machine. Images need not be sent between them then.
    fn shared_segments(&mut self) -> Option<&mut dyn SharedSegments> {
        None
    }

    /// The machine of every rank, numbered in any way, if the ranks of each have
    /// [shared segments](Self::shared_segments). The same on all ranks.
    fn machines_with_shared_memory(&self) -> Option<&[usize]> {
        None
    }

    /// Waits until all ranks of this machine have called it, where they have
    /// [shared segments](Self::shared_segments); else until all ranks have.
    ///
    /// # Errors
    /// As [`barrier`](Self::barrier).
    fn machine_barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        self.barrier(timeout)
    }

    /// The reason why the group ended, if another rank has given up and this rank learns of it only
    /// now. Otherwise `error`, which this rank found itself and which may be a consequence of the
    /// other rank's end.
    fn root_cause(&mut self, error: CommError) -> CommError {
        error
    }

    /// Sends `message` to `destination`; does not wait for it to be received.
    ///
    /// # Errors
    /// [`CommError::NoSuchRank`], [`CommError::PeerLost`], [`CommError::Aborted`] or
    /// [`CommError::Transport`].
    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError>;

    /// Posts a receive for a message of at most `capacity` bytes from `source` with this `tag`. If
    /// it is posted before the message arrives, the message is received directly into its buffer
    /// while this rank works on something else.
    ///
    /// # Errors
    /// [`CommError::NoSuchRank`], [`CommError::Aborted`] or [`CommError::Transport`].
    fn post_recv(&mut self, source: usize, tag: u32, capacity: usize)
    -> Result<Receive, CommError>;

    /// Waits until the message of one of `posted` has arrived, and removes that receive from the
    /// list (the others keep their order). A `timeout` of zero checks once.
    ///
    /// # Errors
    /// [`CommError::Timeout`] when `timeout` has passed since the last [sign of life](Self::alive)
    /// of the sources, [`CommError::PeerLost`] when one of the sources has left before it sent,
    /// [`CommError::TooLong`], [`CommError::NothingPosted`] for an empty list,
    /// [`CommError::Aborted`], [`CommError::Transport`].
    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError>;

    /// Signals that this rank is at work. A rank that works for long between two messages calls it
    /// regularly, for example for each tile it has rendered; it costs about as much as reading a
    /// clock.
    ///
    /// A timeout counts from the last sign of life of the ranks that are waited for, or of those
    /// that these wait for in turn. Signs of life are this call and any message sent. So the others
    /// wait for a slow rank as long as it calls this, and a dead or stalled one is reported when
    /// the timeout has passed since its last sign.
    ///
    /// # Errors
    /// [`CommError::Aborted`] if the group has ended: stop working.
    fn alive(&mut self) -> Result<(), CommError> {
        Ok(())
    }

    /// Waits until at most `most` messages with this `tag` are in flight, or `patience` has passed.
    /// Where all messages share a wire, sending all at once delays the first ones. This is a hint;
    /// transports that send messages at once need not implement it.
    fn throttle_sends(&mut self, _tag: u32, _most: usize, _patience: Duration) {}

    /// Ends the group: all current and later waits on every rank return [`CommError::Aborted`] with
    /// this rank and `reason`. Only the first call counts.
    fn abort(&mut self, reason: &str);

    /// The message of one of `posted` if one has already arrived.
    ///
    /// # Errors
    /// As [`wait_any`](Self::wait_any), without its timeout.
    fn test_any(&mut self, posted: &mut Vec<Receive>) -> Result<Option<Arrival>, CommError> {
        match self.wait_any(posted, Duration::ZERO) {
            Ok(arrival) => Ok(Some(arrival)),
            Err(CommError::Timeout { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The next message of at most `capacity` bytes from `source` with this `tag`.
    ///
    /// # Errors
    /// As [`post_recv`](Self::post_recv) and [`wait_any`](Self::wait_any).
    fn recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
        timeout: Duration,
    ) -> Result<Vec<u8>, CommError> {
        let mut posted = vec![self.post_recv(source, tag, capacity)?];
        Ok(self.wait_any(&mut posted, timeout)?.message)
    }

    /// Waits until all ranks have called it.
    ///
    /// # Errors
    /// [`CommError::BarrierTimeout`], [`CommError::OutOfStep`], [`CommError::PeerLost`],
    /// [`CommError::Aborted`] or [`CommError::Transport`].
    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        collective::barrier(self, timeout)
    }

    /// Gathers the bytes `mine` of every rank at every rank, in rank order. `longest` (bytes, the
    /// same on all ranks) bounds their lengths, which may differ.
    ///
    /// # Errors
    /// As [`send`](Self::send), [`wait_any`](Self::wait_any) and [`barrier`](Self::barrier);
    /// [`CommError::TooLong`] if `mine` is longer than `longest`.
    fn all_gather(
        &mut self,
        mine: &[u8],
        longest: usize,
        timeout: Duration,
    ) -> Result<Vec<Vec<u8>>, CommError> {
        collective::all_gather(self, mine, longest, timeout)
    }

    /// An empty buffer with the given `capacity`, a recycled one if possible. Fresh memory costs a
    /// page fault every 4 KiB, which is more than many networks take to fill it.
    fn buffer(&mut self, capacity: usize) -> Vec<u8> {
        Vec::with_capacity(capacity)
    }

    /// Gives a buffer back for [`buffer`](Self::buffer) and for later receives.
    fn recycle(&mut self, _buffer: Vec<u8>) {}
}
