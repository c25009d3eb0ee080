//! Runs the steps, prints every command before it runs, and prints the cost of all at the end.

use std::path::Path;
use std::time::Instant;

use crate::peers::{self, Install};
use crate::plan::STEPS;
use crate::step::{Action, Context, Outcome, Step};
use crate::{Exit, TestOptions};

/// Runs the steps that `options` selects and prints the summary.
pub(crate) fn run(root: &Path, options: &TestOptions) -> Exit {
    let install = if options.keep_machine { Install::Forbidden } else { Install::Allowed };
    let chosen: Vec<&Step> = STEPS
        .iter()
        .filter(|s| options.only.is_empty() || options.only.iter().any(|n| n == s.name))
        .collect();

    let started = Instant::now();
    let peers = peers::set_up(root, install);
    let mut report = vec![("set-up", Outcome::Passed, started.elapsed().as_secs_f64())];

    let context = Context { root, options, peers: &peers };
    let mut exit = Exit::Success;
    for (i, step) in chosen.iter().enumerate() {
        println!("\n==> [{}/{}] {}: {}", i + 1, chosen.len(), step.name, describe(&step.action));
        let begun = Instant::now();
        let outcome = match &step.action {
            Action::Call(f) => f(&context),
            Action::Cargo { args, env } => context.cargo(args, env),
        };
        let ended = match &outcome {
            Outcome::Failed(_) => Some(Exit::StepFailed),
            Outcome::PeerMissing(_) => Some(Exit::PeerMissing),
            Outcome::NotRun(why) => {
                println!("not run: {why}");
                None
            }
            Outcome::Passed => None,
        };
        report.push((step.name, outcome, begun.elapsed().as_secs_f64()));
        if let Some(code) = ended {
            exit = code;
            break;
        }
    }
    let left = chosen.len() + 1 - report.len();
    print!("{}", summary(&report, left, started.elapsed().as_secs_f64()));
    print!("{}", peers.describe());
    exit
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
