//! Figure 4.8: a timeline of ray traced frames of ParaView.

use super::Context;
use crate::opengl::{Backend, Display, Drawing, Program, Session, Tools, write};
use crate::record::{Attachment, Record, Row};
use crate::stats::Summary;
use anyhow::Context as _;
use datasets::cli::UsageError;
use datasets::generate::nested_wavelet::Size;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("track", "", "thread or kind of work");
    record.column("phase", "", "what was done");
    record.column("count", "", "how often");
    record.column("total", "ms", "all of them together");
    record.column("time", "ms", "median");
    record.column("time_low", "ms", "shortest");
    record.column("time_high", "ms", "longest");
    let paraview = Program::ParaView;
    let (tools, found) = (Tools::find(), paraview.find());
    let (Ok(tools), Ok(_)) = (&tools, &found) else {
        let missing: Vec<String> = tools.err().into_iter().flatten().chain(found.err()).collect();
        return Err(UsageError(format!(
            "fig4.8 needs programs that are not here:\n  {}",
            missing.join("\n  ")
        ))
        .into());
    };
    let (mesh, frames) = match context.quick {
        true => (crate::meshes::coarse_wavelet(51)?, 10),
        // As in the dissertation.
        false => (context.wavelet(Size::M8)?, 40),
    };
    record.notes.push(format!(
        "pvbatch turns a camera around {} triangles for {frames} frames through `gluray run`; the \
         phases are those that the library wrote down meanwhile.",
        mesh.num_triangles()
    ));
    context.report_step("data")?;
    let dir = tempfile::tempdir()?;
    let data = dir.path().join("surfaces.vtp");
    write(&mesh, paraview.format(), &data)?;
    let display = Display::start(&tools.xvfb)?;
    context.report_step("ParaView starts")?;
    let mut session = Session::start(
        paraview,
        Backend::AlwaysRays,
        Some(&tools.gluray),
        &display,
        &dir.path().join("run"),
        Drawing { data: &data, size_px: 1024, view: None },
    )?;
    context.report_step("frames")?;
    session.frames(frames)?;
    let report = session.end()?.context("gluray leaves a report")?;
    let spans = report["timeline"].as_array().map_or(&[][..], Vec::as_slice);
    anyhow::ensure!(!spans.is_empty(), "nothing was traced: {}", report["passed_reasons"]);
    let mut phases: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for s in spans {
        let text = |k: &str| s[k].as_str().unwrap_or("").to_string();
        phases
            .entry((text("track"), text("phase")))
            .or_default()
            .push(s["ms"].as_f64().unwrap_or(0.0));
    }
    for ((track, phase), times) in &phases {
        let Some(t) = Summary::of(times) else { continue };
        record.rows.push(
            Row::new()
                .with("track", track.as_str())
                .with("phase", phase.as_str())
                .with("count", times.len())
                .with("total", times.iter().sum::<f64>())
                .with("time", t.median)
                .with("time_low", t.low)
                .with("time_high", t.high),
        );
    }
    context.report_step("charts")?;
    let file = |name: &str| dir.path().join(name);
    std::fs::write(file("report.json"), serde_json::to_vec(&report)?)?;
    draw(&tools.gluray, &file("report.json"), &[&file("chart.svg"), &file("trace.json")], None)?;
    // Most of the run is one build; some of the last frames show the typical frame.
    let (from, to) = last_frames_range_ms(spans);
    draw(&tools.gluray, &file("report.json"), &[&file("frames.svg")], Some((from, to)))?;
    for (name, caption) in [
        ("chart.svg", "The run: builds and frames."),
        ("frames.svg", "The last frames of the run."),
        ("trace.json", "The same for chrome://tracing and Perfetto."),
    ] {
        let bytes = std::fs::read(file(name))?;
        record.attachments.push(Attachment { name: name.into(), caption: caption.into(), bytes });
    }
    Ok(())
}

/// The time range of some frames at the end of the run, in milliseconds.
fn last_frames_range_ms(spans: &[Value]) -> (f64, f64) {
    let frame = |s: &Value| s["frame"].as_u64().unwrap_or(0);
    let last = spans.iter().map(frame).max().unwrap_or(0);
    let shown = |s: &&Value| (last.saturating_sub(5)..last).contains(&frame(s));
    let from = spans
        .iter()
        .filter(shown)
        .filter_map(|s| s["start_ms"].as_f64())
        .fold(f64::INFINITY, f64::min);
    let to = spans
        .iter()
        .filter(shown)
        .filter_map(|s| Some(s["start_ms"].as_f64()? + s["ms"].as_f64()?))
        .fold(0.0, f64::max);
    (from, to)
}

fn draw(
    gluray: &Path,
    report: &Path,
    files: &[&Path],
    window: Option<(f64, f64)>,
) -> anyhow::Result<()> {
    let mut command = Command::new(gluray);
    command.args(["--quiet", "timeline"]).arg(report);
    for f in files {
        command.arg("-o").arg(f);
    }
    if let Some((from, to)) = window.filter(|(from, to)| from < to) {
        command.args(["--from", &from.to_string(), "--to", &to.to_string()]);
    }
    let output = command.output().context("cannot start `gluray timeline`")?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    anyhow::ensure!(
        output.status.success() && files.iter().all(|f| f.is_file()),
        "`gluray timeline`: {stderr}"
    );
    Ok(())
}
