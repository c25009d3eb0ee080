//! Chooses among ways to do the same work by the time that earlier work took.
//!
//! For some traversals nothing that can be counted beforehand predicts which way is fastest. So now
//! and then a piece of work is done in another way, and its time is compared with that of the
//! pieces before and after it. Only for ways that give the same bits.

use std::time::Instant;

/// What is known about a way that is not the best one.
#[derive(Debug, Clone, Copy)]
struct Trial {
    /// Sums of the times of its trials, and of the best way's beside them. Older trials count less.
    time: f32,
    best_time: f32,
    /// Pieces until the next trial.
    wait: u32,
    /// Number of trials so far.
    count: u32,
    /// The last trial took so long that it may have been interrupted.
    in_doubt: bool,
}

/// Where the comparison with another way stands. A trial is compared with the mean of the pieces
/// before and after it: the work changes slowly from piece to piece.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    /// No trial is near.
    Idle,
    /// The piece before the trial of a way.
    Before(usize),
    /// The trial itself, and the time before it.
    Trial(usize, f32),
    /// The piece after it; the times before it and of the trial.
    After(usize, f32, f32),
}

/// The best of `N` ways to do pieces of work of one kind, learned from earlier pieces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TimedChoice<const N: usize> {
    best: usize,
    trials: [Trial; N],
    step: Step,
}

impl<const N: usize> TimedChoice<N> {
    /// Shortest and longest time between two trials of a way, in pieces.
    const WAIT: [f32; 2] = [10.0, 1024.0];
    /// Longest time after the first trial; it doubles with each. A first trial may be interrupted,
    /// or meet code and data that are not in the caches yet.
    const FIRST_WAIT: f32 = 32.0;
    /// Part of the old sums that a new trial keeps.
    const MEMORY: f32 = 0.7;
    /// A way replaces the best one when it takes less than this part of its time.
    const BETTER: f32 = 0.96;
    /// A trial counts at most this many times the best way's time: an interruption must not rule a
    /// way out for long.
    const MOST: f32 = 8.0;
    /// A trial that takes more than this many times the best way's time counts only when the next
    /// one does too. On a machine whose cores are all in use, one interruption in a trial ruled the
    /// faster way out for thousands of pieces.
    const DOUBTFUL: f32 = 2.0;
    /// Pieces before and after a trial that differ by more than this factor are a border in the
    /// image, or one of them was interrupted. At 4, such pairs let the slower way win.
    const ALIKE: f32 = 2.0;

    /// `best` is taken for the best way at first.
    pub(crate) const fn new(best: usize) -> Self {
        let trial = Trial { time: 0.0, best_time: 0.0, wait: 2, count: 0, in_doubt: false };
        TimedChoice { best, trials: [trial; N], step: Step::Idle }
    }

    /// The way for the next piece; only ways that are `possible` are tried. With the time when the
    /// piece starts, if its duration is needed.
    #[inline]
    pub(crate) fn next(&mut self, possible: impl Fn(usize) -> bool) -> (usize, Option<Instant>) {
        if self.step == Step::Idle {
            for (k, trial) in self.trials.iter_mut().enumerate() {
                trial.wait = trial.wait.saturating_sub(1);
                if k != self.best && trial.wait == 0 && self.step == Step::Idle && possible(k) {
                    self.step = Step::Before(k);
                }
            }
        }
        match self.step {
            Step::Idle => (self.best, None),
            Step::Trial(k, _) => (k, Some(Instant::now())),
            Step::Before(_) | Step::After(..) => (self.best, Some(Instant::now())),
        }
    }

    /// Learns that the piece of the last [`TimedChoice::next`] took so many seconds, divided by its
    /// size where sizes differ.
    #[inline]
    pub(crate) fn learn(&mut self, seconds: f32) {
        self.step = match self.step {
            Step::Idle => Step::Idle,
            Step::Before(k) => Step::Trial(k, seconds),
            Step::Trial(k, before) => Step::After(k, before, seconds),
            Step::After(k, before, time) => {
                if before.max(seconds) <= Self::ALIKE * before.min(seconds) {
                    self.compare(k, time, 0.5 * (before + seconds));
                } else {
                    self.trials[k].wait = Self::WAIT[0] as u32;
                }
                Step::Idle
            }
        };
    }

    /// Learns that way `k` took `time` where the best one took `best_time`.
    fn compare(&mut self, k: usize, time: f32, best_time: f32) {
        let trial = &mut self.trials[k];
        let [shortest, longest] = Self::WAIT;
        if time > Self::DOUBTFUL * best_time && !trial.in_doubt {
            trial.in_doubt = true;
            trial.wait = shortest as u32;
            return;
        }
        trial.in_doubt = false;
        trial.time = Self::MEMORY * trial.time + time.min(Self::MOST * best_time);
        trial.best_time = Self::MEMORY * trial.best_time + best_time;
        let ratio = trial.time / trial.best_time.max(f32::MIN_POSITIVE);
        // A trial costs ratio − 1 pieces. So trials cost at most two percent of the time.
        let longest = longest.min(Self::FIRST_WAIT * f32::exp2(trial.count as f32));
        trial.wait = (shortest * ratio.powi(3)).clamp(shortest, longest) as u32;
        trial.count = (trial.count + 1).min(16);
        if ratio < Self::BETTER {
            let Trial { time, best_time, count, .. } = *trial;
            let wait = shortest as u32;
            self.trials[self.best] =
                Trial { time: best_time, best_time: time, wait, count, in_doubt: false };
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

    /// The mean time of pieces of which the three ways take so many seconds.
    fn work(choice: &mut TimedChoice<3>, pieces: usize, seconds: [f32; 3]) -> f32 {
        let mut sum = 0.0;
        for _ in 0..pieces {
            let time = seconds[choice.next(|_| true).0];
            choice.learn(time);
            sum += time;
        }
        sum / pieces as f32
    }

    #[test]
    fn the_fastest_way_is_found_and_trials_cost_little() {
        for fastest in 0..3 {
            let mut choice = TimedChoice::new(1);
            let mut seconds = [2e-6, 1.5e-6, 3e-6];
            seconds[fastest] = 1e-6;
            work(&mut choice, 100, seconds);
            let mean = work(&mut choice, 2000, seconds);
            assert!(mean < 1.05e-6, "way {fastest}: mean {mean}");
        }
    }

    #[test]
    fn other_work_is_learned_within_a_hundred_pieces() {
        let mut choice = TimedChoice::new(1);
        work(&mut choice, 1000, [1e-6, 1.2e-6, 2e-6]);
        assert_eq!(choice.best, 0);
        // Another view: a thousand times the work for the way that was best.
        work(&mut choice, 100, [1e-3, 2e-6, 1e-6]);
        assert_ne!(choice.best, 0);
    }

    #[test]
    fn an_interruption_does_not_change_the_choice() {
        let mut choice = TimedChoice::new(1);
        let seconds = [2e-6, 1e-6, 1.3e-6];
        work(&mut choice, 1000, seconds);
        for piece in 0..1000 {
            let way = choice.next(|_| true).0;
            let interruption = if piece % 7 == 0 { 1e-3 } else { 0.0 };
            choice.learn(seconds[way] + interruption);
        }
        work(&mut choice, 100, seconds);
        assert_eq!(choice.best, 1);
    }

    #[test]
    fn a_trial_that_is_interrupted_does_not_rule_the_faster_way_out() {
        // Other work, for which way 1 is faster. One of its first trials there is interrupted.
        for interrupted in 0..3 {
            let mut choice = TimedChoice::<2>::new(0);
            for _ in 0..200 {
                let way = choice.next(|_| true).0;
                choice.learn([1e-6, 3e-6][way]);
            }
            let (mut trials, mut slow) = (0, 0);
            for _ in 0..1000 {
                let way = choice.next(|_| true).0;
                slow += u32::from(way == 0);
                let interruption = if way == 1 && trials == interrupted { 1e-3 } else { 0.0 };
                trials += u32::from(way == 1);
                choice.learn([1.5e-6, 1e-6][way] + interruption);
            }
            assert!(slow < 300, "trial {interrupted}: the slower way took {slow} of 1000 pieces");
        }
    }

    #[test]
    fn an_interruption_beside_a_trial_does_not_make_the_slower_way_win() {
        let mut choice = TimedChoice::<2>::new(0);
        let mut slow = 0;
        let mut last_was_trial = false;
        for _ in 0..3000 {
            let way = choice.next(|_| true).0;
            slow += u32::from(way == 1);
            // Each piece after a trial is interrupted for as long as two pieces take.
            let interruption = if last_was_trial { 2e-6 } else { 0.0 };
            last_was_trial = way == 1;
            choice.learn([1e-6, 1.3e-6][way] + interruption);
        }
        assert!(slow < 300, "the slower way took {slow} of 3000 pieces");
    }

    #[test]
    fn impossible_ways_are_never_tried() {
        let mut choice = TimedChoice::<2>::new(0);
        for _ in 0..5000 {
            assert_eq!(choice.next(|k| k != 1).0, 0);
            choice.learn(1e-6);
        }
    }
}
