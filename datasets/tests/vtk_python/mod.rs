//! Finds a Python with VTK, for tests against the real thing.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python that has the modules `vtk` and `numpy`: the one in `RTSV_PYTHON`, else the one in the environment that
/// `cargo xtask test` sets up under `RTSV_PEERS`, else `python3`. `None` after saying so; with `RTSV_REQUIRE_PEERS=1` a missing
/// peer is a failure, so that CI cannot pass by skipping.
pub(crate) fn find() -> Option<PathBuf> {
    let mut candidates: Vec<PathBuf> = Vec::new();
    candidates.extend(std::env::var_os("RTSV_PYTHON").map(PathBuf::from));
    candidates.extend(std::env::var_os("RTSV_PEERS").map(|p| Path::new(&p).join("venv/bin/python")));
    candidates.push("python3".into());
    let has_vtk = |python: &PathBuf| {
        let probe = Command::new(python).args(["-c", "import vtk, numpy"]).output();
        probe.is_ok_and(|o| o.status.success())
    };
    let found = candidates.iter().find(|p| has_vtk(p)).cloned();
    if found.is_none() {
        let message =
            "no Python with the modules vtk and numpy: install with `cargo xtask test`, or set RTSV_PYTHON";
        assert!(
            std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"),
            "RTSV_REQUIRE_PEERS=1, but there is {message}"
        );
        println!("skipped: {message}");
    }
    found
}

/// Runs the script that writes and checks files with VTK; returns what it prints.
pub(crate) fn run(python: &Path, args: &[&std::ffi::OsStr]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vtk_files/write_all.py");
    let output = Command::new(python).arg(&script).args(args).output().expect("python starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{} failed:\n{errors}", script.display());
    String::from_utf8(output.stdout).expect("the script prints UTF-8")
}
