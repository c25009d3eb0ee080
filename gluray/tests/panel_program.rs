//! The panel with a real OpenGL program: glxgears runs under Xvfb, tracing is switched off and on,
//! and the scene is exported.
#![cfg(feature = "panel")]

mod common;
mod panel_common;

use common::{Xvfb, folder, peer};
use gluray::report::Report;
use panel_common::{PROGRAM, Panel};
use serde_json::{Value, json};
use std::process::{Command, Stdio};

fn newest(list: &[Value]) -> Option<&Value> {
    list.first()?["recent"].as_array()?.last()
}

#[test]
fn a_real_program_is_switched_off_and_on_and_gives_its_scene() {
    let Some(gears) = peer("RTSV_GLXGEARS") else { return };
    let Some(x) = Xvfb::start() else { return };
    let p = Panel::start();
    let place = folder();
    let report = place.path().join("report.json");
    let mut run = Command::new(PROGRAM)
        .args(["run", "--report"])
        .arg(&report)
        .arg("--")
        .arg(&gears)
        .env("DISPLAY", &x.display)
        .env("LIBGL_ALWAYS_SOFTWARE", "1")
        .env("XDG_RUNTIME_DIR", p.runtime.path())
        .env("XDG_STATE_HOME", place.path())
        .stdout(Stdio::null())
        .spawn()
        .expect("gluray runs");
    let change = |set: Value, reset: Value| {
        let answer =
            p.ask("POST", "change", &json!({"id": 1, "set": set, "reset": reset}).to_string());
        assert_eq!(answer.status, 200, "{answer:?}");
    };

    // The program appears automatically, with its objects and its cost.
    let list =
        p.until("glxgears", |list| newest(list).is_some_and(|f| f["traced"].as_u64() > Some(0)));
    assert_eq!(list[0]["program"], "glxgears");
    assert!(
        list[0]["objects"].as_array().unwrap().iter().any(|o| o["triangles"].as_u64() > Some(50)),
        "{list:?}"
    );
    assert!(newest(&list).unwrap()["rays"]["primary"].as_u64() > Some(10_000));

    // Switch tracing off and on while it runs.
    change(json!({"enabled": false}), json!([]));
    p.until("off", |list| {
        newest(list)
            .is_some_and(|f| f["traced"] == 0 && f["reasons"]["tracing is off"].as_u64() > Some(0))
    });
    change(json!({}), json!(["enabled"]));
    p.until("on again", |list| {
        newest(list).is_some_and(|f| f["traced"].as_u64() > Some(0) && f["passed"] == 0)
    });

    // The exported scene: three gears about 10 units wide, 40 units away.
    assert_eq!(p.ask("POST", "export", "{\"id\":1}").status, 200);
    p.until("exported", |list| !list[0]["exported"].is_null());
    let vtp = place.path().join("gears.vtp");
    let done = Command::new(PROGRAM)
        .args(["export", "-q", "-o"])
        .arg(&vtp)
        .env("XDG_STATE_HOME", place.path())
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    let (mesh, _) =
        datasets::read::open(&vtp).unwrap().dataset().unwrap().to_trimesh(None).unwrap();
    let bounds = mesh.bounds();
    let size = (bounds.max - bounds.min).max_element();
    assert!(
        mesh.num_triangles() > 500 && (8.0..40.0).contains(&size),
        "{} triangles, {size} units",
        mesh.num_triangles()
    );

    // When the program ends, the run ends with a report and a timeline, and the panel notices.
    let pid = list[0]["process"].as_u64().unwrap().to_string();
    assert!(Command::new("kill").arg(&pid).status().unwrap().success());
    run.wait().unwrap();
    p.until("ended", |list| list[0]["running"] == false);
    let r: Report = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert!(
        r.traced_draws > 0 && r.passed_reasons["tracing is off"] > 0 && r.faults.is_empty(),
        "{r:?}"
    );
    for phase in ["capture", "trace", "present", "fast build"] {
        assert!(r.timeline.iter().any(|s| s.phase == phase && s.ms >= 0.0), "no span of {phase}");
    }
}
