//! `vtk-bridge`: installs the bridge for the VTK installations of this machine, reports problems,
//! and prints the variables to set.
#![forbid(unsafe_code)]

use anyhow::Context;
use clap::{Args, CommandFactory, Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, CureExt, ManArgs, Status, UsageError, run_main};
use std::path::PathBuf;
use std::process::ExitCode;
use vtk_bridge::options::NAMES;
use vtk_bridge::setup::environment::{Program, anari_exports, exports};
use vtk_bridge::setup::headers::{Flavour, find, places, shares_vtk};
use vtk_bridge::setup::layout::{Layout, library};
use vtk_bridge::setup::{SetupError, doctor, plugin};

#[derive(Parser)]
#[command(name = "vtk-bridge", version, about = "Ray tracing inside unmodified VTK and \
                                                 ParaView", after_help = EXAMPLES)]
struct Cli {
    #[command(flatten)]
    common: CommonArgs,
    #[command(subcommand)]
    command: Action,
}

const EXAMPLES: &str = "Examples:
  vtk-bridge install                        build for all VTKs whose headers are here
  eval \"$(vtk-bridge env --paraview)\"       from now on ParaView in this shell is ray traced
  pvbatch script.py                         … any script, unchanged
  RTV_AO=16 RTV_SHADOWS=1 pvbatch script.py with ambient occlusion and shadows
  eval \"$(vtk-bridge env --vtk)\"            the same for Python scripts with VTK
  eval \"$(vtk-bridge env --anari)\"          ANARI programs find the device `rtv`
  vtk-bridge doctor                         what is missing
  vtk-bridge options                        all variables RTV_*";

#[derive(Subcommand)]
enum Action {
    /// Build and lay out the pieces for the VTKs of this machine.
    Install(InstallArgs),
    /// Say what is there, what is missing, and what to do about it.
    Doctor(PrefixArgs),
    /// Print the variables after which any script is ray traced, for `eval`.
    Env(EnvArgs),
    /// List the options: variables RTV_*.
    Options,
    /// Print a completion script for a shell.
    Completions(CompletionsArgs),
    /// Writes the manual pages of the program and its subcommands into a folder.
    #[command(hide = true)]
    Man(ManArgs),
}

#[derive(Args)]
struct PrefixArgs {
    /// Folder for the pieces; by default RTV_HOME, or ~/.local/share/vtk-bridge.
    #[arg(long)]
    prefix: Option<PathBuf>,
}

impl PrefixArgs {
    fn layout(&self) -> Layout {
        let prefix = self.prefix.clone().unwrap_or_else(|| Layout::default_prefix(variable));
        // Programs that run elsewhere must find it.
        Layout::at(std::path::absolute(&prefix).unwrap_or(prefix))
    }
}

#[derive(Args)]
struct InstallArgs {
    #[command(flatten)]
    place: PrefixArgs,
    /// Folder with VTK's headers (vtkObjectFactory.h); may be given several times. RTV_VTK_INCLUDE
    /// and the system's are looked at as well.
    #[arg(long = "include")]
    includes: Vec<PathBuf>,
    /// Build ParaView's plugin with its panel too (needs paraview-dev).
    #[arg(long)]
    plugin: bool,
}

#[derive(Args)]
#[command(group = clap::ArgGroup::new("program").required(true))]
struct EnvArgs {
    #[command(flatten)]
    place: PrefixArgs,
    /// For programs and Python scripts with VTK.
    #[arg(long, group = "program")]
    vtk: bool,
    /// For ParaView, pvpython and pvbatch.
    #[arg(long, group = "program")]
    paraview: bool,
    /// For programs that know ANARI: the device `rtv`.
    #[arg(long, group = "program")]
    anari: bool,
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn main() -> ExitCode {
    run_main(work)
}

fn work() -> anyhow::Result<Status> {
    let cli = Cli::try_parse()?;
    match &cli.command {
        Action::Install(args) => install(&cli.common, args),
        Action::Doctor(args) => examine(&cli.common, args),
        Action::Env(args) => env(&cli.common, args),
        Action::Options => options(&cli.common),
        Action::Completions(args) => {
            debug_assert!(Cli::command().get_name() == "vtk-bridge");
            args.print::<Cli>()?;
            Ok(Status::Success)
        }
        Action::Man(args) => args.write::<Cli>().map(Status::from),
    }
}

fn flavours(more: &[PathBuf]) -> (Vec<Flavour>, Vec<String>, String) {
    let looked: Vec<PathBuf> = more.iter().cloned().chain(places(variable)).collect();
    let (found, faults) = find(&looked);
    let looked = looked.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
    (
        found,
        faults,
        if looked.is_empty() { "/usr/include and /usr/local/include".to_owned() } else { looked },
    )
}

fn install(common: &CommonArgs, args: &InstallArgs) -> anyhow::Result<Status> {
    let layout = args.place.layout();
    let (found, faults, looked) = flavours(&args.includes);
    faults.iter().for_each(|f| common.note(0, f));
    if found.is_empty() {
        return usage(SetupError::NoHeaders { looked });
    }
    for f in &found {
        common.note(0, format!("building for VTK {} (headers in {})", f.name, f.include.display()));
    }
    let done = layout.install(&library()?, &found)?;
    for (name, why) in &done.failed {
        common.warn(format!("VTK {name}: {why}"));
    }
    if args.plugin {
        let Some(pv) = found.iter().find(|f| f.is_paraview()) else {
            return usage(SetupError::NotFound {
                asked: "ParaView",
                cure: Program::ParaView.cure(),
            });
        };
        let file = plugin::install(&layout, pv)?;
        common.note(0, format!("plugin: {}", file.display()));
        common.note(
            0,
            format!("load it with PV_PLUGIN_PATH={}", layout.plugin_folder(&pv.name).display()),
        );
    }
    common.result(&done, || done.summary(&layout))?;
    Ok(if done.failed.is_empty() { Status::Success } else { Status::Failure })
}

fn examine(common: &CommonArgs, args: &PrefixArgs) -> anyhow::Result<Status> {
    let findings = doctor::examine(&args.layout(), variable);
    common.result(&findings, || {
        let line = |f: &doctor::Finding| {
            format!("{} {:<18} {}", if f.ok { "ok " } else { "BAD" }, f.what, f.text)
        };
        findings.iter().map(line).collect::<Vec<_>>().join("\n")
    })?;
    Ok(if findings.iter().all(|f| f.ok) { Status::Success } else { Status::Failure })
}

fn env(common: &CommonArgs, args: &EnvArgs) -> anyhow::Result<Status> {
    let layout = args.place.layout();
    if args.anari {
        let library = library()?;
        if !layout.anari_is(&library) {
            layout.install_anari(&library)?;
        }
        let text = anari_exports(&layout, variable("LD_LIBRARY_PATH").as_deref());
        common.result(&text.lines().collect::<Vec<_>>(), || text.trim_end().to_owned())?;
        return Ok(Status::Success);
    }
    let program = if args.paraview { Program::ParaView } else { Program::Vtk };
    let (found, ..) = flavours(&[]);
    // A ParaView that is linked with the system's VTK needs the shim of that one.
    let shared = program == Program::ParaView && places(variable).iter().any(|p| shares_vtk(p));
    let runs = |name: &str| program.runs(name) || shared;
    let wanted: Vec<Flavour> = found.into_iter().filter(|f| runs(&f.name)).collect();
    let built = layout.shims();
    let missing: Vec<Flavour> = wanted
        .iter()
        .filter(|f| !built.contains(&f.name) || !layout.sources_are_current())
        .cloned()
        .collect();
    if wanted.is_empty() && !built.iter().any(|b| runs(b)) {
        return usage(SetupError::NotFound { asked: program.name(), cure: program.cure() });
    }
    let library = library();
    if !missing.is_empty() {
        common.note(
            0,
            format!(
                "building for VTK {} first",
                missing.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ")
            ),
        );
        let done = layout.install(&library?, &missing)?;
        if let Some((name, why)) = done.failed.first() {
            return Err(anyhow::anyhow!("{why}"))
                .with_context(|| format!("VTK {name} could not be built for"))
                .cure("run `vtk-bridge doctor`");
        }
    } else if let Ok(library) = library {
        if !layout.loader_is(&library) {
            layout.install_loader(&library)?;
        }
    } else if !layout.loader().is_file() {
        library?;
    }
    let text = exports(&layout, variable("VTK_AUTOLOAD_PATH").as_deref());
    common.result(&text.lines().collect::<Vec<_>>(), || text.trim_end().to_owned())?;
    Ok(Status::Success)
}

fn options(common: &CommonArgs) -> anyhow::Result<Status> {
    common.result(&NAMES, || {
        NAMES
            .iter()
            .map(|(n, what, rule)| format!("{n:<18} {what} ({rule})"))
            .collect::<Vec<_>>()
            .join("\n")
    })?;
    Ok(Status::Success)
}

/// Something of the user's is missing: exit code 2.
fn usage(e: SetupError) -> anyhow::Result<Status> {
    Err(UsageError(e.to_string()).into())
}
