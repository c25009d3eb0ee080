//! Runs the steps, prints every command before it runs, and prints the cost of all at the end.

use std::io::Write as _;
use std::path::Path;
use std::sync::mpsc::{self, Sender};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use crate::peers::{self, Install, Peers};
use crate::plan::{BESIDE, MAIN_JOB, PEERS, STEPS, TESTS, WHEELS};
use crate::step::{Action, Context, Outcome, Step};
use crate::{Exit, TestOptions, systems};

/// Runs the steps that `options` selects and prints the summary.
pub(crate) fn run(root: &Path, options: &TestOptions) -> Exit {
    let install = if options.keep_machine { Install::Forbidden } else { Install::Allowed };
    let chosen: Vec<&Step> = STEPS
        .iter()
        .filter(|s| options.only.is_empty() || options.only.iter().any(|n| n == s.name))
        .collect();

    let started = Instant::now();
    let run = Run { count: chosen.len(), report: Mutex::default() };
    let first = number_of_steps_until(&chosen, |s| s.name == PEERS);
    let peers = std::thread::scope(|scope| {
        let set_up = scope.spawn(|| {
            let set_up = (peers::set_up(root, install), started.elapsed());
            if chosen.iter().any(|s| s.name == systems::STEP) {
                systems::prepare(root, !options.keep_machine);
            }
            set_up
        });
        run.steps(&chosen[..first], &Context { root, options, peers: &Peers::default() });
        match set_up.join() {
            Ok((peers, took)) => {
                run.add("set-up", Outcome::Passed, took.as_secs_f64());
                peers
            }
            Err(panic) => std::panic::resume_unwind(panic),
        }
    });
    let context = Context { root, options, peers: &peers };
    let after_tests = |s: &Step| comes_after(s, TESTS);
    let second = number_of_steps_until(&chosen, after_tests);
    run.steps(&chosen[first..second], &context);
    let (beside, last): (Vec<&Step>, Vec<&Step>) =
        chosen[second..].iter().partition(|s| BESIDE.contains(&s.name));
    let beside = ordered(beside);
    std::thread::scope(|scope| {
        let (tell, told) = mpsc::channel();
        let (run, context) = (&run, &context);
        scope.spawn(move || run.steps_beside(&beside, context, &tell));
        let (before, main_job): (Vec<&Step>, Vec<&Step>) =
            last.iter().partition(|s| s.name != MAIN_JOB);
        run.steps(&before, context);
        if !main_job.is_empty() {
            // Ends without the wheels where they are not among the steps, or one has failed.
            told.iter().find(|name| *name == WHEELS);
        }
        run.steps(&main_job, context);
    });
    let report = run.report.into_inner().unwrap_or_else(PoisonError::into_inner);
    let left = chosen.len() + 1 - report.len();
    print!("{}", summary(&report, left, started.elapsed().as_secs_f64()));
    print!("{}", peers.describe());
    report.iter().find_map(|(_, outcome, _)| exit_of(outcome)).unwrap_or(Exit::Success)
}

/// How many of the steps come before the first that `ends` is true for, or that a later step of the
/// plan is.
fn number_of_steps_until(chosen: &[&Step], ends: impl Fn(&Step) -> bool) -> usize {
    let end = STEPS.iter().position(ends).unwrap_or(STEPS.len());
    chosen.iter().take_while(|s| STEPS[..end].iter().any(|e| e.name == s.name)).count()
}

/// Steps in the order of [`BESIDE`].
fn ordered(mut steps: Vec<&Step>) -> Vec<&Step> {
    steps.sort_by_key(|s| BESIDE.iter().position(|name| *name == s.name));
    steps
}

/// Whether a step comes after the one with this name.
fn comes_after(step: &Step, name: &str) -> bool {
    STEPS.iter().skip_while(|s| s.name != name).skip(1).any(|s| s.name == step.name)
}

/// The exit status that a step's end asks for; `None` for the run to go on.
fn exit_of(outcome: &Outcome) -> Option<Exit> {
    match outcome {
        Outcome::Failed(_) => Some(Exit::StepFailed),
        Outcome::PeerMissing(_) => Some(Exit::PeerMissing),
        Outcome::Passed | Outcome::NotRun(_) => None,
    }
}

/// What has run so far.
struct Run {
    /// Steps that were chosen.
    count: usize,
    report: Mutex<Vec<(&'static str, Outcome, f64)>>,
}

impl Run {
    fn add(&self, name: &'static str, outcome: Outcome, secs: f64) {
        let mut report = self.report.lock().unwrap_or_else(PoisonError::into_inner);
        report.push((name, outcome, secs));
    }

    /// Whether a step has failed. None is begun after it.
    fn is_over(&self) -> bool {
        let report = self.report.lock().unwrap_or_else(PoisonError::into_inner);
        report.iter().any(|(_, outcome, _)| exit_of(outcome).is_some())
    }

    /// Runs steps one after the other, until one fails.
    fn steps(&self, steps: &[&Step], context: &Context<'_>) {
        for step in steps {
            if self.is_over() {
                return;
            }
            println!("\n{}", self.title(step));
            let begun = Instant::now();
            let outcome = match &step.action {
                Action::Call(f) => f(context),
                Action::Cargo { args, env } => context.cargo(args, env),
            };
            if let Outcome::NotRun(why) = &outcome {
                println!("not run: {why}");
            }
            self.add(step.name, outcome, begun.elapsed().as_secs_f64());
        }
    }

    /// [`Run::steps`] beside others: what cargo prints comes in one piece when it has ended. Tells
    /// the names of steps that have.
    fn steps_beside(&self, steps: &[&Step], context: &Context<'_>, tell: &Sender<&'static str>) {
        for step in steps {
            if self.is_over() {
                return;
            }
            if let Action::Cargo { args, env } = &step.action {
                let begun = Instant::now();
                let (outcome, said) = context.cargo_in_silence(args, env);
                let secs = begun.elapsed().as_secs_f64();
                let mut out = std::io::stdout().lock();
                // What cannot be printed is no fault of the step.
                let _ = writeln!(out, "\n{}, {secs:.1} s beside others", self.title(step));
                let _ = out.write_all(&said).and_then(|()| out.flush());
                self.add(step.name, outcome, secs);
            } else {
                self.steps(&[step], context);
            }
            // Nobody may wait for it.
            let _ = tell.send(step.name);
        }
    }

    /// The line above what a step prints.
    fn title(&self, step: &Step) -> String {
        let number = STEPS.iter().position(|s| s.name == step.name).unwrap_or(0) + 1;
        let of = if self.count == STEPS.len() {
            format!("[{number}/{}] ", self.count)
        } else {
            String::new()
        };
        format!("==> {of}{}: {}", step.name, describe(&step.action))
    }
}

/// Prints the steps without running them.
pub(crate) fn list() {
    for step in STEPS {
        println!("{:<20} {}\n{:<20} {}", step.name, describe(&step.action), "", step.tells);
    }
}

/// The command of a step as typed in a shell.
fn describe(action: &Action) -> String {
    match action {
        Action::Call(_) => "(inside xtask)".to_owned(),
        Action::Cargo { args, env } => {
            let env = env.iter().map(|(k, v)| format!("{k}='{v}' ")).collect::<String>();
            format!("{env}cargo {}", args.join(" "))
        }
    }
}

fn summary(report: &[(&str, Outcome, f64)], left: usize, total_secs: f64) -> String {
    let mut text = format!("\n{:<20} {:>8}  outcome\n", "step", "secs");
    for (name, outcome, secs) in report {
        let outcome = match outcome {
            Outcome::Passed => "passed".to_owned(),
            Outcome::NotRun(why) => format!("NOT RUN: {why}"),
            Outcome::Failed(why) | Outcome::PeerMissing(why) => format!("FAILED: {why}"),
        };
        text += &format!("{name:<20} {secs:>8.1}  {outcome}\n");
    }
    if left > 0 {
        text += &format!("{left} more steps were not reached.\n");
    }
    text + &format!("{:<20} {total_secs:>8.1}\n", "total")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_divided_by_the_plan_also_where_few_are_chosen() {
        let of = |names: &[&str]| -> Vec<&Step> {
            STEPS.iter().filter(|s| names.contains(&s.name)).collect()
        };
        let until_tests =
            |chosen: &[&Step]| number_of_steps_until(chosen, |s| comes_after(s, TESTS));
        let all: Vec<&Step> = STEPS.iter().collect();
        assert_eq!(all[until_tests(&all) - 1].name, TESTS);
        assert_eq!(until_tests(&of(&["fmt", TESTS, "main-job"])), 2);
        assert_eq!(until_tests(&of(&["main-job", "counters"])), 0);
        assert_eq!(number_of_steps_until(&of(&["fmt", TESTS]), |s| s.name == PEERS), 1);
    }

    #[test]
    fn a_step_that_fails_ends_the_run_of_both_lanes() {
        let run = Run { count: 1, report: Mutex::default() };
        run.add("fmt", Outcome::NotRun("why".to_owned()), 0.1);
        assert!(!run.is_over());
        run.add("wheels", Outcome::Failed("exit status: 1".to_owned()), 0.1);
        assert!(run.is_over());
    }

    #[test]
    fn the_summary_names_what_failed_and_what_was_not_reached() {
        let report = [
            ("fmt", Outcome::Passed, 0.5),
            ("deny", Outcome::NotRun("no cargo-deny".to_owned()), 0.0),
            ("clippy", Outcome::Failed("exit status: 101".to_owned()), 12.25),
        ];
        let text = summary(&report, 4, 12.75);
        for part in ["NOT RUN: no cargo-deny", "FAILED: exit status: 101", "4 more steps", "12.8"] {
            assert!(text.contains(part), "`{part}` is not in\n{text}");
        }
    }
}
