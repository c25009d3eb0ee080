//! Measures the cost of a call that is forwarded to the driver.

use super::Context;
use crate::opengl::{Display, Tools};
use crate::record::{Record, Row};
use crate::runner;
use crate::stats::Summary;
use anyhow::Context as _;
use datasets::cli::UsageError;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// The routes that a program's calls can take.
const BACKENDS: [(&str, &[&str]); 3] = [
    ("native", &[]),
    ("vendor library", &["run", "--via", "vendor", "--"]),
    ("LD_PRELOAD", &["run", "--via", "preload", "--"]),
];

/// The program that makes the calls.
const CALLS: &str = include_str!("../opengl/scripts/calls.c");

/// The calls whose times the program reports, in its order.
fn calls_of(source: &str) -> Vec<&str> {
    let timed = source.lines().filter_map(|l| l.trim_start().strip_prefix("TIME(\""));
    timed.filter_map(|l| l.split('"').next()).collect()
}

/// Rejects a run that does not report each call once: the comparison would be incomplete.
fn check_complete(backend: &str, calls: &[&str], reported: &[(String, f64)]) -> anyhow::Result<()> {
    let missing: Vec<&str> =
        calls.iter().copied().filter(|c| reported.iter().all(|(t, _)| t != c)).collect();
    anyhow::ensure!(
        missing.is_empty(),
        "{backend}: the program of calls ended well, but reported no time of {}; is the gluray next \
         to bench as new as bench? `cargo build --workspace` builds both",
        missing.join(", ")
    );
    anyhow::ensure!(
        reported.len() == calls.len(),
        "{backend}: the program of calls reported {} times of {} calls",
        reported.len(),
        calls.len()
    );
    Ok(())
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("call", "", "an OpenGL call outside of Begin and End");
    record.column(
        "backend",
        "",
        "direct to Mesa, or through gluray as GLVND's vendor library or by LD_PRELOAD",
    );
    record.column(
        "time",
        "ns",
        "a call: median over the runs of each run's best round of two million",
    );
    record.column("time_low", "ns", "fastest run");
    record.column("time_high", "ns", "slowest run");
    record.column("overhead", "ns", "how much more than native, median over pairs of runs");
    record.notes.push(
        "CPU time of the thread that calls, in a program in C that opens OpenGL with dlopen; runs \
         take turns. Colours and normals are kept back until \
         something needs them, so they can cost less than native."
            .into(),
    );
    let compiler = crate::opengl::find("RTSV_CC", "/usr/bin/cc");
    let tools = Tools::find();
    let (Ok(tools), Some(compiler)) = (&tools, &compiler) else {
        let mut missing = tools.err().unwrap_or_default();
        if compiler.is_none() {
            missing.push("cc: install gcc, or name a C compiler in RTSV_CC".into());
        }
        return Err(UsageError(format!(
            "passing needs programs that are not here:\n  {}",
            missing.join("\n  ")
        ))
        .into());
    };
    let dir = tempfile::tempdir()?;
    let (source, program) = (dir.path().join("calls.c"), dir.path().join("calls"));
    std::fs::write(&source, CALLS)?;
    let made = Command::new(compiler)
        .arg("-O2")
        .arg("-o")
        .arg(&program)
        .arg(&source)
        .arg("-ldl")
        .output()?;
    anyhow::ensure!(
        made.status.success(),
        "the C compiler: {}",
        String::from_utf8_lossy(&made.stderr)
    );
    let display = Display::start(&tools.xvfb)?;
    let runs = if context.quick { 3 } else { 11 };
    let mut times: BTreeMap<(String, usize), Vec<f64>> = BTreeMap::new();
    let calls = calls_of(CALLS);
    for n in 0..runs {
        context.report_step(format!("run {} of {runs}", n + 1))?;
        for backend in runner::order(BACKENDS.len(), n) {
            let reported = measure(tools, &display, &program, BACKENDS[backend].1)?;
            check_complete(BACKENDS[backend].0, &calls, &reported)?;
            for (call, ns) in reported {
                times.entry((call, backend)).or_default().push(ns);
            }
        }
    }
    for call in calls {
        for (backend, (name, _)) in BACKENDS.iter().enumerate() {
            let (own, native) =
                (&times[&(call.to_string(), backend)], &times[&(call.to_string(), 0)]);
            let more: Vec<f64> = own.iter().zip(native).map(|(o, n)| o - n).collect();
            let Some(t) = Summary::of(own) else { continue };
            let row = Row::new().with("call", call).with("backend", *name).with("time", t.median);
            let row = row.with("time_low", t.low).with("time_high", t.high);
            record.rows.push(row.with("overhead", Summary::of(&more).map(|s| s.median)));
        }
    }
    Ok(())
}

fn measure(
    tools: &Tools,
    display: &Display,
    program: &Path,
    through: &[&str],
) -> anyhow::Result<Vec<(String, f64)>> {
    let mut command = match through {
        [] => Command::new(program),
        options => {
            let mut c = Command::new(&tools.gluray);
            c.arg("--quiet").args(options).arg(program);
            c
        }
    };
    let place = program.parent().unwrap_or(Path::new("."));
    let output = command
        .env("DISPLAY", display.name())
        .env("LIBGL_ALWAYS_SOFTWARE", "1")
        .env("GALLIUM_DRIVER", "llvmpipe")
        .env("XDG_STATE_HOME", place)
        .output()
        .context("cannot start the program of calls")?;
    let reported = String::from_utf8_lossy(&output.stderr);
    anyhow::ensure!(output.status.success(), "the program of calls: {reported}");
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .map(|l| {
            let (call, ns) = l.split_once(' ').context("a line of a call and its time")?;
            Ok((call.to_string(), ns.parse()?))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_leaves_a_call_out_is_refused_with_its_backend_and_the_call() {
        let calls = calls_of(CALLS);
        assert_eq!(calls.len(), 8, "{calls:?}");
        let mut reported: Vec<(String, f64)> = calls.iter().map(|c| (c.to_string(), 1.0)).collect();
        check_complete("native", &calls, &reported).expect("all are reported");
        reported.retain(|(call, _)| call != "glEnable");
        let why = check_complete("LD_PRELOAD", &calls, &reported)
            .expect_err("one is missing")
            .to_string();
        assert!(
            why.contains("LD_PRELOAD") && why.contains("glEnable") && !why.contains("glColor3f"),
            "{why}"
        );
    }
}
