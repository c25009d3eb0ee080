//! The command line: starts or joins ranks and runs one of the jobs below on them.

mod check;
mod compare;
mod demo;
mod demo_args;
mod demo_data;
mod doctor;
mod first_ranks;
mod gantt;
mod hard_cases;
mod mpirun;
mod phase_sums;
mod rank_records;
mod ranks;
mod smpirun;
mod timeline;

use clap::{Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, ManArgs, Status, status_of};
use std::ffi::OsString;

/// Composites the images of many ranks into one.
///
/// Ranks are threads of this process (--threads), processes of an MPI job (--mpi) or simulated
/// (--smpi).
#[derive(Debug, Parser)]
#[command(name = "composite", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Compares with IceT on the same ranks and frames
    Compare(compare::CompareArgs),
    /// Composites partitioned frames and shows the timeline of each rank
    Demo(demo_args::DemoArgs),
    /// Checks every strategy against the serial reference on these ranks
    Check(check::CheckArgs),
    /// Lists the installed MPI, SimGrid and IceT, and how to install the others
    Doctor,
    /// Prints a completion script for a shell
    Completions(CompletionsArgs),
    /// Writes the manual pages of the program and its subcommands into a folder
    #[command(hide = true)]
    Man(ManArgs),
}

/// Runs the program. Exit codes: 0 done, 1 failed, 2 wrong usage or something missing, 130
/// interrupted.
pub fn main(arguments: impl IntoIterator<Item = impl Into<OsString>>) -> Status {
    let arguments: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    status_of(execute(&arguments))
}

fn execute(arguments: &[OsString]) -> anyhow::Result<Status> {
    let cli = Cli::try_parse_from(arguments)?;
    let common = cli.common;
    let own = arguments.get(1..).unwrap_or_default();
    match cli.command {
        Command::Compare(args) => compare::compare(common, &args, own),
        Command::Demo(args) => demo::demo(common, &args, own),
        Command::Check(args) => check::check(common, &args, own),
        Command::Doctor => doctor::doctor(common),
        Command::Completions(args) => args.print::<Cli>().map(Into::into),
        Command::Man(args) => args.write::<Cli>().map(Into::into),
    }
}
