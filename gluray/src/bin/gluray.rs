//! `gluray`: ray tracing inside OpenGL programs that are not changed.
#![deny(unsafe_code)]

use clap::{Parser, Subcommand};
use datasets::cli::{CommonArgs, Status, run_main};
use std::process::ExitCode;

mod cli;

/// Ray traces what unmodified OpenGL programs draw.
#[derive(Parser)]
#[command(
    name = "gluray",
    version,
    after_help = "Examples:\n  gluray run -- gmsh model.stl\n  gluray run --mode rich --report r.json -- geomview bunny.off\n  gluray explain\n  gluray doctor"
)]
struct Args {
    #[command(flatten)]
    common: CommonArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs a program with ray tracing inside it. Its exit code is that of the program.
    Run(cli::run::RunArgs),
    /// Says whether this machine has what gluray needs.
    Doctor,
    /// What the last run traced, what it passed to the driver, and why.
    Explain(cli::explain::ExplainArgs),
}

fn main() -> ExitCode {
    let mut code = None;
    let status = run_main(|| {
        let args = Args::try_parse()?;
        match args.command {
            Command::Run(run) => {
                let ended = cli::run::run(&run, args.common.quiet)?;
                code = Some(ended);
                Ok(if ended == 0 { Status::Success } else { Status::Failure })
            }
            Command::Doctor => cli::doctor::doctor(&args.common),
            Command::Explain(explain) => cli::explain::explain(&explain, &args.common),
        }
    });
    code.map_or(status, ExitCode::from)
}
