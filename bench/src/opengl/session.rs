//! A running program that draws a frame on request.
//!
//! Programs print `ready` after their first frame and `frame` after each later one, so two of them
//! (native, and through gluray) can alternate. The cost of each is read from the kernel's
//! accounting of its process.

use super::programs::find;
use super::{Display, Drawing, Program};
use anyhow::Context as _;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Programs that every session needs.
#[derive(Debug, Clone)]
pub struct Tools {
    /// The X server.
    pub xvfb: PathBuf,
    /// `gluray`, with its library in the same folder.
    pub gluray: PathBuf,
}

impl Tools {
    /// Finds the programs on this machine. The error lists what is missing, each with its cure.
    pub fn find() -> Result<Tools, Vec<String>> {
        let beside = std::env::current_exe().ok().and_then(|e| Some(e.parent()?.join("gluray")));
        let gluray =
            std::env::var_os("RTSV_GLURAY").map(PathBuf::from).or(beside).filter(|p| p.is_file());
        let xvfb = find("RTSV_XVFB", "/usr/bin/Xvfb");
        match (xvfb, gluray) {
            (Some(xvfb), Some(gluray)) => Ok(Tools { xvfb, gluray }),
            (xvfb, gluray) => {
                let mut missing = Vec::new();
                if xvfb.is_none() {
                    missing.push("Xvfb: install xvfb, or name it in RTSV_XVFB".to_string());
                }
                if gluray.is_none() {
                    missing.push(
                        "gluray: `cargo build --release -p gluray -p gluray-interposer`, or name \
                         it in RTSV_GLURAY"
                            .to_string(),
                    );
                }
                Err(missing)
            }
        }
    }
}

/// The renderer of a program's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// Mesa's llvmpipe.
    Llvmpipe,
    /// gluray; each frame is shown before the next one begins, and goes to the driver or to rays,
    /// whichever is cheaper.
    Serial,
    /// The same, always by rays.
    AlwaysRays,
    /// gluray with pipelined presentation: each frame is shown one frame late.
    Asynchronous,
    /// gluray with this number of processes.
    Ranks(u32),
}

impl Backend {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Backend::Llvmpipe => "llvmpipe",
            Backend::Serial => "gluray",
            Backend::AlwaysRays => "gluray, always by rays",
            Backend::Asynchronous => "gluray, one frame late",
            Backend::Ranks(_) => "gluray, several processes",
        }
    }
}

/// Cost of some frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cost {
    /// Wall-clock seconds until the frames were finished.
    pub wall_secs: f64,
    /// CPU seconds of the program's process, all threads.
    pub cpu_secs: f64,
}

/// A running program that waits for the next request.
pub struct Session {
    program: Program,
    child: Child,
    /// Process id of the program itself; with `gluray run` it is a grandchild.
    pid: u32,
    input: ChildStdin,
    lines: Receiver<String>,
    report: Option<PathBuf>,
    log: PathBuf,
}

/// Programs that do not answer within this time are abandoned.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(600);

impl Session {
    /// Starts `program`. Scripts, logs and the report are written to `dir`, which the
    /// session owns. Backends other than the driver need `gluray`.
    pub fn start(
        program: Program,
        backend: Backend,
        gluray: Option<&Path>,
        display: &Display,
        dir: &Path,
        drawing: Drawing<'_>,
    ) -> anyhow::Result<Session> {
        anyhow::ensure!(
            drawing.view.is_none() || program.takes_a_view(),
            "{} cannot be told where to look from",
            program.name()
        );
        std::fs::create_dir_all(dir)?;
        let executable = program.find().map_err(anyhow::Error::msg)?;
        let arguments = program.arguments(dir, drawing)?;
        let report = (backend != Backend::Llvmpipe).then(|| dir.join("report.json"));
        let mut command = match &report {
            None => Command::new(&executable),
            Some(report) => {
                let gluray = gluray.with_context(|| format!("{} needs gluray", backend.name()))?;
                let mut c = Command::new(gluray);
                c.args(["--quiet", "run", "--mode", "match", "--report"]).arg(report);
                if let Backend::Ranks(ranks) = backend {
                    c.args(["--ranks", &ranks.to_string()]);
                }
                if backend == Backend::AlwaysRays {
                    c.arg("--always-trace");
                }
                let late = if backend == Backend::Asynchronous { "on" } else { "off" };
                c.args(["--set", &format!("asynchronous={late}"), "--"]).arg(&executable);
                c
            }
        };
        let log = dir.join("log.txt");
        let errors = std::fs::File::create(&log)?;
        command
            .args(&arguments)
            .current_dir(dir)
            .env("DISPLAY", display.name())
            .env("LIBGL_ALWAYS_SOFTWARE", "1")
            .env("GALLIUM_DRIVER", "llvmpipe")
            .env("PATH", "/usr/bin:/bin")
            .env("HOME", dir)
            .env("XDG_STATE_HOME", dir)
            .env_remove("LD_LIBRARY_PATH")
            // What programs print must come without it.
            .env_remove("PYTHONUNBUFFERED")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(errors);
        let mut child =
            command.spawn().with_context(|| format!("cannot start {}", program.name()))?;
        let (Some(mut input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            anyhow::bail!("{} has no pipes", program.name());
        };
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        input.write_all(program.startup_commands(drawing).as_bytes())?;
        input.flush()?;
        let mut session = Session { program, pid: child.id(), child, input, lines, report, log };
        session.wait_for("ready")?;
        if session.report.is_some() {
            session.pid = only_child(session.pid).unwrap_or(session.pid);
        }
        Ok(session)
    }

    fn wait_for(&mut self, word: &str) -> anyhow::Result<()> {
        loop {
            match self.lines.recv_timeout(ANSWER_TIMEOUT) {
                Ok(line) if line.trim().ends_with(word) => return Ok(()),
                Ok(_) => {}
                Err(e) => {
                    let log = std::fs::read_to_string(&self.log).unwrap_or_default();
                    let tail: String = log.lines().rev().take(5).collect::<Vec<_>>().join(" / ");
                    let what = match e {
                        RecvTimeoutError::Timeout => "does not answer",
                        RecvTimeoutError::Disconnected => "ended",
                    };
                    anyhow::bail!(
                        "{} {what} before it printed `{word}`: {tail}",
                        self.program.name()
                    );
                }
            }
        }
    }

    /// Draws `count` frames.
    pub fn frames(&mut self, count: u32) -> anyhow::Result<Cost> {
        let (start, cpu) = (Instant::now(), cpu_secs(self.pid)?);
        for _ in 0..count {
            self.input.write_all(self.program.next_frame().as_bytes())?;
            self.input.flush()?;
            self.wait_for("frame")?;
        }
        Ok(Cost { wall_secs: start.elapsed().as_secs_f64(), cpu_secs: cpu_secs(self.pid)? - cpu })
    }

    /// Makes VTK or ParaView write the contents of its window, as raw RGB after a short header.
    pub fn save(&mut self, file: &Path) -> anyhow::Result<Vec<u8>> {
        let can = matches!(self.program, Program::Vtk | Program::ParaView);
        anyhow::ensure!(can, "{} cannot save images", self.program.name());
        self.input.write_all(format!("save {}\n", file.display()).as_bytes())?;
        self.input.flush()?;
        self.wait_for("saved")?;
        std::fs::read(file).with_context(|| format!("no image `{}`", file.display()))
    }

    /// Peak memory of the program, in bytes.
    pub fn peak_bytes(&self) -> Option<u64> {
        crate::memory::resident_peak(&format!("/proc/{}/status", self.pid))
    }

    /// Ends the program; returns gluray's report if the program ran through it.
    pub fn end(mut self) -> anyhow::Result<Option<serde_json::Value>> {
        let text = if self.program == Program::Geomview { "(exit)\n" } else { "" };
        self.input.write_all(text.as_bytes()).ok();
        let Session { mut child, input, report, pid, .. } = self;
        drop(input);
        let deadline = Instant::now() + Duration::from_secs(60);
        while child.try_wait()?.is_none() {
            if Instant::now() > deadline {
                // Signal the program, not `gluray run`, which then writes its report.
                rustix::process::Pid::from_raw(pid as i32)
                    .map(|p| rustix::process::kill_process(p, rustix::process::Signal::TERM));
                child.wait()?;
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let Some(report) = report else { return Ok(None) };
        let text = std::fs::read_to_string(&report)
            .with_context(|| format!("`gluray run` left no report `{}`", report.display()))?;
        Ok(Some(serde_json::from_str(&text)?))
    }
}

/// CPU seconds of a process including its threads, with a resolution of one clock tick, usually
/// 1/100 s (`utime` and `stime` in `/proc/PID/stat`).
fn cpu_secs(pid: u32) -> anyhow::Result<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat"))
        .with_context(|| format!("process {pid} is gone"))?;
    // The name in brackets may contain spaces.
    let fields: Vec<&str> =
        stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    Ok((ticks(11) + ticks(12)) / rustix::param::clock_ticks_per_second() as f64)
}

/// The child of a process with exactly one.
fn only_child(pid: u32) -> Option<u32> {
    let children = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).ok()?;
    children.split_whitespace().next()?.parse().ok()
}
