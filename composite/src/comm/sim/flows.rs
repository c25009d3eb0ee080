//! Messages that share the network interfaces: each has its fair share of both ends, from when it
//! is sent until its last byte has left.
//!
//! Fair means max-min: the smallest share is as large as possible. The end where shares are
//! smallest decides for all messages there, the others share what these leave elsewhere, and so on
//! (D. Bertsekas, R. Gallager, "Data Networks", 1992, section 6.5.2). Adapters that serve their
//! queues in turn behave like this, and SimGrid computes it. Interfaces that send one message after
//! the other would favour programs that cut images into slices: their first slices would arrive
//! first instead of all at about the same time.
use std::collections::BTreeMap;

struct Flow {
    number: u64,
    tag: u32,
    from: usize,
    to: usize,
    /// Seconds it would still take alone, at the time of the last change.
    left_secs: f64,
    /// Its share of an interface.
    rate: f64,
}

/// All messages in flight.
pub(super) struct Flows {
    ranks: usize,
    /// Time of the last change: a beginning or an end. Nothing is accumulated in between, so that
    /// times do not depend on when somebody asks.
    since_secs: f64,
    active: Vec<Flow>,
    /// End times of the messages that have ended.
    through_secs: BTreeMap<u64, f64>,
    /// Receivers of the messages that have ended since [`take_receivers`](Self::take_receivers).
    reached: Vec<usize>,
    next: u64,
}

impl Flows {
    pub(super) fn new(ranks: usize) -> Flows {
        Flows {
            ranks,
            since_secs: 0.0,
            active: Vec::new(),
            through_secs: BTreeMap::new(),
            reached: Vec::new(),
            next: 0,
        }
    }

    /// Begins a message that would take `secs` alone; messages that ended before must have been
    /// [`end`](Self::end_next)ed. Returns its number.
    pub(super) fn begin(
        &mut self,
        (from, to): (usize, usize),
        tag: u32,
        now_secs: f64,
        secs: f64,
    ) -> u64 {
        self.advance(now_secs);
        let number = self.next;
        self.next += 1;
        self.active.push(Flow { number, tag, from, to, left_secs: secs, rate: 0.0 });
        self.share();
        number
    }

    /// Ends the messages that end next, if that is not after `until_secs`. Returns whether there
    /// are any.
    pub(super) fn end_next(&mut self, until_secs: f64) -> bool {
        let ends = |flow: &Flow| self.since_secs + flow.left_secs / flow.rate;
        let Some(next_secs) = self.active.iter().map(ends).min_by(f64::total_cmp) else {
            return false;
        };
        if next_secs > until_secs {
            return false;
        }
        let ending = || self.active.iter().filter(|flow| ends(flow) <= next_secs);
        let through: Vec<u64> = ending().map(|flow| flow.number).collect();
        let reached: Vec<usize> = ending().map(|flow| flow.to).collect();
        self.reached.extend(reached);
        self.advance(next_secs);
        self.active.retain(|flow| !through.contains(&flow.number));
        self.through_secs.extend(through.into_iter().map(|number| (number, next_secs)));
        self.share();
        true
    }

    /// Receivers of messages whose time of arrival has changed since the last call: all messages in
    /// flight, because a beginning or an end changes the shares of the others, and those that have
    /// ended since.
    pub(super) fn take_receivers(&mut self) -> Vec<usize> {
        let mut receivers = std::mem::take(&mut self.reached);
        receivers.extend(self.active.iter().map(|flow| flow.to));
        receivers.sort_unstable();
        receivers.dedup();
        receivers
    }

    /// How many messages of a sender with this tag are in flight, and the end time of the first of
    /// them, as far as is known.
    pub(super) fn leaving(&self, from: usize, tag: u32) -> (usize, f64) {
        let own = self.active.iter().filter(|flow| (flow.from, flow.tag) == (from, tag));
        own.fold((0, f64::INFINITY), |(count, first), flow| {
            (count + 1, first.min(self.since_secs + flow.left_secs / flow.rate))
        })
    }

    /// The end time of a message, as far as is known.
    pub(super) fn end_secs(&self, number: u64) -> f64 {
        if let Some(secs) = self.through_secs.get(&number) {
            return *secs;
        }
        let flow = self.active.iter().find(|flow| flow.number == number);
        flow.map_or(f64::INFINITY, |flow| self.since_secs + flow.left_secs / flow.rate)
    }

    /// Forgets a message whose end time will not be needed again.
    pub(super) fn forget(&mut self, number: u64) {
        self.through_secs.remove(&number);
    }

    fn advance(&mut self, now_secs: f64) {
        let passed_secs = (now_secs - self.since_secs).max(0.0);
        for flow in &mut self.active {
            flow.left_secs = (flow.left_secs - passed_secs * flow.rate).max(0.0);
        }
        self.since_secs = self.since_secs.max(now_secs);
    }

    /// Computes the share of every message.
    fn share(&mut self) {
        let ranks = self.ranks;
        // Ends of senders, then of receivers: the remaining capacity of each, and for how many
        // messages.
        let mut left = vec![1.0_f64; 2 * ranks];
        let mut count = vec![0_usize; 2 * ranks];
        for flow in &self.active {
            count[flow.from] += 1;
            count[ranks + flow.to] += 1;
        }
        let mut open: Vec<usize> = (0..self.active.len()).collect();
        let mut tight = vec![false; 2 * ranks];
        while !open.is_empty() {
            let part = |end: usize| left[end].max(0.0) / count[end] as f64;
            let ends = (0..2 * ranks).filter(|&end| count[end] > 0);
            let smallest = ends.clone().map(part).fold(f64::INFINITY, f64::min);
            tight.fill(false);
            // Equal except for rounding.
            ends.for_each(|end| tight[end] = part(end) <= smallest * (1.0 + 1e-12));
            let active = &mut self.active;
            open.retain(|&index| {
                let flow = &mut active[index];
                let ends = [flow.from, ranks + flow.to];
                let is_fixed = ends.iter().any(|&end| tight[end]);
                if is_fixed {
                    // Never zero, whatever rounding has left.
                    flow.rate = smallest.max(1e-9);
                    for end in ends {
                        left[end] -= smallest;
                        count[end] -= 1;
                    }
                }
                !is_fixed
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends_of(messages: &[(usize, usize, f64, f64)]) -> Vec<f64> {
        let mut flows = Flows::new(4);
        let numbers: Vec<u64> = messages
            .iter()
            .map(|&(from, to, now, secs)| {
                while flows.end_next(now) {}
                flows.begin((from, to), 0, now, secs)
            })
            .collect();
        while flows.end_next(f64::INFINITY) {}
        numbers.into_iter().map(|number| flows.end_secs(number)).collect()
    }

    #[test]
    fn messages_share_the_end_where_they_meet() {
        assert_eq!(ends_of(&[(0, 1, 5.0, 4.0)]), [9.0], "alone");
        assert_eq!(ends_of(&[(0, 1, 0.0, 4.0), (0, 2, 0.0, 4.0)]), [8.0, 8.0], "one sender");
        assert_eq!(ends_of(&[(0, 2, 0.0, 4.0), (1, 2, 0.0, 4.0)]), [8.0, 8.0], "one receiver");
        assert_eq!(ends_of(&[(0, 1, 0.0, 4.0), (1, 0, 0.0, 4.0)]), [4.0, 4.0], "both ways at once");
    }

    #[test]
    fn what_one_message_leaves_the_others_take() {
        // Half of the time alone, then two at half speed until the first is through, then alone
        // again.
        assert_eq!(ends_of(&[(0, 1, 0.0, 4.0), (0, 2, 2.0, 4.0)]), [6.0, 8.0]);
        // Three go to rank 3; the sender of the first has another message, which gets the two
        // thirds that are left.
        let ends =
            ends_of(&[(0, 3, 0.0, 1.0), (1, 3, 0.0, 1.0), (2, 3, 0.0, 1.0), (0, 1, 0.0, 1.0)]);
        for (end, expected) in ends.iter().zip([3.0, 3.0, 3.0, 1.5]) {
            assert!((end - expected).abs() < 1e-9, "{ends:?}");
        }
    }
}
