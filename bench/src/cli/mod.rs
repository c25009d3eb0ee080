//! The command line: what was typed becomes a call of the library.

mod list;
mod peers;
mod report;
mod run;

use clap::{Args, Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, run_main};
use std::path::PathBuf;
use std::process::ExitCode;

/// Measures every table and figure of the dissertation, and error against time.
///
/// Without a command, the quick form of every experiment runs (within five minutes on two cores, after the build)
/// and the path of the report is printed.
#[derive(Debug, Parser)]
#[command(name = "bench", version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Names the experiments
    List,
    /// Runs experiments, writes their records and the report
    Run(RunArgs),
    /// Makes the report of records again
    Report(ReportArgs),
    /// Says which other ray tracers are found and how to get the others; `bench run peers` measures them
    Peers,
    /// Prints a completion script for a shell
    Completions(CompletionsArgs),
}

/// Options of `bench run`.
#[derive(Debug, Args)]
struct RunArgs {
    /// Experiments, as `bench list` names them. With --json, one object per line, in this order
    #[arg(required = true, value_name = "ID")]
    ids: Vec<String>,
    /// Smaller data and fewer rounds: each experiment within a minute
    #[arg(long)]
    quick: bool,
    /// Also keep the records in bench/runs/DATE-MACHINE/
    #[arg(long)]
    record: bool,
    /// Folder for the records and the report [default: bench-report in the build folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Options of `bench report`.
#[derive(Debug, Args)]
struct ReportArgs {
    /// Folder with records [default: bench-report in the build folder]
    dir: Option<PathBuf>,
    /// The page [default: index.html in the folder]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Runs the program. Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.
pub fn main() -> ExitCode {
    run_main(|| execute(Cli::try_parse()?))
}

fn execute(cli: Cli) -> anyhow::Result<()> {
    let common = cli.common;
    match cli.command {
        None => run::everything_quick(common),
        Some(Command::List) => list::list(common),
        Some(Command::Run(args)) => run::run(common, &args),
        Some(Command::Report(args)) => report::report(common, &args),
        Some(Command::Peers) => peers::peers(common),
        Some(Command::Completions(args)) => args.print::<Cli>(),
    }
}

/// Where records and reports go unless told otherwise: the build folder that this program lies in.
fn default_dir() -> PathBuf {
    let beside = std::env::current_exe().ok().and_then(|exe| {
        let build = exe.parent()?.parent()?;
        build.join("CACHEDIR.TAG").exists().then(|| build.to_path_buf())
    });
    beside.unwrap_or_else(|| PathBuf::from("target")).join("bench-report")
}
