//! The command line: converts arguments to calls of the library.

mod convert;
mod description;
mod info;
mod list;
mod make;
mod open_args;
mod output;
mod stored_file;

use clap::{Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, ManArgs, run_main};
use std::process::ExitCode;

const EXAMPLES: &str = "Examples:
  datasets list
  datasets make wavelet --size 1M --normals -o wavelet.vtp
  datasets make wedge -o wedge.vti
  datasets info wedge.vti
  datasets convert wedge.vti shock.ply --isovalue 1.5 --array density

Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.";

/// Generates the data sets of scientific visualization, and describes and converts files.
#[derive(Debug, Parser)]
#[command(name = "datasets", version, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Lists the data sets that can be generated, with their sizes
    List,
    /// Generates a data set and writes it to a file
    Make(make::MakeArgs),
    /// Describes a file: format, kind, points and cells, arrays with their ranges
    Info(info::InfoArgs),
    /// Converts a file to another format
    Convert(convert::ConvertArgs),
    /// Prints a completion script for a shell
    Completions(CompletionsArgs),
    /// Writes the manual pages of the program and its subcommands into a folder
    #[command(hide = true)]
    Man(ManArgs),
}

/// Runs the program. Exit codes: 0 done, 1 failed, 2 usage error, 130 interrupted.
pub(crate) fn main() -> ExitCode {
    run_main(|| execute(Cli::try_parse()?))
}

fn execute(cli: Cli) -> anyhow::Result<()> {
    let common = cli.common;
    match cli.command {
        Command::List => list::list(common),
        Command::Make(args) => make::make(common, &args),
        Command::Info(args) => info::info(common, &args),
        Command::Convert(args) => convert::convert(common, &args),
        Command::Completions(args) => args.print::<Cli>(),
        Command::Man(args) => args.write::<Cli>(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        <Cli as clap::CommandFactory>::command().debug_assert();
    }
}
