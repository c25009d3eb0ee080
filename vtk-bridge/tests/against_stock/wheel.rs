//! The same unmodified scripts in the `vtk` wheel from PyPI, alone and started by `python -m
//! rtvtk`.

use crate::peers::skip;
use crate::scripts::{Exception, differences};
use crate::session::{Program, Run, With, output, scripts_in};
use crate::vtk::EMPTY;
use std::path::PathBuf;

/// Images with their own limits, or without limits, and the reason. Those of Debian's VTK also
/// apply here.
const EXCEPTIONS: &[Exception] = &[
    (
        "windows",
        "first",
        None,
        "the stock wheel shows nothing of an actor that two windows share; we show it in both",
    ),
    ("windows", "second", None, "as the first window"),
];

/// All scripts of a folder.
fn names(folder: &str) -> Vec<String> {
    let stems = scripts_in(folder).into_iter();
    stems.filter_map(|p| Some(p.file_stem()?.to_str()?.to_owned())).collect()
}

fn run(with: With, folder: &str, names: &[String], settings: &[(&str, &str)]) -> Option<Run> {
    let chosen =
        |p: &PathBuf| names.iter().any(|n| p.file_stem().is_some_and(|stem| stem == n.as_str()));
    let scripts: Vec<PathBuf> = scripts_in(folder).into_iter().filter(chosen).collect();
    assert_eq!(scripts.len(), names.len(), "every script is there");
    let folder = output(&format!("wheel-{folder}-{with:?}{}", settings.len()).to_lowercase());
    Run::new(Program::Wheel, with, &scripts, folder, settings).map_err(|reason| skip(&reason)).ok()
}

/// Compares all images of all scripts of a folder and returns the runs.
fn same_as_stock(folder: &str) -> Option<[Run; 2]> {
    let scripts = names(folder);
    let (stock, ours) =
        (run(With::Stock, folder, &scripts, &[])?, run(With::Bridge, folder, &scripts, &[])?);
    let exceptions = [EXCEPTIONS, crate::vtk::EXCEPTIONS];
    let untraced = [EMPTY, &[("steady", "after_a_fault")]].concat();
    let of = |script: &String| differences(&stock, &ours, script, &exceptions, &untraced);
    let found: Vec<String> = scripts.iter().flat_map(of).collect();
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
    Some([stock, ours])
}

#[test]
fn unmodified_scripts_look_the_same_in_the_stock_wheel() {
    let Some([stock, ours]) = same_as_stock("vtk") else { return };
    crate::vtk::check_samples(&stock, &ours, &["glyphs", "isosurface", "creases", "edges"]);
    let capture = ours.capture("reasons", "reasons").unwrap();
    assert_eq!(capture.passed("reason"), capture.expected_reasons(), "the reasons are the shim's");
}

/// Classes derived in Python (as in PyVista), observers that a program removes, tiled images, an
/// error of the bridge.
#[test]
fn python_programs_of_other_kinds_look_the_same_and_steady_frames_look_at_no_array() {
    let Some([_, ours]) = same_as_stock("wheel") else { return };
    let turned = ours.path("steady", "turned");
    let looks = std::fs::read_to_string(turned.with_file_name("looks.txt")).unwrap();
    let looks: Vec<u32> = looks.split_whitespace().map(|n| n.parse().unwrap()).collect();
    assert!(
        looks[0] > 0 && looks[1] == 0,
        "arrays looked at in the first frame and in five more: {looks:?}"
    );
    assert!(ours.stderr.contains("internal error, OpenGL draws from now on"), "{}", ours.stderr);
}

#[test]
fn shadows_come_to_the_wheel_by_their_variable() {
    let room = ["room".to_owned()];
    let with = |settings: &[(&str, &str)]| run(With::Bridge, "effects", &room, settings);
    let (Some(plain), Some(shadows)) = (with(&[]), with(&[("RTV_SHADOWS", "1")])) else { return };
    let [plain, shadows] = [plain, shadows].map(|r| r.capture("room", "room").unwrap());
    let by_20 = |a: &[[u8; 3]], b: &[[u8; 3]]| {
        a.iter().zip(b).filter(|(a, b)| a[1] > b[1].saturating_add(20)).count()
    };
    let (darker, brighter) = (by_20(&plain.rgb, &shadows.rgb), by_20(&shadows.rgb, &plain.rgb));
    assert!(darker > 500 && brighter < darker / 20, "{darker} darker, {brighter} brighter");
}

/// Without `RTV_ALWAYS_TRACE`: OpenGL draws what it draws faster, and the report says why.
#[test]
fn small_scenes_and_first_images_are_opengls_own_and_large_meshes_are_traced() {
    let ask = [("RTV_ALWAYS_TRACE", "0")];
    // Contours are traced from the second image on.
    let names = ["many_actors", "volume"].map(str::to_owned);
    let (stock, ours) = (
        run(With::Stock, "vtk", &names, &[("LC_ALL", "C")]),
        run(With::Bridge, "vtk", &names, &ask),
    );
    let (Some(stock), Some(ours)) = (stock, ours) else { return };
    for script in &names {
        for image in stock.images(script).unwrap() {
            let [a, b] = [&stock, &ours].map(|r| r.capture(script, &image).unwrap());
            assert_eq!(b.traced_elements(), 0, "{script}/{image}");
            assert!(a.rgb == b.rgb && a.depth == b.depth, "{script}/{image} is not stock's");
            let reasons = b.passed("reason");
            assert!(!reasons.is_empty(), "{script}/{image}");
            let known = ["the first image", "cheaper in OpenGL", "OpenGL's driver is hardware"];
            let says = |r: &String| known.iter().any(|k| r.starts_with(k));
            assert!(reasons.iter().all(says), "{script}/{image}: {reasons:?}");
        }
    }
    let Some(frames) = run(With::Bridge, "wheel", &["many_frames".to_owned()], &ask) else {
        return;
    };
    let traced = ["first", "last"]
        .map(|image| frames.capture("many_frames", image).unwrap().traced_elements() > 0);
    assert_eq!(traced, [false, true]);
}
