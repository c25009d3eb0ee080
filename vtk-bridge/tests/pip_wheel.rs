//! The package for the stock `vtk` wheel: built and installed without a network, and its messages
//! when something is missing. `against_stock/wheel.rs` compares images with and without it.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn python() -> Option<PathBuf> {
    let found = std::env::var_os("RTSV_PYTHON").map(PathBuf::from);
    if found.is_none() {
        assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none(), "RTSV_PYTHON is not set");
        writeln!(std::io::stderr(), "SKIPPED: tests of the pip wheel: RTSV_PYTHON is not set")
            .expect("stderr");
    }
    found
}

fn library() -> PathBuf {
    std::env::current_exe().expect("a test is a file").with_file_name("libvtk_bridge.so")
}

fn out() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("pip-wheel");
    std::fs::create_dir_all(&folder).expect("a folder for pictures");
    folder
}

/// Python without a display: VTK then draws with EGL or OSMesa.
fn command(python: &Path) -> Command {
    let mut command = Command::new(python);
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    command
        .env("PYTHONPATH", package)
        .env("RTVTK_LIBRARY", library())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    command.env_remove("DISPLAY");
    command
}

fn checked(what: &str, output: Output) -> String {
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {}\n{said}", output.status);
    said.into_owned()
}

#[test]
fn the_wheel_is_built_and_installed_without_a_network() {
    let Some(python) = python() else { return };
    let folder = out().join("wheel");
    let target = out().join("installed");
    let _ = std::fs::remove_dir_all(&folder);
    let _ = std::fs::remove_dir_all(&target);
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    let pip = |args: &[&str]| {
        let mut c = Command::new(&python);
        c.args(["-m", "pip", "--disable-pip-version-check"])
            .args(args)
            .env("RTVTK_LIBRARY", library());
        checked(&args.join(" "), c.output().expect("pip runs"))
    };
    let (folder_text, target_text) = (folder.display().to_string(), target.display().to_string());
    let source = source.display().to_string();
    pip(&["wheel", "--no-index", "--no-deps", "--no-build-isolation", "-w", &folder_text, &source]);
    let wheel = std::fs::read_dir(&folder)
        .expect("a folder")
        .next()
        .expect("a wheel")
        .expect("an entry")
        .path();
    pip(&[
        "install",
        "--no-index",
        "--no-deps",
        "--target",
        &target_text,
        &wheel.display().to_string(),
    ]);
    let mut c = Command::new(&python);
    let program =
        "import rtvtk, vtkmodules.vtkRenderingCore as c; print(type(c.vtkRenderer()).__name__)";
    c.args(["-c", program]).env("PYTHONPATH", &target).env_remove("RTVTK_LIBRARY");
    assert!(checked("rtvtk", c.output().expect("python runs")).contains("RtvRenderer"));
}

#[test]
fn a_missing_library_or_script_is_a_clear_message_and_exit_code_2() {
    let Some(python) = python() else { return };
    let run = |library: &str, arguments: &[&str]| {
        let output = command(&python)
            .args(["-m", "rtvtk"])
            .args(arguments)
            .env("RTVTK_LIBRARY", library)
            .output();
        let output = output.expect("python runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let here = library().display().to_string();
    let (code, said) = run(&here, &["no_such_script.py"]);
    assert_eq!(
        (code, said.contains("no_such_script.py: no such script")),
        (Some(2), true),
        "{said}"
    );
    let script = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/scripts/run_all.py")
        .display()
        .to_string();
    let (code, said) = run("/no/such/library.so", &[&script]);
    assert_eq!((code, said.contains("set RTVTK_LIBRARY to the file")), (Some(2), true), "{said}");
}
