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

#[test]
fn options_are_keyword_arguments_for_all_renderers_or_for_one_plotter() {
    let Some(python) = python() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts/options.py");
    let output = command(&python).arg(script).output().expect("python runs");
    assert!(checked("options.py", output).contains("pixels darker by occlusion"));
}

#[test]
fn keyword_arguments_are_the_options_of_the_library() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/rtvtk/options.py");
    let source = std::fs::read_to_string(package).expect("the package's options");
    let rules = source.split("RULES = {").nth(1).and_then(|s| s.split("\n}").next());
    let named: Vec<String> = rules
        .expect("a dictionary RULES")
        .lines()
        .filter_map(|line| line.trim().strip_prefix('"')?.split_once('"'))
        .map(|(name, _)| format!("RTV_{}", name.to_uppercase()))
        .collect();
    // `enable` and `disable` are RTV_OFF; the others are `vtk-bridge install`'s.
    let others = ["RTV_OFF", "RTV_HOME", "RTV_VTK_INCLUDE", "RTV_LIBRARY"];
    let names = vtk_bridge::options::NAMES.iter().map(|(name, ..)| *name);
    let expected: Vec<&str> = names.filter(|name| !others.contains(name)).collect();
    assert_eq!(named, expected);
}

#[test]
fn the_doctor_says_what_is_there_and_what_is_missing() {
    let Some(python) = python() else { return };
    let doctor = |name: &str, value: &str| {
        let output = command(&python).args(["-m", "rtvtk", "doctor"]).env(name, value).output();
        let output = output.expect("python runs");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let (code, said) = doctor("RTV_QUIET", "1");
    assert_eq!((code, said.contains("ok   frame: traced in a vtk")), (Some(0), true), "{said}");
    let (code, said) = doctor("RTV_AO", "many");
    let named = said.contains("FAIL options: RTV_AO=many is not understood; give 0 to 4096");
    assert_eq!((code, named), (Some(1), true), "{said}");
    let (code, said) = doctor("RTVTK_LIBRARY", "/no/such/library.so");
    let named = said.contains("FAIL library") && said.contains("frame: not tried");
    assert_eq!((code, named), (Some(1), true), "{said}");
}

#[test]
fn options_stand_before_the_script() {
    let Some(python) = python() else { return };
    let run = |arguments: &[&str]| {
        let output = command(&python).args(["-m", "rtvtk"]).args(arguments).output();
        let output = output.expect("python runs");
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8_lossy(&said).into_owned())
    };
    for (arguments, part) in [
        (&["--shadow", "a.py"][..], "did you mean --shadows?"),
        (&["--shadows=1", "a.py"], "write --shadows"),
        (&["--ao", "a.py"], "write --ao=VALUE"),
        (&["--ao=-3", "-m", "this"], "ao is '-3'; give 0 to 4096"),
    ] {
        let (code, said) = run(arguments);
        assert_eq!((code, said.contains(part)), (Some(2), true), "{arguments:?}: {said}");
    }
    let (code, said) = run(&["--ao=16", "--shadows", "-m", "this"]);
    assert_eq!((code, said.contains("Namespaces are one honking")), (Some(0), true), "{said}");
    let (code, said) = run(&["--help"]);
    assert_eq!((code, said.contains("--light-size=VALUE     0 to 45")), (Some(0), true), "{said}");
}
