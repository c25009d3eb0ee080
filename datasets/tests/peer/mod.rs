//! Finds a Python with VTK, so that tests compare with VTK itself rather than with recorded
//! numbers.
//!
//! Order: `RTSV_PYTHON`, `python3`, `$RTSV_PEERS/venv/bin/python`. Without one, the test is skipped
//! and says why; with `RTSV_REQUIRE_PEERS=1` it fails instead.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::Command;

/// A Python that can `import vtk`; otherwise prints what was tried and returns `None`.
pub(crate) fn python_with_vtk(test: &str) -> Option<PathBuf> {
    let mut candidates: Vec<PathBuf> =
        std::env::var_os("RTSV_PYTHON").into_iter().map(PathBuf::from).collect();
    candidates.push("python3".into());
    if let Some(peers) = std::env::var_os("RTSV_PEERS") {
        candidates.push(PathBuf::from(peers).join("venv/bin/python"));
    }
    let mut tried = Vec::new();
    for python in candidates {
        match Command::new(&python).args(["-c", "import vtkmodules.all"]).output() {
            Ok(out) if out.status.success() => return Some(python),
            Ok(out) => {
                let stderr = String::from_utf8_lossy(&out.stderr);
                tried.push(format!(
                    "{}: {}",
                    python.display(),
                    stderr.lines().last().unwrap_or("failed")
                ));
            }
            Err(e) => tried.push(format!("{}: {e}", python.display())),
        }
    }
    let reason = format!("{test} needs a Python with VTK (set RTSV_PYTHON): {}", tried.join("; "));
    assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{reason}");
    say_skipped(&reason);
    None
}

/// Prints on stderr why a test is skipped. `println!` and `eprintln!` would not work: libtest
/// captures both in tests that pass.
pub(crate) fn say_skipped(reason: &str) {
    writeln!(std::io::stderr(), "skipped: {reason}").expect("stderr can be written");
}

/// Runs `script` with `args` and returns its output. Panics with its error output when it fails.
pub(crate) fn run(python: &PathBuf, script: &str, args: &[&str]) -> String {
    let out =
        Command::new(python).arg("-c").arg(script).args(args).output().expect("python starts");
    assert!(out.status.success(), "python failed:\n{}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).expect("python prints UTF-8")
}
