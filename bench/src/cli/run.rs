//! `bench run`, and `bench` alone.

use super::report::write_page;
use super::{RunArgs, default_dir};
use crate::experiments::{self, Context, Experiment};
use crate::record::Record;
use datasets::cli::{Cancel, CommonArgs, Interrupted, UsageError};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(common: CommonArgs, args: &RunArgs) -> anyhow::Result<()> {
    let chosen = args.ids.iter().map(|id| find(id)).collect::<Result<Vec<_>, _>>()?;
    let dir = args.out.clone().unwrap_or_else(default_dir);
    let mut dirs = vec![dir.clone()];
    if args.record {
        dirs.push(runs_dir()?);
    }
    let (start, cancel) = (Instant::now(), Cancel::on_ctrl_c()?);
    let mut progress = |what: &str| {
        common.note(0, format_args!("{:6.1} s  {what}", start.elapsed().as_secs_f64()));
        Ok(cancel.check()?)
    };
    let mut context = Context::new(args.quick, &mut progress);
    for experiment in chosen {
        let record = experiments::run(experiment, &mut context)?;
        for dir in &dirs {
            record.write(dir)?;
        }
        common.result(&record, || summary(&record))?;
    }
    finish(common, &dir)
}

/// Every experiment in its quick form. One that fails is reported, and the others go on.
pub(super) fn everything_quick(common: CommonArgs) -> anyhow::Result<()> {
    let dir = default_dir();
    let (start, cancel) = (Instant::now(), Cancel::on_ctrl_c()?);
    let mut failed = vec![];
    let count = experiments::ALL.len();
    for (i, experiment) in experiments::ALL.iter().enumerate() {
        let mut progress = |what: &str| {
            let secs = start.elapsed().as_secs_f64();
            common.note(0, format_args!("{secs:6.1} s  [{}/{count}] {}: {what}", i + 1, experiment.id));
            Ok(cancel.check()?)
        };
        match experiments::run(experiment, &mut Context::new(true, &mut progress)) {
            Ok(record) => {
                record.write(&dir)?;
                if common.json {
                    common.result(&record, String::new)?;
                }
            }
            Err(e) if e.is::<Interrupted>() => {
                // What was finished is worth its report.
                finish(common, &dir)?;
                return Err(e);
            }
            Err(e) => {
                common.warn(format_args!("{e:#}"));
                failed.push(experiment.id);
            }
        }
    }
    finish(common, &dir)?;
    anyhow::ensure!(failed.is_empty(), "these experiments failed: {}", failed.join(", "));
    Ok(())
}

/// Makes the report and says where it is: on standard output, or beside the progress where that carries JSON.
fn finish(common: CommonArgs, dir: &Path) -> anyhow::Result<()> {
    let page = write_page(dir, &dir.join("index.html"))?;
    if common.json {
        common.note(0, format_args!("report: {}", page.display()));
        return Ok(());
    }
    common.result(&json!({}), || format!("report: {}", page.display()))
}

fn find(id: &str) -> Result<&'static Experiment, UsageError> {
    experiments::find(id).ok_or_else(|| {
        let known: Vec<&str> = experiments::ALL.iter().map(|e| e.id).collect();
        UsageError(format!("there is no experiment `{id}`; `bench list` names them: {}", known.join(", ")))
    })
}

/// What is missing and the ratios.
fn summary(r: &Record) -> String {
    let mut text = format!("{}: {} ({} rows, {:.1} s)", r.id, r.title, r.rows.len(), r.elapsed_secs);
    for m in &r.missing {
        text += &format!("\n  missing: {m}");
    }
    for x in &r.ratios {
        let low_high = format!("{:.2} to {:.2}", x.low, x.high);
        text += &format!("\n  {:6.2}  ({low_high})  {}  against  {}", x.value, x.name, x.rival);
    }
    text
}

/// `bench/runs/DATE-MACHINE` of the repository that the working directory is in.
fn runs_dir() -> anyhow::Result<PathBuf> {
    let here = std::env::current_dir()?;
    let root = here.ancestors().find(|d| d.join("bench/Cargo.toml").exists()).ok_or_else(|| {
        UsageError(
            "--record writes to bench/runs of the repository: start `bench` inside it, or use --out".into(),
        )
    })?;
    let machine = crate::machine::Machine::describe();
    Ok(root.join("bench/runs").join(format!("{}-{}", machine.day(), machine.slug())))
}
