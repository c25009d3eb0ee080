//! Measures ray queries from Python: rt_core's package beside those that Python programs use today.

use super::Context;
use crate::record::{Record, Row};
use crate::runner::Ratio;
use crate::stats::Summary;
use anyhow::Context as _;
use serde::Deserialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write as _;
use std::process::{Command, Stdio};

/// The program that measures; packages take turns in it.
const SCRIPT: &str = include_str!("python_rays.py");
const OURS: &str = "rt_core";

/// What the program prints.
#[derive(Deserialize)]
struct Answer {
    versions: BTreeMap<String, String>,
    missing: Vec<String>,
    rows: Vec<Measured>,
}

/// One package at one task.
#[derive(Deserialize)]
struct Measured {
    kind: String,
    triangles: u64,
    rays: u64,
    tracer: String,
    /// One of each round.
    seconds: Vec<f64>,
    /// Hits, or triangles of a build.
    found: u64,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column(
        "kind",
        "",
        "importing beyond numpy; from Ctrl-C to the end of a call; building; the first hit of each \
         ray; all hits of each ray",
    );
    record.column("triangles", "", "triangles of the mesh");
    record.column("rays", "", "rays of one call");
    record.column("tracer", "", "package");
    record.column("time", "s", "one call, median over the rounds, wall time, all threads");
    record.column("time_low", "s", "fastest round");
    record.column("time_high", "s", "slowest round");
    record.column("rate", "1/s", "rays per second, or triangles per second of a build");
    record.column("found", "", "rays that hit, or all hits");
    record.notes.push(
        "Rays in float32 from around an uneven ball towards it, in random order. trimesh takes \
         float64. PyVista traces one segment a call, 1000 at most."
            .into(),
    );
    let python = crate::opengl::find("RTSV_RT_CORE_PYTHON", "target/wheels/adapted/bin/python");
    let Some(python) = python else {
        record.missing.push(
            "a Python with rt_core: run `cargo xtask wheels`, or name one in RTSV_RT_CORE_PYTHON"
                .to_owned(),
        );
        return Ok(());
    };
    let order = if context.quick {
        json!({ "rings": [100], "rays": [1000, 10_000], "rounds": 3 })
    } else {
        json!({ "rings": [158, 500, 1581], "rays": [1000, 10_000, 1_000_000], "rounds": 7 })
    };
    context.report_step("packages in turns")?;
    let mut child = Command::new(&python)
        .args(["-B", "-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("{} does not start", python.display()))?;
    if let Some(mut input) = child.stdin.take() {
        input.write_all(order.to_string().as_bytes())?;
    }
    let output = child.wait_with_output()?;
    anyhow::ensure!(output.status.success(), "{}: {}", python.display(), output.status);
    let answer: Answer = serde_json::from_slice(&output.stdout)?;
    record.missing.extend(answer.missing);
    let versions: Vec<String> = answer.versions.iter().map(|(m, v)| format!("{m} {v}")).collect();
    record.notes.push(format!("Packages: {}.", versions.join(", ")));
    for measured in &answer.rows {
        record.rows.extend(row(measured));
    }
    record.ratios.extend(ratios(&answer.rows));
    Ok(())
}

fn row(m: &Measured) -> Option<Row> {
    let time = Summary::of(&m.seconds)?;
    let count = match m.kind.as_str() {
        "build" => m.triangles,
        "first" | "all" => m.rays,
        _ => 0,
    };
    Some(
        Row::new()
            .with("kind", m.kind.as_str())
            .with("triangles", m.triangles)
            .with("rays", m.rays)
            .with("tracer", m.tracer.as_str())
            .with("time", time.median)
            .with("time_low", time.low)
            .with("time_high", time.high)
            .with("rate", count as f64 / time.median)
            .with("found", m.found),
    )
}

/// Ours against each other package, at each task.
fn ratios(rows: &[Measured]) -> Vec<Ratio> {
    let mut ratios = Vec::new();
    for ours in rows.iter().filter(|m| m.tracer == OURS) {
        let same = |m: &&Measured| {
            m.kind == ours.kind && m.triangles == ours.triangles && m.rays == ours.rays
        };
        for other in rows.iter().filter(same).filter(|m| m.tracer != OURS) {
            let rounds: Vec<f64> =
                other.seconds.iter().zip(&ours.seconds).map(|(o, s)| o / s).collect();
            let name = match ours.kind.as_str() {
                "build" => format!("{OURS}: build of {} triangles", ours.triangles),
                "import" => format!("{OURS}: import"),
                kind => format!(
                    "{OURS}: {kind} hits of {} rays, {} triangles",
                    ours.rays, ours.triangles
                ),
            };
            ratios.extend(Ratio::of_rounds(name, other.tracer.as_str(), &rounds));
        }
    }
    ratios
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_formed_within_rounds_of_the_same_task() {
        let of = |tracer: &str, kind: &str, seconds: [f64; 2]| Measured {
            kind: kind.into(),
            triangles: 4,
            rays: 9,
            tracer: tracer.into(),
            seconds: seconds.to_vec(),
            found: 1,
        };
        let rows =
            [of(OURS, "first", [1.0, 2.0]), of("x", "first", [3.0, 6.0]), of("x", "all", [9.0; 2])];
        let ratios = ratios(&rows);
        assert_eq!(ratios.len(), 1);
        assert!((ratios[0].value - 3.0).abs() < 1e-12 && ratios[0].baseline == "x");
    }
}
