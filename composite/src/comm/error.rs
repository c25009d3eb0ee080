//! Errors of communicators.

/// Why a call of a communicator failed.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CommError {
    /// A message did not arrive in time.
    #[error(
        "rank {rank} waited {waited_ms} ms for a message from rank {peer} (tag {tag}) in vain, \
         without a sign of life: \
         is that rank stalled, or does its renderer work longer than the timeout without calling \
         Communicator::alive?"
    )]
    Timeout {
        /// The waiting rank.
        rank: usize,
        /// The rank waited for; of several, the first that was posted.
        peer: usize,
        /// Tag of the message.
        tag: u32,
        /// Milliseconds since the last sign of life.
        waited_ms: u64,
    },
    /// Not all ranks reached a barrier in time.
    #[error("rank {rank} waited {waited_ms} ms at a barrier in vain: rank {missing} did not come")]
    BarrierTimeout {
        /// The waiting rank.
        rank: usize,
        /// The lowest rank that did not arrive.
        missing: usize,
        /// Milliseconds waited.
        waited_ms: u64,
    },
    /// Some ranks called an all-gather and others a barrier.
    #[error(
        "rank {rank}: {} came to an all-gather and {} to a barrier: all ranks must make the same \
         calls in the same order",
        ranks(gathering),
        ranks(waiting)
    )]
    OutOfStep {
        /// The rank that noticed; all ranks do.
        rank: usize,
        /// Ranks that called [`all_gather`](super::Communicator::all_gather).
        gathering: Vec<usize>,
        /// Ranks that called [`barrier`](super::Communicator::barrier).
        waiting: Vec<usize>,
    },
    /// A rank has left the group (its program part ended or panicked).
    #[error("rank {rank} lost rank {peer}: it has left the group")]
    PeerLost {
        /// The rank that noticed.
        rank: usize,
        /// The rank that left.
        peer: usize,
    },
    /// Another rank, or this one, gave up.
    #[error("rank {by} ended the group: {reason}")]
    Aborted {
        /// The rank that gave up.
        by: usize,
        /// Its reason.
        reason: String,
    },
    /// A rank number that the group does not have.
    #[error("there is no rank {peer} in a group of {size}")]
    NoSuchRank {
        /// The rank number.
        peer: usize,
        /// Size of the group.
        size: usize,
    },
    /// A message is longer than the receiver allowed for: sender and receiver disagree about what
    /// is sent.
    #[error(
        "rank {rank} got a message from rank {peer} (tag {tag}) that is longer than the {capacity} \
         bytes it allowed for: \
         do all ranks use the same sizes and options?"
    )]
    TooLong {
        /// The receiver.
        rank: usize,
        /// The sender.
        peer: usize,
        /// Tag of the message.
        tag: u32,
        /// What the receiver allowed for, in bytes.
        capacity: usize,
    },
    /// A wait without posted receives, which would never end.
    #[error("rank {rank} waits for a message but has posted no receive")]
    NothingPosted {
        /// The waiting rank.
        rank: usize,
    },
    /// The library that carries the messages reported a failure.
    #[error("rank {rank}: {call} failed: {reason}")]
    Transport {
        /// The rank on which it failed.
        rank: usize,
        /// The call that failed.
        call: String,
        /// The error text of the library.
        reason: String,
    },
    /// A rank's thread panicked ([`threads::run`](super::threads::run) only).
    #[error("rank {rank} panicked: {message}")]
    Panicked {
        /// The rank.
        rank: usize,
        /// The message of the panic.
        message: String,
    },
    /// The operating system gave no thread ([`threads::run`](super::threads::run) only).
    #[error("no thread for rank {rank}: {reason}: use fewer ranks")]
    NoThread {
        /// The rank.
        rank: usize,
        /// The error text of the system.
        reason: String,
    },
}

/// `rank 2`, or `ranks 0, 1`.
fn ranks(list: &[usize]) -> String {
    let numbers: Vec<String> = list.iter().map(ToString::to_string).collect();
    format!("{} {}", if list.len() == 1 { "rank" } else { "ranks" }, numbers.join(", "))
}
