//! Real programs, natively and through gluray. In `match` mode the images must equal the driver's.

mod common;
#[path = "programs/vtk_surfaces.rs"]
mod vtk_surfaces;

use common::metrics::{Metrics, compare};
use common::{Picture, Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A bumpy sphere of 2 (n - 1)² triangles.
fn bumpy_sphere(n: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let angle = |i: usize, from: f64, to: f64| from + (to - from) * i as f64 / (n - 1) as f64;
    let mut points = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let (u, v) =
                (angle(i, 0.0, std::f64::consts::TAU), angle(j, 0.02, std::f64::consts::PI - 0.02));
            let r = 1.0 + 0.15 * (9.0 * u).sin() * (7.0 * v).sin();
            points.push(
                [r * v.sin() * u.cos(), r * v.sin() * u.sin(), r * v.cos()].map(|x| x as f32),
            );
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n - 1 {
        for i in 0..n - 1 {
            let a = (j * n + i) as u32;
            let (b, c, d) = (a + 1, a + n as u32, a + n as u32 + 1);
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    (points, triangles)
}

fn write_stl(file: &Path) {
    let (points, triangles) = bumpy_sphere(81);
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        bytes.extend([0; 12]);
        t.iter().flat_map(|i| points[*i as usize]).for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    std::fs::write(file, bytes).expect("a temporary file");
}

fn write_off(file: &Path) {
    let (points, triangles) = bumpy_sphere(81);
    let mut text = format!("OFF\n{} {} 0\n", points.len(), triangles.len());
    points.iter().for_each(|p| writeln!(text, "{} {} {}", p[0], p[1], p[2]).expect("a String"));
    triangles
        .iter()
        .for_each(|t| writeln!(text, "3 {} {} {}", t[0], t[1], t[2]).expect("a String"));
    std::fs::write(file, text).expect("a temporary file");
}

fn script(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs").join(name);
    path.to_str().expect("UTF-8").to_owned()
}

/// Both images of a program, and gluray's report.
fn both(
    program: &Path,
    arguments: &[&str],
    picture: &str,
    least: Share,
    prepare: impl Fn(&Path),
) -> Option<(Metrics, Report)> {
    let x = Xvfb::start()?;
    let run = |through: Option<&[&str]>| {
        let place = folder();
        prepare(place.path());
        let environment =
            [("HOME", place.path().to_str().expect("UTF-8")), ("QT_QPA_PLATFORM", "xcb")];
        let run = Run { x: &x, folder: place.path(), through, environment: &environment };
        let (output, report) = run.program(program, arguments);
        let file = place.path().join(picture);
        assert!(
            file.is_file(),
            "{}: {}",
            program.display(),
            String::from_utf8_lossy(&output.stderr)
        );
        (Picture::read(&file), report)
    };
    let (native, _) = run(None);
    let (ours, report) = run(Some(&["--mode", "match"]));
    let m = compare(&native, &ours);
    eprintln!(
        "{}: {m:?}, traced {}, passed {:?}",
        program.display(),
        report.traced_draws,
        report.passed_reasons
    );
    assert!(report.traced_draws > 0, "{report:?}");
    let name = program.file_name().expect("a file").to_string_lossy();
    Share::of(&native, &report).assert(&format!("{name} {arguments:?}"), least, &report);
    Some((m, report))
}

/// Fraction of a program's drawing that is traced.
#[derive(Debug, Clone, Copy)]
struct Share {
    /// Fraction of its draws.
    draws: f64,
    /// Pixels of traced surfaces, divided by the non-background pixels of all frames. Surfaces
    /// hidden behind others in the same trace count once, so a value above 1 means that something
    /// was drawn over traced surfaces.
    pixels: f64,
}

/// Measured fractions.
const fn share(draws: f64, pixels: f64) -> Share {
    Share { draws, pixels }
}

/// Every pixel except those of silhouettes.
const ALL: Share = share(0.99, 0.99);

impl Share {
    fn of(native: &Picture, report: &Report) -> Share {
        let seen =
            native.pixels.iter().filter(|p| (0..3).any(|k| p[k].abs_diff(native.pixels[0][k]) > 2));
        let draws = (report.traced_draws + report.passed_draws).max(1);
        let pixels = seen.count() as f64 * report.frames.max(1) as f64;
        Share {
            draws: report.traced_draws as f64 / draws as f64,
            pixels: report.pixels as f64 / pixels.max(1.0),
        }
    }

    /// Requires at least half of `least`: how often a window is drawn, and so how many of its
    /// frames are traced, depends on the machine.
    fn assert(self, what: &str, least: Share, report: &Report) {
        let enough = self.draws >= 0.5 * least.draws && self.pixels >= 0.5 * least.pixels;
        let (frames, passed) = (report.frames, &report.passed_reasons);
        assert!(enough, "{what}: {self:?}, measured {least:?}, {frames} frames, passed {passed:?}");
    }
}

fn program(variable: &str) -> Option<PathBuf> {
    peer(variable)
}

#[test]
fn gmsh_draws_the_drivers_image() {
    let Some(gmsh) = program("RTSV_GMSH") else { return };
    let lines = "Merge \"s.stl\";\nGeneral.GraphicsWidth=768; General.GraphicsHeight=768; \
                 General.MenuWidth=0;\nGeneral.Trackball=0; \
                 General.RotationX=-60; General.RotationZ=30;\nMesh.SurfaceFaces=1; \
                 Mesh.SurfaceEdges=0;\nDraw;\nPrint \"out.png\";\nExit;\n";
    let prepare = |f: &Path| {
        write_stl(&f.join("s.stl"));
        std::fs::write(f.join("s.geo"), lines).expect("a temporary file");
    };
    // Corresponds to two of its three frames: one is drawn without a depth test. The driver draws
    // the lines.
    if let Some((m, _)) = both(&gmsh, &["s.geo"], "out.png", share(0.33, 0.66), prepare) {
        m.assert_filled("gmsh");
    }
}

#[test]
fn geomview_draws_the_drivers_image() {
    let Some(geomview) = program("RTSV_GEOMVIEW") else { return };
    let lines = "(load s.off)\n(window c0 {size 768 768})\n(bbox-draw g1 no)\n(backcolor c0 0.1 \
                 0.1 0.2)\n(normalization g1 none)\n\
                 (merge-ap g1 { shading smooth -edge })\n(look g1)\n(redraw c0)\n(snapshot c0 \
                 out.ppm ppmscreen 768 768)\n(exit)\n";
    let prepare = |f: &Path| {
        write_off(&f.join("s.off"));
        std::fs::write(f.join("s.gcl"), lines).expect("a temporary file");
    };
    // 0.916 of the area of its last image, over eight frames; the number of frames depends on the
    // machine.
    if let Some((m, _)) =
        both(&geomview, &["-nopanels", "-c", "s.gcl"], "out.ppm", share(0.99, 0.8), prepare)
    {
        m.assert_filled("geomview");
    }
}

#[test]
fn openscad_draws_the_drivers_image() {
    let Some(openscad) = program("RTSV_OPENSCAD") else { return };
    let scene = "$fn=32;\ndifference(){ sphere(r=20); cylinder(r=8,h=50,center=true); \
                 }\ntranslate([30,0,0]) cube([10,20,30],center=true);\n";
    let prepare = |f: &Path| std::fs::write(f.join("s.scad"), scene).expect("a temporary file");
    let arguments =
        ["-o", "out.png", "--imgsize=768,768", "--render", "--camera=0,0,0,60,0,30,150", "s.scad"];
    if let Some((m, _)) = both(&openscad, &arguments, "out.png", ALL, prepare) {
        m.assert_filled("openscad");
    }
}

#[test]
fn octave_draws_the_drivers_image() {
    let Some(octave) = program("RTSV_OCTAVE") else { return };
    let file = script("octave.m");
    let arguments = ["--no-gui", "--quiet", "--no-init-file", file.as_str()];
    // Half of the draws are blended and passed to the driver.
    if let Some((m, _)) = both(&octave, &arguments, "out.png", share(0.49, 0.99), |_| ()) {
        m.assert_lines("octave");
    }
}

#[test]
fn pymol_without_shaders_draws_the_drivers_image() {
    let Some(pymol) = program("RTSV_PYMOL") else { return };
    let lines = "set internal_gui, 0\nfragment trp\nviewport 768,768\nhide everything\nshow \
                 sticks\nshow spheres\nset use_shaders, 0\n\
                 bg_color white\norient\npng out.png, ray=0\nquit\n";
    let prepare = |f: &Path| std::fs::write(f.join("s.pml"), lines).expect("a temporary file");
    // Corresponds to one of its three frames.
    if let Some((m, _)) = both(&pymol, &["-q", "s.pml"], "out.png", share(0.99, 0.33), prepare) {
        m.assert_filled("pymol");
    }
}

#[test]
fn paraview_draws_the_drivers_image() {
    let Some(pvbatch) = program("RTSV_PVBATCH") else { return };
    let file = script("paraview_scene.py");
    // Corresponds to three of its four frames, without the lines, which the driver draws.
    if let Some((m, _)) = both(&pvbatch, &[file.as_str()], "out.png", share(0.53, 0.72), |_| ()) {
        m.assert_filled("pvbatch");
    }
}

#[test]
fn vtk_in_python_draws_the_drivers_image() {
    let (Some(python), Some(_)) = (program("RTSV_SYSTEM_PYTHON"), program("RTSV_PVBATCH")) else {
        return;
    };
    let file = script("vtk_scene.py");
    if let Some((m, _)) = both(&python, &[file.as_str()], "out.png", share(0.66, 0.93), |_| ()) {
        m.assert_filled("python vtk");
    }
}

#[test]
fn vtk_leaves_blending_on_and_is_opaque_all_the_same() {
    let (Some(python), Some(_)) = (program("RTSV_SYSTEM_PYTHON"), program("RTSV_PVBATCH")) else {
        return;
    };
    let Some(x) = Xvfb::start() else { return };
    let place = folder();
    let home = [("HOME", place.path().to_str().expect("UTF-8"))];
    let run =
        Run { x: &x, folder: place.path(), through: Some(&["--mode", "rich"]), environment: &home };
    let (_, report) = run.program(&python, &[script("vtk_scene.py").as_str()]);
    assert!(report.traced_draws > 0, "{report:?}");
    assert_eq!(
        report.rays.get("transparency"),
        None,
        "nothing here lets light through: {:?}",
        report.rays
    );
}

/// Result for VTK's depth peeling: the driver draws one pass, and the rest is traced at once.
fn assert_peeled(report: &Report) {
    assert!(report.flushes.get("depth peeling").is_some_and(|n| *n > 0), "{report:?}");
    assert_eq!(
        report.passed_reasons.get("translucent surfaces that VTK peels"),
        None,
        "{report:?}"
    );
    assert_eq!(report.problems, Vec::<String>::new());
}

#[test]
fn translucent_surfaces_that_vtk_peels_are_traced_in_one_pass_and_give_the_drivers_image() {
    let (Some(python), Some(_)) = (program("RTSV_SYSTEM_PYTHON"), program("RTSV_PVBATCH")) else {
        return;
    };
    let file = script("vtk_translucent.py");
    if let Some((m, report)) = both(&python, &[file.as_str()], "out.png", share(0.33, 0.99), |_| ())
    {
        m.assert_filled("translucent surfaces in VTK");
        assert_peeled(&report);
    }
}

#[test]
fn paraviews_translucent_contours_are_traced_in_one_pass_and_give_the_drivers_image() {
    let Some(pvbatch) = program("RTSV_PVBATCH") else { return };
    let file = script("paraview_translucent.py");
    // As in `paraview_draws_the_drivers_image`.
    if let Some((m, report)) =
        both(&pvbatch, &[file.as_str()], "out.png", share(0.41, 0.72), |_| ())
    {
        m.assert_filled("translucent contours in ParaView");
        assert_peeled(&report);
    }
}

#[test]
fn lines_among_translucent_surfaces_leave_the_whole_peeling_to_the_driver() {
    let (Some(python), Some(_)) = (program("RTSV_SYSTEM_PYTHON"), program("RTSV_PVBATCH")) else {
        return;
    };
    let file = script("vtk_translucent.py");
    // One draw of each frame; the peeling passes are left to the driver.
    if let Some((m, report)) =
        both(&python, &[file.as_str(), "lines"], "out.png", share(0.02, 0.13), |_| ())
    {
        m.assert_filled("lines among translucent surfaces");
        assert_eq!(report.flushes.get("depth peeling"), None, "{report:?}");
        assert!(
            report.passed_reasons.contains_key("translucent surfaces that VTK peels"),
            "{report:?}"
        );
    }
}

#[test]
fn vtk_by_egl_draws_the_drivers_image() {
    let (Some(python), Some(_)) = (program("RTSV_PYTHON"), program("RTSV_XVFB")) else { return };
    let file = script("egl_scene.py");
    if let Some((m, _)) = both(&python, &[file.as_str()], "out.png", ALL, |_| ()) {
        m.assert_filled("VTK by EGL");
    }
}

/// Mesa writes every error of a call to stderr when `MESA_DEBUG` is set, whoever made the call and
/// whoever has taken the error since.
#[test]
fn no_call_of_ours_is_an_error_in_contexts_without_fixed_function() {
    let Some(python) = program("RTSV_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let file = script("wheel_scene.py");
    let errors = |through: Option<&[&str]>, kind: &str| {
        let place = folder();
        let home = place.path().to_str().expect("UTF-8").to_owned();
        let environment = [("HOME", home.as_str()), ("MESA_DEBUG", "1")];
        let run = Run { x: &x, folder: place.path(), through, environment: &environment };
        let (output, report) = run.program(&python, &[file.as_str(), kind]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let lines = text.lines().filter(|l| l.contains("User error")).map(str::to_owned);
        (lines.collect::<Vec<_>>(), report)
    };
    for kind in ["plain", "pictures", "images", "peeled"] {
        let (native, _) = errors(None, kind);
        let (ours, report) = errors(Some(&[]), kind);
        assert_eq!(ours, native, "{kind}");
        assert!(report.traced_draws > 0, "{kind}");
    }
}

#[test]
fn passing_everything_changes_no_pixel() {
    let Some(gmsh) = program("RTSV_GMSH") else { return };
    let Some(x) = Xvfb::start() else { return };
    let lines = "Merge \"s.stl\";\nGeneral.GraphicsWidth=400; General.GraphicsHeight=400; \
                 General.MenuWidth=0;\nDraw;\nPrint \"out.png\";\nExit;\n";
    let picture = |through: Option<&[&str]>, more: &[(&str, &str)]| {
        let place = folder();
        write_stl(&place.path().join("s.stl"));
        std::fs::write(place.path().join("s.geo"), lines).expect("a temporary file");
        let home = ("HOME", place.path().to_str().expect("UTF-8"));
        let environment: Vec<_> = more.iter().copied().chain([home]).collect();
        let run = Run { x: &x, folder: place.path(), through, environment: &environment };
        run.program(&gmsh, &["s.geo"]);
        Picture::read(&place.path().join("out.png"))
    };
    let native = picture(None, &[]);
    for via in ["vendor", "preload"] {
        let ours = picture(Some(&["--mode", "off", "--via", via]), &[]);
        assert!(native.pixels == ours.pixels, "pixels differ by way of {via}");
        // With `off` nothing comes to us. A refused shader makes us pass what has come.
        let refused = [("GLURAY_INJECT_FAULT", "shader")];
        let ours = picture(Some(&["--via", via]), &refused);
        assert!(native.pixels == ours.pixels, "pixels that are passed differ by way of {via}");
    }
}
