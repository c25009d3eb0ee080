//! The first ranks of a group as a group of their own, so that one launch checks several numbers of ranks; and a rank whose messages
//! are damaged, for tests.
use crate::comm::{Arrival, CommError, Communicator, FIRST_RESERVED_TAG, Receive};
use std::time::Duration;

/// The first `size` ranks of a group.
pub(super) struct FirstRanks<'a> {
    inner: &'a mut dyn Communicator,
    size: usize,
    /// Whether this rank's next message of pixels gets a wrong bit.
    damage: bool,
}

impl<'a> FirstRanks<'a> {
    /// The first `size` ranks of `inner`; `None` for a rank that is none of them.
    pub(super) fn new(inner: &'a mut dyn Communicator, size: usize) -> Option<Self> {
        (inner.rank() < size && size <= inner.size()).then_some(Self { inner, size, damage: false })
    }

    /// All ranks; this one's first message of pixels arrives with a wrong bit.
    pub(super) fn damaged(inner: &'a mut dyn Communicator) -> Self {
        let size = inner.size();
        Self { inner, size, damage: true }
    }
}

impl Communicator for FirstRanks<'_> {
    fn rank(&self) -> usize {
        self.inner.rank()
    }

    fn size(&self) -> usize {
        self.size
    }

    fn now(&self) -> f64 {
        self.inner.now()
    }

    fn send(&mut self, destination: usize, tag: u32, mut message: Vec<u8>) -> Result<(), CommError> {
        if self.damage
            && tag < FIRST_RESERVED_TAG
            && let Some(last) = message.last_mut()
        {
            *last ^= 16;
            self.damage = false;
        }
        self.inner.send(destination, tag, message)
    }

    fn post_recv(&mut self, source: usize, tag: u32, capacity: usize) -> Result<Receive, CommError> {
        self.inner.post_recv(source, tag, capacity)
    }

    fn wait_any(&mut self, posted: &mut Vec<Receive>, timeout: Duration) -> Result<Arrival, CommError> {
        self.inner.wait_any(posted, timeout)
    }

    fn abort(&mut self, reason: &str) {
        self.inner.abort(reason);
    }

    fn buffer(&mut self, capacity: usize) -> Vec<u8> {
        self.inner.buffer(capacity)
    }

    fn recycle(&mut self, buffer: Vec<u8>) {
        self.inner.recycle(buffer);
    }
}
