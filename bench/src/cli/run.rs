//! `bench run`, and `bench` alone.

use super::mesh_file::read_mesh;
use super::report::write_page;
use super::{RunArgs, default_dir};
use crate::checkpoint::Checkpoint;
use crate::doubts::{Admission, Gate};
use crate::experiments::{self, Context, Experiment, Outcome, WITH_THESIS_SIZES};
use crate::machine::Machine;
use crate::record::Record;
use datasets::cli::{Cancel, CommonArgs, Interrupted, ProgressBar, UsageError};
use serde_json::json;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(common: CommonArgs, args: &RunArgs) -> anyhow::Result<()> {
    let chosen = args.ids.iter().map(|id| find(id)).collect::<Result<Vec<_>, _>>()?;
    if let (Some(file), Some(other)) = (&args.mesh, chosen.iter().find(|e| e.id != "peers")) {
        let (file, id) = (file.display(), other.id);
        let text = format!("--mesh {file} is for `peers`; `{id}` has data of its own, omit --mesh");
        return Err(UsageError(text).into());
    }
    if args.thesis
        && let Some(other) = chosen.iter().find(|e| !WITH_THESIS_SIZES.contains(&e.id))
    {
        let (id, with) = (other.id, WITH_THESIS_SIZES.join(", "));
        let text = format!("--thesis is for {with}; `{id}` has one full size, omit --thesis");
        return Err(UsageError(text).into());
    }
    if args.resume
        && let Some(other) = chosen.iter().find(|e| !WITH_THESIS_SIZES.contains(&e.id))
    {
        let (id, with) = (other.id, WITH_THESIS_SIZES.join(", "));
        let text = format!("--resume is for {with}; `{id}` takes minutes, omit --resume");
        return Err(UsageError(text).into());
    }
    if args.mesh.is_some() && (args.record || args.record_despite_doubts) {
        let text = "records in bench/runs are of meshes that anyone can make again; give --out DIR \
                    instead of --record to keep what --mesh measures";
        return Err(UsageError(text.into()).into());
    }
    let dir = args.out.clone().unwrap_or_else(default_dir);
    let recording = args.record || args.record_despite_doubts;
    let kept = if recording { Some(runs_dir()?) } else { None };
    let cancel = Cancel::on_ctrl_c()?;
    let mut gate = gate(args.record_despite_doubts, cancel);
    let steps = Steps::new(common, cancel, chosen.len());
    let mut progress = |what: &str, share: Option<f64>| steps.next(what, share);
    let mut context = Context::new(args.quick, Some(cancel.flag().clone()), &mut progress);
    context.thesis = args.thesis;
    context.mesh = args.mesh.as_deref().map(|file| read_mesh(common, file)).transpose()?;
    let mut written = false;
    for (i, experiment) in chosen.into_iter().enumerate() {
        steps.begin(i, experiment.id);
        let admission = if recording { gate.admit(i) } else { Admission::Clean };
        if let Admission::Refused(why) = admission {
            if written {
                finish(common, &dir)?;
            }
            return Err(refusal(experiment.id, &why).into());
        }
        context.checkpoint = Some(checkpoint(&dir, experiment, args)?);
        let Outcome { mut record, interrupted } = match experiments::run(experiment, &mut context) {
            Err(e) if e.is::<Interrupted>() && written => {
                // Report the experiments that finished.
                finish(common, &dir)?;
                return Err(e);
            }
            outcome => outcome?,
        };
        if let Admission::Despite(why) = admission {
            record.recorded_despite = why;
        }
        record.write(&dir)?;
        if let Some(checkpoint) = context.checkpoint.take().filter(|_| !interrupted) {
            checkpoint.remove();
        }
        // An interrupted measurement is not kept among the permanent records.
        if let Some(kept) = kept.as_ref().filter(|_| !interrupted) {
            record.write_measurements(kept)?;
        }
        written = true;
        common.result(&record, || summary(&record))?;
        if interrupted {
            finish(common, &dir)?;
            return Err(Interrupted.into());
        }
    }
    drop(steps);
    finish(common, &dir)
}

/// Where the parts of an experiment are kept, with those of the last run if it is to be continued.
fn checkpoint(dir: &Path, experiment: &Experiment, args: &RunArgs) -> anyhow::Result<Checkpoint> {
    let (quick, thesis) = (args.quick, args.thesis);
    let checkpoint = Checkpoint::new(dir, experiment.id, quick, thesis, Machine::describe());
    if args.resume { checkpoint.with_earlier_parts() } else { Ok(checkpoint) }
}

/// A gate that waits between experiments until Ctrl-C is pressed.
fn gate(insist: bool, cancel: Cancel) -> Gate {
    let pause = move |time| {
        std::thread::sleep(time);
        cancel.check().is_ok()
    };
    Gate { insist, state: Box::new(Machine::describe), pause: Box::new(pause) }
}

/// The error for a measurement that was not made because it would not have been kept.
fn refusal(id: &str, why: &[String]) -> UsageError {
    UsageError(format!(
        "`{id}` is not recorded:\n  {}\n--record-despite-doubts records it all the same, and its \
         record and report say \
         why it is in doubt; without --record it is measured and not kept",
        why.join("\n  ")
    ))
}

/// Progress of the experiments: a bar on a terminal; elsewhere a line for each experiment, and with
/// -v for each step.
struct Steps {
    common: CommonArgs,
    cancel: Cancel,
    bar: ProgressBar,
    start: Instant,
    /// Index and id of the current experiment.
    now: Cell<(usize, &'static str)>,
    count: usize,
}

/// Steps of the progress bar for each experiment.
const FINE: f64 = 1000.0;

impl Steps {
    fn new(common: CommonArgs, cancel: Cancel, count: usize) -> Steps {
        let bar = common.progress(count as u64 * FINE as u64, "experiments");
        Steps { common, cancel, bar, start: Instant::now(), now: Cell::new((0, "")), count }
    }

    fn begin(&self, i: usize, id: &'static str) {
        self.now.set((i, id));
        self.bar.set_position((i as f64 * FINE) as u64);
        if self.bar.is_hidden() {
            let secs = self.start.elapsed().as_secs_f64();
            self.common.note(0, format_args!("{secs:6.1} s  [{}/{}] {id}", i + 1, self.count));
        }
    }

    fn next(&self, what: &str, share: Option<f64>) -> anyhow::Result<()> {
        let (i, id) = self.now.get();
        self.bar.set_message(format!("{id}: {what}"));
        if let Some(share) = share {
            self.bar.set_position(((i as f64 + share.clamp(0.0, 1.0)) * FINE) as u64);
        }
        if self.bar.is_hidden() {
            let secs = self.start.elapsed().as_secs_f64();
            self.common.note(1, format_args!("{secs:6.1} s  {id}: {what}"));
        }
        Ok(self.cancel.check()?)
    }
}

/// Runs every experiment in its quick form. An experiment that fails is reported, and the others
/// continue. An experiment that needs programs which are not installed (another member of the
/// workspace, ParaView) is left out by name, with the cure; this is not a failure, because only
/// Rust is required.
pub(super) fn everything_quick(common: CommonArgs) -> anyhow::Result<()> {
    let dir = default_dir();
    let cancel = Cancel::on_ctrl_c()?;
    let steps = Steps::new(common, cancel, experiments::ALL.len());
    let (mut failed, mut left_out) = (vec![], vec![]);
    for (i, experiment) in experiments::ALL.iter().enumerate() {
        steps.begin(i, experiment.id);
        let mut progress = |what: &str, share: Option<f64>| steps.next(what, share);
        let mut context = Context::new(true, Some(cancel.flag().clone()), &mut progress);
        match experiments::run(experiment, &mut context) {
            Ok(Outcome { record, interrupted }) => {
                record.write(&dir)?;
                if common.json {
                    common.result(&record, String::new)?;
                }
                if interrupted {
                    finish(common, &dir)?;
                    return Err(Interrupted.into());
                }
            }
            Err(e) if e.is::<Interrupted>() => {
                if i > 0 {
                    finish(common, &dir)?;
                }
                return Err(e);
            }
            Err(e) => match e.downcast_ref::<UsageError>() {
                Some(UsageError(why)) => {
                    common.note(0, format_args!("left out: {why}"));
                    // Keep measurements of an earlier run.
                    if !dir.join(format!("{}.json", experiment.id)).exists() {
                        experiments::left_out(experiment, why).write(&dir)?;
                    }
                    left_out.push(experiment.id);
                }
                None => {
                    common.warn(format_args!("{e:#}"));
                    failed.push(experiment.id);
                }
            },
        }
    }
    drop(steps);
    finish(common, &dir)?;
    if !left_out.is_empty() {
        common.note(
            0,
            format_args!(
                "left out, for want of other programs: {}; the report and `bench run ID` say what \
                 each needs",
                left_out.join(", ")
            ),
        );
    }
    anyhow::ensure!(failed.is_empty(), "these experiments failed: {}", failed.join(", "));
    // Where all baselines are required (CI), a left-out experiment is a failure.
    let all_peers = std::env::var_os("RTSV_REQUIRE_PEERS").is_some_and(|v| v == "1");
    anyhow::ensure!(
        left_out.is_empty() || !all_peers,
        "RTSV_REQUIRE_PEERS=1, but these experiments lack a program: {}",
        left_out.join(", ")
    );
    Ok(())
}

/// Writes the report and prints its path: on stdout, or on stderr when stdout carries JSON.
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
        UsageError(format!(
            "there is no experiment `{id}`; `bench list` names them: {}",
            known.join(", ")
        ))
    })
}

/// A summary of the missing parts and the ratios.
fn summary(r: &Record) -> String {
    let mut text =
        format!("{}: {} ({} rows, {:.1} s)", r.id, r.title, r.rows.len(), r.elapsed_secs);
    for m in &r.missing {
        text += &format!("\n  missing: {m}");
    }
    for x in &r.ratios {
        let low_high = format!("{:.2} to {:.2}", x.low, x.high);
        let open =
            x.why_open().map_or(String::new(), |why| format!(", {} rounds ({why})", x.rounds));
        text += &format!(
            "\n  {:6.2}  ({low_high})  {}  against  {}{open}",
            x.value, x.name, x.baseline
        );
    }
    text
}

/// The directory `bench/runs/DATE-MACHINE` of the repository that contains the working directory.
fn runs_dir() -> anyhow::Result<PathBuf> {
    let here = std::env::current_dir()?;
    let root = here.ancestors().find(|d| d.join("bench/Cargo.toml").exists()).ok_or_else(|| {
        UsageError(
            "--record writes to bench/runs of the repository: start `bench` inside it, or use \
             --out"
                .into(),
        )
    })?;
    let machine = Machine::describe();
    Ok(root.join("bench/runs").join(format!("{}-{}", machine.day(), machine.slug())))
}
