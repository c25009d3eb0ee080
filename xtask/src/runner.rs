//! Runs the steps, prints every command before it runs, and prints the cost of all at the end.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use crate::peers::{self, Install, Peers};
use crate::plan::{Action, STEPS, Step};
use crate::{Exit, TestOptions};

/// The state of the run that steps can access.
#[derive(Debug)]
pub(crate) struct Context<'a> {
    /// Root of the workspace; every command runs there.
    pub(crate) root: &'a Path,
    /// The command line.
    pub(crate) options: &'a TestOptions,
    /// The peers that were found.
    pub(crate) peers: &'a Peers,
}

/// Result of a step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The check passed.
    Passed,
    /// The check could not run here, for this reason. Does not stop the run; the summary repeats
    /// it.
    NotRun(String),
    /// The check failed, for this reason.
    Failed(String),
    /// A peer that the command line requires is missing.
    PeerMissing(String),
}

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
            Action::Cargo { args, env } => cargo(&context, args, env),
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

/// Runs cargo in the root with the peers' variables set.
pub(crate) fn cargo(context: &Context<'_>, args: &[&str], env: &[(&str, &str)]) -> Outcome {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(args).current_dir(context.root).envs(env.iter().copied());
    command.envs(context.peers.environment(context.options.require_peers));
    match command.status() {
        Ok(status) if status.success() => Outcome::Passed,
        Ok(status) => Outcome::Failed(status.to_string()),
        Err(e) => Outcome::Failed(format!("cargo does not start: {e}")),
    }
}

/// First line of a program's output, or `None` when it cannot be run.
pub(crate) fn first_line_of(program: impl AsRef<std::ffi::OsStr>, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    output.status.success().then(|| text.lines().next().unwrap_or_default().to_owned())
}

// ---- Steps that are functions -------------------------------------------------------------------
/// Checks that the compiler is at least the `rust-version` of the workspace, and that rustfmt and
/// clippy are installed.
pub(crate) fn check_tools(context: &Context<'_>) -> Outcome {
    let manifest = match std::fs::read_to_string(context.root.join("Cargo.toml")) {
        Ok(text) => text,
        Err(e) => return Outcome::Failed(format!("Cargo.toml: {e}")),
    };
    let Some(wanted) =
        manifest.lines().find_map(|l| l.strip_prefix("rust-version = ")).and_then(version_numbers)
    else {
        return Outcome::Failed("Cargo.toml: [workspace.package] has no rust-version".to_owned());
    };
    let Some(rustc) = first_line_of("rustc", &["--version"]) else {
        return Outcome::Failed(
            "rustc does not run; install Rust from https://rustup.rs".to_owned(),
        );
    };
    println!("{rustc}");
    if version_numbers(&rustc).is_none_or(|found| found < wanted) {
        return Outcome::Failed(format!(
            "{rustc} is older than rust-version {}.{}; run `rustup update stable`",
            wanted.0, wanted.1
        ));
    }
    for tool in ["fmt", "clippy"] {
        match first_line_of("cargo", &[tool, "--version"]) {
            Some(version) => println!("{version}"),
            None => {
                return Outcome::Failed(format!(
                    "cargo {tool} is missing; `rustup component add rustfmt clippy`"
                ));
            }
        }
    }
    Outcome::Passed
}

/// Major and minor of the first version number in a text.
fn version_numbers(text: &str) -> Option<(u32, u32)> {
    text.split(|c: char| !(c.is_ascii_digit() || c == '.')).find_map(|word| {
        let mut parts = word.split('.');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    })
}

/// Reports the peers that the tests will find; an error when a required one is missing.
pub(crate) fn report_peers(context: &Context<'_>) -> Outcome {
    print!("{}", context.peers.describe());
    let missing = context.peers.missing();
    match (missing.is_empty(), context.options.require_peers) {
        (true, _) => Outcome::Passed,
        (false, true) => {
            Outcome::PeerMissing(format!("--require-peers, but {} not found", missing.join(", ")))
        }
        (false, false) => {
            Outcome::NotRun(format!("tests that need {} will skip themselves", missing.join(", ")))
        }
    }
}

/// Runs cargo-deny where it is installed. CI does not install it: building it costs 150 CPU-seconds
/// (0.20.2, measured), and its advisory database comes from github.com, which CI cannot reach. The
/// `licences` step checks the same lists.
pub(crate) fn cargo_deny(context: &Context<'_>) -> Outcome {
    if first_line_of("cargo", &["deny", "--version"]).is_none() {
        return Outcome::NotRun(
            "cargo-deny is not installed (`cargo install --locked cargo-deny`)".to_owned(),
        );
    }
    let args = ["deny", "--all-features", "check", "licenses", "bans", "sources"];
    println!("cargo {}", args.join(" "));
    cargo(context, &args, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_compare_as_numbers() {
        assert_eq!(version_numbers("rustc 1.95.0 (59807616e 2026-04-14)"), Some((1, 95)));
        assert_eq!(version_numbers("\"1.95\""), Some((1, 95)));
        assert_eq!(version_numbers("nothing here"), None);
        assert!(version_numbers("1.9") < version_numbers("1.95"));
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
