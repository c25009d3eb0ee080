//! A rank whose messages are changed on their way: what tests of faults share.
//!
//! Tests that must end in the same way on a busy machine use simulated ranks with
//! [`sim::Compute::Given`](composite::comm::sim::Compute): their timeouts pass in virtual time, and
//! messages come in the same order in every run.
use composite::comm::{Arrival, Receive};
use composite::{CommError, Communicator};
use std::time::Duration;

/// What is about to be sent, with its number among those of its kind, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outgoing {
    /// A message to one rank.
    Message(usize),
    /// A contribution to an all-gather.
    Gathered(usize),
}

/// Calls `meddle` with all that this rank sends, but for collective calls of the transport itself.
/// What it returns false for is not sent. The ranks do not say that they are on one machine, so
/// they send what ranks of several machines send.
pub(crate) struct Meddling<C, F> {
    inner: C,
    meddle: F,
    messages: usize,
    gathered: usize,
    /// Bytes of the receives and buffers that this rank has asked for.
    #[allow(dead_code, reason = "some tests do not count memory")]
    pub(crate) requested_bytes: usize,
}

impl<C: Communicator, F: FnMut(Outgoing, &mut Vec<u8>) -> bool> Meddling<C, F> {
    pub(crate) fn new(inner: C, meddle: F) -> Self {
        Self { inner, meddle, messages: 0, gathered: 0, requested_bytes: 0 }
    }
}

impl<C: Communicator, F: FnMut(Outgoing, &mut Vec<u8>) -> bool> Communicator for Meddling<C, F> {
    fn rank(&self) -> usize {
        self.inner.rank()
    }

    fn size(&self) -> usize {
        self.inner.size()
    }

    fn now(&self) -> f64 {
        self.inner.now()
    }

    fn working_secs(&self) -> f64 {
        self.inner.working_secs()
    }

    fn send(&mut self, to: usize, tag: u32, mut message: Vec<u8>) -> Result<(), CommError> {
        if tag < composite::comm::FIRST_RESERVED_TAG {
            self.messages += 1;
            if !(self.meddle)(Outgoing::Message(self.messages - 1), &mut message) {
                return Ok(());
            }
        }
        self.inner.send(to, tag, message)
    }

    fn post_recv(&mut self, from: usize, tag: u32, capacity: usize) -> Result<Receive, CommError> {
        self.requested_bytes = self.requested_bytes.saturating_add(capacity);
        self.inner.post_recv(from, tag, capacity)
    }

    fn test_any(&mut self, posted: &mut Vec<Receive>) -> Result<Option<Arrival>, CommError> {
        self.inner.test_any(posted)
    }

    fn wait_any(
        &mut self,
        posted: &mut Vec<Receive>,
        timeout: Duration,
    ) -> Result<Arrival, CommError> {
        self.inner.wait_any(posted, timeout)
    }

    fn barrier(&mut self, timeout: Duration) -> Result<(), CommError> {
        self.inner.barrier(timeout)
    }

    fn all_gather(
        &mut self,
        mine: &[u8],
        longest: usize,
        timeout: Duration,
    ) -> Result<Vec<Vec<u8>>, CommError> {
        let mut message = mine.to_vec();
        self.gathered += 1;
        (self.meddle)(Outgoing::Gathered(self.gathered - 1), &mut message);
        self.inner.all_gather(&message, longest, timeout)
    }

    fn alive(&mut self) -> Result<(), CommError> {
        self.inner.alive()
    }

    fn throttle_sends(&mut self, tag: u32, most: usize, patience: Duration) {
        self.inner.throttle_sends(tag, most, patience);
    }

    fn root_cause(&mut self, error: CommError) -> CommError {
        self.inner.root_cause(error)
    }

    fn abort(&mut self, reason: &str) {
        self.inner.abort(reason);
    }

    fn buffer(&mut self, capacity: usize) -> Vec<u8> {
        self.requested_bytes = self.requested_bytes.saturating_add(capacity);
        self.inner.buffer(capacity)
    }

    fn recycle(&mut self, buffer: Vec<u8>) {
        self.inner.recycle(buffer);
    }
}
