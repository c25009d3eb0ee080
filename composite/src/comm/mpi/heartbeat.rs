//! Signs of life: a rank that waits long for another asks whether it is at work, and counts its
//! timeout from the last answer.
//!
//! A rank counts its steps: messages it sent, messages it received, and calls of
//! [`alive`](crate::Communicator::alive). When asked, it answers with its count if that has grown
//! since its last answer to the same rank. A rank that itself waits makes no steps, but forwards
//! the signs of those it waits for. Each count of each rank counts once, so two ranks that wait for
//! each other do not keep each other alive. Nothing is sent until a rank has waited for a quarter
//! of its timeout.
use std::time::{Duration, Instant};

/// Requests per timeout.
const REQUESTS_PER_TIMEOUT: u32 = 4;

/// The steps of a rank, as far as known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Heartbeat {
    /// The rank that made the steps.
    pub(super) origin: usize,
    pub(super) steps: u64,
}

/// What this rank knows of signs of life.
pub(super) struct Heartbeats {
    rank: usize,
    steps: u64,
    /// By rank, the most steps it is known to have made; new ones are signs of life.
    newest: Vec<u64>,
    /// Ranks that have requested a sign of this one.
    requesters: Vec<usize>,
    /// By rank, the own steps that have been reported to it.
    reported_steps: Vec<u64>,
    /// Signs that have arrived, with their sender.
    unread: Vec<(usize, Heartbeat)>,
}

impl Heartbeats {
    pub(super) fn new(rank: usize, size: usize) -> Self {
        Self {
            rank,
            steps: 0,
            newest: vec![0; size],
            requesters: Vec::new(),
            reported_steps: vec![0; size],
            unread: Vec::new(),
        }
    }

    /// Counts a step of this rank.
    pub(super) fn step(&mut self) {
        self.steps += 1;
    }

    pub(super) fn requested_by(&mut self, rank: usize) {
        if rank < self.reported_steps.len() && !self.requesters.contains(&rank) {
            self.requesters.push(rank);
        }
    }

    pub(super) fn record(&mut self, from: usize, heartbeat: Heartbeat) {
        if heartbeat.origin < self.newest.len() && heartbeat.origin != self.rank {
            self.unread.push((from, heartbeat));
        }
    }

    /// Signs of this rank's own steps, for requesters that do not know of them.
    pub(super) fn take_replies(&mut self) -> Vec<(usize, Heartbeat)> {
        let heartbeat = Heartbeat { origin: self.rank, steps: self.steps };
        let reported_steps = &mut self.reported_steps;
        let mut out = Vec::new();
        self.requesters.retain(|&requester| {
            if reported_steps[requester] == heartbeat.steps {
                return true;
            }
            reported_steps[requester] = heartbeat.steps;
            out.push((requester, heartbeat));
            false
        });
        out
    }

    /// Checks the signs that have arrived. Returns whether any is a new sign of a rank that is
    /// waited for, and those signs, to be forwarded to the ranks that wait for this one.
    pub(super) fn take_new(
        &mut self,
        waited_for: impl Fn(usize) -> bool,
    ) -> (bool, Vec<(usize, Heartbeat)>) {
        let mut new = Vec::new();
        for (from, heartbeat) in std::mem::take(&mut self.unread) {
            if waited_for(from) && heartbeat.steps > self.newest[heartbeat.origin] {
                self.newest[heartbeat.origin] = heartbeat.steps;
                new.push(heartbeat);
            }
        }
        if new.is_empty() {
            return (false, Vec::new());
        }
        let requesters = std::mem::take(&mut self.requesters);
        let to_all = |heartbeat: &Heartbeat| {
            let heartbeat = *heartbeat;
            requesters
                .iter()
                .filter(move |&&requester| requester != heartbeat.origin)
                .map(move |&requester| (requester, heartbeat))
        };
        (true, new.iter().flat_map(to_all).collect())
    }
}

/// The timeout of a wait.
pub(super) struct HeartbeatTimeout {
    timeout: Duration,
    /// When the wait began or the last sign of life arrived.
    since: Instant,
    asked: Instant,
}

impl HeartbeatTimeout {
    pub(super) fn new(timeout: Duration, begin: Instant) -> Self {
        Self { timeout, since: begin, asked: begin }
    }

    pub(super) fn is_over(&self, now: Instant) -> bool {
        now.duration_since(self.since) >= self.timeout
    }

    /// Whether the ranks that are waited for are to be asked now.
    pub(super) fn is_request_due(&mut self, now: Instant) -> bool {
        let asks = now.duration_since(self.asked) >= self.timeout / REQUESTS_PER_TIMEOUT;
        if asks {
            self.asked = now;
        }
        asks
    }

    pub(super) fn renew(&mut self, now: Instant) {
        self.since = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rank_that_asked_is_notified_of_new_steps_once() {
        let mut heartbeats = Heartbeats::new(2, 3);
        heartbeats.requested_by(0);
        heartbeats.requested_by(0);
        assert_eq!(heartbeats.take_replies(), []);
        heartbeats.step();
        assert_eq!(heartbeats.take_replies(), [(0, Heartbeat { origin: 2, steps: 1 })]);
        heartbeats.step();
        assert_eq!(heartbeats.take_replies(), [], "nobody has asked again");
        heartbeats.requested_by(1);
        heartbeats.requested_by(7);
        assert_eq!(heartbeats.take_replies(), [(1, Heartbeat { origin: 2, steps: 2 })]);
    }

    #[test]
    fn who_waits_hands_on_each_sign_once_so_that_a_ring_of_waiting_ranks_falls_silent() {
        // Rank 0 waits for 1, which waits for 2 and 0; 2 is at work, and then no longer.
        let mut heartbeats = [Heartbeats::new(0, 3), Heartbeats::new(1, 3), Heartbeats::new(2, 3)];
        heartbeats[2].step();
        heartbeats[2].requested_by(1);
        heartbeats[1].requested_by(0);
        heartbeats[0].requested_by(1);
        let [(to, heartbeat)] = heartbeats[2].take_replies()[..] else { panic!("one sign") };
        heartbeats[to].record(2, heartbeat);
        assert_eq!(heartbeats[1].take_new(|from| from != 1), (true, vec![(0, heartbeat)]));
        heartbeats[0].record(1, heartbeat);
        assert_eq!(heartbeats[0].take_new(|from| from == 1), (true, vec![(1, heartbeat)]));
        heartbeats[0].requested_by(1);
        heartbeats[1].requested_by(0);
        heartbeats[1].record(0, heartbeat);
        assert_eq!(heartbeats[1].take_new(|from| from != 1), (false, vec![]));
        assert!(heartbeats.iter_mut().all(|heartbeats| heartbeats.take_replies().is_empty()));
    }

    #[test]
    fn patience_counts_from_the_last_sign_and_asks_a_few_times() {
        let begin = Instant::now();
        let at = |secs| begin + Duration::from_secs(secs);
        let mut patience = HeartbeatTimeout::new(Duration::from_secs(8), begin);
        let asked: Vec<u64> = (0..8).filter(|&secs| patience.is_request_due(at(secs))).collect();
        assert_eq!(asked, [2, 4, 6]);
        assert!(!patience.is_over(at(7)) && patience.is_over(at(8)));
        patience.renew(at(7));
        assert!(!patience.is_over(at(14)) && patience.is_over(at(15)));
    }
}
