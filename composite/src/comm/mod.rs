//! How ranks talk. Compositing needs no more than this trait, so any transport can be plugged in.
pub mod threads;

use std::time::Duration;

/// A group of ranks, seen from one of them.
///
/// Messages from one rank to another with one tag arrive in the order they were sent. No call waits for longer than its
/// timeout, and a rank that gives up tells the others by [`abort`](Self::abort), so that a fault ends in an error on every
/// rank and never in a hang.
pub trait Communicator {
    /// This rank, below [`size`](Self::size).
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// Hands `message` over to `destination`; does not wait for it to be received.
    ///
    /// # Errors
    /// [`CommError::NoSuchRank`], [`CommError::PeerLost`] or [`CommError::Aborted`].
    fn send(&mut self, destination: usize, tag: u32, message: Vec<u8>) -> Result<(), CommError>;

    /// The next message from `source` with this `tag`.
    ///
    /// # Errors
    /// As [`send`](Self::send), and [`CommError::Timeout`] when `timeout` has passed without one.
    fn recv(&mut self, source: usize, tag: u32, timeout: Duration) -> Result<Vec<u8>, CommError>;

    /// Waits until all ranks have called it.
    ///
    /// # Errors
    /// [`CommError::BarrierTimeout`], [`CommError::PeerLost`] or [`CommError::Aborted`].
    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError>;

    /// Ends the group: all waiting and later calls on every rank give [`CommError::Aborted`] with this rank and `reason`.
    /// Only the first call counts.
    fn abort(&mut self, reason: &str);
}

/// Why ranks could not talk.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
pub enum CommError {
    /// A message did not come in time.
    #[error(
        "rank {rank} waited {waited_ms} ms for a message from rank {peer} (tag {tag}) in vain: \
         is that rank stalled, or the timeout too short for its rendering?"
    )]
    Timeout {
        /// Who waited.
        rank: usize,
        /// For whom.
        peer: usize,
        /// Tag of the message.
        tag: u32,
        /// How long, in milliseconds.
        waited_ms: u64,
    },
    /// Not all ranks came to a barrier in time.
    #[error("rank {rank} waited {waited_ms} ms at a barrier in vain: rank {missing} did not come")]
    BarrierTimeout {
        /// Who waited.
        rank: usize,
        /// The lowest rank that did not come.
        missing: usize,
        /// How long, in milliseconds.
        waited_ms: u64,
    },
    /// A rank has left the group (its program part ended or panicked).
    #[error("rank {rank} lost rank {peer}: it has left the group")]
    PeerLost {
        /// Who noticed.
        rank: usize,
        /// Who is gone.
        peer: usize,
    },
    /// Another rank, or this one, gave up.
    #[error("rank {by} ended the group: {reason}")]
    Aborted {
        /// Who gave up.
        by: usize,
        /// Why.
        reason: String,
    },
    /// A rank number that the group does not have.
    #[error("there is no rank {peer} in a group of {size}")]
    NoSuchRank {
        /// The number.
        peer: usize,
        /// Size of the group.
        size: usize,
    },
    /// A rank's thread panicked ([`threads::run`] only).
    #[error("rank {rank} panicked: {message}")]
    Panicked {
        /// Who.
        rank: usize,
        /// The message of the panic.
        message: String,
    },
    /// The operating system gave no thread ([`threads::run`] only).
    #[error("no thread for rank {rank}: {reason}: use fewer ranks")]
    NoThread {
        /// Who.
        rank: usize,
        /// The system's words.
        reason: String,
    },
}
