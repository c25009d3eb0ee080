//! Costs of a frame on one rank, in IceT's columns.

/// Times and counts of one rank for one frame. Seconds are those of
/// [`Communicator::now`](crate::Communicator::now).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Finding active pixels and writing messages (IceT: compress).
    pub compress_secs: f64,
    /// Reading messages and merging pixels (IceT: blend).
    pub blend_secs: f64,
    /// Sending and waiting for messages of the strategy, load imbalance included (IceT: send).
    pub exchange_secs: f64,
    /// Collecting the pieces on one rank: encoding them, writing them into the image and waiting
    /// for the last ones (IceT: collect).
    pub collect_secs: f64,
    /// The whole frame.
    pub total_secs: f64,
    /// Messages sent, collecting included.
    pub messages_sent: u64,
    /// Bytes sent, collecting included.
    pub bytes_sent: u64,
    /// Bytes received, collecting included.
    pub bytes_received: u64,
    /// Depths of this rank's frame that were NaN and counted as background.
    pub nan_depths: u64,
    /// The strategy that was used, also where it was chosen automatically.
    pub strategy: crate::Strategy,
    /// Whether ranks of one machine merged the frame in shared memory instead of sending messages.
    pub in_memory: bool,
    /// Number of machines of which each merged its part in memory; messages went between these
    /// only, so none for 1. 0 where all ranks sent messages.
    pub machines: usize,
}

impl Report {
    /// Sum of the four columns.
    pub(crate) fn counted_secs(&self) -> f64 {
        self.compress_secs + self.blend_secs + self.exchange_secs + self.collect_secs
    }
}
