//! The command line: parses the arguments and calls the library.

mod desktop;
mod doctor;
mod explain;
mod export;
mod helpers;
#[cfg(feature = "panel")]
mod panel;
mod run;
mod serve_rays;
mod timeline;
mod vendor;

use clap::{Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, ManArgs, Status, run_main};
use std::path::PathBuf;
use std::process::ExitCode;

/// Ray tracing inside OpenGL programs that are not changed.
#[derive(Debug, Parser)]
#[command(name = "gluray", version, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: CommonArgs,
}

const EXAMPLES: &str = "Examples:
  gluray run --mode rich -- gmsh a.stl   gmsh, ray traced
  gluray doctor                          what there is to work with, and what will not work
  gluray explain                         what was traced in the last run, what was not, and why
  gluray panel                           a page that changes running programs
  gluray export scene.gluray -o a.glb    a captured scene for other programs";

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs a program with ray tracing inside it. Its exit code is that of the program
    Run(Box<run::RunArgs>),
    /// Says which OpenGL there is, how programs can be reached, and what will not work
    Doctor(doctor::DoctorArgs),
    /// Says what was traced in the last run, what was left to the driver, and why
    Explain(explain::ExplainArgs),
    /// Writes a captured scene as PLY, glTF or VTP
    Export(export::ExportArgs),
    /// Serves the control panel for running programs
    #[cfg(feature = "panel")]
    Panel(panel::PanelArgs),
    /// Traces a share of other programs' pictures
    ServeRays(serve_rays::ServeRaysArgs),
    /// Draws when each phase of each frame ran
    Timeline(timeline::TimelineArgs),
    /// Adds an entry to the desktop's menu that starts a program ray traced
    InstallDesktop(desktop::DesktopArgs),
    /// Prints a completion script for a shell
    Completions(CompletionsArgs),
    /// Writes the manual pages of the program and its subcommands into a folder
    #[command(hide = true)]
    Man(ManArgs),
}

/// Runs the program. Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted; with `run`, that
/// of the program that was run.
pub fn main() -> ExitCode {
    let mut code = None;
    let status = run_main(|| execute(Cli::try_parse()?, &mut code));
    code.map_or(status, ExitCode::from)
}

fn execute(cli: Cli, code: &mut Option<u8>) -> anyhow::Result<Status> {
    let common = cli.common;
    match cli.command {
        Command::Run(args) => {
            *code = Some(run::run(&args)?);
            Ok(Status::Success)
        }
        Command::Doctor(args) => doctor::doctor(&args, &common),
        Command::Explain(args) => explain::explain(&args, &common),
        Command::Export(args) => export::export(common, &args).map(Status::from),
        #[cfg(feature = "panel")]
        Command::Panel(args) => panel::panel(common, &args).map(Status::from),
        Command::ServeRays(args) => serve_rays::serve_rays(&common, &args).map(Status::from),
        Command::Timeline(args) => timeline::timeline(common, &args).map(Status::from),
        Command::InstallDesktop(args) => desktop::install(&args, &common).map(Status::from),
        Command::Completions(args) => args.print::<Cli>().map(Status::from),
        Command::Man(args) => args.write::<Cli>().map(Status::from),
    }
}

/// Where the account of the last run is kept.
fn last_report() -> PathBuf {
    crate::host::folders::state(crate::host::folders::variable)
        .unwrap_or_default()
        .join("last.json")
}

/// The shared library that belongs to this program: the one that is named, else the newest of those
/// near it. `cargo test` leaves it in `deps`, `cargo build` beside the program, and either may be
/// of another day.
fn library() -> Option<PathBuf> {
    if let Some(named) =
        std::env::var_os("GLURAY_LIBRARY").map(PathBuf::from).filter(|p| p.is_file())
    {
        return Some(named);
    }
    let exe = std::env::current_exe().ok()?;
    let folder = exe.parent()?;
    let places = [folder.to_owned(), folder.join("deps"), folder.join("../lib"), folder.join("..")];
    let found = places.map(|p| p.join("libgluray.so")).into_iter().filter(|p| p.is_file());
    found.max_by_key(|p| std::fs::metadata(p).and_then(|m| m.modified()).ok())
}
