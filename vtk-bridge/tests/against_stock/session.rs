//! Runs the scripts in stock programs, and in the same programs with the output of `vtk-bridge
//! env`.

use crate::capture::Capture;
use crate::peers;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The program that runs a script.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Program {
    /// Debian's VTK in Python: 9.1 on Debian 12.
    Vtk,
    /// Debian's ParaView, `pvbatch`: 5.11 on Debian 12.
    ParaView,
    /// The `vtk` wheel of PyPI.
    Wheel,
}

/// Without or with the bridge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum With {
    /// As Debian ships it.
    Stock,
    /// After `eval "$(vtk-bridge env ...)"`; for the wheel, started by `python -m rtvtk`.
    Bridge,
}

/// Time limit of a process, in seconds.
const TIME_LIMIT: &str = "240";

/// The bridge, installed by its own program once for all tests of this process.
pub(crate) fn installed() -> &'static Path {
    static HOME: OnceLock<PathBuf> = OnceLock::new();
    HOME.get_or_init(|| {
        let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bridge");
        let mut install = Command::new(env!("CARGO_BIN_EXE_vtk-bridge"));
        install.args(["install", "--prefix"]).arg(&home);
        if let Some(headers) = peers::vtk91().and_then(|root| peers::vtk_headers(&root)) {
            install.arg("--include").arg(headers);
        }
        if peers::paraview_headers().is_some() {
            install.arg("--plugin");
        }
        let out = install.output().expect("vtk-bridge starts");
        let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
        assert!(
            out.status.success(),
            "vtk-bridge install:\n{}\n{}",
            text(&out.stdout),
            text(&out.stderr)
        );
        home
    })
}

/// The folder of ParaView's plugin, whatever ParaView's version; reasons for its absence.
pub(crate) fn plugin_folder() -> Result<PathBuf, String> {
    let folder = installed().join("plugins");
    let none = || format!("no plugin in {}: no headers of ParaView are here", folder.display());
    let entries = std::fs::read_dir(&folder).map_err(|_| none())?;
    let mut folders = entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.is_dir());
    folders.next().ok_or_else(none)
}

/// A shell command in the environment of `program`.
pub(crate) struct Launch {
    command: Command,
}

impl Launch {
    /// Prepares `line` (shell syntax; `"$@"` are `args`), or says why it cannot run here.
    pub(crate) fn new(program: Program, with: With, line: &str) -> Result<Launch, String> {
        let display = peers::display()?;
        let mut command = Command::new("timeout");
        let mut script = String::new();
        if with == With::Bridge && program != Program::Wheel {
            let which = if program == Program::Vtk { "--vtk" } else { "--paraview" };
            let tool = env!("CARGO_BIN_EXE_vtk-bridge");
            script = format!(
                "exports=$('{tool}' env {which} --prefix '{}') || exit 97; eval \"$exports\"; ",
                installed().display()
            );
        }
        command.args(["-k", "5", TIME_LIMIT, "sh", "-c", &(script + line), "sh"]);
        command
            .env("DISPLAY", display)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("LC_ALL", "C.UTF-8");
        // Remove the variables of the person who runs the tests.
        for (name, _) in
            std::env::vars_os().filter(|(n, _)| n.to_string_lossy().starts_with("RTV_"))
        {
            command.env_remove(name);
        }
        // The scenes are small: OpenGL would draw most of them, and nothing would be compared.
        command
            .env("RTV_ALWAYS_TRACE", "1")
            .env_remove("VTK_AUTOLOAD_PATH")
            .env_remove("PV_PLUGIN_PATH")
            .env_remove("PYTHONPATH");
        if program == Program::Wheel {
            // Without a display, VTK draws with EGL or OSMesa, as on a server.
            let library = std::env::current_exe()
                .map_err(|e| e.to_string())?
                .with_file_name("libvtk_bridge.so");
            let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
            command.env_remove("DISPLAY").env("PYTHONPATH", package).env("RTVTK_LIBRARY", library);
        }
        if program == Program::Vtk {
            let root = peers::vtk91()
                .ok_or("Debian's VTK was not found (set RTSV_VTK91 to where it is unpacked)")?;
            let libraries = format!("usr/lib/{}-linux-gnu", std::env::consts::ARCH);
            command.env("LD_LIBRARY_PATH", root.join(libraries));
            command.env("PYTHONPATH", root.join("usr/lib/python3/dist-packages"));
        }
        Ok(Launch { command })
    }

    /// Sets the arguments for `"$@"`.
    pub(crate) fn args<S: AsRef<std::ffi::OsStr>>(
        mut self,
        args: impl IntoIterator<Item = S>,
    ) -> Launch {
        self.command.args(args);
        self
    }

    /// Sets an environment variable.
    pub(crate) fn env(mut self, name: &str, value: impl AsRef<std::ffi::OsStr>) -> Launch {
        self.command.env(name, value);
        self
    }

    /// Runs the command and returns all its output and its exit status.
    pub(crate) fn output(mut self) -> Outcome {
        let out = self.command.output().expect("timeout (coreutils) starts");
        let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
        Outcome { stdout: text(&out.stdout), stderr: text(&out.stderr), code: out.status.code() }
    }
}

/// Result of a process.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    /// Exit code; `None` after a signal.
    pub(crate) code: Option<i32>,
}

impl Outcome {
    /// Panics with all output unless the process exited with 0.
    pub(crate) fn expect_success(self, what: &str) -> Outcome {
        assert!(
            self.code == Some(0),
            "{what}: ended with {:?}\n{}\n{}",
            self.code,
            self.stdout,
            self.stderr
        );
        self
    }
}

/// The command line that runs Python scripts in `program`.
pub(crate) fn interpreter(program: Program, with: With) -> Result<String, String> {
    match program {
        Program::Wheel => {
            let python = peers::find("RTSV_PYTHON", &[])
                .ok_or("Python with the wheel `vtk` was not found (set RTSV_PYTHON)")?;
            let module = if with == With::Bridge { " -m rtvtk" } else { "" };
            Ok(format!("'{}'{module}", python.display()))
        }
        // Debian's modules need Debian's Python.
        Program::Vtk => Ok("/usr/bin/python3".to_owned()),
        Program::ParaView => {
            let pvbatch = peers::pvbatch().ok_or("pvbatch was not found (set RTSV_PVBATCH)")?;
            Ok(format!("'{}'", pvbatch.display()))
        }
    }
}

/// All scripts of a kind, run one after the other, in as few processes as crashes allow.
#[derive(Debug, Default)]
pub(crate) struct Run {
    folder: PathBuf,
    /// Failures of scripts, by name.
    failed: BTreeMap<String, String>,
    /// All output on stderr.
    pub(crate) stderr: String,
}

impl Run {
    /// Runs `scripts` with output to `folder`. `settings` are environment variables.
    pub(crate) fn new(
        program: Program,
        with: With,
        scripts: &[PathBuf],
        folder: PathBuf,
        settings: &[(&str, &str)],
    ) -> Result<Run, String> {
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let line = format!("exec {} \"$@\"", interpreter(program, with)?);
        let mut run = Run { folder, ..Run::default() };
        let mut left = scripts;
        while !left.is_empty() {
            let beside = run.folder.join("report.json");
            let mut launch = Launch::new(program, with, &line)?
                .args([peers::scripts().join("run_all.py"), run.folder.clone()])
                .args(left)
                .env("CAPTURE_BESIDE", &beside);
            if with == With::Bridge {
                launch = launch.env("RTV_REPORT", &beside);
            }
            for (name, value) in settings {
                launch = launch.env(name, value);
            }
            let out = launch.output();
            run.stderr += &out.stderr;
            for line in out.stdout.lines() {
                if let Some(name) = line.strip_prefix("raised ") {
                    run.failed
                        .insert(name.to_owned(), format!("raised an exception:\n{}", out.stderr));
                }
            }
            let started = out.stdout.lines().filter_map(|l| l.strip_prefix("running ")).count();
            let finished = out.stdout.lines().filter(|l| l.starts_with("finished ")).count();
            if started == finished && (finished == left.len() || started == 0) {
                if started == 0 {
                    return Err(format!(
                        "no script was started ({:?}):\n{}\n{}",
                        out.code, out.stdout, out.stderr
                    ));
                }
                break;
            }
            // The process crashed in the script that started last. Continue with the others.
            let name =
                left[finished].file_stem().unwrap_or_default().to_string_lossy().into_owned();
            run.failed
                .insert(name, format!("the process ended with {:?}:\n{}", out.code, out.stderr));
            left = &left[finished + 1..];
        }
        Ok(run)
    }

    /// Names of all images of a script, sorted.
    pub(crate) fn images(&self, script: &str) -> Result<Vec<String>, String> {
        if let Some(how) = self.failed.get(script) {
            return Err(format!("{script}: {how}"));
        }
        let folder = self.folder.join(script);
        let entries =
            std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let names = entries
            .filter_map(|e| Some(e.ok()?.file_name().to_str()?.strip_suffix(".png")?.to_owned()));
        let mut names: Vec<String> = names.collect();
        names.sort();
        if names.is_empty() {
            Err(format!("{script} saved no image:\n{}", self.stderr))
        } else {
            Ok(names)
        }
    }

    /// One image of a script.
    pub(crate) fn capture(&self, script: &str, image: &str) -> Result<Capture, String> {
        Capture::read(&self.folder.join(script), image)
    }

    /// The path of an image.
    pub(crate) fn path(&self, script: &str, image: &str) -> PathBuf {
        self.folder.join(script).join(format!("{image}.png"))
    }
}

/// The scripts of a folder, sorted.
pub(crate) fn scripts_in(folder: &str) -> Vec<PathBuf> {
    let folder = peers::scripts().join(folder);
    let entries =
        std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut scripts: Vec<PathBuf> = entries
        .filter_map(|e| Some(e.ok()?.path()).filter(|p| p.extension().is_some_and(|x| x == "py")))
        .collect();
    scripts.sort();
    scripts
}

/// A folder for the images of a run. It is kept after the tests for inspection.
pub(crate) fn output(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("pictures").join(name)
}
