//! Chooses how packets are traced, by the time that earlier packets took.
//!
//! Nothing that can be counted before a packet is traced predicts which way is fastest. Bounds on
//! its rays fit tiles of pixels on large triangles, per-ray tests fit rays that diverge, and where
//! triangles are smaller than pixels the rays do best alone. With rules on counts (the share of
//! rays that a box keeps), tiles of a terrain took 1.7 times as long as they need, and rays from a
//! light 2.2 times. So now and then a packet is traced in another way, and its time is compared
//! with its neighbours'. Results do not depend on it: every way gives the same bits.

use super::SlabCounts;
use std::time::Instant;

/// A way to trace a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Strategy {
    /// Boxes are tested against the intervals of groups of rays. Only for rays of one origin:
    /// combined intervals of origins and directions are weak bounds (measured seven times slower).
    Intervals,
    /// Boxes are also tested ray by ray. Rays leave the packet where few of them hit a box.
    Rays,
    /// As `Rays`, but the rays leave the packet early.
    RaysLeaveEarly,
}

const STRATEGIES: [Strategy; 3] = [Strategy::Intervals, Strategy::Rays, Strategy::RaysLeaveEarly];

impl Strategy {
    /// Largest number of rays of a packet that leave it at a box.
    pub(super) fn most_leaving(self) -> u32 {
        match self {
            Strategy::Intervals => 0,
            Strategy::Rays => 4,
            Strategy::RaysLeaveEarly => 64,
        }
    }
}

/// What is known about a strategy that is not the best one.
#[derive(Debug, Clone, Copy, Default)]
struct Trial {
    /// Sums of the times of its trials, and of the best strategy's beside them. Older trials count
    /// less.
    time: f32,
    best_time: f32,
    /// Packets until the next trial.
    wait: u32,
}

/// Where the comparison with another strategy stands. The packet of a trial is compared with the
/// mean of the packets before and after it: the work changes slowly from packet to packet.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    /// No trial is near.
    Idle,
    /// The packet before the trial of a strategy.
    Before(usize),
    /// The trial itself.
    Trial(usize, f32),
    /// The packet after it.
    After(usize, f32, f32),
}

/// The best strategy for one kind of packets, learned from packets.
#[derive(Debug, Clone, Copy)]
pub(super) struct StrategyChoice {
    best: usize,
    trials: [Trial; 3],
    step: Step,
    /// Means over packets traced with [`Strategy::Rays`]: the share of the groups tested ray by ray
    /// that were kept, and the number of rays in a tested group that hit the box.
    kept: f32,
    rays: f32,
}

impl StrategyChoice {
    /// Shortest and longest time between two trials, in packets.
    const WAIT: [f32; 2] = [10.0, 1024.0];
    /// Part of the old sums that a new trial keeps.
    const MEMORY: f32 = 0.7;
    /// A strategy replaces the best one when it takes less than this part of its time.
    const BETTER: f32 = 0.96;
    /// Intervals alone are tried only if per-ray tests keep more than this share of the groups, with
    /// more rays in a group. Otherwise they can take 60 times as long.
    const KEPT: f32 = 0.75;
    const RAYS: f32 = 5.0;

    pub(super) const fn new() -> Self {
        let trial = Trial { time: 0.0, best_time: 0.0, wait: 2 };
        // Per-ray tests are never slower than the others by much.
        StrategyChoice { best: 1, trials: [trial; 3], step: Step::Idle, kept: 0.0, rays: 0.0 }
    }

    /// The strategy for the next packet. With the time when it starts, if its
    /// duration is needed.
    pub(super) fn next(&mut self, common_origin: bool) -> (Strategy, Option<Instant>) {
        if self.step == Step::Idle {
            let intervals = common_origin && self.kept > Self::KEPT && self.rays > Self::RAYS;
            for (k, trial) in self.trials.iter_mut().enumerate() {
                trial.wait = trial.wait.saturating_sub(1);
                let possible = STRATEGIES[k] != Strategy::Intervals || intervals;
                if k != self.best && possible && trial.wait == 0 && self.step == Step::Idle {
                    self.step = Step::Before(k);
                }
            }
        }
        match self.step {
            Step::Idle => (STRATEGIES[self.best], None),
            Step::Trial(k, _) => (STRATEGIES[k], Some(Instant::now())),
            Step::Before(_) | Step::After(..) => (STRATEGIES[self.best], Some(Instant::now())),
        }
    }

    /// Learns from the packet that [`StrategyChoice::next`] was asked about: it took
    /// `seconds` for each of its groups.
    pub(super) fn learn(&mut self, strategy: Strategy, counts: SlabCounts, seconds: f32) {
        if strategy == Strategy::Rays && counts.tested > 0 {
            let tested = counts.tested as f32;
            self.kept += 0.2 * (counts.kept as f32 / tested - self.kept);
            self.rays += 0.2 * (counts.rays as f32 / tested - self.rays);
        }
        self.step = match self.step {
            Step::Idle => Step::Idle,
            Step::Before(k) => Step::Trial(k, seconds),
            Step::Trial(k, before) => Step::After(k, before, seconds),
            Step::After(k, before, time) => {
                // Neighbours that differ much are a border in the image, or an interruption.
                if before.max(seconds) <= 4.0 * before.min(seconds) {
                    self.compare(k, time, 0.5 * (before + seconds));
                }
                Step::Idle
            }
        };
    }

    /// Learns that strategy `k` took `time` where the best one took `best_time`.
    fn compare(&mut self, k: usize, time: f32, best_time: f32) {
        // An interruption of a trial must not rule a strategy out for long.
        let most = if STRATEGIES[k] == Strategy::Intervals { f32::INFINITY } else { 4.0 };
        let time = time.min(most * best_time);
        let trial = &mut self.trials[k];
        trial.time = Self::MEMORY * trial.time + time;
        trial.best_time = Self::MEMORY * trial.best_time + best_time;
        let ratio = trial.time / trial.best_time.max(f32::MIN_POSITIVE);
        let [shortest, longest] = Self::WAIT;
        // A trial costs ratio − 1 packets. So trials cost at most two percent of the time.
        trial.wait = (shortest * ratio.powi(3)).clamp(shortest, longest) as u32;
        if ratio < Self::BETTER {
            let Trial { time, best_time, .. } = *trial;
            self.trials[self.best] = Trial { time: best_time, best_time: time, wait: 10 };
            for (j, other) in self.trials.iter_mut().enumerate() {
                if j != self.best && j != k {
                    other.best_time *= ratio;
                }
            }
            self.best = k;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: SlabCounts = SlabCounts { tested: 100, kept: 90, rays: 1200 };

    /// Times of packets, in seconds for each group, of the three strategies.
    fn trace(choice: &mut StrategyChoice, packets: usize, seconds: [f32; 3]) -> f32 {
        let mut sum = 0.0;
        for _ in 0..packets {
            let (strategy, _) = choice.next(true);
            let time = seconds[strategy as usize];
            choice.learn(strategy, COUNTS, time);
            sum += time;
        }
        sum / packets as f32
    }

    #[test]
    fn the_fastest_strategy_is_found_and_trials_cost_little() {
        for fastest in 0..3 {
            let mut choice = StrategyChoice::new();
            let mut seconds = [2e-6, 1.5e-6, 3e-6];
            seconds[fastest] = 1e-6;
            trace(&mut choice, 100, seconds);
            let mean = trace(&mut choice, 2000, seconds);
            assert!(mean < 1.05e-6, "strategy {fastest}: mean {mean}");
        }
    }

    #[test]
    fn another_view_is_learned_within_a_hundred_packets() {
        let mut choice = StrategyChoice::new();
        trace(&mut choice, 1000, [1e-6, 1.2e-6, 2e-6]);
        assert_eq!(STRATEGIES[choice.best], Strategy::Intervals);
        // Diverging rays: a thousand times the work of before for bounds, little for rays alone.
        trace(&mut choice, 100, [1e-3, 2e-6, 1e-6]);
        assert_ne!(STRATEGIES[choice.best], Strategy::Intervals);
    }

    #[test]
    fn bounds_of_rays_that_diverge_are_not_tried() {
        let mut choice = StrategyChoice::new();
        for _ in 0..5000 {
            let (strategy, _) = choice.next(true);
            assert_ne!(strategy, Strategy::Intervals);
            choice.learn(strategy, SlabCounts { tested: 100, kept: 60, rays: 250 }, 1e-6);
        }
        for _ in 0..5000 {
            let (strategy, _) = choice.next(false);
            assert_ne!(strategy, Strategy::Intervals, "rays of different origins");
            choice.learn(strategy, COUNTS, 1e-6);
        }
    }

    #[test]
    fn an_interruption_does_not_change_the_choice() {
        let mut choice = StrategyChoice::new();
        trace(&mut choice, 1000, [2e-6, 1e-6, 1.3e-6]);
        let best = choice.best;
        for packet in 0..1000 {
            let (strategy, _) = choice.next(true);
            let interruption = if packet % 7 == 0 { 1e-3 } else { 0.0 };
            let seconds = [2e-6, 1e-6, 1.3e-6][strategy as usize] + interruption;
            choice.learn(strategy, COUNTS, seconds);
        }
        trace(&mut choice, 100, [2e-6, 1e-6, 1.3e-6]);
        assert_eq!(choice.best, best);
    }
}
