//! Measures ray queries from Python: rt_core's package beside those that Python programs use today,
//! and beside the same calls from Rust.

mod from_rust;

use super::Context;
use crate::record::{Record, Row};
use crate::runner::Ratio;
use crate::stats::Summary;
use anyhow::Context as _;
use from_rust::{FromRust, Question};
use serde::Deserialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

/// The program that measures; packages take turns in it.
const SCRIPT: &str = include_str!("rays.py");
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
    /// Hits, triangles of a build, or bytes.
    found: u64,
}

/// A line that the program prints.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Question(Question),
    Answer(Answer),
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column(
        "kind",
        "",
        "importing beyond numpy; from Ctrl-C to the end of a call; building; the first hit of each \
         ray; all hits of each ray; rays from inside a closed mesh to its vertices and edges; \
         memory of a mesh's structures, beyond the arrays that the caller has, and the most while \
         they are built",
    );
    record.column("triangles", "", "triangles of the mesh");
    record.column("rays", "", "rays of one call");
    record.column("tracer", "", "package");
    record.column("time", "s", "one call, median over the rounds, wall time, all threads");
    record.column("time_low", "s", "fastest round");
    record.column("time_high", "s", "slowest round");
    record.column("rate", "1/s", "rays per second, or triangles per second of a build");
    record.column("found", "", "rays that hit, or all hits; of rays to edges, those that miss");
    record.column("memory", "MB", "growth of a process that does nothing else");
    record.notes.push(
        "Rays in float32 from around an uneven ball towards it, in random order. trimesh takes \
         float64. PyVista and VTK trace one segment a call, 1000 at most. In its turn a package \
         answers a call again and again for 0.1 s, after one call that does not count."
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
    let folder = tempfile::tempdir()?;
    let mut order = if context.quick {
        json!({ "rings": [100], "rays": [1000, 10_000], "rounds": 3, "edge_rays": 400_000 })
    } else {
        let rays = [1000, 10_000, 1_000_000, 10_000_000];
        let rings = [158, 500, 1581];
        json!({ "rings": rings, "rays": rays, "rounds": 5, "edge_rays": 100_000_000 })
    };
    order["edge_rays_of_others"] = json!(if context.quick { 100_000 } else { 4_000_000 });
    order["folder"] = json!(folder.path());
    context.report_step("packages in turns")?;
    let answer = converse(&python, &order)?;
    record.missing.extend(answer.missing);
    let versions: Vec<String> = answer.versions.iter().map(|(m, v)| format!("{m} {v}")).collect();
    record.notes.push(format!("Packages: {}.", versions.join(", ")));
    for measured in &answer.rows {
        record.rows.extend(row(measured));
    }
    record.ratios.extend(ratios(&answer.rows));
    Ok(())
}

/// Runs the program, and answers its questions until it answers ours.
fn converse(python: &Path, order: &serde_json::Value) -> anyhow::Result<Answer> {
    let mut child = Command::new(python)
        .args(["-B", "-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("{} does not start", python.display()))?;
    let (input, output) = (child.stdin.take(), child.stdout.take());
    let (Some(mut input), Some(output)) = (input, output) else {
        anyhow::bail!("{} has no input or output", python.display());
    };
    writeln!(input, "{order}")?;
    let mut rust = FromRust::default();
    let mut found = None;
    for line in BufReader::new(output).lines() {
        match serde_json::from_str(&line?)? {
            Line::Question(question) => {
                let answer = rust.answer(question)?;
                writeln!(input, "{}", serde_json::to_string(&answer)?)?;
            }
            Line::Answer(answer) => found = Some(answer),
        }
    }
    let status = child.wait()?;
    anyhow::ensure!(status.success(), "{}: {status}", python.display());
    found.with_context(|| format!("{} ended without an answer", python.display()))
}

fn row(m: &Measured) -> Option<Row> {
    let row = Row::new()
        .with("kind", m.kind.as_str())
        .with("triangles", m.triangles)
        .with("rays", m.rays)
        .with("tracer", m.tracer.as_str());
    if m.kind.starts_with("memory") {
        return Some(row.with("memory", m.found as f64 / 1e6));
    }
    let time = Summary::of(&m.seconds)?;
    let count = match m.kind.as_str() {
        "build" => m.triangles,
        "first" | "all" | "edges" => m.rays,
        _ => 0,
    };
    Some(
        row.with("time", time.median)
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
