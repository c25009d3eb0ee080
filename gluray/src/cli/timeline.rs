//! `gluray timeline`.

use super::explain::read_report;
use crate::host::timeline::{GanttOptions, chrome_trace, gantt_svg};
use anyhow::Context;
use clap::Args;
use datasets::cli::{CommonArgs, UsageError};
use serde_json::json;
use std::path::PathBuf;

/// Options of `gluray timeline`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  gluray timeline -o run.svg                   the last run as a chart
  gluray timeline report.json -o run.json      for chrome://tracing or https://ui.perfetto.dev
  gluray timeline -o first.svg --from 0 --to 500")]
pub(super) struct TimelineArgs {
    /// A report of `gluray run --report`; without it that of the last run
    report: Option<PathBuf>,
    /// Where to draw: .svg for a chart, .json for Chrome's trace viewer; several times for several
    /// files
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// First millisecond of a chart
    #[arg(long, value_name = "MS")]
    from: Option<f64>,
    /// Last millisecond of a chart
    #[arg(long, value_name = "MS")]
    to: Option<f64>,
    /// Width of a chart, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(300..=20000))]
    width: u32,
}

pub(super) fn timeline(common: CommonArgs, args: &TimelineArgs) -> anyhow::Result<()> {
    let ending = |p: &PathBuf| p.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    if let Some(other) =
        args.output.iter().find(|p| !matches!(ending(p).as_deref(), Some("svg" | "json")))
    {
        return Err(UsageError(format!(
            "{}: no known ending; give .svg or .json",
            other.display()
        ))
        .into());
    }
    let (path, report) = read_report(args.report.as_deref())?;
    let spans = &report.timeline;
    let first = spans.iter().map(|s| s.start_ms).fold(f64::INFINITY, f64::min);
    let last =
        spans.iter().map(crate::host::timeline::Span::end_ms).fold(f64::NEG_INFINITY, f64::max);
    let window = [args.from.unwrap_or(first), args.to.unwrap_or(last)];
    let asked = args.from.is_some() || args.to.is_some();
    if asked && (window[0] >= window[1] || window.iter().any(|v| v.is_nan())) {
        return Err(UsageError(format!(
            "nothing lies between {} and {} ms; the run has {first:.1} to {last:.1} ms",
            window[0], window[1]
        ))
        .into());
    }
    if spans.is_empty() {
        common.warn(format_args!(
            "{}: no phase was recorded; nothing was traced in that run",
            path.display()
        ));
    }
    for file in &args.output {
        let text = match ending(file).as_deref() {
            Some("svg") => {
                let title = format!("{}, mode {}", report.program, report.mode);
                gantt_svg(
                    spans,
                    &GanttOptions { title, width: args.width, window_ms: asked.then_some(window) },
                )
            }
            _ => chrome_trace(&report.program, spans).to_string(),
        };
        std::fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))?;
        common.result(&json!({ "file": file, "spans": spans.len() }), || {
            file.display().to_string()
        })?;
    }
    Ok(())
}
