//! The changes of the modes beyond `match` to an image, in programs whose correct images are known.

mod common;

use common::{Picture, Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::path::Path;

const SIZE: usize = 128;

/// A case of `hard_cases.py` with options of `gluray run`; `None` without the peers. Rows start at
/// the bottom.
fn draw(case: &str, through: Option<&[&str]>) -> Option<(Picture, Report)> {
    let python = peer("RTSV_SYSTEM_PYTHON")?;
    let x = Xvfb::start()?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/hard_cases.py");
    let place = folder();
    let run = Run { x: &x, folder: place.path(), through, environment: &[] };
    let (output, report) = run.program(&python, &[script.to_str().expect("UTF-8"), case, "out"]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{case}: {text}");
    let bytes = std::fs::read(place.path().join("out")).expect("a picture");
    let pixels =
        bytes[8..8 + 4 * SIZE * SIZE].chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
    Some((Picture { width: SIZE, height: SIZE, pixels }, report))
}

/// Mean colour of a rectangle: x, y (from the bottom), width, height.
fn mean(p: &Picture, [x, y, w, h]: [usize; 4]) -> [f64; 3] {
    let n = (w * h) as f64;
    std::array::from_fn(|k| {
        let rows = (y..y + h).flat_map(|j| (x..x + w).map(move |i| (i, j)));
        rows.map(|(i, j)| f64::from(p.pixels[j * SIZE + i][k])).sum::<f64>() / n
    })
}

/// Excess of red over blue in a part.
fn redness(p: &Picture, part: [usize; 4]) -> f64 {
    let [r, _, b] = mean(p, part);
    r - b
}

/// The floor in front of the box, and far to the left of it; the floor to the right of the box,
/// where its shadow falls.
const FRONT: [usize; 4] = [58, 37, 12, 9];
const AWAY: [usize; 4] = [8, 8, 10, 6];
const SHADOW: [usize; 4] = [82, 51, 8, 4];

fn rays(r: &Report, kind: &str) -> u64 {
    r.rays.get(kind).copied().unwrap_or(0)
}

#[test]
fn path_mode_has_shadows_and_light_from_wall_to_wall_and_is_deterministic() {
    let options = ["--mode", "path", "--set", "samples=24"];
    let Some((picture, report)) = draw("box_on_floor", Some(&options)) else { return };
    let (again, _) = draw("box_on_floor", Some(&options)).expect("it ran before");
    assert!(picture.pixels == again.pixels, "equal runs give equal pictures");
    let (plain, _) = draw("box_on_floor", Some(&["--mode", "phong"])).expect("it ran before");
    assert!(
        rays(&report, "path") > 10_000 && rays(&report, "shadow") > 10_000,
        "{:?}",
        report.rays
    );
    assert!(mean(&picture, SHADOW)[1] < mean(&plain, SHADOW)[1] - 40.0, "a shadow");
    let near = redness(&picture, FRONT);
    assert!(near > redness(&plain, FRONT) + 4.0, "the box colours the floor before it: {near}");
    assert!(redness(&picture, AWAY) < near / 2.0, "but not the floor far from it");
    assert_eq!(report.problems, Vec::<String>::new());
}

#[test]
fn rich_is_lit_where_the_model_view_turns_the_view_over() {
    /// The floor to the left of the box, in a parallel view.
    const FLOOR: [usize; 4] = [20, 44, 10, 4];
    let rich = ["--mode", "rich", "--set", "effects.ambient_occlusion_samples=32"];
    let Some((before, _)) = draw("box_on_floor_parallel", Some(&rich)) else { return };
    let (behind, _) = draw("viewed_from_behind", Some(&rich)).expect("it ran before");
    let (plain, _) = draw("viewed_from_behind", Some(&["--mode", "phong"])).expect("it ran before");
    for part in [FRONT, FLOOR, SHADOW] {
        let [before, behind] = [&before, &behind].map(|p| mean(p, part)[1]);
        // The rays of ambient occlusion are mirrored, so they are others.
        assert!((before - behind).abs() < 6.0, "{part:?}: {behind} from behind, {before} before");
    }
    let (open, unlit) = (mean(&behind, FLOOR)[1], mean(&plain, FLOOR)[1]);
    assert!(open > 0.8 * unlit, "{open} of {unlit} far from the box");
}

#[test]
fn phong_takes_normals_of_any_length_as_the_driver_does() {
    for case in ["normals_of_length_two", "normals_of_half_length", "normals_under_a_scale"] {
        let Some((native, _)) = draw(case, None) else { return };
        let (phong, report) = draw(case, Some(&["--mode", "phong"])).expect("it ran before");
        assert!(report.traced_draws > 0, "{case}");
        // The dome's top, its sides, and its darkest part.
        for part in [[60, 60, 8, 8], [80, 60, 6, 6], [44, 44, 6, 6]] {
            let [a, b] = [&native, &phong].map(|p| mean(p, part)[1]);
            assert!((a - b).abs() < 2.0, "{case} {part:?}: {b} instead of {a}");
        }
    }
}

#[test]
fn fog_takes_the_same_share_of_path_traced_colours_as_of_others() {
    const FOG: [f64; 3] = [51.0, 102.0, 255.0];
    let path = ["--mode", "path", "--set", "samples=24"];
    let Some((picture, report)) = draw("box_in_fog", Some(&path)) else { return };
    assert_eq!(report.problems, Vec::<String>::new());
    let others = [
        ("box_on_floor", &path[..]),
        ("box_on_floor", &["--mode", "phong"]),
        ("box_in_fog", &["--mode", "phong"]),
    ];
    let [clear, plain, fogged] =
        others.map(|(case, options)| draw(case, Some(options)).expect("it ran before").0);
    for part in [FRONT, AWAY, SHADOW] {
        let (a, b) = (mean(&plain, part)[2], mean(&fogged, part)[2]);
        let share = (b - a) / (FOG[2] - a);
        assert!(share > 0.1, "there is fog: {share}");
        let (with, without) = (mean(&picture, part), mean(&clear, part));
        for k in 0..3 {
            let expected = without[k] * (1.0 - share) + FOG[k] * share;
            assert!(
                (with[k] - expected).abs() < 4.0,
                "{part:?}: {with:?} of {without:?} by {share}"
            );
        }
    }
}

#[test]
fn mirrors_are_seen_and_cost_rays_only_where_they_are_asked_for() {
    let Some((plain, report)) = draw("box_on_floor", Some(&["--mode", "rich"])) else { return };
    assert_eq!(rays(&report, "reflection"), 0);
    let options = ["--mode", "rich", "--set", "material.mirror=0.6"];
    let (mirrored, report) = draw("box_on_floor", Some(&options)).expect("it ran before");
    assert!(rays(&report, "reflection") > 1000, "{:?}", report.rays);
    // The box is 24 pixels above: its image appears in the floor below its foot.
    let (before, after) = (redness(&plain, FRONT), redness(&mirrored, FRONT));
    assert!(after > before + 25.0, "the box in the floor: {before} and {after}");
    let dull = ["--mode", "rich", "--set", "material.mirror=0.6", "--set", "material.specular=0"];
    let (picture, report) = draw("box_on_floor", Some(&dull)).expect("it ran before");
    assert_eq!(rays(&report, "reflection"), 0, "no rays for a surface that reflects nothing");
    assert!(picture.pixels == plain.pixels);
    let off =
        ["--mode", "rich", "--set", "material.mirror=0.6", "--set", "effects.reflections=false"];
    let (picture, report) = draw("box_on_floor", Some(&off)).expect("it ran before");
    assert_eq!(rays(&report, "reflection"), 0);
    assert!(picture.pixels == plain.pixels);
}

#[test]
fn glass_bends_light_in_rich_and_in_path() {
    for mode in ["rich", "path"] {
        let options =
            ["--mode", mode, "--set", "material.surface=glass", "--set", "lights.sky=0.6"];
        let Some((picture, report)) = draw("box_on_floor", Some(&options)) else { return };
        let kind = if mode == "path" { "path" } else { "refraction" };
        assert!(rays(&report, kind) > 1000, "{mode}: {:?}", report.rays);
        // White light through clear glass: nothing is red any more.
        assert!(redness(&picture, [56, 50, 16, 10]).abs() < 30.0, "{mode}");
    }
}

#[test]
fn translucent_surfaces_are_sorted_by_rays() {
    let center = [50, 50, 28, 28];
    let Some((native, _)) = draw("sheets_blended_in_the_wrong_order", None) else { return };
    assert!(mean(&native, center)[1] < 60.0, "OpenGL loses the far sheet behind the near one");
    let (rich, report) =
        draw("sheets_blended_in_the_wrong_order", Some(&["--mode", "rich"])).expect("it ran");
    // Half red over half green over (0.1, 0.1, 0.2).
    let [r, g, b] = mean(&rich, center);
    let expected = [0.5 + 0.25 * 0.1, 0.25 + 0.25 * 0.1, 0.25 * 0.2].map(|v| v * 255.0);
    assert!(
        (r - expected[0]).abs() < 3.0
            && (g - expected[1]).abs() < 3.0
            && (b - expected[2]).abs() < 3.0
    );
    assert!(rays(&report, "transparency") > 1000 && report.traced_draws == 2, "{report:?}");
    let (matched, report) =
        draw("sheets_blended_in_the_wrong_order", Some(&["--mode", "match"])).expect("it ran");
    assert!(
        matched.pixels == native.pixels && report.traced_draws == 0,
        "match is the driver's picture"
    );
}

/// Number of pixels with a channel off by more than 8.
fn off(a: &Picture, b: &Picture) -> usize {
    let far = |(p, q): (&[u8; 3], &[u8; 3])| (0..3).any(|k| p[k].abs_diff(q[k]) > 8);
    a.pixels.iter().zip(&b.pixels).filter(|(p, q)| far((p, q))).count()
}

#[test]
fn silhouettes_have_the_samples_of_the_window_in_all_modes() {
    const PLAIN: [&str; 4] =
        ["--set", "effects.shadows=false", "--set", "effects.ambient_occlusion_samples=0"];
    let Some((native, _)) = draw("samples_of_silhouettes", None) else { return };
    // Number of pixels that can be wrong: those that differ from the next pixel in the row or
    // column.
    let unlike = |i: usize| {
        [1, native.width]
            .iter()
            .any(|far| native.pixels.get(i + far).is_some_and(|p| *p != native.pixels[i]))
    };
    let mixed = (0..native.pixels.len()).filter(|i| unlike(*i)).count();
    assert!(mixed > 300, "{mixed} pixels on silhouettes");
    for (mode, more) in [
        ("match", ""),
        ("phong", ""),
        ("rich", ""),
        ("rich", "material.mirror=0.01"),
        ("enhance", "samples=3"),
    ] {
        let mut options = vec!["--mode", mode];
        options.extend(if matches!(mode, "match" | "phong") { &[][..] } else { &PLAIN });
        options.extend(if more.is_empty() { vec![] } else { vec!["--set", more] });
        let (ours, report) = draw("samples_of_silhouettes", Some(&options)).expect("it ran before");
        let different = off(&native, &ours);
        println!("{mode} {more}: {different} of {mixed}");
        assert!(different * 50 <= mixed, "{mode} {more}: {different} of {mixed} pixels");
        assert!(
            report.traced_draws == 14 && report.problems.is_empty(),
            "{mode} {more}: {report:?}"
        );
    }
    // With more rays than samples, silhouettes are smooth without multisampling.
    let options = ["--mode", "rich", PLAIN[0], PLAIN[1], PLAIN[2], PLAIN[3], "--set", "samples=64"];
    let (ours, report) = draw("samples_of_silhouettes", Some(&options)).expect("it ran before");
    let total = |p: &Picture| p.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    let ratio = total(&ours) / total(&native);
    println!("rich samples=64: {ratio} of the light, {} of {mixed} pixels", off(&native, &ours));
    assert!(
        (ratio - 1.0).abs() < 0.005 && report.problems.is_empty(),
        "{ratio}, {:?}",
        report.problems
    );
    assert!(off(&native, &ours) * 4 > mixed, "sixty-four rays see more than four samples");
}

#[test]
fn a_lens_blurs_what_is_out_of_focus_and_is_refused_by_name_without_perspective() {
    let options = |aperture| {
        ["--mode", "rich", "--set", "samples=16", "--set", aperture, "--set", "effects.focus=1"]
    };
    let Some((sharp, _)) = draw("box_on_floor", Some(&options("effects.aperture_radius=0"))) else {
        return;
    };
    let (blurred, report) =
        draw("box_on_floor", Some(&options("effects.aperture_radius=0.05"))).expect("it ran");
    let steepest = |p: &Picture| {
        // Along a row through the box.
        (1..SIZE)
            .map(|x| {
                let at = |x: usize| f64::from(p.pixels[56 * SIZE + x][1]);
                (at(x) - at(x - 1)).abs()
            })
            .fold(0.0, f64::max)
    };
    let (a, b) = (steepest(&sharp), steepest(&blurred));
    assert!(b < 0.75 * a, "edges of {a} and {b} levels");
    assert_eq!(report.problems, Vec::<String>::new());
    for mode in ["rich", "path"] {
        let lens = ["--mode", mode, "--set", "effects.aperture_radius=0.02"];
        let (_, report) = draw("box_on_floor_parallel", Some(&lens)).expect("it ran before");
        let told = |p: &String| p.contains("effects.aperture_radius") && p.contains("parallel");
        assert!(report.problems.iter().any(told), "{mode}: {:?}", report.problems);
    }
}

#[test]
fn a_setting_that_changes_nothing_in_the_mode_is_reported_by_name() {
    let options = ["--mode", "match", "--set", "material.mirror=0.5"];
    let Some((_, report)) = draw("plain", Some(&options)) else { return };
    let told =
        report.problems.iter().any(|p| p.contains("`material.mirror`") && p.contains("rich, path"));
    assert!(told, "{:?}", report.problems);
}

#[test]
fn enhance_darkens_corners_of_any_shader_that_is_a_matrix() {
    let Some((native, _)) = draw("shader_of_ones_own", None) else { return };
    let options = ["--mode", "enhance", "--set", "effects.ambient_occlusion_samples=32"];
    let (picture, report) = draw("shader_of_ones_own", Some(&options)).expect("it ran before");
    assert_eq!((report.traced_draws, report.passed_draws), (1, 0), "{report:?}");
    let factor = |part| mean(&picture, part)[1] / mean(&native, part)[1];
    // In the corner of the three walls, and in the middle of the back wall, far from the pillar.
    let (corner, open) = (factor([41, 41, 4, 4]), factor([50, 74, 8, 8]));
    assert!(corner < 0.8 * open && open > 0.5, "factors {corner} and {open}");
    assert!(
        picture.pixels.iter().zip(&native.pixels).all(|(a, b)| (0..3).all(|k| a[k] <= b[k])),
        "only darker"
    );
    assert!(native.pixels[0] == picture.pixels[0], "the background stays");
    let (matched, report) =
        draw("shader_of_ones_own", Some(&["--mode", "match"])).expect("it ran before");
    assert!(matched.pixels == native.pixels && report.traced_draws == 0);
}

#[test]
fn a_shader_that_bends_positions_is_the_drivers_and_named() {
    let Some((native, _)) = draw("shader_that_bends", None) else { return };
    let (picture, report) =
        draw("shader_that_bends", Some(&["--mode", "enhance"])).expect("it ran before");
    assert!(picture.pixels == native.pixels);
    let reasons: Vec<&String> = report.passed_reasons.keys().collect();
    assert_eq!(reasons, ["a vertex shader that is no matrix times a position"]);
}

#[test]
fn a_fault_of_ours_leaves_the_program_the_drivers_image_and_is_logged() {
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/hard_cases.py");
    let place = folder();
    let picture = |through, environment: &[(&str, &str)]| {
        let run = Run { x: &x, folder: place.path(), through, environment };
        let (output, report) = run.faulty_program(
            &python,
            &[script.to_str().expect("UTF-8"), "lists_over_several_frames", "out"],
        );
        assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
        (std::fs::read(place.path().join("out")).expect("a picture"), report)
    };
    let (native, _) = picture(None, &[]);
    let (ours, report) = picture(Some(&[]), &[("GLURAY_INJECT_FAULT", "flush")]);
    assert_eq!(report.faults.len(), 1, "{:?}", report.faults);
    assert!(report.faults[0].contains("GLURAY_INJECT_FAULT"), "{:?}", report.faults);
    assert!(
        native == ours,
        "lists compiled before the fault, and the colour that was set before it, are the driver's \
         now"
    );
}

#[test]
fn frames_are_shown_one_late_where_that_is_asked_for_and_read_as_they_are() {
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/frames_shown.py");
    let shown = |through: Option<&[&str]>| {
        let place = folder();
        let run = Run { x: &x, folder: place.path(), through, environment: &[] };
        let (output, report) = run.program(&python, &[script.to_str().expect("UTF-8"), "out"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(place.path().join("out")).expect("what was shown");
        (serde_json::from_str::<serde_json::Value>(&text).expect("JSON"), report)
    };
    let at_once = serde_json::json!({ "shown": [0, 1, 2, 3, 4, 5, 6, 7], "read": 8 });
    assert_eq!(shown(None).0, at_once, "the driver");
    assert_eq!(shown(Some(&["--mode", "match"])).0, at_once, "in time");
    let (late, report) = shown(Some(&["--mode", "match", "--set", "asynchronous=true"]));
    // No frame precedes the first one, so it is waited for.
    assert_eq!(late, serde_json::json!({ "shown": [0, 0, 1, 2, 3, 4, 5, 6], "read": 8 }));
    assert_eq!(report.traced_draws, 9);
}
