//! `gluray explain`: an account of a run, in words.

use super::last_report;
use crate::classify::reasons::advice_for;
use crate::host::report::Report;
use anyhow::Context as _;
use datasets::cli::{CommonArgs, CureExt as _, Status};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Options of `gluray explain`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gluray explain
  gluray explain report.json
  gluray explain --json | jq .passed_reasons")]
pub(super) struct ExplainArgs {
    /// A report of `gluray run --report`; without it, that of the last run
    report: Option<PathBuf>,
}

pub(super) fn explain(args: &ExplainArgs, common: &CommonArgs) -> anyhow::Result<Status> {
    let (_, report) = read_report(args.report.as_deref())?;
    common.result(&report, || in_words(&report))?;
    Ok(Status::Success)
}

/// A report by name, or that of the last run.
pub(super) fn read_report(named: Option<&Path>) -> anyhow::Result<(PathBuf, Report)> {
    let file = named.map_or_else(last_report, Path::to_path_buf);
    let text = std::fs::read_to_string(&file)
        .with_context(|| format!("cannot read {}", file.display()))
        .cure("run a program first: `gluray run -- PROGRAM`")?;
    let report = serde_json::from_str(&text)
        .with_context(|| format!("{}: is no report", file.display()))
        .cure("give a file that `gluray run --report` wrote")?;
    Ok((file, report))
}

fn in_words(r: &Report) -> String {
    let mut s = String::new();
    let mut line = |text: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(s, "{text}");
    };
    line(format!("{}: mode {}, driver {}", r.program, or_none(&r.mode), or_none(&r.driver)));
    let per_frame = |n: u64| {
        if r.frames > 0 {
            format!(" ({:.1} a frame)", n as f64 / r.frames as f64)
        } else {
            String::new()
        }
    };
    line(format!("{} frames", r.frames));

    // What was traced.
    line(format!("\ntraced  {:>12} draws{}", r.traced_draws, per_frame(r.traced_draws)));
    if r.traced_draws > 0 {
        line(format!("        {:>12} triangles, {} pixels", r.triangles, r.pixels));
        line(format!(
            "        {:>12} geometries were there already, {} were new, {} structures built, {} \
             refitted",
            r.cache_hits, r.cache_misses, r.builds, r.refits
        ));
        if r.pictures_again > 0 {
            line(format!(
                "        {:>12} pictures shown again, as nothing had changed",
                r.pictures_again
            ));
        }
        for (kind, n) in by_size(&r.rays) {
            line(format!("        {n:>12} rays: {kind}"));
        }
    }

    // Who traced it.
    for rank in &r.ranks {
        let of = if rank.rank == 0 { "the program" } else { "helper" };
        let lost = rank.lost.as_ref().map_or(String::new(), |why| format!("; lost: {why}"));
        line(format!(
            "        {:>12} pictures by rank {} ({of}): {:.1} ms each, {} rays, {} structures \
             built, {} refitted, {} kB sent to it, {} kB of rows back{lost}",
            rank.pictures,
            rank.rank,
            rank.trace_ms / rank.pictures.max(1) as f64,
            rank.rays,
            rank.builds,
            rank.refits,
            rank.sent_bytes / 1000,
            rank.received_bytes / 1000
        ));
    }

    // What was not, and why.
    line(format!("\npassed  {:>12} draws{}", r.passed_draws, per_frame(r.passed_draws)));
    for (why, n) in by_size(&r.passed_reasons) {
        line(format!("        {n:>12} {why}"));
        if let Some(text) = advice_for(why, &r.mode, r.trace_all) {
            line(format!("                     → {text}"));
        }
    }
    for c in &r.routes {
        line(format!(
            "        from frame {} on {}: {} triangles on {} pixels cost the driver {:.1} ms, and \
             rays {:.1} (by the model of costs)",
            c.frame,
            if c.to == "rays" { "rays draw" } else { "the driver draws" },
            c.triangles,
            c.pixels,
            c.driver_ms,
            c.rays_ms
        ));
    }
    if r.traced_draws + r.passed_draws == 0 && r.mode == "off" {
        line("        tracing was off: calls went to the driver as they came, uncounted".into());
        line("                     → switch it on with --mode or on the panel".into());
    } else if r.traced_draws + r.passed_draws == 0 {
        line(
            "        nothing was drawn: the library did not reach the program, or the program uses \
             no OpenGL"
                .into(),
        );
        line("                     → `gluray doctor` says how programs are reached".into());
    }

    // When pictures were finished, and the time.
    if !r.flushes.is_empty() {
        line("\npictures were finished before".into());
        by_size(&r.flushes)
            .into_iter()
            .for_each(|(before, n)| line(format!("        {n:>12} {before}")));
    }
    if !r.milliseconds.is_empty() {
        line("\ntime".into());
        let mut phases: Vec<_> = r.milliseconds.iter().collect();
        phases.sort_by(|a, b| b.1.total_cmp(a.1));
        for (phase, ms) in phases {
            let each = if r.frames > 0 {
                format!(", {:.2} a frame", ms / r.frames as f64)
            } else {
                String::new()
            };
            line(format!("        {ms:>12.1} ms {phase}{each}"));
        }
        slowness(r).into_iter().for_each(|text| line(format!("                     → {text}")));
    }
    if !r.objects.is_empty() {
        line("\nobjects, by the keys that [objects.KEY] takes".into());
        for o in r.objects.iter().take(20) {
            line(format!("        {:>12} triangles  {}  {}", o.triangles, o.key, o.name));
        }
        if r.objects.len() > 20 {
            line(format!("        {:>12} more, see --json", r.objects.len() - 20));
        }
    }
    r.problems.iter().for_each(|p| line(format!("\nSETTING NOT TAKEN: {p}")));
    r.faults.iter().for_each(|f| line(format!("\nFAULT (the driver drew from here on): {f}")));
    s.truncate(s.trim_end().len());
    s
}

/// Why frames are slow, in milliseconds a frame from which a program no longer feels direct.
fn slowness(r: &Report) -> Option<String> {
    const SLOW: f64 = 100.0;
    let frames = r.frames.max(1) as f64;
    let of = |phase: &str| r.milliseconds.get(phase).copied().unwrap_or(0.0) / frames;
    if of("trace") < SLOW {
        return None;
    }
    let all: u64 = r.rays.values().sum();
    let (kind, most) = by_size(&r.rays).into_iter().next()?;
    let cure = match kind {
        "shadow" => "--set effects.shadows=false sends none of them",
        "ambient occlusion" => "--set effects.ambient_occlusion_samples=N sends fewer",
        "path" => "--set samples=N sends fewer",
        _ if r.mode == "match" => "a smaller window has fewer pixels",
        _ => "--mode match sends only what the driver's picture needs",
    };
    Some(format!(
        "tracing takes {:.0} ms a frame, and {:.0} % of its rays are {kind}: {cure}",
        of("trace"),
        100.0 * most as f64 / all.max(1) as f64
    ))
}

fn or_none(text: &str) -> &str {
    if text.is_empty() { "unknown" } else { text }
}

fn by_size(map: &BTreeMap<String, u64>) -> Vec<(&str, u64)> {
    let mut list: Vec<(&str, u64)> = map.iter().map(|(k, n)| (k.as_str(), *n)).collect();
    list.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    list
}
