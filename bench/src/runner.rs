//! Times variants against each other on a shared machine.
//!
//! Variants alternate, one run each per round. Their order changes from round to round, so a slow
//! minute of the machine affects all of them. The reported ratio is the median over the rounds of
//! the ratio within each round. Load by other users cancels in it, because two runs of one round
//! see nearly the same machine. It would not cancel in a ratio of two medians.

use crate::clock::{self, Clock, Sample};
use crate::stats::Summary;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Minimum number of rounds for a verdict of faster or slower. If both variants are equally fast,
/// all five rounds are on the same side of 1 with probability 1/16; with three rounds it would be
/// 1/4.
pub const VERDICT_ROUNDS: usize = 5;

/// How often and how long to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Warm-up rounds that are not counted: caches, page tables and clock frequency settle.
    pub warmup_rounds: u32,
    /// Maximum number of counted rounds.
    pub rounds: u32,
    /// No new round starts after this many seconds, but at least `min_rounds` are counted.
    pub budget_secs: f64,
    /// Minimum number of counted rounds, whatever the time budget.
    pub min_rounds: u32,
    /// The clock for comparisons.
    pub clock: Clock,
    /// Bind the calling thread to one core per round, another in the next round. Only for work on
    /// one thread.
    pub pin: bool,
}

impl Schedule {
    /// For work on one thread: 7 rounds by thread CPU time, pinned.
    pub fn one_thread() -> Schedule {
        let clock = Clock::ThreadCpu;
        let min_rounds = VERDICT_ROUNDS as u32;
        Schedule { warmup_rounds: 1, rounds: 7, budget_secs: 25.0, min_rounds, clock, pin: true }
    }

    /// For work on several threads: 7 rounds by the wall clock.
    pub fn all_threads() -> Schedule {
        Schedule { clock: Clock::Wall, pin: false, budget_secs: 60.0, ..Schedule::one_thread() }
    }

    /// Few rounds within `budget_secs`, for `--quick`: they show that everything runs, but give no
    /// verdict ([`Ratio::verdict`]).
    pub fn quick(self, budget_secs: f64) -> Schedule {
        Schedule { rounds: 3, min_rounds: 1, budget_secs, ..self }
    }
}

/// One of the variants to compare.
pub struct Variant<'a> {
    /// Its name in rows and ratios.
    pub name: String,
    /// Does the work once and returns a check number that must be the same every time, such as the
    /// number of hits. The number exposes a variant that skips work, and prevents the compiler from
    /// removing the work. It may also return times, if the work measures them better than our
    /// clocks.
    run: Box<dyn FnMut() -> (u64, Option<Sample>) + 'a>,
    /// Computes the check number after the clock has stopped, if that takes work of its own.
    check: Option<Box<dyn FnMut() -> u64 + 'a>>,
}

impl<'a> Variant<'a> {
    /// A named closure that returns its own check.
    pub fn new(name: impl Into<String>, mut run: impl FnMut() -> u64 + 'a) -> Self {
        Variant { name: name.into(), run: Box::new(move || (run(), None)), check: None }
    }

    /// A named closure that delegates the work to another process, or times only a part of it, and
    /// returns the measured time.
    pub fn timed(name: impl Into<String>, mut run: impl FnMut() -> Sample + 'a) -> Self {
        Variant { name: name.into(), run: Box::new(move || (0, Some(run()))), check: None }
    }

    /// A named closure whose result `check` inspects outside the measured time.
    pub fn checked(
        name: impl Into<String>,
        mut run: impl FnMut() + 'a,
        check: impl FnMut() -> u64 + 'a,
    ) -> Self {
        let run = move || {
            run();
            (0, None)
        };
        Variant { name: name.into(), run: Box::new(run), check: Some(Box::new(check)) }
    }

    fn result(&mut self, returned: u64) -> u64 {
        self.check.as_mut().map_or(returned, |c| c())
    }
}

/// The samples of one variant, one per counted round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    /// Name of the variant.
    pub name: String,
    /// One sample per round, in order.
    pub samples: Vec<Sample>,
    /// What the variant returned, the same in every round.
    pub check: u64,
}

impl Timed {
    /// Median and spread by the given clock.
    pub fn summary(&self, clock: Clock) -> Summary {
        let times: Vec<f64> = self.samples.iter().map(|s| s.by(clock)).collect();
        Summary::of(&times).unwrap_or(Summary {
            median: f64::NAN,
            low: f64::NAN,
            high: f64::NAN,
            quartile_1: f64::NAN,
            quartile_3: f64::NAN,
        })
    }
}

/// How many times longer a baseline took: above 1 we are faster.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// Our variant.
    pub name: String,
    /// The baseline that it is compared with.
    // The key in the files of records.
    #[serde(rename = "rival")]
    pub baseline: String,
    /// Median over the rounds of (baseline's time / our time).
    pub value: f64,
    /// Interquartile range of the rounds' ratios.
    pub spread: f64,
    /// Smallest ratio of a round.
    pub low: f64,
    /// Largest ratio of a round.
    pub high: f64,
    /// Number of rounds.
    pub rounds: usize,
    /// Whether both variants alternated. If they ran one after the other, changes of the machine's
    /// load in between are part of the ratio.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub in_turns: bool,
}

fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_yes(value: &bool) -> bool {
    *value
}

/// The verdict of a [`Ratio`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Ours was faster in every round.
    Faster,
    /// Ours was slower in every round.
    Slower,
    /// The rounds contradict each other.
    Even,
    /// No verdict: fewer rounds than [`VERDICT_ROUNDS`], or not alternating.
    Open,
}

impl Ratio {
    /// The ratio of alternating times: `per_round` is (baseline's time / our time) of each round.
    /// `None` without a finite one.
    pub fn of_rounds(
        name: impl Into<String>,
        baseline: impl Into<String>,
        per_round: &[f64],
    ) -> Option<Ratio> {
        let s = Summary::of(per_round)?;
        Some(Ratio {
            name: name.into(),
            baseline: baseline.into(),
            value: s.median,
            spread: s.interquartile_range(),
            low: s.low,
            high: s.high,
            rounds: per_round.iter().filter(|r| r.is_finite()).count(),
            in_turns: true,
        })
    }

    /// The verdict of the rounds. Reports, summaries and notes all take it from here.
    pub fn verdict(&self) -> Verdict {
        match (self.rounds >= VERDICT_ROUNDS && self.in_turns, self.low > 1.0, self.high < 1.0) {
            (false, ..) => Verdict::Open,
            (_, true, _) => Verdict::Faster,
            (_, _, true) => Verdict::Slower,
            _ => Verdict::Even,
        }
    }

    /// The ratio and its verdict, in words for a note.
    pub fn in_words(&self) -> String {
        let decides = match self.verdict() {
            Verdict::Faster => "above 1 in every round".into(),
            Verdict::Slower => "below 1 in every round".into(),
            Verdict::Even => "rounds on both sides of 1".into(),
            Verdict::Open => self.why_open().unwrap_or_default(),
        };
        format!(
            "{:.3} ({:.3} to {:.3}, {} rounds: {decides})",
            self.value, self.low, self.high, self.rounds
        )
    }

    /// Why there is no verdict, in words; `None` if there is one.
    pub fn why_open(&self) -> Option<String> {
        match (self.in_turns, self.rounds) {
            (false, _) => Some("not in turns: decides nothing".into()),
            (_, n) if n < VERDICT_ROUNDS => {
                Some(format!("rounds below {VERDICT_ROUNDS} decide nothing"))
            }
            _ => None,
        }
    }
}

/// All variants of one comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Clock that [`Timings::ratio`] uses.
    pub clock: Clock,
    /// In the order in which the variants were given.
    pub variants: Vec<Timed>,
}

impl Timings {
    /// The variant with the given name.
    pub fn get(&self, name: &str) -> Option<&Timed> {
        self.variants.iter().find(|v| v.name == name)
    }

    /// Median and spread of a variant by the comparison's clock.
    pub fn summary(&self, name: &str) -> Option<Summary> {
        self.get(name).map(|v| v.summary(self.clock))
    }

    /// How many times longer `baseline` took than `ours`. `None` if one of them was not run.
    pub fn ratio(&self, ours: &str, baseline: &str) -> Option<Ratio> {
        let (a, b) = (self.get(ours)?, self.get(baseline)?);
        let per_round: Vec<f64> = a
            .samples
            .iter()
            .zip(&b.samples)
            .map(|(x, y)| y.by(self.clock) / x.by(self.clock))
            .collect();
        Ratio::of_rounds(ours, baseline, &per_round)
    }
}

/// Why a comparison is invalid: a variant's check number changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Unstable {
    /// The variant.
    pub variant: String,
    /// The first check number.
    pub first: u64,
    /// The later, different one.
    pub later: u64,
}

impl std::fmt::Display for Unstable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Unstable { variant, first, later } = self;
        write!(
            f,
            "`{variant}` returned {first} in its first run and {later} in a later one: it does not \
             do the same work \
             each time, so its times cannot be compared; make its result depend on its input alone"
        )
    }
}

impl std::error::Error for Unstable {}

/// The order of round `round` for `n` variants: rotated, and reversed in every second round, so
/// that each variant runs first, last, and after each of its neighbours equally often. For work
/// that cannot use [`interleave`], such as ranks that must all follow the same order.
pub fn order(n: usize, round: usize) -> Vec<usize> {
    let mut o: Vec<usize> = (0..n).map(|i| (i + round / 2) % n.max(1)).collect();
    if round % 2 == 1 {
        o.reverse();
    }
    o
}

/// Runs the variants in alternation, as `schedule` specifies.
///
/// ```
/// use bench::runner::{Schedule, Variant, interleave};
/// let sum = |n: u64| (0..n).fold(0u64, |a, i| a ^ std::hint::black_box(i));
/// let timings = interleave(&Schedule::one_thread(), &mut [
///     Variant::new("short", move || sum(10_000)),
///     Variant::new("long", move || sum(100_000)),
/// ]).unwrap();
/// assert!(timings.ratio("short", "long").unwrap().value > 2.0);
/// ```
pub fn interleave(schedule: &Schedule, variants: &mut [Variant<'_>]) -> Result<Timings, Unstable> {
    let cores = Cores::of_this_thread(schedule.pin);
    let mut timed: Vec<Timed> = Vec::with_capacity(variants.len());
    let start = Instant::now();

    // Warm-up. Its results are also the reference for later checks.
    let mut firsts: Vec<Option<u64>> = vec![None; variants.len()];
    for round in 0..schedule.warmup_rounds as usize {
        cores.pin(round);
        for i in order(variants.len(), round) {
            let (returned, _) = (variants[i].run)();
            let value = variants[i].result(returned);
            check(&variants[i].name, &mut firsts[i], value)?;
        }
    }
    for v in variants.iter() {
        timed.push(Timed { name: v.name.clone(), samples: vec![], check: 0 });
    }

    // Counted rounds.
    let start_counted = start.elapsed().as_secs_f64();
    for round in 0..schedule.rounds.max(1) as usize {
        let spent_secs = start.elapsed().as_secs_f64();
        let round_secs = if round == 0 { 0.0 } else { (spent_secs - start_counted) / round as f64 };
        if round >= schedule.min_rounds.max(1) as usize
            && spent_secs + round_secs > schedule.budget_secs
        {
            break;
        }
        cores.pin(round);
        for i in order(variants.len(), round) {
            let ((returned, reported), sample) = clock::measure(|| (variants[i].run)());
            let value = variants[i].result(returned);
            check(&variants[i].name, &mut firsts[i], value)?;
            timed[i].samples.push(reported.unwrap_or(sample));
            timed[i].check = value;
        }
    }
    Ok(Timings { clock: schedule.clock, variants: timed })
}

fn check(variant: &str, first: &mut Option<u64>, value: u64) -> Result<(), Unstable> {
    match *first.get_or_insert(value) {
        first if first == value => Ok(()),
        first => Err(Unstable { variant: variant.to_string(), first, later: value }),
    }
}

/// The cores that this thread may run on; restored on drop.
struct Cores {
    allowed: Option<CpuSet>,
    ids: Vec<usize>,
}

impl Cores {
    fn of_this_thread(pin: bool) -> Cores {
        let allowed = if pin { sched_getaffinity(None).ok() } else { None };
        let ids =
            allowed.map_or(vec![], |set| (0..CpuSet::MAX_CPU).filter(|&c| set.is_set(c)).collect());
        Cores { allowed, ids }
    }

    /// If pinning is not permitted, the times only scatter more, so a failure is not an error.
    fn pin(&self, round: usize) {
        if !self.ids.is_empty() {
            let mut set = CpuSet::new();
            set.set(self.ids[round % self.ids.len()]);
            sched_setaffinity(None, &set).ok();
        }
    }
}

impl Drop for Cores {
    fn drop(&mut self) {
        if let Some(set) = &self.allowed {
            sched_setaffinity(None, set).ok();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    fn timings(a: &[f64], b: &[f64]) -> Timings {
        let timed = |name: &str, t: &[f64]| Timed {
            name: name.into(),
            samples: t.iter().map(|&s| Sample { wall_secs: s, ..Default::default() }).collect(),
            check: 0,
        };
        Timings { clock: Clock::Wall, variants: vec![timed("ours", a), timed("baseline", b)] }
    }

    #[test]
    fn a_slow_round_of_the_machine_cancels_in_the_ratio() {
        // The machine was ten times slower during round 3. A ratio of means would be wrong; the
        // median of ratios is not.
        let r = timings(&[1.0, 1.0, 10.0], &[2.0, 2.0, 20.0]).ratio("ours", "baseline").unwrap();
        assert_eq!((r.value, r.spread, r.rounds), (2.0, 0.0, 3));
    }

    #[test]
    fn ratio_is_above_one_when_the_baseline_is_slower() {
        let t = timings(&[1.0, 1.0, 1.0], &[3.0, 4.0, 5.0]);
        let r = t.ratio("ours", "baseline").unwrap();
        assert_eq!((r.value, r.low, r.high), (4.0, 3.0, 5.0));
        assert!((t.ratio("baseline", "ours").unwrap().value - 0.25).abs() < 1e-15);
        assert_eq!(t.ratio("ours", "absent"), None);
    }

    #[test]
    fn every_variant_runs_once_per_round_and_takes_every_place() {
        let log = RefCell::new(vec![]);
        let plan = Schedule { warmup_rounds: 0, rounds: 6, ..Schedule::all_threads() };
        let mut v: Vec<Variant<'_>> = (0..3)
            .map(|i| {
                let log = &log;
                Variant::new(format!("v{i}"), move || {
                    log.borrow_mut().push(i);
                    7
                })
            })
            .collect();
        let t = interleave(&plan, &mut v).unwrap();
        assert!(t.variants.iter().all(|v| v.samples.len() == 6 && v.check == 7));
        drop(v);
        let log = log.into_inner();
        let rounds: Vec<&[i32]> = log.chunks(3).collect();
        for place in 0..3 {
            for variant in 0..3 {
                assert_eq!(rounds.iter().filter(|r| r[place] == variant).count(), 2, "{rounds:?}");
            }
        }
    }

    #[test]
    fn budget_stops_early_but_never_below_the_minimum() {
        let nap = || {
            std::thread::sleep(std::time::Duration::from_millis(5));
            1
        };
        let plan = Schedule {
            warmup_rounds: 0,
            rounds: 1000,
            budget_secs: 0.0,
            min_rounds: 2,
            ..Schedule::all_threads()
        };
        let t = interleave(&plan, &mut [Variant::new("nap", nap)]).unwrap();
        assert_eq!(t.variants[0].samples.len(), 2);
    }

    #[test]
    fn a_variant_that_does_other_work_later_is_refused() {
        let mut n = 0;
        let e = interleave(
            &Schedule::all_threads(),
            &mut [Variant::new("drifting", || {
                n += 1;
                n
            })],
        )
        .unwrap_err();
        assert_eq!((e.first, e.later), (1, 2));
        assert!(e.to_string().contains("`drifting` returned 1"));
    }

    #[test]
    fn checking_is_not_timed() {
        let slow_check = || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            5
        };
        let mut v = [Variant::checked("x", || (), slow_check)];
        let t = interleave(&Schedule { rounds: 2, ..Schedule::all_threads() }, &mut v).unwrap();
        assert_eq!(t.variants[0].check, 5);
        assert!(t.summary("x").unwrap().high < 0.01, "{t:?}");
    }

    #[test]
    fn times_that_the_work_reports_replace_ours() {
        let reported = Sample { wall_secs: 7.0, process_cpu_secs: 3.0, ..Default::default() };
        let mut v = [Variant::timed("elsewhere", || reported)];
        let t = interleave(&Schedule { rounds: 2, ..Schedule::all_threads() }, &mut v).unwrap();
        assert_eq!(t.variants[0].samples, [reported, reported]);
    }

    #[test]
    fn fewer_than_five_rounds_or_no_turns_decide_nothing() {
        let of =
            |n: usize, value: f64| Ratio::of_rounds("ours", "baseline", &vec![value; n]).unwrap();
        for n in 1..VERDICT_ROUNDS {
            assert_eq!(
                (of(n, 9.0).verdict(), of(n, 0.1).verdict()),
                (Verdict::Open, Verdict::Open),
                "{n}"
            );
            assert!(of(n, 9.0).why_open().unwrap().contains('5'));
        }
        assert_eq!(
            (of(5, 9.0).verdict(), of(5, 0.1).verdict()),
            (Verdict::Faster, Verdict::Slower)
        );
        assert_eq!(of(5, 9.0).why_open(), None);
        let apart = Ratio { in_turns: false, ..of(7, 9.0) };
        assert_eq!(apart.verdict(), Verdict::Open);
        assert!(apart.why_open().unwrap().contains("turns"));
        let both = Ratio::of_rounds("a", "b", &[0.9, 1.1, 1.2, 1.3, 1.4]).unwrap();
        assert_eq!(both.verdict(), Verdict::Even);
        // A round without a measurement does not count.
        assert_eq!(Ratio::of_rounds("a", "b", &[2.0, 2.0, 2.0, 2.0, f64::NAN]).unwrap().rounds, 4);
    }

    #[test]
    fn a_full_measurement_has_as_many_rounds_as_a_verdict_needs() {
        for full in [Schedule::one_thread(), Schedule::all_threads()] {
            assert!(full.min_rounds as usize >= VERDICT_ROUNDS && full.rounds >= full.min_rounds);
        }
    }

    #[test]
    fn pinning_is_undone_afterwards() {
        let before = sched_getaffinity(None).unwrap();
        interleave(&Schedule::one_thread(), &mut [Variant::new("x", || 1)]).unwrap();
        assert_eq!(sched_getaffinity(None).unwrap(), before);
    }
}
