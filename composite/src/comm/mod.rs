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

/// Tags from here on are for [`collective`] and for the back ends themselves.
pub const FIRST_RESERVED_TAG: u32 = 16_384;

/// A receive that has been posted and not yet waited for. Made by [`Communicator::post_recv`], used
/// up by [`Communicator::wait_any`]; dropping it leaves the message, when it comes, unread.
#[derive(Debug)]
pub struct Receive {
    /// Which of the communicator's receives; for back ends.
    pub id: u64,
    /// From whom.
    pub source: usize,
    /// Tag of the message.
    pub tag: u32,
    /// Longest message allowed, in bytes.
    pub capacity: usize,
}

/// A message that has come.
#[derive(Debug, PartialEq, Eq)]
pub struct Arrival {
    /// From whom.
    pub source: usize,
    /// Its tag.
    pub tag: u32,
    /// Its bytes. Give the buffer back with [`Communicator::recycle`] when it is read.
    pub message: Vec<u8>,
}

/// Memory of one machine that the ranks of a group share: a room for each of them. See
/// [`Communicator::shared_segments`].
///
/// A frame: all meet ([`all_gather`](Communicator::all_gather)), each [`publish`](Self::publish)s
/// its pixels down, all meet at a [barrier](Communicator::barrier) and [`attach`](Self::attach) the
/// rooms of the others, take bands until there are none left, and meet at a barrier again. In any
/// other order what is read may be half written.
pub trait SharedSegments {
    /// Makes this rank's room `bytes` long and has the first `used` of them written. If there is
    /// not enough memory, [`attach`](Self::attach) says so to all.
    fn publish(&mut self, bytes: usize, used: usize, fill: &mut dyn FnMut(&mut [u8]));

    /// Opens the rooms of all; false, on all ranks, if there is one that could not be made.
    ///
    /// # Errors
    /// [`CommError::Transport`] if a room that was made cannot be opened here, or a rank has laid
    /// down nothing for this frame; [`CommError::PeerLost`] if its process has ended.
    fn attach(&mut self) -> Result<bool, CommError>;

    /// The first `bytes` of the room of `rank`, as it has laid them down; fewer if it is smaller.
    fn segment(&self, rank: usize, bytes: usize) -> &[u8];

    /// The next band that nobody has taken, from 0 on.
    fn next_band(&self) -> usize;

    /// Has a band written, into `bytes` from `from` on of the room of `rank`, by the one who has
    /// taken it.
    fn write_band(&self, rank: usize, from: usize, bytes: usize, write: &mut dyn FnMut(&mut [u8]));

    /// A band that was written, behind the barrier.
    fn band(&self, rank: usize, from: usize, bytes: usize) -> &[u8];
}

/// A group of ranks, seen from one of them.
///
/// Messages from one rank to another with one tag arrive in the order they were sent, and receives
/// of one source and tag are served in the order they were posted. Tags are below
/// [`FIRST_RESERVED_TAG`]. Buffers are owned: what is sent is handed over, what comes is the
/// receiver's.
///
/// No call waits for longer than its timeout, and a rank that gives up tells the others by
/// [`abort`](Self::abort), so that a fault ends in an error on every rank and never in a hang.
pub trait Communicator {
    /// This rank, below [`size`](Self::size).
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// Seconds since some moment in the past, the time in which costs are counted: wall-clock time,
    /// or the virtual time of a simulated network.
    fn now(&self) -> f64;

    /// As [`now`](Self::now), for the lengths of spans in which this rank waits for nothing. Where
    /// time is simulated, looking at the simulated clock may cost more than what is measured.
    fn working_secs(&self) -> f64 {
        self.now()
    }

    /// Whether all ranks share one memory and its processors, so that no message travels while its
    /// ranks do something else: then it is not worth cutting pictures in slices for that. The same
    /// on all ranks.
    fn is_one_node(&self) -> bool {
        false
    }

    /// Memory that all ranks share though they are processes, if there is such and all of them have
    /// it: then pictures need not travel.
    fn shared_segments(&mut self) -> Option<&mut dyn SharedSegments> {
        None
    }

    /// What ended the group, if another rank has given up and this one hears of it only now; else
    /// `error`, which this rank came upon by itself and which may be no more than what the other's
    /// end has left.
    fn root_cause(&mut self, error: CommError) -> CommError {
        error
    }

    /// Hands `message` over to `destination`; does not wait for it to be received.
    ///
    /// # Errors
    /// [`CommError::NoSuchRank`], [`CommError::PeerLost`], [`CommError::Aborted`] or
    /// [`CommError::Transport`].
    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError>;

    /// Announces that a message of at most `capacity` bytes from `source` with this `tag` will be
    /// waited for. Posted before it comes, a message goes straight into its place while this rank
    /// works on something else.
    ///
    /// # Errors
    /// [`CommError::NoSuchRank`], [`CommError::Aborted`] or [`CommError::Transport`].
    fn post_recv(&mut self, source: usize, tag: u32, capacity: usize)
    -> Result<Receive, CommError>;

    /// Waits until the message of one of `posted` is there, and takes that one out of the list (the
    /// others keep their order). A `timeout` of zero looks once.
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

    /// Says that this rank is at work. Whoever works for long between two messages calls it now and
    /// then, as for each tile it has rendered; it costs about as much as looking at a clock.
    ///
    /// A timeout counts from the last sign of life of those that are waited for, or of those that
    /// these wait for themselves: from this call, and from any message sent. So a slow rank is
    /// waited for as long as it says so, and one that is dead or stalled is missed when the timeout
    /// has passed since its last sign.
    ///
    /// # Errors
    /// [`CommError::Aborted`] if the group has ended: further work is in vain.
    fn alive(&mut self) -> Result<(), CommError> {
        Ok(())
    }

    /// Lets messages with this `tag` leave until at most `most` of them are on their way: where all
    /// share a wire, the first ones arrive no sooner than the last. A hint, with which a transport
    /// whose messages leave at once need do nothing; after `patience` it has an end anyway.
    fn throttle_sends(&mut self, _tag: u32, _most: usize, _patience: Duration) {}

    /// Ends the group: all waiting and later calls on every rank give [`CommError::Aborted`] with
    /// this rank and `reason`. Only the first call counts.
    fn abort(&mut self, reason: &str);

    /// The message of one of `posted` if one is already there.
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

    /// Gives the bytes `mine` of every rank to every rank, in rank order. `longest` (bytes, the
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

    /// An empty buffer with room for `capacity` bytes, from those given back if there is one: fresh
    /// memory costs a page fault every 4 KiB, more than many a network takes to fill it.
    fn buffer(&mut self, capacity: usize) -> Vec<u8> {
        Vec::with_capacity(capacity)
    }

    /// Gives a buffer back for [`buffer`](Self::buffer) and for later receives.
    fn recycle(&mut self, _buffer: Vec<u8>) {}
}
