//! The command-line conventions in a real process: closed pipes, Ctrl-C, exit codes.
#![cfg(all(feature = "cli", unix))]

use datasets::cli::{Cancel, CommonArgs, Status, status_of};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const MODE: &str = "RTSV_TEST_CLI_CHILD";

/// Not a test: the code of the child processes (this test binary, with `MODE` set).
#[test]
fn child() {
    let Ok(mode) = std::env::var(MODE) else { return };
    let common = CommonArgs { json: true, ..Default::default() };
    let work = || -> anyhow::Result<Status> {
        if mode == "many lines" {
            for i in 0..1_000_000 {
                common.result(&i, || i)?;
            }
        } else {
            let cancel = Cancel::on_ctrl_c()?;
            common.result(&"ready", || "ready")?;
            let started = Instant::now();
            while mode == "deaf" || !cancel.is_set() {
                anyhow::ensure!(
                    started.elapsed() < Duration::from_secs(60),
                    "nobody pressed Ctrl-C"
                );
                std::thread::sleep(Duration::from_millis(5));
            }
            common.result(&"kept", || "kept")?;
            cancel.check()?;
        }
        Ok(Status::Success)
    };
    #[expect(clippy::exit, reason = "the test harness would turn the status into its own")]
    std::process::exit(status_of(work()) as i32);
}

fn start(mode: &str) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child", "--nocapture"])
        .env(MODE, mode)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn interrupt(child: &Child) {
    assert!(
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success()
    );
}

/// Waits for a line of the child, skipping lines of the test harness.
fn wait_for(expected: &str, child: &mut Child) -> BufReader<std::process::ChildStdout> {
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while line.trim_end() != expected {
        line.clear();
        assert_ne!(out.read_line(&mut line).unwrap(), 0, "the child ended early");
    }
    out
}

#[test]
fn closed_pipe_ends_quietly_with_success() {
    let mut child = start("many lines");
    drop(wait_for("0", &mut child));
    let end = child.wait_with_output().unwrap();
    assert_eq!(end.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&end.stderr), "");
}

#[test]
fn ctrl_c_keeps_what_is_finished_and_ends_with_130() {
    let mut child = start("cancellable");
    let mut out = wait_for("\"ready\"", &mut child);
    interrupt(&child);
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    assert_eq!(line.trim_end(), "\"kept\"");
    let end = child.wait_with_output().unwrap();
    assert_eq!(end.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&end.stderr).contains("Ctrl-C again"));
}

#[test]
fn second_ctrl_c_ends_a_program_that_does_not_listen() {
    let mut child = start("deaf");
    let _out = wait_for("\"ready\"", &mut child);
    interrupt(&child);
    // Pending signals of the same kind are merged: wait until the first one was handled.
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
}
