//! Tests what the interactive page has of an experimentalist's bench: the frame, arrays and lattice
//! of the flow, vectors, profiles, legends, warnings, sheets, and the way back from what fails.
#![cfg(feature = "serve")]

mod serving;

use datasets::image_io::read_png;
use serde_json::{Value, json};
use serving::{Server, changed};
use std::path::Path;

const SMALL: [&str; 4] = ["--size", "96x48", "--samples", "16"];

/// Linear colours of a PNG, and its size.
fn png(path: &Path, bytes: &[u8]) -> ([u32; 2], Vec<[f32; 4]>) {
    std::fs::write(path, bytes).unwrap();
    let image = read_png(path).unwrap();
    ([image.width, image.height], image.rgba().unwrap())
}

/// What `schlieren render` makes of the scene that the page saves.
fn rendered(s: &Server, folder: &Path, options: &[&str]) -> Vec<[f32; 4]> {
    let (scene, out) = (folder.join("saved.toml"), folder.join("again.png"));
    std::fs::write(&scene, s.get("save/toml").body).unwrap();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_schlieren"))
        .args(["render", "--quiet", "--scene"])
        .arg(&scene)
        .arg("-o")
        .arg(&out)
        .args(options)
        .status()
        .unwrap();
    assert!(status.success());
    read_png(&out).unwrap().rgba().unwrap()
}

fn refusal(s: &Server, patch: &Value) -> String {
    let answer = s.request("POST", "scene", &patch.to_string());
    assert_eq!(answer.status, 422, "{patch}: {}", answer.text());
    answer.json()["error"].as_str().unwrap().to_owned()
}

#[test]
fn a_frame_that_nobody_chose_has_the_flows_shape_and_turns_with_it() {
    // The flow is 0.2 x 0.1 x 0.1 m; a square picture of it is half empty.
    let s = Server::start(&["--samples", "4"]);
    s.finished();
    let state = s.get("state").json();
    assert_eq!(
        (&state["fit"], &state["scene"]["film"]["size"]),
        (&json!(true), &json!([512, 256]))
    );
    let turned = s.change(&json!({"view": {"direction": "x"}, "fit": true}));
    assert_eq!(turned["scene"]["film"]["size"], json!([512, 512]));
    // Turning alone keeps the frame, so that it does not jump while the flow is dragged.
    let dragged = s.change(&json!({"view": {"direction": "z"}}));
    assert_eq!(dragged["scene"]["film"]["size"], json!([512, 512]));

    // A frame that was chosen stays, and the whole flow comes back.
    let zoomed = s.change(&json!({"film": {"field_of_view_m": 0.05, "center_m": [0.03, 0.01]}}));
    assert_eq!(zoomed["fit"], false);
    let shown = s.finished().info;
    assert_eq!(shown["center_m"], json!([0.03, 0.01]));
    assert!((shown["whole_width_m"].as_f64().unwrap() - 0.2).abs() < 1e-9, "{shown}");
    assert_eq!(shown["axes"], json!([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]));
    let whole = s.change(&json!({"fit": true}));
    let film = &whole["scene"]["film"];
    assert_eq!((&film["size"], &film["field_of_view_m"]), (&json!([512, 256]), &Value::Null));

    for wrong in [json!({"fit": 3}), json!({"fit": true, "film": {"size": [64, 64]}})] {
        assert!(refusal(&s, &wrong).contains("`fit`"), "{wrong}");
    }
    let chosen = Server::start(&SMALL);
    chosen.finished();
    let state = chosen.get("state").json();
    assert_eq!((&state["fit"], &state["scene"]["film"]["size"]), (&json!(false), &json!([96, 48])));
}

#[test]
fn the_arrays_of_the_index_are_chosen_on_the_page() {
    let s = Server::start(&SMALL);
    let density = s.finished().rgb;
    // The same air by its temperature at one pressure: 1.2 kg/m3 at 293.15 K.
    s.change(&json!({"flow": {"temperature": "T", "pressure": "101325"}}));
    let state = s.get("state").json();
    assert_eq!(state["scene"]["flow"]["density"], Value::Null, "{state}");
    let by_state = s.finished();
    assert_eq!(by_state.info["error"], Value::Null);
    assert!(changed(&density, &by_state.rgb) < 0.05, "the same flow by another law");

    // Curves replace the arrays, and give back the last ones.
    let knots = json!([[290.0, 0.0], [400.0, 3e-4]]);
    s.change(&json!({"flow": {"multifield": {"fields": {"T": {"knots": knots}}}}}));
    let back = s.change(&json!({"flow": {"multifield": null}}));
    assert_eq!(back["scene"]["flow"]["temperature"], "T");
    assert_eq!(s.finished().rgb, by_state.rgb);
    s.change(&json!({"flow": {"density": "rho"}}));
    assert_eq!(s.finished().rgb, density);

    for (wrong, word) in [
        (json!({"density": "u"}), "there is no array `u`; there are: T, rho"),
        (json!({"density": 3}), "give the name of an array"),
        (json!({"density": null}), "give the name of an array"),
        (json!({"density": "rho", "n_minus_1": "T"}), "density and n_minus_1 are alternatives"),
        (json!({"density": "rho", "multifield": {"fields": {}}}), "alternatives"),
        (json!({"pressure": "101325"}), "flow.pressure has no effect"),
        (json!({"viscosity": "mu"}), "only `multifield`"),
    ] {
        let text = refusal(&s, &json!({ "flow": wrong }));
        assert!(text.contains(word), "{wrong}: {text}");
    }
    assert_eq!(s.finished().rgb, density);
}

#[test]
fn lattice_smoothing_and_outside_are_chosen_on_the_page() {
    let s = Server::start(&SMALL);
    let sharp = s.finished();
    s.change(&json!({"flow": {"smoothing_nodes": 3.0}}));
    let smooth = s.finished();
    assert!(changed(&sharp.rgb, &smooth.rgb) > 0.02, "smoothing weakens the blob");
    s.change(&json!({"flow": {"smoothing_nodes": null, "resample_nodes": 9}}));
    let coarse = s.finished();
    assert_eq!(coarse.info["error"], Value::Null);
    assert!(changed(&sharp.rgb, &coarse.rgb) > 0.02, "nine nodes are too few for the blob");
    s.change(&json!({"flow": {"resample_nodes": null}}));
    assert_eq!(s.finished().rgb, sharp.rgb);

    // A choice without effect says so by its name.
    s.change(&json!({"flow": {"outside": "solid"}}));
    let warnings = s.finished().info["warnings"].to_string();
    assert!(warnings.contains("flow.outside has no effect"), "{warnings}");
    s.change(&json!({"flow": {"outside": "auto"}}));

    for (wrong, word) in [
        (json!({"resample_nodes": 100_000}), "4 to 320"),
        (json!({"resample_nodes": -1}), "not a flow"),
        (json!({"smoothing_nodes": -2.0}), "flow.smoothing_nodes"),
        (json!({"outside": "water"}), "not a flow"),
        (json!({"average_jumps": "yes"}), "not a flow"),
    ] {
        let text = refusal(&s, &json!({ "flow": wrong }));
        assert!(text.contains(word), "{wrong}: {text}");
    }
    assert_eq!(s.finished().rgb, sharp.rgb);
}

#[test]
fn cells_what_is_between_points_and_hidden_cells_are_chosen_on_the_page() {
    let s = Server::start(&["--size", "48x24", "--samples", "4"]);
    let in_lattice = s.finished().rgb;
    // The cells of the same data give nearly the same picture.
    let state = s.change(&json!({"flow": {"on_cells": true}}));
    assert_eq!(state["effective"]["flow"]["on_cells"], true, "{state}");
    let cubic = s.finished();
    assert_eq!(cubic.info["error"], Value::Null);
    assert!(changed(&in_lattice, &cubic.rgb) < 0.1, "the same flow on its cells");
    s.change(&json!({"flow": {"reconstruction": "linear", "hidden": "gas"}}));
    let linear = s.finished();
    assert_eq!(linear.info["error"], Value::Null);
    assert!(linear.rgb != cubic.rgb, "linear cells bend light at their faces");
    // What counts in nodes is refused, by its name.
    let text = refusal(&s, &json!({"flow": {"resample_nodes": 9}}));
    assert!(text.contains("flow.on_cells (--on-cells) traces light without one"), "{text}");
    let lattice = json!({"on_cells": false, "reconstruction": "cubic", "hidden": "solid"});
    s.change(&json!({ "flow": lattice }));
    assert_eq!(s.finished().rgb, in_lattice);
    for wrong in [json!({"hidden": "stone"}), json!({"on_cells": 1}), json!({"reconstruction": 3})]
    {
        let text = refusal(&s, &json!({ "flow": wrong }));
        assert!(text.contains("not a flow"), "{wrong}: {text}");
    }
}

#[test]
fn what_cannot_be_shown_goes_back_to_what_was() {
    let s = Server::start(&SMALL);
    let first = s.finished().rgb;
    // A density of 3e5 kg/m3 is no gas: that is only seen when the flow is read.
    s.change(&json!({"flow": {"n_minus_1": "T"}}));
    let failed = s.finished().info;
    assert!(failed["error"].as_str().is_some_and(|e| e.contains("n - 1")), "{failed}");
    let answer = s.request("POST", "back", "");
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert_eq!(answer.json()["scene"]["flow"]["density"], "rho");
    assert_eq!(s.finished().rgb, first);
    let again = s.request("POST", "back", "");
    assert!(again.status == 422 && again.text().contains("last one"), "{}", again.text());
}

#[test]
fn vectors_are_drawn_as_render_draws_them() {
    let s = Server::start(&["--size", "192x96", "--samples", "16", "--technique", "bos"]);
    let folder = tempfile::tempdir().unwrap();
    let bare = s.finished();
    for style in ["arrows", "lic"] {
        assert_eq!(s.change(&json!({ "overlay": style }))["overlay"], style);
        let shown = s.finished();
        assert_eq!(shown.info["error"], Value::Null);
        assert!(changed(&bare.rgb, &shown.rgb) > 0.005, "{style} changes the picture");
        let answer = s.get("save/png");
        assert_eq!(answer.status, 200, "{}", answer.text());
        let (_, saved) = png(&folder.path().join("saved.png"), &answer.body);
        assert_eq!(saved, rendered(&s, folder.path(), &["--overlay", style]), "{style}");
    }
    // Each technique keeps its own; those without light refuse it.
    assert_eq!(s.change(&json!({"technique": {"kind": "volume"}}))["overlay"], Value::Null);
    assert!(refusal(&s, &json!({"overlay": "lic"})).contains("technique `volume` traces none"));
    assert_eq!(s.change(&json!({"technique": {"kind": "bos"}}))["overlay"], "lic");
    for wrong in [json!("dots"), json!(3), json!(["lic"])] {
        assert!(refusal(&s, &json!({ "overlay": wrong })).contains("overlay"), "{wrong}");
    }
    s.change(&json!({ "overlay": null }));
    assert_eq!(s.finished().rgb, bare.rgb);
}

#[test]
fn a_profile_has_the_deflections_along_its_line() {
    let s = Server::start(&SMALL);
    s.finished();
    let ask = |from: [f64; 2], to: [f64; 2]| {
        s.request("POST", "profile", &json!({"from": from, "to": to}).to_string())
    };
    let profile = ask([0.0, 0.4], [1.0, 0.4]).json();
    assert!((profile["length_m"].as_f64().unwrap() - 0.2).abs() < 1e-9, "{profile}");
    let right: Vec<f64> = profile["deflection_rad"]
        .as_array()
        .unwrap()
        .iter()
        .map(|d| d[0].as_f64().expect("light everywhere"))
        .collect();
    // Light is bent away from the light blob at 0.03 m, which is 0.65 of the way.
    let middle = (right.len() - 1) * 65 / 100;
    let size = right.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(size > 1e-6 && right[middle].abs() < 0.2 * size, "{} of {size}", right[middle]);
    assert!(right[middle - 20] * right[middle + 20] < 0.0, "opposite on both sides");
    // The same as at one point.
    let traced = s.request("POST", "trace", &json!({"at": [0.5, 0.4]}).to_string()).json();
    for axis in [0, 1] {
        let [one, line] = [&traced["deflection_rad"], &profile["deflection_rad"][128]]
            .map(|d| d[axis].as_f64().unwrap());
        // The same number of single precision, written with fewer digits.
        assert!((one - line).abs() <= 1e-6 * one.abs(), "{one} {line}");
    }

    for (from, to, status) in [
        ([0.0, 0.0], [2.0, 0.0], 422),
        ([0.5, 0.5], [0.5, 0.5], 422),
        ([-0.1, 0.5], [0.5, 0.5], 422),
    ] {
        assert_eq!(ask(from, to).status, status, "{from:?} {to:?}");
    }
    assert_eq!(s.request("POST", "profile", "{\"from\": 3}").status, 400);
}

#[test]
fn frames_have_the_legend_of_their_colours() {
    let s = Server::start(&SMALL);
    let shown = s.finished();
    let side = shown.info["legend_size"][0].as_u64().unwrap() as usize;
    let at = |column: usize| shown.legend[3 * (side / 2 * side + column)];
    assert!(at(1) < at(side / 2) && at(side / 2) < at(side - 2), "a knife that opens to the right");
    // Undisturbed light has the colour of no deflection, which is beside the middle.
    assert!(shown.rgb[0].abs_diff(at(side / 2)) < 6, "{} {}", shown.rgb[0], at(side / 2));
    s.change(&json!({"technique": {"kind": "shadowgraph"}}));
    assert_eq!(s.finished().info["legend_size"], json!([0, 0]));
    // Several wavelengths add up: colours of deflections, and of the paths of fringes.
    s.change(&json!({"light": {"wavelengths_nm": [450.0, 550.0, 650.0]},
        "technique": {"kind": "schlieren"}}));
    let shown = s.finished();
    assert_eq!(shown.info["legend_size"], json!([side, side]));
    let middle = &shown.legend[3 * (side / 2 * side + side / 2)..][..3];
    assert!(middle.iter().all(|c| c.abs_diff(middle[0]) < 6), "{middle:?}: white light is grey");
    s.change(&json!({"technique": {"kind": "interferogram"}}));
    let shown = s.finished();
    let longest_m = shown.info["legend_path_m"].as_f64().unwrap();
    assert!((longest_m - 2.6e-6).abs() < 1e-12, "{longest_m}");
    assert!(shown.legend[..3].iter().all(|c| *c > 240), "{:?}", &shown.legend[..3]);
    assert_eq!(shown.info["legend_half_rad"], Value::Null);
}

#[test]
fn a_profile_has_the_phase_of_fringes_and_the_movement_of_dots() {
    let s = Server::start(&SMALL);
    let profile = || {
        s.finished();
        let line = json!({"from": [0.0, 0.4], "to": [1.0, 0.4]}).to_string();
        s.request("POST", "profile", &line).json()
    };
    let length = |p: &Value, key: &str| p[key].as_array().unwrap().len();
    let knife = profile();
    let points = length(&knife, "deflection_rad");
    assert_eq!([length(&knife, "waves"), length(&knife, "dots_m")], [0, 0]);

    s.change(&json!({"technique": {"kind": "interferogram"}}));
    let fringes = profile();
    assert_eq!([length(&fringes, "waves"), length(&fringes, "dots_m")], [points, 0]);
    // The path's slope is the deflection, so its sum along the line is the path's difference.
    let wave = |i: usize| fringes["waves"][i].as_f64().unwrap();
    let nm = s.get("state").json()["effective"]["light"]["wavelengths_nm"][0].as_f64().unwrap();
    let step_m = fringes["length_m"].as_f64().unwrap() / (points - 1) as f64;
    let (from, to) = (20, 160);
    let right = |p: &Value, i: usize| p["deflection_rad"][i][0].as_f64().unwrap();
    let sum = (from..to).map(|i| right(&knife, i) * step_m).sum::<f64>();
    let path_m = (wave(to) - wave(from)) * nm * 1e-9;
    assert!((path_m - sum).abs() < 0.05 * sum.abs(), "{path_m:e} {sum:e}");

    s.change(&json!({"technique": {"kind": "bos"}, "film": {"focus_m": 0.5}}));
    let dots = profile();
    assert_eq!([length(&dots, "waves"), length(&dots, "dots_m")], [0, points]);
    // A dot moves against the ray, by its angle times the distance: half a metre.
    let most = (0..points).max_by(|a, b| right(&dots, *a).total_cmp(&right(&dots, *b))).unwrap();
    let moved = dots["dots_m"][most][0].as_f64().unwrap();
    let bent = right(&dots, most);
    assert!((moved + 0.5 * bent).abs() < 0.15 * moved.abs(), "{moved:e} {bent:e}");
}

#[test]
fn the_page_warns_of_what_the_command_line_warns_of() {
    let s = Server::start(&SMALL);
    s.change(&json!({"march": {"tolerance_rad": 1e-13}}));
    let shown = s.finished().info;
    let warnings = shown["warnings"].to_string();
    assert!(warnings.contains("above the tolerance of 1.0e-13 rad"), "{shown}");
    s.change(&json!({"march": {"tolerance_rad": 1e-4}}));
    assert_eq!(s.finished().info["warnings"], json!([]));
}

#[test]
fn the_sheet_shows_the_present_view_while_the_page_answers() {
    let s = Server::start(&SMALL);
    s.change(&json!({"view": {"direction": "30,10"}}));
    let folder = tempfile::tempdir().unwrap();
    let answer = std::thread::scope(|scope| {
        let sheet = scope.spawn(|| s.get("save/sheet"));
        for _ in 0..5 {
            assert!(s.is_healthy());
        }
        sheet.join().unwrap()
    });
    assert_eq!(answer.status, 200, "{}", answer.text());
    let (size, pixels) = png(&folder.path().join("sheet.png"), &answer.body);
    assert!(size[0] > 4 * 320 && size[1] > 2 * 160, "{size:?}");
    // The program makes the same sheet of the same scene and panels.
    let (scene, out) = (folder.path().join("saved.toml"), folder.path().join("again.png"));
    std::fs::write(&scene, s.get("save/toml").body).unwrap();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_schlieren"))
        .args(["sheet", "--quiet", "--size", "320x160", "--scene"])
        .arg(&scene)
        .arg("-o")
        .arg(&out)
        .status()
        .unwrap();
    assert!(status.success());
    assert_eq!(read_png(&out).unwrap().rgba().unwrap(), pixels);

    s.change(&json!({"light": {"wavelengths_nm": [500.0, 600.0]}}));
    let refused = s.get("save/sheet");
    assert!(
        refused.status == 422 && refused.text().contains("one wavelength"),
        "{}",
        refused.text()
    );
    assert_eq!(s.finished().info["error"], Value::Null);
}
