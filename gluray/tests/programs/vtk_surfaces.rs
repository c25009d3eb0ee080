//! Surfaces of VTK's of all kinds, each scene of `wheel_scene.py`, natively and through gluray.

use super::common::metrics::compare;
use super::common::{Picture, Run, Xvfb, folder};
use super::{ALL, Share, assert_peeled, both, program, script, share};
use gluray::report::Report;

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
