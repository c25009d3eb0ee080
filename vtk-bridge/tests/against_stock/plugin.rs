//! The ParaView plugin, loaded by `PV_PLUGIN_PATH`: it overrides the renderer without
//! `VTK_AUTOLOAD_PATH`, and its options are set as a user sets them.

use crate::capture::{Capture, bright};
use crate::compare::{Limits, faults};
use crate::peers::{pvbatch, scripts, skip};
use crate::session::{Launch, Program, Run, With, interpreter, output, plugin_folder};
use std::sync::OnceLock;

const SCRIPT: &str = "options";

/// The script's images, rendered once.
fn images() -> Option<&'static Run> {
    static RUN: OnceLock<Result<Run, String>> = OnceLock::new();
    let run = RUN.get_or_init(|| {
        pvbatch().ok_or("pvbatch was not found (set RTSV_PVBATCH)")?;
        let folder = output("plugin");
        let report = folder.join("report.json");
        let settings = [
            ("PV_PLUGIN_PATH", plugin_folder()?.display().to_string()),
            ("RTV_REPORT", report.display().to_string()),
        ];
        let settings: Vec<(&str, &str)> = settings.iter().map(|(n, v)| (*n, v.as_str())).collect();
        // `Stock`: no VTK_AUTOLOAD_PATH, only the plugin.
        Run::new(
            Program::ParaView,
            With::Stock,
            &crate::session::scripts_in("plugin"),
            folder,
            &settings,
        )
    });
    run.as_ref().map_err(|reason| skip(reason)).ok()
}

fn image(name: &str) -> Option<Capture> {
    let run = images()?;
    run.images(SCRIPT).unwrap_or_else(|e| panic!("{e}"));
    Some(run.capture(SCRIPT, name).unwrap_or_else(|e| panic!("{name}: {e}\n{}", run.stderr)))
}

#[test]
fn names_are_those_of_ospray_where_there_is_one() {
    let Some(plain) = image("plain") else { return };
    let names: Vec<&str> =
        plain.facts["names"].as_array().expect("names").iter().filter_map(|n| n.as_str()).collect();
    // As paraview.simple names the properties of a view in a ParaView with OSPRay.
    for name in [
        "EnableRayTracing",
        "BackEnd",
        "Shadows",
        "AmbientSamples",
        "SamplesPerPixel",
        "ProgressivePasses",
    ] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    // The panel of the thesis, section 3.2.8.
    for name in ["Threads", "AmbientRadius", "Reflections", "Material", "Robustness", "LensRadius"]
    {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
}

#[test]
fn the_plugin_alone_traces_and_the_image_is_stock() {
    let (Some(plain), Some(off)) = (image("plain"), image("off")) else { return };
    assert!(plain.traced_elements() > 0, "{:?}", plain.report);
    assert_eq!(off.traced_elements(), 0, "EnableRayTracing=0 must leave everything to OpenGL");
    let mut off = off;
    off.facts = plain.facts.clone();
    assert_eq!(faults(&off, &plain, &Limits::STRICT), Vec::<String>::new());
}

#[test]
fn the_panel_switches_every_effect() {
    let Some(plain) = image("plain") else { return };
    let ratio = |name: &str, place: &str| {
        let other = image(name).expect("the run is there");
        bright(other.at(place)) / bright(plain.at(place))
    };
    assert!(ratio("shadows", "shadow") < 0.3 && (ratio("shadows", "lit") - 1.0).abs() < 0.01);
    let (concave, convex) = (ratio("ambient", "concave"), ratio("ambient", "convex"));
    assert!(
        concave < 0.93 * convex,
        "ambient occlusion: where box and floor meet {concave}, on top of the box {convex}"
    );
    let mirror = image("mirror").expect("the run is there");
    // Half of the reflection on the floor in front of the box shows the box, which is red; the rest
    // shows the background, which is blue.
    let redder = |c: &Capture| {
        let [a, b] = [c.at("mirror_of_box"), c.at("lit")];
        (a[0] - a[2]) - (b[0] - b[2])
    };
    assert!(redder(&mirror) > redder(&plain) + 20.0, "{} {}", redder(&mirror), redder(&plain));
    for (name, kind) in
        [("glass", "refraction"), ("metal", "reflection"), ("transparent", "transparency")]
    {
        let other = image(name).expect("the run is there");
        let rays = other.report.clone().unwrap_or_default().to_string();
        assert!(rays.contains(kind), "{name}: no {kind} rays: {rays}");
        assert!(other.rgb != plain.rgb, "{name} changes nothing");
    }
    let lens = image("lens").expect("the run is there");
    let colors = |c: &Capture| c.rgb.iter().collect::<std::collections::BTreeSet<_>>().len();
    assert!(
        colors(&lens) > colors(&plain) + 40,
        "out of focus: {} colours, {} before",
        colors(&lens),
        colors(&plain)
    );
}

#[test]
fn options_go_back_and_views_do_not_share_them() {
    let (Some(plain), Some(back), Some(other)) = (image("plain"), image("back"), image("other"))
    else {
        return;
    };
    let mut back = back;
    back.facts = plain.facts.clone();
    assert_eq!(faults(&plain, &back, &Limits::STRICT), Vec::<String>::new());
    assert_eq!(other.facts["shadows"], 0);
}

#[test]
fn a_plugin_without_its_bridge_says_so_and_harms_nothing() {
    if let Err(reason) =
        interpreter(Program::ParaView, With::Stock).and_then(|_| crate::peers::display().map(drop))
    {
        return skip(&reason);
    }
    // The plugin alone in a folder: what it needs is not in a parent folder.
    let lonely = tempfile::tempdir().unwrap();
    let folder = plugin_folder().expect("built with ParaView's headers");
    std::fs::copy(folder.join("VtkBridge.so"), lonely.path().join("VtkBridge.so")).unwrap();
    let folder = output("plugin-alone");
    std::fs::create_dir_all(&folder).unwrap();
    let line = format!("exec {} \"$@\"", interpreter(Program::ParaView, With::Stock).unwrap());
    let script = [scripts().join("run_all.py"), folder, scripts().join("paraview/views.py")];
    let launch = Launch::new(Program::ParaView, With::Stock, &line).unwrap().args(script);
    let out = launch
        .env("PV_PLUGIN_PATH", lonely.path())
        .output()
        .expect_success("pvbatch with a plugin alone");
    assert!(out.stderr.contains("vtk-bridge install --plugin"), "{}", out.stderr);
}
