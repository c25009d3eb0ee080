//! The ANARI device in ANARI's own loader, which the wheel pynari brings, with test programs in Python next to this file: `tests/anari`.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Python with pynari; `None`, with a word on stderr, when it is not there and need not be.
fn python() -> Option<PathBuf> {
    let found = std::env::var_os("RTSV_PYTHON").map(PathBuf::from);
    if found.is_none() {
        assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none(), "RTSV_PYTHON is not set");
        writeln!(std::io::stderr(), "SKIPPED: tests of the ANARI device: RTSV_PYTHON is not set")
            .expect("stderr");
    }
    found
}

/// A folder with the device under the name that the loader looks for.
fn device_folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("anari");
    std::fs::create_dir_all(&folder).expect("a folder for the device");
    let built = std::env::current_exe().expect("a test is a file").with_file_name("libvtk_bridge.so");
    // Tests run side by side: each moves a complete copy into place.
    let copy = folder.join(format!("copy-{:?}", std::thread::current().id()));
    std::fs::copy(&built, &copy).unwrap_or_else(|e| panic!("{}: {e}", built.display()));
    std::fs::rename(&copy, folder.join("libanari_library_rtv.so")).expect("a name for the device");
    folder
}

fn run(python: &Path, program: &str, arguments: &[&str]) -> Output {
    let folder = device_folder();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/anari").join(program);
    let mut command = Command::new(python);
    command.arg(script).args(arguments).env("LD_LIBRARY_PATH", &folder).env("PYTHONDONTWRITEBYTECODE", "1");
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

/// PSNR that counts as the same picture: edges differ by how pixels are sampled, and barney's noise remains.
const SAME_DB: f64 = 30.0;

#[test]
fn every_kind_of_object_looks_as_in_barney() {
    let Some(python) = python() else { return };
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("anari-pictures");
    std::fs::create_dir_all(&folder).expect("a folder for pictures");
    let output = run(&python, "compare.py", &[&folder.display().to_string()]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}\n{said}", output.status);
    let scenes: serde_json::Value = serde_json::from_slice(&output.stdout).expect("compare.py prints JSON");
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
