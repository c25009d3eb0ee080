//! Shared by the tests of real programs: a private X server, runs of a program natively and through
//! gluray, and the comparison of images.
#![allow(dead_code, reason = "each test file uses its part")]

pub(crate) mod cases;
pub(crate) mod metrics;

use gluray::report::Report;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// Reports that a test does not run and why, or fails where peers are required.
pub(crate) fn skip(why: &str) {
    assert!(
        std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"),
        "{why}, and peers are required"
    );
    // libtest captures `eprintln!` in a passing test.
    writeln!(std::io::stderr(), "skipped: {why}").ok();
}

/// A peer from the variable that `cargo xtask test` sets. Without it: `None` and a visible message,
/// or a failure where peers are required.
pub(crate) fn peer(variable: &str) -> Option<PathBuf> {
    let found = std::env::var_os(variable).map(PathBuf::from).filter(|p| p.exists());
    if found.is_none() {
        skip(&format!("{variable} names no program; `cargo xtask test` installs it"));
    }
    found
}

/// An X server without a screen, on a display of its own.
pub(crate) struct Xvfb {
    server: Child,
    pub(crate) display: String,
}

impl Xvfb {
    pub(crate) fn start() -> Option<Xvfb> {
        let program = peer("RTSV_XVFB")?;
        let mut server = Command::new(program)
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1280x1280x24",
                "+extension",
                "GLX",
                "-noreset",
                "-nolisten",
                "tcp",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts");
        let mut line = String::new();
        BufReader::new(server.stdout.take().expect("piped"))
            .read_line(&mut line)
            .expect("Xvfb says its display");
        Some(Xvfb { server, display: format!(":{}", line.trim()) })
    }
}

impl Drop for Xvfb {
    fn drop(&mut self) {
        self.server.kill().ok();
        self.server.wait().ok();
    }
}

/// A folder that is removed at the end of the test.
pub(crate) fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// How to run a program.
pub(crate) struct Run<'a> {
    pub(crate) x: &'a Xvfb,
    pub(crate) folder: &'a Path,
    /// Arguments of `gluray run`; `None` runs natively.
    pub(crate) through: Option<&'a [&'a str]>,
    pub(crate) environment: &'a [(&'a str, &'a str)],
}

impl Run<'_> {
    /// Runs the program to its end; returns its output and gluray's report.
    pub(crate) fn program(&self, program: &Path, arguments: &[&str]) -> (Output, Report) {
        let (output, report) = self.faulty_program(program, arguments);
        assert_eq!(report.faults, Vec::<String>::new(), "our own faults");
        (output, report)
    }

    /// The same for tests that expect a fault of gluray.
    pub(crate) fn faulty_program(&self, program: &Path, arguments: &[&str]) -> (Output, Report) {
        let report = self.folder.join("report.json");
        let mut command = match self.through {
            None => Command::new(program),
            Some(options) => {
                let mut c = Command::new(env!("CARGO_BIN_EXE_gluray"));
                c.args(["--quiet", "run", "--report"])
                    .arg(&report)
                    .args(options)
                    .arg("--")
                    .arg(program);
                c
            }
        };
        command.args(arguments).current_dir(self.folder).stdin(Stdio::null());
        command
            .env("DISPLAY", &self.x.display)
            .env("LIBGL_ALWAYS_SOFTWARE", "1")
            .env("GALLIUM_DRIVER", "llvmpipe")
            .env("PATH", "/usr/bin:/bin")
            .env("XDG_STATE_HOME", self.folder)
            // Pictures of a few triangles are the driver's otherwise.
            .env("GLURAY_ALWAYS_TRACE", "true")
            .env_remove("LD_LIBRARY_PATH");
        self.environment.iter().for_each(|(k, v)| {
            command.env(k, v);
        });
        let output = command.output().expect("the program starts");
        let report = match self.through {
            None => Report::default(),
            Some(_) => {
                let text = std::fs::read_to_string(&report).unwrap_or_else(|e| {
                    let said = String::from_utf8_lossy(&output.stderr);
                    panic!("no report ({e}) of a program that ended with {}: {said}", output.status)
                });
                serde_json::from_str(&text).expect("a report in JSON")
            }
        };
        (output, report)
    }
}

/// An image of 8-bit RGB, top row first.
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Reads a PNG or a binary PPM.
    pub(crate) fn read(file: &Path) -> Picture {
        if file.extension().is_some_and(|e| e == "ppm") {
            return Picture::read_ppm(file);
        }
        let image =
            image::open(file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).to_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        Picture { width, height, pixels: image.pixels().map(|p| p.0).collect() }
    }

    fn read_ppm(file: &Path) -> Picture {
        let bytes = std::fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let (mut words, mut at, mut word) = (Vec::new(), 0, Vec::new());
        while words.len() < 4 {
            match bytes[at] {
                b'#' => {
                    while bytes[at] != b'\n' {
                        at += 1
                    }
                }
                b if b.is_ascii_whitespace() => {
                    if !word.is_empty() {
                        words.push(String::from_utf8(std::mem::take(&mut word)).expect("text"));
                    }
                }
                b => word.push(b),
            }
            at += 1;
        }
        assert_eq!(words[0], "P6", "{}", file.display());
        let size = |i: usize| words[i].parse::<usize>().expect("a size");
        let pixels = bytes[at..].chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        Picture { width: size(1), height: size(2), pixels }
    }
}
