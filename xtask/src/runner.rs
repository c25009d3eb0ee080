//! Runs the steps, prints every command before it runs, and prints the cost of all at the end.

use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use crate::peers::{self, Install, Peers};
use crate::plan::{PEERS, STEPS};
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
    let mut run = Run { chosen: &chosen, report: vec![], exit: None };
    let early = chosen.iter().take_while(|s| runs_beside_set_up(s)).count();
    let peers = std::thread::scope(|scope| {
        let set_up = scope.spawn(|| {
            let set_up = (peers::set_up(root, install), started.elapsed());
            if chosen.iter().any(|s| s.name == systems::STEP) {
                systems::prepare(root, !options.keep_machine);
            }
            set_up
        });
        run.steps(0..early, &Context { root, options, peers: &Peers::default() });
        match set_up.join() {
            Ok((peers, took)) => {
                run.report.push(("set-up", Outcome::Passed, took.as_secs_f64()));
                peers
            }
            Err(panic) => std::panic::resume_unwind(panic),
        }
    });
    run.steps(early..chosen.len(), &Context { root, options, peers: &peers });
    let Run { report, exit, .. } = run;
    let left = chosen.len() + 1 - report.len();
    print!("{}", summary(&report, left, started.elapsed().as_secs_f64()));
    print!("{}", peers.describe());
    exit.unwrap_or(Exit::Success)
}

/// Whether a step needs no peers: those before [`PEERS`].
fn runs_beside_set_up(step: &Step) -> bool {
    STEPS.iter().take_while(|s| s.name != PEERS).any(|s| s.name == step.name)
}

/// What has run so far.
struct Run<'a> {
    chosen: &'a [&'a Step],
    report: Vec<(&'static str, Outcome, f64)>,
    exit: Option<Exit>,
}

impl Run<'_> {
    /// Runs some of the chosen steps, until one fails.
    fn steps(&mut self, range: Range<usize>, context: &Context<'_>) {
        for i in range {
            if self.exit.is_some() {
                return;
            }
            let step = self.chosen[i];
            let (number, action) = (i + 1, describe(&step.action));
            println!("\n==> [{number}/{}] {}: {action}", self.chosen.len(), step.name);
            let begun = Instant::now();
            let outcome = match &step.action {
                Action::Call(f) => f(context),
                Action::Cargo { args, env } => context.cargo(args, env),
            };
            self.exit = match &outcome {
                Outcome::Failed(_) => Some(Exit::StepFailed),
                Outcome::PeerMissing(_) => Some(Exit::PeerMissing),
                Outcome::NotRun(why) => {
                    println!("not run: {why}");
                    None
                }
                Outcome::Passed => None,
            };
            self.report.push((step.name, outcome, begun.elapsed().as_secs_f64()));
        }
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
