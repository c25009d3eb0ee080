//! Runs the program `schlieren`: parses the command line and calls the library.

mod flow_args;
mod index;
mod info;
mod march_args;
mod media_args;
mod probe;
mod render;
mod scene_args;
#[cfg(feature = "serve")]
mod serve;
mod sheet;
mod sweep;
mod units;
mod words;

use clap::{Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, ManArgs, run_main};
use std::process::ExitCode;

/// Schlieren, shadowgraph, interferogram and background-oriented schlieren from flow data.
#[derive(Debug, Parser)]
#[command(name = "schlieren", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Renders a flow
    Render(Box<render::RenderArgs>),
    /// Renders a flow by all techniques into one labelled picture
    Sheet(Box<sheet::SheetArgs>),
    /// Renders a time series, or one flow for several values of a key of its scene
    Sweep(Box<sweep::SweepArgs>),
    /// Prints what a flow's file holds, and a command that renders it
    Info(info::InfoArgs),
    /// Prints the path of one pixel's ray and its numbers
    Probe(Box<probe::ProbeArgs>),
    /// Opens an interactive page in the browser
    #[cfg(feature = "serve")]
    Serve(Box<serve::ServeArgs>),
    /// Computes the index of refraction of a gas
    Index(index::IndexArgs),
    /// Prints a completion script for a shell
    Completions(CompletionsArgs),
    /// Writes the manual pages of the program and its subcommands into a folder
    #[command(hide = true)]
    Man(ManArgs),
}

/// Runs the program. Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.
pub fn main() -> ExitCode {
    run_main(|| execute(Cli::try_parse()?).map_err(words::error_in_options))
}

fn execute(cli: Cli) -> anyhow::Result<()> {
    let common = cli.common;
    match cli.command {
        Command::Render(args) => render::render(common, &args),
        Command::Sheet(args) => sheet::sheet(common, &args),
        Command::Sweep(args) => sweep::sweep(common, &args),
        Command::Info(args) => info::info(common, &args),
        Command::Probe(args) => probe::probe(common, &args),
        #[cfg(feature = "serve")]
        Command::Serve(args) => serve::serve(common, &args),
        Command::Index(args) => index::index(common, &args),
        Command::Completions(args) => args.print::<Cli>(),
        Command::Man(args) => args.write::<Cli>(),
    }
}
