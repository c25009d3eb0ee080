//! Signs of life: whoever waits long for a rank asks whether it is at work, and counts its timeout from the last answer.
//!
//! A rank counts its steps: messages it sent, messages it got, and calls of [`alive`](crate::Communicator::alive). Asked, it tells
//! its count if it has grown since it last told that rank. A rank that itself waits makes no steps, but hands on what it hears from
//! those it waits for; each count of each rank counts once, so two ranks that wait for each other do not keep each other alive.
//! Nothing is sent unless somebody waits for a quarter of its timeout.
use std::time::{Duration, Instant};

/// Asks in a timeout.
const ASKS: u32 = 4;

/// The steps of a rank, as far as is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sign {
    /// Whose steps.
    pub(super) origin: usize,
    pub(super) steps: u64,
}

/// What is known of signs on this rank.
pub(super) struct Signs {
    rank: usize,
    steps: u64,
    /// Of each rank the most steps it is known to have made; new ones are signs of life.
    newest: Vec<u64>,
    /// Ranks that want a sign of this one.
    askers: Vec<usize>,
    /// Own steps that each rank has been told of.
    told: Vec<u64>,
    /// Signs that have come, with the rank that gave them.
    came: Vec<(usize, Sign)>,
}

impl Signs {
    pub(super) fn new(rank: usize, size: usize) -> Self {
        Self {
            rank,
            steps: 0,
            newest: vec![0; size],
            askers: Vec::new(),
            told: vec![0; size],
            came: Vec::new(),
        }
    }

    /// This rank has done something.
    pub(super) fn step(&mut self) {
        self.steps += 1;
    }

    pub(super) fn asked_by(&mut self, rank: usize) {
        if rank < self.told.len() && !self.askers.contains(&rank) {
            self.askers.push(rank);
        }
    }

    pub(super) fn heard(&mut self, from: usize, sign: Sign) {
        if sign.origin < self.newest.len() && sign.origin != self.rank {
            self.came.push((from, sign));
        }
    }

    /// Signs of this rank's own steps, for those who asked and do not know of them.
    pub(super) fn own(&mut self) -> Vec<(usize, Sign)> {
        let sign = Sign { origin: self.rank, steps: self.steps };
        let told = &mut self.told;
        let mut out = Vec::new();
        self.askers.retain(|&asker| {
            if told[asker] == sign.steps {
                return true;
            }
            told[asker] = sign.steps;
            out.push((asker, sign));
            false
        });
        out
    }

    /// Of what has come, whether anything is a new sign of one of those waited for; and those signs, for the ranks that wait for this
    /// one.
    pub(super) fn of(&mut self, waited_for: impl Fn(usize) -> bool) -> (bool, Vec<(usize, Sign)>) {
        let mut new = Vec::new();
        for (from, sign) in std::mem::take(&mut self.came) {
            if waited_for(from) && sign.steps > self.newest[sign.origin] {
                self.newest[sign.origin] = sign.steps;
                new.push(sign);
            }
        }
        if new.is_empty() {
            return (false, Vec::new());
        }
        let askers = std::mem::take(&mut self.askers);
        let to_all = |sign: &Sign| {
            let sign = *sign;
            askers.iter().filter(move |&&asker| asker != sign.origin).map(move |&asker| (asker, sign))
        };
        (true, new.iter().flat_map(to_all).collect())
    }
}

/// How long a rank goes on waiting.
pub(super) struct Patience {
    timeout: Duration,
    /// When the wait began or a sign of life came.
    since: Instant,
    asked: Instant,
}

impl Patience {
    pub(super) fn new(timeout: Duration, begin: Instant) -> Self {
        Self { timeout, since: begin, asked: begin }
    }

    pub(super) fn is_over(&self, now: Instant) -> bool {
        now.duration_since(self.since) >= self.timeout
    }

    /// Whether those waited for are to be asked now.
    pub(super) fn asks(&mut self, now: Instant) -> bool {
        let asks = now.duration_since(self.asked) >= self.timeout / ASKS;
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
    fn a_rank_that_asked_is_told_of_new_steps_once() {
        let mut signs = Signs::new(2, 3);
        signs.asked_by(0);
        signs.asked_by(0);
        assert_eq!(signs.own(), []);
        signs.step();
        assert_eq!(signs.own(), [(0, Sign { origin: 2, steps: 1 })]);
        signs.step();
        assert_eq!(signs.own(), [], "nobody has asked again");
        signs.asked_by(1);
        signs.asked_by(7);
        assert_eq!(signs.own(), [(1, Sign { origin: 2, steps: 2 })]);
    }

    #[test]
    fn who_waits_hands_on_each_sign_once_so_that_a_ring_of_waiting_ranks_falls_silent() {
        // Rank 0 waits for 1, which waits for 2 and 0; 2 is at work, and then no more.
        let mut signs = [Signs::new(0, 3), Signs::new(1, 3), Signs::new(2, 3)];
        signs[2].step();
        signs[2].asked_by(1);
        signs[1].asked_by(0);
        signs[0].asked_by(1);
        let [(to, sign)] = signs[2].own()[..] else { panic!("one sign") };
        signs[to].heard(2, sign);
        assert_eq!(signs[1].of(|from| from != 1), (true, vec![(0, sign)]));
        signs[0].heard(1, sign);
        assert_eq!(signs[0].of(|from| from == 1), (true, vec![(1, sign)]));
        signs[0].asked_by(1);
        signs[1].asked_by(0);
        signs[1].heard(0, sign);
        assert_eq!(signs[1].of(|from| from != 1), (false, vec![]));
        assert!(signs.iter_mut().all(|signs| signs.own().is_empty()));
    }

    #[test]
    fn patience_counts_from_the_last_sign_and_asks_a_few_times() {
        let begin = Instant::now();
        let at = |secs| begin + Duration::from_secs(secs);
        let mut patience = Patience::new(Duration::from_secs(8), begin);
        let asked: Vec<u64> = (0..8).filter(|&secs| patience.asks(at(secs))).collect();
        assert_eq!(asked, [2, 4, 6]);
        assert!(!patience.is_over(at(7)) && patience.is_over(at(8)));
        patience.renew(at(7));
        assert!(!patience.is_over(at(14)) && patience.is_over(at(15)));
    }
}
