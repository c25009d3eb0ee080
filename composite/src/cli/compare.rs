//! `composite compare`: our compositing and IceT's, frame by frame on the same ranks and frames, in
//! one table for any lists of numbers of ranks, sizes, workloads, formats and instruction sets.
mod measure;
mod table;

use super::ranks::{RankArgs, RankComm};
use crate::icet;
use crate::simd::SimdLevel;
use crate::strategies::Strategy;
use crate::workload::Workload;
use datasets::cli::{CommonArgs, Status, UsageError};
use measure::{Bench, Groups, Setting};
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};
use table::{Comparison, Machine, Pixels};

/// Arguments of `composite compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    composite compare --ranks 8 --size 1024 --mpi --json\n  \
    composite compare --ranks 2,4,8 --size 1024,2048 --scene all --mpi\n  \
    composite compare --ranks 8 --smpi --simd avx512,avx2,scalar --pixels depth,blend --scene \
    discs\n  \
    composite compare --ranks 127 --smpi --scene discs\n  \
    composite compare --ranks 4 --threads --pixels blend")]
pub(super) struct CompareArgs {
    #[command(flatten)]
    ranks: RankArgs,
    /// Width and height of the image, in pixels; several such as 1024,2048
    #[arg(long, default_value = "1024", value_name = "PIXELS", value_delimiter = ',')]
    size: Vec<u32>,
    /// The frames: discs, dense, frag, several of them or all
    #[arg(long, default_value = "all", value_name = "SCENE", value_delimiter = ',', value_parser = workload_named)]
    scene: Vec<Workloads>,
    /// What is composited; several such as depth,blend
    #[arg(long, default_value = "depth", value_delimiter = ',')]
    pixels: Vec<Pixels>,
    /// Our strategy; auto selects the fastest by a model of the network, which is measured first
    #[arg(long, default_value = "auto", value_name = "direct|tree|bswap|radix-k[:K]|auto", value_parser = strategy_named)]
    strategy: Strategy,
    /// Also send messages between processes of one machine and between threads, which otherwise
    /// merge in shared memory
    #[arg(long)]
    messages: bool,
    /// Our widest instruction set: scalar, sse4.2, avx2, avx512 or neon, if this machine has it; or
    /// several
    #[arg(long, value_name = "LEVEL", value_delimiter = ',', value_parser = simd_named)]
    simd: Vec<SimdLevel>,
    /// Number of timed frames [default: 7; simulated: 5]
    #[arg(long, value_name = "N")]
    frames: Option<u64>,
}

/// The workloads of one word of `--scene`.
type Workloads = &'static [Workload];

pub(super) fn compare(
    common: CommonArgs,
    args: &CompareArgs,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    if let Some(size) = args.size.iter().find(|size| !(1..=32_768).contains(*size)) {
        return Err(UsageError(format!("an image of {size}x{size}: give 1 to 32768")).into());
    }
    // Before any rank is started: without IceT there is nothing to compare with.
    let icet = icet::find().map_err(|error| UsageError(error.to_string()))?;
    let counts = args.ranks.counts();
    if args.ranks.is_rank() || counts.len() < 2 {
        let is_table =
            !args.messages && matches!(args.strategy, Strategy::DirectSend | Strategy::Automatic);
        let threads = if is_table && args.ranks.are_threads() { args.ranks.count()? } else { 0 };
        let groups = Groups::new(threads);
        return args.ranks.run(
            common,
            arguments,
            |comm| one_job(comm, args, &icet, &groups),
            |comparison| {
                common.result(&comparison, || &comparison)?;
                Ok(Status::Success)
            },
        );
    }

    // One job for each number of ranks, and one table of all.
    let mut all: Option<Comparison> = None;
    let mut status = Status::Success;
    for &ranks in counts {
        common.note(0, format_args!("{ranks} ranks"));
        match started_again(ranks, arguments)? {
            Ok(job) => match &mut all {
                None => all = Some(job),
                Some(all) => all.rows.extend(job.rows),
            },
            Err(failed) => {
                common.warn(format_args!(
                    "the comparison on {ranks} ranks has failed; its rows are missing"
                ));
                status = failed;
            }
        }
    }
    if let Some(all) = all {
        common.result(&all, || &all)?;
    }
    Ok(status)
}

/// All measurements on one group of ranks.
fn one_job(
    comm: &mut RankComm,
    args: &CompareArgs,
    icet: &Path,
    groups: &Groups,
) -> anyhow::Result<Comparison> {
    let mut members = groups.members_of(comm.comm().rank());
    let machine = Machine {
        processors: std::thread::available_parallelism().map_or(1, usize::from),
        transport: comm.transport(),
        icet: icet.display().to_string(),
        note: args.ranks.caveat(),
    };
    let frames = args.frames.unwrap_or(if args.ranks.is_simulated() { 5 } else { 7 }).max(1);
    let levels: Vec<Option<SimdLevel>> = if args.simd.is_empty() {
        vec![None]
    } else {
        args.simd.iter().copied().map(Some).collect()
    };
    let mut rows = Vec::new();
    for &size_px in &args.size {
        for &pixels in &args.pixels {
            for &simd in &levels {
                let timeout = args.ranks.timeout();
                let (strategy, in_memory) = (args.strategy, !args.messages);
                let setting =
                    Setting { size_px, pixels, strategy, in_memory, simd, frames, timeout };
                let mut bench = Bench::new(comm, icet, setting)?;
                for &scene in args.scene.iter().copied().flatten() {
                    rows.push(bench.measure(scene, members.as_mut())?);
                }
            }
        }
    }
    Ok(Comparison { machine, rows })
}

/// Runs this program with one number of ranks and returns its result; its notes and errors go where
/// ours go.
fn started_again(
    ranks: usize,
    arguments: &[OsString],
) -> anyhow::Result<Result<Comparison, Status>> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(of_one_count(ranks, arguments)).stdout(Stdio::piped());
    let output = command.spawn()?.wait_with_output()?;
    let status = super::mpirun::outcome(output.status);
    if status != Status::Success {
        return Ok(Err(status));
    }
    let line = output.stdout.split(|&byte| byte == b'\n').find(|line| line.starts_with(b"{"));
    Ok(Ok(serde_json::from_slice(line.unwrap_or_default())?))
}

/// `arguments` with one number of ranks instead of several, and with JSON as the result.
fn of_one_count(ranks: usize, arguments: &[OsString]) -> Vec<OsString> {
    let mut changed = Vec::with_capacity(arguments.len() + 2);
    let mut is_count = false;
    for argument in arguments {
        let text = argument.to_string_lossy();
        if std::mem::take(&mut is_count) || text == "--json" {
            continue;
        }
        if text == "--ranks" || text == "-n" {
            is_count = true;
        } else if !(text.starts_with("--ranks=") || text.starts_with("-n")) {
            changed.push(argument.clone());
        }
    }
    changed.extend(["--json".into(), format!("--ranks={ranks}").into()]);
    changed
}

fn workload_named(name: &str) -> Result<Workloads, String> {
    if name == "all" {
        return Ok(&Workload::ALL);
    }
    let scene: Workload = name.parse().map_err(|error: String| format!("{error}, or all"))?;
    let found = Workload::ALL.iter().position(|other| *other == scene).unwrap_or(0);
    Ok(&Workload::ALL[found..=found])
}

fn strategy_named(name: &str) -> Result<Strategy, String> {
    let (name, k) = name.split_once(':').unwrap_or((name, "8"));
    match (name, k.parse()) {
        ("direct", _) => Ok(Strategy::DirectSend),
        ("tree", _) => Ok(Strategy::Tree),
        ("bswap", _) => Ok(Strategy::BinarySwap),
        ("radix-k", Ok(k)) => Ok(Strategy::RadixK { k }),
        ("auto", _) => Ok(Strategy::Automatic),
        _ => Err("use direct, tree, bswap, radix-k, radix-k:4 or auto".to_string()),
    }
}

fn simd_named(name: &str) -> Result<SimdLevel, String> {
    let levels = SimdLevel::available();
    let names = || levels.iter().map(|level| level.name()).collect::<Vec<_>>().join(", ");
    let found = levels.iter().find(|level| level.name() == name).copied();
    found.ok_or_else(|| format!("this machine has {}", names()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_of_many_is_started_with_its_own_number_of_ranks_however_that_was_written() {
        for given in ["--ranks 2,4", "--ranks=2,4", "-n 2,4", "-n2,4", "-n=2,4 --json"] {
            let words = format!("compare --mpi {given} --size 64,128");
            let arguments: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            let expected: Vec<OsString> = "compare --mpi --size 64,128 --json --ranks=4"
                .split(' ')
                .map(OsString::from)
                .collect();
            assert_eq!(of_one_count(4, &arguments), expected, "{given}");
        }
    }

    #[test]
    fn scenes_are_known_by_name_and_all_is_all_of_them() {
        assert_eq!(workload_named("all"), Ok(Workload::ALL.as_slice()));
        assert_eq!(workload_named("frag"), Ok([Workload::Frag].as_slice()));
        assert!(workload_named("fog").is_err());
    }
}
