//! What a frame cost on one rank, in IceT's columns.

/// Times and counts of one rank for one frame. Seconds are those of
/// [`Communicator::now`](crate::Communicator::now).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Finding active pixels and writing messages (IceT: compress).
    pub compress_secs: f64,
    /// Reading messages and joining pixels (IceT: blend).
    pub blend_secs: f64,
    /// Handing over and waiting for messages of the strategy, load imbalance included (IceT: send).
    pub exchange_secs: f64,
    /// Bringing the pieces to one rank: encoding them, placing them and waiting for them at the end
    /// (IceT: collect).
    pub collect_secs: f64,
    /// The whole frame.
    pub total_secs: f64,
    /// Messages sent, collecting included.
    pub messages_sent: u64,
    /// Bytes sent, collecting included.
    pub bytes_sent: u64,
    /// Bytes received, collecting included.
    pub bytes_received: u64,
    /// Depths of this rank's frame that were not a number and counted as background.
    pub nan_depths: u64,
    /// The strategy that was used, also where it was chosen automatically.
    pub strategy: crate::Strategy,
    /// Whether ranks of one machine merged the frame in shared memory instead of sending messages.
    pub in_memory: bool,
}

impl Report {
    /// The four columns together.
    pub(crate) fn counted_secs(&self) -> f64 {
        self.compress_secs + self.blend_secs + self.exchange_secs + self.collect_secs
    }
}
