//! A group of the first ranks of a group, so that one launch checks several numbers of ranks; and a
//! rank whose messages are damaged, for tests.
use crate::comm::{
    Arrival, CommError, Communicator, FIRST_RESERVED_TAG, Receive, SharedSegments, collective,
};
use std::time::Duration;

/// The first `size` ranks of a group.
pub(super) struct FirstRanks<'a> {
    inner: &'a mut dyn Communicator,
    size: usize,
    /// Whether this rank's next message with pixels gets a wrong bit.
    damage: bool,
}

impl<'a> FirstRanks<'a> {
    /// The first `size` ranks of `inner`; `None` on the other ranks.
    pub(super) fn new(inner: &'a mut dyn Communicator, size: usize) -> Option<Self> {
        (inner.rank() < size && size <= inner.size()).then_some(Self { inner, size, damage: false })
    }

    /// All ranks; this one's first message with pixels arrives with a wrong bit.
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

    fn working_secs(&self) -> f64 {
        self.inner.working_secs()
    }

    // Plans depend on it: ranks that are wrapped and ranks that are not must agree.
    fn is_one_node(&self) -> bool {
        self.inner.is_one_node()
    }

    fn root_cause(&mut self, error: CommError) -> CommError {
        self.inner.root_cause(error)
    }

    fn shared_segments(&mut self) -> Option<&mut dyn SharedSegments> {
        if self.size == self.inner.size() { self.inner.shared_segments() } else { None }
    }

    fn machines_with_shared_memory(&self) -> Option<&[usize]> {
        if self.size == self.inner.size() { self.inner.machines_with_shared_memory() } else { None }
    }

    fn machine_barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        if self.size == self.inner.size() {
            return self.inner.machine_barrier(timeout);
        }
        self.barrier(timeout)
    }

    fn send(
        &mut self,
        destination: usize,
        tag: u32,
        mut message: Vec<u8>,
    ) -> Result<(), CommError> {
        if self.damage
            && tag < FIRST_RESERVED_TAG
            && let Some(last) = message.last_mut()
        {
            *last ^= 16;
            self.damage = false;
        }
        self.inner.send(destination, tag, message)
    }

    fn post_recv(
        &mut self,
        source: usize,
        tag: u32,
        capacity: usize,
    ) -> Result<Receive, CommError> {
        self.inner.post_recv(source, tag, capacity)
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        self.inner.wait_any(posted, timeout)
    }

    // All ranks must take the same path: a whole group uses the barrier of its transport.
    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        if self.size == self.inner.size() {
            return self.inner.barrier(timeout);
        }
        collective::barrier(self, timeout)
    }

    fn all_gather(
        &mut self,
        mine: &[u8],
        longest: usize,
        timeout: Duration,
    ) -> Result<Vec<Vec<u8>>, CommError> {
        if self.size == self.inner.size() {
            return self.inner.all_gather(mine, longest, timeout);
        }
        collective::all_gather(self, mine, longest, timeout)
    }

    fn alive(&mut self) -> Result<(), CommError> {
        self.inner.alive()
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
