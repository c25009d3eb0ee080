//! The package for the stock `vtk` wheel: ordinary scripts with and without it, and its own wheel built and installed without a network.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Scripts of `tests/scripts/vtk` that a current VTK can run, with props that are traced.
const SCRIPTS: &[&str] = &[
    "annotations",
    "clipping",
    "contours",
    "data_set_mapper",
    "light_kit",
    "opacity",
    "parallel_projection",
    "selection",
    "specular",
    "streamlines",
    "textures",
    "two_viewports",
];
/// Mean difference of colours, in levels of 255.
const COLOR_MEAN: f64 = 0.5;
/// Share of pixels whose silhouette differs.
const SILHOUETTE: f64 = 0.0002;
/// VTK's depth buffer has 24 bits, and so has what crosses to it: nine of ten pixels agree within four steps.
const DEPTH: f32 = 4.0 / 16_777_215.0;
/// Where a surface is steep to the viewer, OpenGL's own interpolation is off by some steps more: all but a hundredth agree within these.
const DEPTH_STEEP: f32 = 24.0 / 16_777_215.0;

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
    command.env("PYTHONPATH", package).env("RTVTK_LIBRARY", library()).env("PYTHONDONTWRITEBYTECODE", "1");
    command.env_remove("DISPLAY");
    command
}

fn checked(what: &str, output: Output) -> String {
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {}\n{said}", output.status);
    said.into_owned()
}

struct Shot {
    rgba: Vec<u8>,
    depth: Vec<f32>,
    answers: serde_json::Value,
}

fn shot(python: &Path, script: &str, traced: bool) -> Shot {
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts");
    let base = out().join(format!("{script}-{}", if traced { "rtvtk" } else { "stock" }));
    let mut c = command(python);
    if traced {
        c.args(["-m", "rtvtk"]).env("RTV_REPORT", base.with_extension("report.json"));
    }
    c.arg(scripts.join("run.py")).arg(scripts.join(format!("vtk/{script}.py"))).arg(&base);
    checked(script, c.output().expect("python runs"));
    let read = |end: &str| {
        let path = format!("{}.{end}", base.display());
        std::fs::read(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
    };
    let floats =
        |b: Vec<u8>| b.chunks_exact(4).map(|c| f32::from_ne_bytes([c[0], c[1], c[2], c[3]])).collect();
    let json: serde_json::Value = serde_json::from_slice(&read("json")).expect("JSON");
    Shot { rgba: read("rgba"), depth: floats(read("z")), answers: json["answers"].clone() }
}

#[test]
fn unmodified_scripts_look_the_same_in_the_stock_wheel() {
    let Some(python) = python() else { return };
    for script in SCRIPTS {
        let (stock, traced) = (shot(&python, script, false), shot(&python, script, true));
        let pixels = stock.depth.len();
        assert_eq!(stock.rgba.len(), traced.rgba.len(), "{script}");
        let colors = stock.rgba.iter().zip(&traced.rgba);
        let mean = colors.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / stock.rgba.len() as f64;
        assert!(mean <= COLOR_MEAN, "{script}: colours differ by {mean}");
        let depths = || stock.depth.iter().zip(&traced.depth);
        let silhouette = depths().filter(|(a, b)| (**a < 1.0) != (**b < 1.0)).count();
        assert!(
            silhouette as f64 <= (SILHOUETTE * pixels as f64).max(1.0),
            "{script}: {silhouette} of {pixels}"
        );
        let both = || depths().filter(|(a, b)| **a < 1.0 && **b < 1.0);
        let covered = both().count();
        let off = |limit: f32| both().filter(|(a, b)| (**a - **b).abs() > limit).count();
        assert!(covered > 500, "{script} shows something");
        assert!(off(DEPTH) * 10 <= covered, "{script}: depth differs at {} of {covered}", off(DEPTH));
        assert!(
            off(DEPTH_STEEP) * 100 <= covered,
            "{script}: depth differs at {} of {covered}",
            off(DEPTH_STEEP)
        );
        // Nodes of a selection come in the order of their actors' addresses.
        let sorted = |v: &serde_json::Value| {
            let mut all: Vec<_> = v.as_array().into_iter().flatten().map(ToString::to_string).collect();
            all.sort();
            all
        };
        assert_eq!(sorted(&stock.answers), sorted(&traced.answers), "{script}: picks and selections");
    }
}

#[test]
fn effects_come_by_environment_variables() {
    let Some(python) = python() else { return };
    let plain = shot(&python, "shadow_scene", true).rgba;
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts");
    let base = out().join("shadows-on");
    let mut c = command(&python);
    c.args(["-m", "rtvtk"]).env("RTV_SHADOWS", "1").arg(scripts.join("run.py"));
    c.arg(scripts.join("vtk/shadow_scene.py")).arg(&base);
    checked("shadow_scene", c.output().expect("python runs"));
    let shadows = std::fs::read(format!("{}.rgba", base.display())).expect("a picture");
    let darker = plain.iter().zip(&shadows).filter(|(a, b)| **a > b.saturating_add(20)).count();
    let brighter = plain.iter().zip(&shadows).filter(|(a, b)| **b > a.saturating_add(20)).count();
    assert!(darker > 500 && brighter < darker / 20, "{darker} darker, {brighter} brighter");
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
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts/run.py").display().to_string();
    let (code, said) = run("/no/such/library.so", &[&script]);
    assert_eq!((code, said.contains("set RTVTK_LIBRARY to the file")), (Some(2), true), "{said}");
}
