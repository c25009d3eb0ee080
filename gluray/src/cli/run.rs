//! `gluray run`: sets the environment for the library, runs the program and reports what happened.

use super::helpers::Helpers;
use super::vendor::VendorFolder;
use super::{last_report, library};
use crate::host::config::environment::{OBJECTS, ONLY_CHILD_OF, parse_pair, texts, variable_of};
use crate::host::config::{Assignment, ConfigFile, SettingError, Settings, assign};
use crate::host::report::Report;
use anyhow::Context as _;
use datasets::cli::{CureExt as _, UsageError};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::DirBuilderExt as _;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

/// How the library gets into the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Via {
    /// As GLVND's vendor library where there is GLVND, else by LD_PRELOAD.
    Auto,
    /// As GLVND's vendor library.
    Vendor,
    /// By LD_PRELOAD.
    Preload,
}

/// Options of `gluray run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit code: that of the program; 2 for wrong options.

Examples:
  gluray run -- gmsh model.stl
  gluray run --ranks 4 -- paraview
  gluray run --mode rich --report r.json -- geomview bunny.off
  gluray run --mode rich --set effects.ambient_occlusion_samples=32 --set \
  objects.3f2a.surface=glass -- paraview")]
pub(super) struct RunArgs {
    /// Look of traced surfaces: match (the driver's picture), phong, rich, enhance, path, or off
    /// (nothing is traced).
    #[arg(long, value_parser = ["match", "phong", "rich", "enhance", "path", "off"])]
    mode: Option<String>,
    /// `all` traces every filled primitive, in the order drawn, also without a depth test or with
    /// blending.
    #[arg(long, value_parser = ["all", "scene"])]
    trace: Option<String>,
    /// In mode match, trace also the frames that the driver draws for less. The picture is the
    /// same.
    #[arg(long)]
    always_trace: bool,
    /// Write the account of the run here, as JSON.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Settings by program name, TOML; without it `gluray/gluray.toml` in the folder for settings,
    /// if there is one.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// A setting by name, over the file's; several times for several. `gluray doctor --variables`
    /// lists them.
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Processes that trace one picture: the program, and N - 1 helpers that this starts and ends.
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=256))]
    ranks: u32,
    /// Trace the program itself, and none that it starts. A script that starts the program is not
    /// the program.
    #[arg(long)]
    no_children: bool,
    /// How the library gets into the program.
    #[arg(long, value_enum, default_value = "auto")]
    via: Via,
    /// The program and its arguments.
    #[arg(
        required = true,
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "PROGRAM"
    )]
    program: Vec<OsString>,
}

/// The settings of the command line as the variables that carry them, if they make sense.
fn settings(args: &RunArgs) -> Result<Vec<(String, String)>, UsageError> {
    let usage = |e: &[SettingError]| {
        UsageError(e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n  "))
    };
    if let Some(file) = &args.config {
        let read =
            ConfigFile::read(file).map_err(|e| UsageError(datasets::cli::report(&e.into())))?;
        let (_, errors) = assign(&Settings::default(), &read.all_assignments());
        if !errors.is_empty() {
            return Err(usage(&errors));
        }
    }
    // The program's part of us would not obey them, nor could it say so before the end.
    let (_, no_text) = texts(std::env::vars_os());
    let ours: Vec<SettingError> =
        no_text.into_iter().filter(|e| e.path.starts_with("GLURAY_")).collect();
    if !ours.is_empty() {
        return Err(usage(&ours));
    }
    let mut variables: Vec<(String, String)> = Vec::new();
    match args.mode.as_deref() {
        Some("off") => variables.push((variable_of("enabled"), "false".into())),
        Some(mode) => variables.push((variable_of("mode"), mode.into())),
        None => {}
    }
    if args.always_trace {
        variables.push((variable_of("always_trace"), "true".into()));
    }
    variables.extend(args.trace.iter().map(|t| (variable_of("trace"), t.clone())));
    let mut objects: Vec<String> = std::env::var(OBJECTS).into_iter().collect();
    let mut all: Vec<Assignment> = Vec::new();
    for pair in &args.set {
        let assignment = parse_pair("--set", pair).map_err(|e| usage(&[e]))?;
        let value = pair.split_once('=').map_or("", |(_, v)| v).replace(char::is_whitespace, "");
        match assignment.path.strip_prefix("objects.") {
            Some(object) => objects.push(format!("{object}={value}")),
            None => variables.push((variable_of(&assignment.path), value)),
        }
        all.push(assignment);
    }
    if args.set.iter().any(|s| s.starts_with("objects.")) {
        variables.push((OBJECTS.into(), objects.join(" ")));
    }
    match assign(&Settings::default(), &all).1 {
        errors if errors.is_empty() => Ok(variables),
        errors => Err(usage(&errors)),
    }
}

/// True when OpenGL here is GLVND's, which takes vendor libraries.
fn has_glvnd() -> bool {
    crate::doctor::find_glvnd().is_some()
}

/// A folder for reports and sockets that goes when the run is over; nobody else may enter it.
struct RunFolder(PathBuf);

/// Folders of a process that was killed stay behind, and its number comes again: so many may be in
/// the way.
const MOST_LEFT_BEHIND: u32 = 1000;

impl RunFolder {
    fn new() -> anyhow::Result<RunFolder> {
        RunFolder::within(&std::env::temp_dir())
    }

    fn within(place: &Path) -> anyhow::Result<RunFolder> {
        let pid = std::process::id();
        for n in 0..MOST_LEFT_BEHIND {
            let path = place.join(format!("gluray-run-{pid}-{n}"));
            match fs::DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(RunFolder(path)),
                // Not ours, whoever made it.
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(e) => {
                    return Err(e)
                        .with_context(|| format!("cannot make the folder {}", path.display()));
                }
            }
        }
        Err(anyhow::anyhow!("{} is full of folders gluray-run-{pid}-*", place.display()))
            .cure("remove those of runs that are over")
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

fn with_first(variable: &str, first: &Path) -> OsString {
    let mut value = first.as_os_str().to_owned();
    if let Some(old) = std::env::var_os(variable).filter(|v| !v.is_empty()) {
        value.push(":");
        value.push(old);
    }
    value
}

/// Variables for the library: what GLVND's had, which are ours now. `__GLX_FORCE_VENDOR_LIBRARY_n`
/// goes before the name for all screens.
fn vendors_in_front_of() -> Vec<(String, OsString)> {
    let get = crate::host::folders::variable;
    let screen = crate::interpose::glvnd::screen_of(&get("DISPLAY").unwrap_or_default());
    let forced = format!("__GLX_FORCE_VENDOR_LIBRARY_{screen}");
    let names = ["GLURAY_GLX_VENDOR", forced.as_str(), "__GLX_VENDOR_LIBRARY_NAME"];
    let named = names.iter().find_map(|n| get(n)).filter(|v| v != "gluray").unwrap_or_default();
    let egl: Vec<String> =
        crate::interpose::glvnd::egl_vendors(get).into_iter().map(|v| v.name).collect();
    let mut out = vec![
        ("GLURAY_GLX_VENDOR".to_owned(), named.into()),
        ("GLURAY_EGL_VENDOR".to_owned(), egl.join(":").into()),
    ];
    let is_forced = |(name, _): &(OsString, OsString)| {
        name.to_str().is_some_and(|n| n.starts_with("__GLX_FORCE_VENDOR_LIBRARY_"))
    };
    let forced = std::env::vars_os().filter(is_forced).filter_map(|(n, _)| n.into_string().ok());
    out.extend(forced.map(|name| (name, "gluray".into())));
    out
}

/// Runs the program; the result is its exit code.
pub(super) fn run(args: &RunArgs) -> anyhow::Result<u8> {
    anyhow::ensure!(
        crate::interposer::HAS_ENTRY_POINTS,
        "gluray runs in programs for x86-64 Linux alone"
    );
    let library = library().context("libgluray.so is not beside this program").cure(
        "build it with `cargo build --release -p gluray-interposer`, or name it in the variable \
               GLURAY_LIBRARY",
    )?;
    let library = fs::canonicalize(&library)?;
    let variables = settings(args)?;
    let folder = RunFolder::new()?;
    let reports = folder.0.join("reports");
    fs::create_dir_all(&reports)?;
    let mut command = Command::new(&args.program[0]);
    command.args(&args.program[1..]).env("GLURAY_RUN_DIR", &reports);
    command.envs(variables);
    if args.no_children {
        command.env(ONLY_CHILD_OF, std::process::id().to_string());
    } else {
        command.env_remove(ONLY_CHILD_OF);
    }
    if let Some(file) = &args.config {
        command.env("GLURAY_CONFIG", fs::canonicalize(file)?);
    }
    let vendor = args.via == Via::Vendor || (args.via == Via::Auto && has_glvnd());
    if vendor {
        let found = VendorFolder::of(&library)?;
        command
            .envs(vendors_in_front_of())
            .env("LD_LIBRARY_PATH", with_first("LD_LIBRARY_PATH", &found.folder))
            .env("__GLX_VENDOR_LIBRARY_NAME", "gluray")
            .env("__EGL_VENDOR_LIBRARY_FILENAMES", &found.egl);
    } else {
        command.env("LD_PRELOAD", with_first("LD_PRELOAD", &library));
    }
    let helpers = Helpers::start(args.ranks, &folder.0, &mut command)?;
    let name = args.program[0].to_string_lossy().into_owned();
    // Before there is a program, so that no signal finds one of us without the other.
    let signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("cannot watch for signals")?;
    let mut child = command.spawn().with_context(|| format!("cannot start {name}")).cure(
        "check the name and the PATH; everything behind `--` is the program and its arguments",
    )?;
    pass_to(&child, signals);
    let status = child.wait()?;
    drop(helpers);
    let report = collect(&reports, &name);
    let text = serde_json::to_string_pretty(&report)?;
    if let Some(file) = &args.report {
        fs::write(file, &text).with_context(|| format!("cannot write {}", file.display()))?;
    }
    let last = last_report();
    if let Some(parent) = last.parent() {
        // Convenience for `gluray explain`: a home that cannot be written is no reason to fail.
        fs::create_dir_all(parent).and_then(|()| fs::write(&last, &text)).ok();
    }
    let code = status.code().unwrap_or_else(|| 128 + status.signal().unwrap_or(0));
    Ok(u8::try_from(code).unwrap_or(1))
}

/// From now on signals end the program and not us, who stay to write the report. Ctrl-C goes to
/// both by the terminal; a TERM or HUP (of batch systems, `timeout`, a closed terminal) goes to us
/// alone and is passed on.
fn pass_to(child: &Child, mut signals: Signals) {
    let program = rustix::process::Pid::from_child(child);
    std::thread::spawn(move || {
        for signal in signals.forever() {
            let passed = match signal {
                SIGTERM => rustix::process::Signal::TERM,
                SIGHUP => rustix::process::Signal::HUP,
                _ => continue,
            };
            // It may have ended by itself: then there is nobody to tell.
            let _ = rustix::process::kill_process(program, passed);
        }
    });
}

/// All processes' accounts as one.
fn collect(folder: &Path, program: &str) -> Report {
    let mut sum = Report { program: program.to_owned(), ..Report::default() };
    let mut drew = 0;
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    files.sort();
    for file in files.iter().filter(|f| f.extension().is_some_and(|e| e == "json")) {
        let report = fs::read(file).ok().and_then(|t| serde_json::from_slice::<Report>(&t).ok());
        if let Some(r) = report {
            sum.add(&r);
            sum.mode.clone_from(&r.mode);
            sum.pid = r.pid;
            // What was started may be `timeout` or a script; the account is that of the program
            // that drew.
            if r.traced_draws + r.passed_draws > drew {
                drew = r.traced_draws + r.passed_draws;
                sum.program.clone_from(&r.program);
            }
        }
    }
    // A line for each phase that ran; the last may be half written.
    for file in files.iter().filter(|f| f.extension().is_some_and(|e| e == "spans")) {
        let text = fs::read_to_string(file).unwrap_or_default();
        sum.timeline.extend(text.lines().filter_map(|l| serde_json::from_str(l).ok()));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn folders_that_killed_runs_left_behind_are_not_taken() {
        let place = tempfile::tempdir().expect("a folder");
        let left = place.path().join(format!("gluray-run-{}-0", std::process::id()));
        fs::create_dir(&left).expect("a folder");
        let [one, other] = [(); 2].map(|()| RunFolder::within(place.path()).expect("a folder"));
        assert!(one.0 != left && other.0 != left && one.0 != other.0);
        assert_eq!(fs::metadata(&one.0).expect("there").permissions().mode() & 0o777, 0o700);
        drop((one, other));
        assert_eq!(fs::read_dir(place.path()).expect("a folder").count(), 1);
    }
}
