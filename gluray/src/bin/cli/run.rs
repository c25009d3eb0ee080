//! `gluray run`: the environment for the library, the program, and the account of what happened.

use super::{has_glvnd, last_report, library};
use anyhow::Context as _;
use datasets::cli::{CureExt as _, UsageError};
use gluray::config::{ConfigFile, Mode};
use gluray::report::Report;
use std::ffi::OsString;
use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How the library gets into the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Via {
    /// As GLVND's vendor library where there is GLVND, else by LD_PRELOAD.
    Auto,
    /// As GLVND's vendor library.
    Vendor,
    /// By LD_PRELOAD.
    Preload,
}

#[derive(clap::Args)]
pub(crate) struct RunArgs {
    /// Look of traced surfaces: match (the driver's picture), phong, rich, enhance, path, or off (nothing is traced).
    #[arg(long, value_parser = parse_mode)]
    mode: Option<Mode>,
    /// `all` traces every filled primitive, in the order drawn, also without a depth test or with blending.
    #[arg(long, value_parser = ["all", "surfaces"])]
    trace: Option<String>,
    /// Write the account of the run here, as JSON.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Settings by program name, TOML.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// How the library gets into the program.
    #[arg(long, value_enum, default_value = "auto")]
    via: Via,
    /// The program and its arguments.
    #[arg(required = true, trailing_var_arg = true, allow_hyphen_values = true, value_name = "PROGRAM")]
    program: Vec<OsString>,
}

fn parse_mode(text: &str) -> Result<Mode, String> {
    Mode::from_name(text).ok_or_else(|| "one of match, phong, rich, enhance, path, off".to_owned())
}

/// A folder that goes when the run is over.
struct RunFolder(PathBuf);

impl RunFolder {
    fn new() -> anyhow::Result<RunFolder> {
        let path = std::env::temp_dir().join(format!("gluray-run-{}", std::process::id()));
        fs::create_dir_all(&path).with_context(|| format!("cannot make the folder {}", path.display()))?;
        Ok(RunFolder(path))
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

/// Runs the program; the result is its exit code.
pub(crate) fn run(args: &RunArgs, quiet: bool) -> anyhow::Result<u8> {
    let library = library().context("libgluray.so is not beside this program").cure(
        "build it with `cargo build --release -p gluray`, or name it in the variable GLURAY_LIBRARY",
    )?;
    let library = fs::canonicalize(&library)?;
    if let Some(file) = &args.config {
        let text = fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
        toml::from_str::<ConfigFile>(&text).map_err(|e| UsageError(format!("{}: {e}", file.display())))?;
    }
    let folder = RunFolder::new()?;
    let reports = folder.0.join("reports");
    fs::create_dir_all(&reports)?;
    let mut command = Command::new(&args.program[0]);
    command.args(&args.program[1..]).env("GLURAY_RUN_DIR", &reports);
    if let Some(mode) = args.mode {
        command.env("GLURAY_MODE", mode.name());
    }
    if let Some(trace) = &args.trace {
        command.env("GLURAY_TRACE", trace);
    }
    if let Some(file) = &args.config {
        command.env("GLURAY_CONFIG", fs::canonicalize(file)?);
    }
    let vendor = args.via == Via::Vendor || (args.via == Via::Auto && has_glvnd());
    if vendor {
        for name in ["libGLX_gluray.so.0", "libEGL_gluray.so.0"] {
            std::os::unix::fs::symlink(&library, folder.0.join(name))?;
        }
        let egl = folder.0.join("egl.json");
        let icd = folder.0.join("libEGL_gluray.so.0");
        let text = serde_json::json!({ "file_format_version": "1.0.0", "ICD": { "library_path": icd } });
        fs::write(&egl, text.to_string())?;
        command
            .env("GLURAY_GLX_VENDOR", std::env::var_os("__GLX_VENDOR_LIBRARY_NAME").unwrap_or_default())
            .env("LD_LIBRARY_PATH", with_first("LD_LIBRARY_PATH", &folder.0))
            .env("__GLX_VENDOR_LIBRARY_NAME", "gluray")
            .env("__EGL_VENDOR_LIBRARY_FILENAMES", &egl);
    } else {
        command.env("LD_PRELOAD", with_first("LD_PRELOAD", &library));
    }
    let name = args.program[0].to_string_lossy().into_owned();
    let mut child = command
        .spawn()
        .with_context(|| format!("cannot start {name}"))
        .cure("check the name and the PATH; everything behind `--` is the program and its arguments")?;
    // Ctrl-C goes to the program, too, which decides what to do about it; we stay to write the report.
    if !quiet {
        datasets::cli::Cancel::on_ctrl_c().ok();
    }
    let status = child.wait()?;
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

/// All processes' accounts as one.
fn collect(folder: &Path, program: &str) -> Report {
    let mut sum = Report { program: program.to_owned(), ..Report::default() };
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    files.sort();
    for file in files.iter().filter(|f| f.extension().is_some_and(|e| e == "json")) {
        let report = fs::read(file).ok().and_then(|t| serde_json::from_slice::<Report>(&t).ok());
        if let Some(r) = report {
            sum.add(&r);
            sum.mode.clone_from(&r.mode);
            sum.pid = r.pid;
        }
    }
    sum
}
