//! The package for the stock `vtk` wheel: ordinary scripts with and without it, and its own wheel built and installed without a network.

#[allow(dead_code, reason = "the tests of the other programs use more of it")]
#[path = "against_stock/capture.rs"]
mod capture;
#[allow(dead_code, reason = "the tests of the other programs use more of it")]
#[path = "against_stock/compare.rs"]
mod compare;

use capture::{Capture, bright};
use compare::{Bars, faults};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Scripts of `tests/scripts/vtk` that a current VTK can run, with props that are traced.
const SCRIPTS: &[&str] = &[
    "annotations",
    "changing",
    "clipping",
    "colors",
    "contours",
    "data_sets",
    "edges",
    "lights",
    "opacity",
    "projections",
    "selection",
    "specular",
    "streamlines",
    "textures",
    "viewports",
    "volumes",
];

/// Pictures that are held to other bars, and why.
const EXCEPTIONS: &[(&str, &str, Bars, &str)] = &[
    (
        "projections",
        "sheared",
        Bars { color_mean: 255.0, color_strays: 1.0, ..Bars::STRICT },
        "OpenGL shades in sheared coordinates, where right angles are none: its light is wrong",
    ),
    (
        "textures",
        "transparent",
        Bars { silhouette: 1.0, depth_ulp: u32::MAX, ..Bars::STRICT },
        "OpenGL writes no depth for a surface with a translucent texture; we write it where the texture is opaque",
    ),
    (
        "volumes",
        "translucent_inside",
        Bars { color_mean: 3.0, color_strays: 0.2, ..Bars::STRICT },
        "OpenGL blends volumes over all translucent surfaces, also over those in front of them and inside",
    ),
    (
        "streamlines",
        "streamlines",
        Bars { silhouette: 0.0005, ..Bars::STRICT },
        "the tubes' rims: VTK 9.7 makes other tubes than 9.1, with more slivers",
    ),
];

/// The Python with the wheel, or nothing, said aloud.
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

fn command(python: &Path) -> Command {
    let mut command = Command::new(python);
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    command.env("PYTHONPATH", package).env("RTVTK_LIBRARY", library()).env("PYTHONDONTWRITEBYTECODE", "1");
    command.env_remove("DISPLAY");
    command
}

fn checked(what: &str, output: Output) -> String {
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(output.status.success(), "{what}: {}\n{said}", output.status);
    said
}

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts")
}

/// Runs scripts into a folder of that name, one after the other in one process.
fn run(
    python: &Path,
    scripts_to_run: &[PathBuf],
    traced: bool,
    name: &str,
    settings: &[(&str, &str)],
) -> PathBuf {
    let folder = out().join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder for pictures");
    let mut c = command(python);
    if traced {
        let report = folder.join("report.json");
        c.args(["-m", "rtvtk"]).env("RTV_REPORT", &report).env("CAPTURE_BESIDE", &report);
    }
    c.envs(settings.iter().copied()).arg(scripts().join("run_all.py")).arg(&folder).args(scripts_to_run);
    checked(name, c.output().expect("python runs"));
    folder
}

#[test]
fn unmodified_scripts_look_the_same_in_the_stock_wheel() {
    let Some(python) = python() else { return };
    let files: Vec<PathBuf> = SCRIPTS.iter().map(|s| scripts().join(format!("vtk/{s}.py"))).collect();
    let stock = run(&python, &files, false, "stock", &[]);
    let ours = run(&python, &files, true, "rtvtk", &[]);
    let (mut found, mut compared) = (Vec::new(), 0);
    for script in SCRIPTS {
        for entry in std::fs::read_dir(stock.join(script)).expect("pictures") {
            let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
            let Some(name) = name.strip_suffix(".png") else { continue };
            let [a, b] = [&stock, &ours].map(|f| {
                let mut capture = Capture::read(&f.join(script), name).expect("a picture");
                // Two rectangles with the picture are drawn in the place of the props.
                capture.facts.as_object_mut().map(|facts| facts.remove("props"));
                capture
            });
            let exception = EXCEPTIONS.iter().find(|(s, n, ..)| (*s, *n) == (*script, name));
            let bars = exception.map_or(Bars::STRICT, |(_, _, bars, _)| *bars);
            if b.traced_elements() == 0 {
                found.push(format!("{script}/{name}: nothing was ray traced"));
            }
            found.extend(faults(&a, &b, &bars).iter().map(|f| format!("{script}/{name}: {f}")));
            compared += 1;
        }
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
    assert!(compared >= 30, "only {compared} pictures");
}

#[test]
fn effects_come_by_environment_variables() {
    let Some(python) = python() else { return };
    let room = [scripts().join("effects/room.py")];
    let picture = |name: &str, settings: &[(&str, &str)]| {
        Capture::read(&run(&python, &room, true, name, settings).join("room"), "room").expect("a picture")
    };
    let (plain, shadows) = (picture("plain", &[]), picture("shadows", &[("RTV_SHADOWS", "1")]));
    let change = |place: &str| bright(shadows.at(place)) - bright(plain.at(place));
    assert!(change("shadow") < -20.0, "the shadow is as bright as before: {}", change("shadow"));
    assert!(change("lit").abs() < 1.0 && change("far_from_shadow").abs() < 1.0, "lit floor has changed");
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
        c.args(["-m", "pip", "--disable-pip-version-check"]).args(args).env("RTVTK_LIBRARY", library());
        checked(&args.join(" "), c.output().expect("pip runs"))
    };
    let (folder_text, target_text) = (folder.display().to_string(), target.display().to_string());
    let source = source.display().to_string();
    pip(&["wheel", "--no-index", "--no-deps", "--no-build-isolation", "-w", &folder_text, &source]);
    let wheel =
        std::fs::read_dir(&folder).expect("a folder").next().expect("a wheel").expect("an entry").path();
    pip(&["install", "--no-index", "--no-deps", "--target", &target_text, &wheel.display().to_string()]);
    let mut c = Command::new(&python);
    let program = "import rtvtk, vtkmodules.vtkRenderingCore as c; print(type(c.vtkRenderer()).__name__)";
    c.args(["-c", program]).env("PYTHONPATH", &target).env_remove("RTVTK_LIBRARY");
    assert!(checked("rtvtk", c.output().expect("python runs")).contains("RtvRenderer"));
}

#[test]
fn a_missing_library_or_script_is_a_clear_message_and_exit_code_2() {
    let Some(python) = python() else { return };
    let run = |library: &str, arguments: &[&str]| {
        let output =
            command(&python).args(["-m", "rtvtk"]).args(arguments).env("RTVTK_LIBRARY", library).output();
        let output = output.expect("python runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let here = library().display().to_string();
    let (code, said) = run(&here, &["no_such_script.py"]);
    assert_eq!((code, said.contains("no_such_script.py: no such script")), (Some(2), true), "{said}");
    let script = scripts().join("run_all.py").display().to_string();
    let (code, said) = run("/no/such/library.so", &[&script]);
    assert_eq!((code, said.contains("set RTVTK_LIBRARY to the file")), (Some(2), true), "{said}");
}
