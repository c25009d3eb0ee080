//! `gluray explain`: an account of a run, in words.

use super::last_report;
use anyhow::Context as _;
use datasets::cli::{CommonArgs, CureExt as _, Status};
use gluray::report::Report;
use std::fmt::Write as _;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct ExplainArgs {
    /// A report of `gluray run --report`; without it, the last run.
    report: Option<PathBuf>,
}

pub(crate) fn explain(args: &ExplainArgs, common: &CommonArgs) -> anyhow::Result<Status> {
    let file = args.report.clone().unwrap_or_else(last_report);
    let text = std::fs::read_to_string(&file)
        .with_context(|| format!("cannot read {}", file.display()))
        .cure("run a program first: `gluray run -- PROGRAM`")?;
    let report: Report = serde_json::from_str(&text).with_context(|| format!("{} is no report", file.display()))?;
    common.result(&report, || in_words(&report))?;
    Ok(Status::Success)
}

fn in_words(r: &Report) -> String {
    let mut s = String::new();
    let mut line = |text: String| writeln!(s, "{text}").expect("writing to a String cannot fail");
    line(format!("{} (mode {}) on {}", r.program, r.mode, r.driver));
    line(format!("frames {}, draw calls traced {}, passed {}", r.frames, r.traced_draws, r.passed_draws));
    let mut reasons: Vec<_> = r.passed_reasons.iter().collect();
    reasons.sort_by(|a, b| b.1.cmp(a.1));
    reasons.iter().for_each(|(why, n)| line(format!("  passed {n:>9}  {why}")));
    r.flushes.iter().for_each(|(before, n)| line(format!("  drawn  {n:>9}  {before}")));
    r.rays.iter().for_each(|(kind, n)| line(format!("rays {kind}: {n}")));
    line(format!("triangles {}, structures built {}, geometry found again {} times, new {}", r.triangles, r.builds, r.cache_hits, r.cache_misses));
    r.milliseconds.iter().for_each(|(phase, ms)| line(format!("time in {phase}: {ms:.1} ms")));
    if r.traced_draws == 0 {
        line("nothing was traced: the reasons above say why; `--trace all` traces more".to_owned());
    }
    r.faults.iter().for_each(|f| line(format!("FAULT (the driver drew from here on): {f}")));
    s.truncate(s.trim_end().len());
    s
}
