//! The ANARI device in ANARI's own loader, which the wheel pynari contains, with Python test
//! programs in `tests/anari`.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Python with pynari; `None`, with a message on stderr, when it is missing and not required.
fn python() -> Option<PathBuf> {
    let found = std::env::var_os("RTSV_PYTHON").map(PathBuf::from);
    if found.is_none() {
        assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none(), "RTSV_PYTHON is not set");
        writeln!(std::io::stderr(), "SKIPPED: tests of the ANARI device: RTSV_PYTHON is not set")
            .expect("stderr");
    }
    found
}

/// A folder with the device under the file name that the loader looks for.
fn device_folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("anari");
    std::fs::create_dir_all(&folder).expect("a folder for the device");
    let built =
        std::env::current_exe().expect("a test is a file").with_file_name("libvtk_bridge.so");
    // Tests run in parallel: each moves a complete copy to the final name.
    let copy = folder.join(format!("copy-{:?}", std::thread::current().id()));
    std::fs::copy(&built, &copy).unwrap_or_else(|e| panic!("{}: {e}", built.display()));
    std::fs::rename(&copy, folder.join("libanari_library_rtv.so")).expect("a name for the device");
    folder
}

fn run(python: &Path, program: &str, arguments: &[&str]) -> Output {
    let folder = device_folder();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/anari").join(program);
    let mut command = Command::new(python);
    command
        .arg(script)
        .args(arguments)
        .env("LD_LIBRARY_PATH", &folder)
        .env("PYTHONDONTWRITEBYTECODE", "1");
    command.output().expect("python runs")
}

fn assert_passes(program: &str) {
    let Some(python) = python() else { return };
    let output = run(&python, program, &[]);
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program}: {}\n{said}", output.status);
}

#[test]
fn objects_parameters_and_frames_are_what_the_specification_says() {
    assert_passes("spec.py");
}

#[test]
fn samplers_area_lights_and_panoramas_match_closed_forms() {
    assert_passes("surfaces.py");
}

#[test]
fn misuse_is_named_and_harms_nothing() {
    assert_passes("robust.py");
}

#[test]
fn a_program_of_pynari_s_users_draws_with_us() {
    assert_passes("through_pynari.py");
}

#[test]
fn numbers_at_their_limits_and_random_values_harm_nothing() {
    assert_passes("limits.py");
}

/// Runs `c_abi/anari.c`, which prints "done" at the end, prefixed by a command.
fn c_program(before: &[&str]) -> Option<Output> {
    let python = python()?;
    let place = "import importlib.util, os; \
                 print(os.path.dirname(importlib.util.find_spec('pynari').origin))";
    let found = Command::new(&python).args(["-c", place]).output().expect("python runs");
    let loader = Path::new(String::from_utf8_lossy(&found.stdout).trim()).join("libanari.so.0");
    let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("anari-c-{}", before.len()));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c_abi/anari.c");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut compile = Command::new(&compiler);
    compile
        .args(["-std=c11", "-g", "-O1", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&out)
        .arg(source)
        .arg("-ldl");
    let made = compile.output().unwrap_or_else(|e| panic!("{compiler}: {e}"));
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let mut words = before.iter().map(|w| (*w).to_owned()).chain([out.display().to_string()]);
    let mut command = Command::new(words.next().expect("a program"));
    command
        .args(words)
        .arg(loader)
        .env("LD_LIBRARY_PATH", device_folder())
        .env("RAYON_NUM_THREADS", "2");
    Some(command.output().expect("it starts"))
}

fn assert_done(output: &Output) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && output.stdout == b"done\n", "{:?}\n{text}", output.status);
}

#[test]
fn a_c_program_draws_every_kind_of_object_through_the_loader() {
    if let Some(output) = c_program(&[]) {
        assert_done(&output);
    }
}

#[test]
fn valgrind_finds_no_fault_in_the_device() {
    let valgrind =
        std::env::var("RTSV_VALGRIND").unwrap_or_else(|_| "/usr/bin/valgrind".to_owned());
    if !Path::new(&valgrind).exists() {
        // Valgrind is optional: the program itself runs without it.
        writeln!(std::io::stderr(), "SKIPPED: {valgrind} was not found (apt-get install valgrind)")
            .expect("stderr");
        return;
    }
    // Up to 0.14, the loader deletes the library as an object of an incomplete type: with C++'s
    // delete and without the destructor. The memory comes from malloc, to which this delete returns
    // it.
    let command =
        [valgrind.as_str(), "--error-exitcode=9", "--quiet", "--show-mismatched-frees=no"];
    let leaks =
        ["--leak-check=full", "--show-leak-kinds=definite", "--errors-for-leak-kinds=definite"];
    let command = [&command[..], &leaks].concat();
    if let Some(output) = c_program(&command) {
        assert_done(&output);
    }
}

/// PSNR above which two images count as equal: pixel sampling differs at edges, and barney's noise
/// remains.
const SAME_DB: f64 = 30.0;

#[test]
fn every_kind_of_object_looks_as_in_barney() {
    let Some(python) = python() else { return };
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("anari-pictures");
    std::fs::create_dir_all(&folder).expect("a folder for pictures");
    let output = run(&python, "compare.py", &[&folder.display().to_string()]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}\n{said}", output.status);
    let scenes: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("compare.py prints JSON");
    let scenes = scenes.as_object().expect("an object");
    assert!(scenes.len() >= 20, "{}", scenes.len());
    let mut compared = 0;
    for (name, found) in scenes {
        assert!(found["covered"].as_u64() > Some(500), "{name} shows something: {found}");
        if found["comparable"] == true {
            compared += 1;
            assert!(found["psnr"].as_f64() >= Some(SAME_DB), "{name}: {found}");
        }
    }
    assert!(compared >= 10, "{compared} scenes are compared");
}
