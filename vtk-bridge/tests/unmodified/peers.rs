//! The programs, an X server for them, and an installation of the bridge.

use crate::shot::Shot;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Which program runs a script.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Program {
    /// python3 with Debian's VTK 9.1.
    Vtk,
    /// pvbatch of ParaView 5.11.
    ParaView,
    /// The same on this many ranks.
    Ranks(u32),
}

/// Longest time a script may take; the machine of CI is slow.
const TIME_LIMIT: Duration = Duration::from_secs(240);

/// What all tests share.
pub(crate) struct Peers {
    vtk91: PathBuf,
    pvbatch: PathBuf,
    mpirun: Option<PathBuf>,
    display: String,
    /// Where `vtk-bridge install` has put things.
    pub(crate) home: PathBuf,
    /// For pictures and reports.
    pub(crate) out: PathBuf,
    /// Ends with the test process, because its standard input closes.
    _server: Child,
}

/// The peers; `None`, with a word on stderr, when they are not there and need not be.
pub(crate) fn peers() -> Option<&'static Peers> {
    static PEERS: OnceLock<Option<Peers>> = OnceLock::new();
    PEERS.get_or_init(set_up).as_ref()
}

fn set_up() -> Option<Peers> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let names = ["RTSV_VTK91", "RTSV_PVBATCH", "RTSV_XVFB"];
    let found: Vec<_> = names.iter().filter_map(|n| variable(n)).collect();
    let [vtk91, pvbatch, xvfb] = found.as_slice() else {
        assert!(variable("RTSV_REQUIRE_PEERS").is_none(), "{names:?} are not all set");
        writeln!(std::io::stderr(), "SKIPPED: tests of vtk-bridge in VTK and ParaView: {names:?} are not all set")
            .expect("stderr");
        return None;
    };
    let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("vtk-bridge");
    let home = out.join("home");
    std::fs::create_dir_all(&out).expect("a folder for pictures");
    let mut install = Command::new(env!("CARGO_BIN_EXE_vtk-bridge"));
    install.args(["install", "--quiet", "--prefix"]).arg(&home);
    install.arg("--include").arg(vtk91.join("usr/include/vtk-9.1"));
    let output = install.output().expect("vtk-bridge runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // -noreset: a server that resets when its last client leaves turns the next one away.
    let mut server = Command::new(xvfb)
        .args(["-displayfd", "1", "-noreset", "-screen", "0", "1280x1024x24"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("Xvfb starts");
    let mut number = String::new();
    BufReader::new(server.stdout.take().expect("piped")).read_line(&mut number).expect("Xvfb says its display");
    watch(server.id());
    Some(Peers {
        vtk91: vtk91.clone(),
        pvbatch: pvbatch.clone(),
        mpirun: variable("RTSV_MPIRUN"),
        display: format!(":{}", number.trim()),
        home,
        out,
        _server: server,
    })
}

/// Ends the X server when the test process ends: nothing else would, because statics are not dropped.
fn watch(server: u32) {
    let script = format!("while kill -0 {} 2>/dev/null; do sleep 1; done; kill {server}", std::process::id());
    Command::new("sh").args(["-c", &script]).stdin(Stdio::null()).spawn().expect("sh runs");
}

/// The folder of the scripts.
pub(crate) fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts")
}

/// Options of a run: variables, and whether the bridge is there.
#[derive(Debug, Clone, Default)]
pub(crate) struct Run {
    pub(crate) traced: bool,
    pub(crate) variables: Vec<(String, String)>,
}

impl Run {
    pub(crate) fn plain() -> Run {
        Run::default()
    }

    pub(crate) fn traced() -> Run {
        Run { traced: true, ..Run::default() }
    }

    pub(crate) fn with(mut self, name: &str, value: impl ToString) -> Run {
        self.variables.push((name.to_owned(), value.to_string()));
        self
    }
}

impl Peers {
    /// Whether there is an mpiexec.
    pub(crate) fn has_mpi(&self) -> bool {
        self.mpirun.is_some()
    }

    /// The command that runs a Python file.
    fn command(&self, program: Program, run: &Run) -> Command {
        let mut c = match program {
            Program::Vtk => {
                let mut c = Command::new("/usr/bin/python3");
                let libraries = format!("usr/lib/{}-linux-gnu", std::env::consts::ARCH);
                c.env("LD_LIBRARY_PATH", self.vtk91.join(libraries));
                c.env("PYTHONPATH", self.vtk91.join("usr/lib/python3/dist-packages"));
                c
            }
            Program::ParaView => Command::new(&self.pvbatch),
            Program::Ranks(n) => {
                let mut c = Command::new(self.mpirun.as_ref().expect("asked before"));
                c.args(["--allow-run-as-root", "--oversubscribe", "-n", &n.to_string()]).arg(&self.pvbatch);
                c
            }
        };
        c.env("DISPLAY", &self.display).env_remove("VTK_AUTOLOAD_PATH").env("RTV_HOME", &self.home);
        for (name, _) in std::env::vars_os().filter(|(n, _)| n.to_string_lossy().starts_with("RTV_")) {
            if name != "RTV_HOME" {
                c.env_remove(name);
            }
        }
        if run.traced {
            c.env("VTK_AUTOLOAD_PATH", self.home.join("autoload"));
        }
        c.envs(run.variables.iter().cloned());
        c
    }

    /// Runs a Python file with arguments to its end.
    pub(crate) fn python(&self, program: Program, run: &Run, arguments: &[&str]) -> Output {
        let mut command = self.command(program, run);
        let mut child = command
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let started = Instant::now();
        // Output of scripts is short: pipes do not fill up.
        while child.try_wait().expect("a child").is_none() {
            if started.elapsed() > TIME_LIMIT {
                child.kill().expect("a child");
                panic!("{command:?} takes longer than {TIME_LIMIT:?}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        child.wait_with_output().expect("its output")
    }

    /// Runs a script of `tests/scripts` and returns what its window shows, and what it printed on stderr.
    pub(crate) fn shot(&self, program: Program, script: &str, run: &Run) -> (Shot, String) {
        use std::sync::atomic::{AtomicU32, Ordering};
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let name = script.replace('/', "-");
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let out = self.out.join(format!("{name}-{number}"));
        let folder = scripts();
        let (runner, file) = (folder.join("run.py"), folder.join(format!("{script}.py")));
        let paths = [&runner, &file, &out].map(|p| p.to_str().expect("UTF-8").to_owned());
        let output = self.python(program, run, &[&paths[0], &paths[1], &paths[2]]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{script}: {:?}\n{said}", output.status);
        (Shot::read(&out), said)
    }
}
