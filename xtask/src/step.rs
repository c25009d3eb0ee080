//! What the steps of a run have in common: the state that they see and how they end.

use crate::TestOptions;
use crate::peers::Peers;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

/// One check.
#[derive(Debug)]
pub(crate) struct Step {
    /// Name in the summary and for `--only`.
    pub(crate) name: &'static str,
    /// What a passed step shows.
    pub(crate) tells: &'static str,
    /// The action.
    pub(crate) action: Action,
}

/// What a step does.
#[derive(Debug)]
pub(crate) enum Action {
    /// Runs cargo in the workspace root; passes when it exits with 0.
    Cargo {
        /// Arguments of cargo.
        args: &'static [&'static str],
        /// Environment variables set for this command only.
        env: &'static [(&'static str, &'static str)],
    },
    /// Calls a function of this program.
    Call(fn(&Context<'_>) -> Outcome),
}

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

impl Context<'_> {
    /// Runs cargo in the root with the peers' variables set.
    pub(crate) fn cargo(&self, args: &[&str], env: &[(&str, &str)]) -> Outcome {
        outcome(self.command(args, env).status())
    }

    /// [`Context::cargo`], and what it printed instead of printing it.
    pub(crate) fn cargo_in_silence(
        &self,
        args: &[&str],
        env: &[(&str, &str)],
    ) -> (Outcome, Vec<u8>) {
        match self.command(args, env).stdin(Stdio::null()).output() {
            Ok(output) => (outcome(Ok(output.status)), [output.stdout, output.stderr].concat()),
            Err(e) => (outcome(Err(e)), Vec::new()),
        }
    }

    fn command(&self, args: &[&str], env: &[(&str, &str)]) -> Command {
        let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        command.args(args).current_dir(self.root).envs(env.iter().copied());
        command.envs(self.peers.environment(self.options.require_peers));
        command
    }
}

/// How a step ended that ran cargo.
fn outcome(ended: std::io::Result<ExitStatus>) -> Outcome {
    match ended {
        Ok(status) if status.success() => Outcome::Passed,
        Ok(status) => Outcome::Failed(status.to_string()),
        Err(e) => Outcome::Failed(format!("cargo does not start: {e}")),
    }
}
