//! `bench run`, and `bench` alone.

use super::report::write_page;
use super::{Common, RunArgs, UsageError, default_dir, print};
use crate::experiments::{self, Context, Experiment};
use crate::record::Record;
use std::path::PathBuf;
use std::time::Instant;

pub(super) fn run(common: Common, args: &RunArgs) -> anyhow::Result<()> {
    let chosen = args.ids.iter().map(|id| find(id)).collect::<Result<Vec<_>, _>>()?;
    let dir = args.out.clone().unwrap_or_else(default_dir);
    let mut dirs = vec![dir.clone()];
    if args.record {
        dirs.push(runs_dir()?);
    }
    let start = Instant::now();
    let mut say = |what: &str| {
        if !common.quiet {
            eprintln!("{:6.1} s  {what}", start.elapsed().as_secs_f64());
        }
    };
    let mut context = Context::new(args.quick, &mut say);
    for experiment in chosen {
        let record = experiments::run(experiment, &mut context)?;
        for dir in &dirs {
            record.write(dir)?;
        }
        if common.json {
            print(&serde_json::to_string(&record)?)?;
        } else {
            summary(&record)?;
        }
    }
    let page = write_page(&dir, &dir.join("index.html"))?;
    if !common.json {
        print(&format!("report: {}", page.display()))?;
    }
    Ok(())
}

/// Every experiment in its quick form. One that fails is reported, and the others go on.
pub(super) fn everything_quick(common: Common) -> anyhow::Result<()> {
    let dir = default_dir();
    let start = Instant::now();
    let mut failed = vec![];
    let count = experiments::ALL.len();
    for (i, experiment) in experiments::ALL.iter().enumerate() {
        let mut say = |what: &str| {
            if !common.quiet {
                let secs = start.elapsed().as_secs_f64();
                eprintln!("{secs:6.1} s  [{}/{count}] {}: {what}", i + 1, experiment.id);
            }
        };
        match experiments::run(experiment, &mut Context::new(true, &mut say)) {
            Ok(record) => {
                record.write(&dir)?;
                if common.json {
                    print(&serde_json::to_string(&record)?)?;
                }
            }
            Err(e) => {
                eprintln!("error: {e:#}");
                failed.push(experiment.id);
            }
        }
    }
    let page = write_page(&dir, &dir.join("index.html"))?;
    if !common.json {
        print(&format!("report: {}", page.display()))?;
    }
    anyhow::ensure!(failed.is_empty(), "these experiments failed: {}", failed.join(", "));
    Ok(())
}

fn find(id: &str) -> Result<&'static Experiment, UsageError> {
    experiments::find(id).ok_or_else(|| {
        let known: Vec<&str> = experiments::ALL.iter().map(|e| e.id).collect();
        UsageError(format!("there is no experiment `{id}`; `bench list` names them: {}", known.join(", ")))
    })
}

/// The ratios, or how many rows there are.
fn summary(r: &Record) -> anyhow::Result<()> {
    print(&format!("{}: {} ({} rows, {:.1} s)", r.id, r.title, r.rows.len(), r.elapsed_secs))?;
    for m in &r.missing {
        print(&format!("  missing: {m}"))?;
    }
    for x in &r.ratios {
        let low_high = format!("{:.2} to {:.2}", x.low, x.high);
        print(&format!("  {:6.2}  ({low_high})  {}  against  {}", x.value, x.name, x.rival))?;
    }
    Ok(())
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
