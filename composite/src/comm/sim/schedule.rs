//! The scheduler: what has the lowest virtual time is done first, so that every message finds the
//! network as it would be at that time.
//!
//! Ranks are threads. Between two calls a rank computes, and a few ranks may do so at once because
//! they cannot affect each other. A call takes effect when no other rank can do anything earlier; a
//! computing rank counts with the time at which it began.
use super::flows::Flows;
use super::network::Network;
use std::collections::VecDeque;

/// When a message arrives.
#[derive(Clone, Copy)]
pub(super) enum Delivery {
    /// At this time: it is too short to delay other messages.
    Until(f64),
    /// With the last byte of this flow, and the latency after it.
    With(u64, f64),
}

/// A message that is in flight or has arrived.
pub(super) struct QueuedMessage {
    pub(super) tag: u32,
    pub(super) delivery: Delivery,
    pub(super) message: Vec<u8>,
}

/// What a waiting rank accepts: the `index`-th message from `source` with `tag`.
#[derive(Clone, Copy, Debug)]
pub(super) struct PostedReceive {
    pub(super) source: usize,
    pub(super) tag: u32,
    pub(super) index: usize,
}

/// What a rank is doing.
#[derive(Debug)]
pub(super) enum State {
    /// Between two calls, on its thread.
    Computing,
    /// Waits for a core to compute.
    Ready,
    /// In a call that takes effect at its clock.
    Acting,
    /// In a call that takes effect when one of these has arrived, or at the deadline: at
    /// `earliest_secs`, as far as is known.
    Waiting { wanted: Vec<PostedReceive>, deadline_secs: f64, earliest_secs: f64 },
    /// Its call may take effect.
    Granted,
    /// It has left.
    Gone,
}

pub(super) struct Rank {
    pub(super) clock_secs: f64,
    /// When it last sent anything or called `alive`.
    pub(super) heartbeat_secs: f64,
    pub(super) state: State,
    /// By sender.
    pub(super) mail: Vec<VecDeque<QueuedMessage>>,
}

pub(super) struct Schedule {
    pub(super) ranks: Vec<Rank>,
    pub(super) flows: Flows,
    pub(super) network: Network,
    pub(super) aborted: Option<(usize, String)>,
    cores: usize,
}

impl Schedule {
    pub(super) fn new(size: usize, network: Network, cores: usize) -> Schedule {
        let rank = || Rank {
            clock_secs: 0.0,
            heartbeat_secs: 0.0,
            state: State::Ready,
            mail: (0..size).map(|_| VecDeque::new()).collect(),
        };
        Schedule {
            ranks: (0..size).map(|_| rank()).collect(),
            flows: Flows::new(size),
            network,
            aborted: None,
            cores: cores.max(1),
        }
    }

    /// The message that a rank waits for, if it has been sent.
    pub(super) fn find(&self, rank: usize, wanted: &PostedReceive) -> Option<(usize, f64)> {
        let mail = self.ranks[rank].mail[wanted.source].iter().enumerate();
        let (at, mail) = mail.filter(|(_, m)| m.tag == wanted.tag).nth(wanted.index)?;
        let arrival_secs = match mail.delivery {
            Delivery::Until(secs) => secs,
            Delivery::With(flow, latency_secs) => self.flows.end_secs(flow) + latency_secs,
        };
        Some((at, arrival_secs))
    }

    /// Sends `message` at the time of the rank's clock; from then on it shares the interfaces.
    pub(super) fn send(&mut self, from: usize, to: usize, tag: u32, message: Vec<u8>) {
        let now_secs = self.ranks[from].clock_secs;
        let Network { gap_secs, byte_secs, .. } = self.network;
        let (latency_factor, byte_factor) = self.network.factors(message.len());
        let latency_secs = self.network.latency_secs * latency_factor;
        let busy_secs = message.len() as f64 * byte_secs * byte_factor;
        let delivery = if from == to {
            Delivery::Until(now_secs)
        } else if busy_secs <= gap_secs {
            Delivery::Until(now_secs + gap_secs + latency_secs)
        } else {
            while self.flows.end_next(now_secs) {}
            Delivery::With(self.flows.begin((from, to), tag, now_secs, busy_secs), latency_secs)
        };
        self.ranks[to].mail[from].push_back(QueuedMessage { tag, delivery, message });
        self.reevaluate(to);
        // Messages in flight may have become slower.
        self.reevaluate_receivers();
    }

    /// Takes a message out of its queue.
    pub(super) fn take(&mut self, rank: usize, source: usize, at: usize) -> Vec<u8> {
        let Some(mail) = self.ranks[rank].mail[source].remove(at) else { return Vec::new() };
        if let Delivery::With(flow, _) = mail.delivery {
            self.flows.forget(flow);
        }
        mail.message
    }

    /// Updates the receivers of messages whose share has changed; nobody else is affected.
    /// (Updating all ranks took three quarters of all computing at 128 ranks.)
    fn reevaluate_receivers(&mut self) {
        for rank in self.flows.take_receivers() {
            self.reevaluate(rank);
        }
    }

    /// Whether a message that a rank waits for will never arrive.
    pub(super) fn is_lost(&self, rank: usize, wanted: &PostedReceive) -> bool {
        matches!(self.ranks[wanted.source].state, State::Gone) && self.find(rank, wanted).is_none()
    }

    /// Makes a rank wait.
    pub(super) fn wait(&mut self, rank: usize, wanted: Vec<PostedReceive>, deadline_secs: f64) {
        self.ranks[rank].state =
            State::Waiting { wanted, deadline_secs, earliest_secs: deadline_secs };
        self.reevaluate(rank);
    }

    /// Call this when something has changed for a rank that may wait: a message was sent to it, or
    /// another rank has left.
    pub(super) fn reevaluate(&mut self, rank: usize) {
        let r = &self.ranks[rank];
        let State::Waiting { wanted, deadline_secs, .. } = &r.state else { return };
        let time = if wanted.iter().any(|w| self.is_lost(rank, w)) {
            r.clock_secs
        } else {
            let arrivals = wanted.iter().filter_map(|w| self.find(rank, w));
            arrivals.map(|(_, arrival)| arrival).fold(*deadline_secs, f64::min).max(r.clock_secs)
        };
        if let State::Waiting { earliest_secs, .. } = &mut self.ranks[rank].state {
            *earliest_secs = time;
        }
    }

    /// The earliest time at which a rank can do something that affects others.
    fn earliest_secs(&self, rank: usize) -> f64 {
        match &self.ranks[rank].state {
            State::Gone => f64::INFINITY,
            State::Waiting { earliest_secs, .. } => *earliest_secs,
            _ => self.ranks[rank].clock_secs,
        }
    }

    /// Lets ranks continue that may; calls `wake` for each of them.
    pub(super) fn dispatch(&mut self, mut wake: impl FnMut(usize)) {
        let computing = self.ranks.iter().filter(|r| matches!(r.state, State::Computing)).count();
        let mut free = self.cores.saturating_sub(computing);
        while free > 0 {
            let ready =
                (0..self.ranks.len()).filter(|&r| matches!(self.ranks[r].state, State::Ready));
            let first = ready
                .min_by(|&a, &b| self.ranks[a].clock_secs.total_cmp(&self.ranks[b].clock_secs));
            let Some(rank) = first else { break };
            self.ranks[rank].state = State::Computing;
            wake(rank);
            free -= 1;
        }
        let next = loop {
            let times = (0..self.ranks.len()).map(|r| (self.earliest_secs(r), r));
            let next = times.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // A message that ends leaves its share to others, which then arrive earlier than was
            // known.
            let until_secs = next.map_or(0.0, |next| next.0);
            if !until_secs.is_finite() || !self.flows.end_next(until_secs) {
                break next;
            }
            self.reevaluate_receivers();
        };
        if let Some((_, rank)) = next
            && matches!(self.ranks[rank].state, State::Acting | State::Waiting { .. })
        {
            wake(rank);
            // The call of a waiting rank keeps its own list of receives.
            self.ranks[rank].state = State::Granted;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The times that ranks wait for, as they are known and as all of them would find them if they
    /// looked now.
    fn known_and_found(schedule: &mut Schedule) -> [Vec<f64>; 2] {
        let times = |s: &Schedule| (0..s.ranks.len()).map(|rank| s.earliest_secs(rank)).collect();
        let known = times(schedule);
        (0..schedule.ranks.len()).for_each(|rank| schedule.reevaluate(rank));
        [known, times(schedule)]
    }

    #[test]
    fn ranks_that_do_not_look_again_would_have_found_nothing_new() {
        const RANKS: usize = 7;
        let mut schedule = Schedule::new(RANKS, Network::QDR, RANKS);
        let mut bits = 1_u64;
        let mut random = |below: usize| {
            bits = bits
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (bits >> 33) as usize % below
        };
        // Every rank but the first waits for the oldest message of each of the others.
        for rank in 1..RANKS {
            let wanted =
                (0..RANKS).map(|source| PostedReceive { source, tag: 3, index: 0 }).collect();
            schedule.wait(rank, wanted, 1.0 + rank as f64);
        }
        let mut now_secs = 0.0;
        for _ in 0..2000 {
            now_secs += random(1000) as f64 * 1e-9;
            let (from, to) = (random(RANKS), random(RANKS));
            schedule.ranks[from].clock_secs = now_secs;
            // A sender is not waiting. A rank that waits here has another clock now.
            schedule.reevaluate(from);
            // Some are too short to share an interface, some long enough to overlap many others
            // there.
            let message = vec![0; [8, 4096, 65_536][random(3)]];
            schedule.send(from, to, 3, message);
            let [known, found] = known_and_found(&mut schedule);
            assert_eq!(known, found);
            if random(4) == 0 {
                schedule.dispatch(|_| {});
                for rank in 1..RANKS {
                    if matches!(schedule.ranks[rank].state, State::Granted) {
                        for source in 0..RANKS {
                            if !schedule.ranks[rank].mail[source].is_empty() {
                                schedule.take(rank, source, 0);
                            }
                        }
                        let wanted = (0..RANKS)
                            .map(|source| PostedReceive { source, tag: 3, index: 0 })
                            .collect();
                        schedule.wait(rank, wanted, now_secs + 1.0);
                    }
                }
                let [known, found] = known_and_found(&mut schedule);
                assert_eq!(known, found);
            }
        }
    }
}
