//! Runs the program `composite` in bounded time.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Far longer than any of these runs needs, even on a slow and busy machine; a hang fails here.
pub(super) const BOUND: Duration = Duration::from_secs(100);

pub(super) fn peer(variable: &str) -> Option<PathBuf> {
    let found = std::env::var_os(variable).map(PathBuf::from);
    if found.is_none() {
        assert!(
            std::env::var_os("RTSV_REQUIRE_PEERS").is_none(),
            "{variable} is not set, but RTSV_REQUIRE_PEERS is: `cargo xtask` sets both"
        );
        eprintln!("SKIPPED: {variable} is not set");
    }
    found
}

pub(super) struct ProgramOutput {
    pub(super) code: Option<i32>,
    pub(super) stdout: String,
    /// Output including stderr.
    pub(super) text: String,
    pub(super) took: Duration,
}

/// Runs the program; fails the test if it does not end in time.
pub(super) fn run(arguments: &[&str], variables: &[(&str, &Path)]) -> ProgramOutput {
    let begin = Instant::now();
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", &BOUND.as_secs().to_string()]);
    command.arg(env!("CARGO_BIN_EXE_composite")).args(arguments).stdin(Stdio::null());
    for launcher in
        ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "COMPOSITE_MPI", "COMPOSITE_MPIRUN"]
    {
        command.env_remove(launcher);
    }
    // Symbolising a backtrace takes seconds on a busy machine, longer than the waits that are
    // tested here.
    command.env("RUST_BACKTRACE", "0");
    command.envs(variables.iter().copied());
    let Output { status, stdout, stderr } = command.output().expect("coreutils' timeout runs");
    let stdout = String::from_utf8_lossy(&stdout).into_owned();
    let text = stdout.clone() + &String::from_utf8_lossy(&stderr);
    let took = begin.elapsed();
    assert!(took < BOUND, "{arguments:?} did not end:\n{text}");
    ProgramOutput { code: status.code(), stdout, text, took }
}
