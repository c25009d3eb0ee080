//! Real programs, natively and through gluray. In `match` mode the images must equal the driver's.

mod common;

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

/// Traced fraction of a scene of `wheel_scene.py`. With four samples, each counts.
fn share_of_scene(kind: &[&str]) -> Share {
    match kind {
        // One of the four surfaces has VTK's original shader.
        ["replaced"] => share(0.25, 0.74),
        // Two of four have a texture with anisotropic filtering.
        ["pictures_smaller"] => share(0.5, 0.59),
        // The driver draws the shadow maps; in a second frame also the surfaces.
        ["shadows"] => share(0.25, 0.99),
        ["shadows", "0", "2"] => share(0.16, 0.49),
        // A third of the draws are lines; VTK's own pass over the whole image is not recognised.
        ["moved_back"] => share(0.66, 0.99),
        ["moved_back", "4"] => share(0.61, 3.9),
        ["translucent_moved_back"] => share(0.61, 0.9),
        // VTK's own passes over the whole image are not traced.
        ["peeled"] => share(0.42, 0.99),
        ["peeled_glyphs"] => share(0.37, 0.99),
        ["translucent_glyphs"] => share(0.75, 0.99),
        ["translucent"] => share(0.85, 0.99),
        ["translucent_pictures"] => share(0.83, 0.99),
        [_, "4"] => share(0.8, 3.9),
        _ => ALL,
    }
}

/// Draws scenes of `wheel_scene.py` in the current VTK and, if `old`, in Debian's, natively and
/// through gluray. Each image must equal the driver's, and at least `least` of its surface draws in
/// each frame must be traced.
fn scenes(kinds: &[&[&str]], old: bool, least: u64) -> Vec<Report> {
    let (Some(python), Some(_)) = (program("RTSV_PYTHON"), program("RTSV_XVFB")) else {
        return Vec::new();
    };
    let older = program("RTSV_SYSTEM_PYTHON").filter(|_| old && program("RTSV_PVBATCH").is_some());
    let file = script("wheel_scene.py");
    let mut reports = Vec::new();
    for python in [Some(python), older].iter().flatten() {
        for kind in kinds {
            let arguments = [&[file.as_str()], *kind].concat();
            let share = share_of_scene(kind);
            let Some((m, report)) = both(python, &arguments, "out.png", share, |_| ()) else {
                continue;
            };
            m.assert_filled(&format!("{kind:?} in {}", python.display()));
            assert!(report.traced_draws >= least, "{kind:?}: {report:?}");
            assert_eq!(report.problems, Vec::<String>::new());
            reports.push(report);
        }
    }
    reports
}

#[test]
fn surfaces_of_todays_vtk_are_traced_without_normals_and_with_colour_maps() {
    scenes(&[&["plain"], &["flat"]], false, 4);
}

#[test]
fn colours_of_cells_are_the_drivers() {
    scenes(&[&["cells"], &["cells", "4"]], true, 4);
}

#[test]
fn translucent_layers_that_vtk_sums_up_are_the_drivers() {
    for report in scenes(&[&["translucent"]], true, 6) {
        assert!(report.flushes.contains_key("translucent sums"), "{report:?}");
        assert_eq!(
            report.passed_reasons.get("translucent surfaces that VTK sums up"),
            None,
            "{report:?}"
        );
    }
}

#[test]
fn surfaces_that_todays_vtk_peels_are_traced_in_one_go() {
    scenes(&[&["peeled"]], false, 6).iter().for_each(assert_peeled);
}

#[test]
fn clipping_planes_of_mappers_cut_where_the_driver_cuts() {
    scenes(&[&["clipped"]], true, 4);
    scenes(&[&["clipped", "4"]], false, 4);
}

#[test]
fn lamps_spots_and_light_kits_are_the_drivers() {
    scenes(&[&["lights"], &["light_kit"]], true, 4);
}

#[test]
fn glyphs_of_todays_vtk_are_the_drivers() {
    scenes(&[&["glyphs"]], true, 4);
    scenes(&[&["glyphs", "4"], &["lit_glyphs"], &["two_sided_glyphs"]], false, 4);
}

#[test]
fn translucent_glyphs_are_the_drivers() {
    scenes(&[&["translucent_glyphs"]], true, 3);
    scenes(&[&["peeled_glyphs"]], false, 3).iter().for_each(assert_peeled);
}

#[test]
fn back_faces_have_a_material_of_their_own() {
    scenes(&[&["both_sides"]], true, 4);
}

#[test]
fn physically_based_materials_are_the_drivers() {
    scenes(&[&["physical"]], true, 4);
    // Debian's VTK has another formula for lamps.
    scenes(&[&["physical_lights"]], false, 4);
}

#[test]
fn colours_of_blocks_are_over_others_and_over_back_faces() {
    scenes(&[&["blocks"]], true, 4);
}

#[test]
fn a_surface_with_a_scripts_own_shader_is_the_drivers() {
    // One of the four surfaces has VTK's original shader.
    for report in scenes(&[&["replaced"]], true, 1) {
        let passed =
            report.passed_reasons.get("a surface of VTK's with a statement that is not known");
        assert!(passed.is_some_and(|n| *n >= 3), "{report:?}");
    }
}

#[test]
fn lines_along_edges_of_cells_are_the_drivers() {
    scenes(&[&["edges"], &["edges", "4"]], false, 4);
}

#[test]
fn surfaces_that_are_moved_back_for_lines_are_the_drivers() {
    for report in
        scenes(&[&["moved_back"], &["moved_back", "4"], &["translucent_moved_back"]], true, 8)
    {
        assert_eq!(
            report.passed_reasons.get("polygon offset of OpenGL's and of VTK's"),
            None,
            "{report:?}"
        );
    }
}

/// All surfaces of scenes with textures are traced in both VTKs.
fn textures(kinds: &[&[&str]], least: u64) {
    for report in scenes(kinds, true, least) {
        let passed: Vec<_> =
            report.passed_reasons.keys().filter(|why| why.contains("picture")).collect();
        assert!(passed.is_empty(), "{report:?}");
    }
}

#[test]
fn textures_on_surfaces_are_the_drivers() {
    textures(&[&["pictures"], &["pictures", "4"], &["pictures_under_lamps"]], 4);
}

#[test]
fn textures_over_colours_have_coordinates_of_their_own() {
    textures(&[&["pictures_over_colors"]], 4);
}

#[test]
fn minified_textures_are_the_drivers() {
    textures(&[&["pictures_smaller"]], 2);
}

#[test]
fn translucent_textures_are_blended_with_other_layers() {
    textures(&[&["translucent_pictures"]], 5);
}

#[test]
fn colours_of_physically_based_materials_come_from_textures() {
    textures(&[&["physical_pictures"]], 4);
}

#[test]
fn slices_of_images_are_textures_on_planes() {
    textures(&[&["images"]], 4);
}

#[test]
fn surfaces_that_are_drawn_again_with_shadow_maps_are_the_drivers_and_named() {
    // The first frame is recognised by its shadow maps when surfaces have already been traced; in
    // the second frame, the driver draws the surfaces.
    for report in scenes(&[&["shadows"], &["shadows", "0", "2"]], false, 4) {
        assert!(report.passed_reasons.contains_key("a shadow map"), "{report:?}");
        let again = report
            .passed_reasons
            .contains_key("surfaces that VTK draws again with its shadow maps");
        assert_eq!(again, report.frames > 1, "{report:?}");
    }
}

#[test]
fn modes_beyond_match_keep_clipping_planes_and_say_what_paths_leave_out() {
    let (Some(python), Some(_)) = (program("RTSV_PYTHON"), program("RTSV_XVFB")) else { return };
    let Some(x) = Xvfb::start() else { return };
    let file = script("wheel_scene.py");
    let picture = |kind: &str, through: Option<&[&str]>| {
        let place = folder();
        let home = [("HOME", place.path().to_str().expect("UTF-8"))];
        let run = Run { x: &x, folder: place.path(), through, environment: &home };
        let (_, report) = run.program(&python, &[file.as_str(), kind]);
        (Picture::read(&place.path().join("out.png")), report)
    };
    let (native, _) = picture("clipped", None);
    for mode in ["rich", "path"] {
        let (ours, report) = picture("clipped", Some(&["--mode", mode, "--set", "samples=4"]));
        let overlap = compare(&native, &ours).overlap;
        assert!(overlap > 0.95 && report.traced_draws >= 4, "{mode}: {overlap}, {report:?}");
    }
    // The halves that are clipped away cast no shadow on those that remain.
    let (shaded, _) = picture("clipped", Some(&["--mode", "rich"]));
    let brightness = |p: &[u8; 3]| p.iter().map(|v| u32::from(*v)).sum::<u32>();
    let both = native.pixels.iter().zip(&shaded.pixels);
    let surface = || both.clone().filter(|(n, _)| brightness(n) > 120);
    let dark = surface().filter(|(n, s)| 4 * brightness(s) < brightness(n)).count();
    assert!(20 * dark < surface().count(), "{dark} of {} pixels", surface().count());
    for (kind, what) in [("edges", "edges of cells"), ("both_sides", "materials of back faces")] {
        let (_, report) = picture(kind, Some(&["--mode", "path"]));
        let said = format!("mode path: {what} are left out");
        assert!(report.problems.contains(&said), "{report:?}");
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
