//! Injects a fault of the library into every function that programs can call. The program must get
//! the driver's image and errors.

mod common;

use common::{Run, Xvfb, folder, peer};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// What a program saw: colours in hexadecimal digits.
#[derive(Deserialize)]
struct Seen {
    #[serde(default)]
    first: String,
    #[serde(default)]
    next: String,
    #[serde(default)]
    errors: Vec<u32>,
    died: Option<String>,
}

const HOOKS: &str = include_str!("programs/hooks.txt");
/// Functions that gluray does not record: noticed with nothing pending, drawn or flushed, and
/// looked up.
const OTHERS: [&str; 4] = ["glRotatef", "glTexImage2D", "glScissor", "glReadPixels"];
/// Later calls: inside primitives, inside lists, and when the recorded frame is ready to be traced.
const LATER: [&str; 13] = [
    "glVertex3f:2",
    "glVertex3f:77",
    "glVertex3f:130",
    "glNormal3f:66",
    "glColor4f:64",
    "glBegin:2",
    "glBegin:6",
    "glEnd:2",
    "glEnd:6",
    "glCallList:2",
    "glEndList:2",
    "glEndList:3",
    "glNewList:3",
];

/// GLVND answers these itself, so they reach gluray only if it is loaded first.
const PRELOADED: [&str; 4] =
    ["eglGetProcAddress", "glXGetProcAddress", "glXGetProcAddressARB", "glXMakeContextCurrent"];

/// Number of pixels whose colours differ by more than rounding.
fn off(a: &str, b: &str) -> usize {
    let colors = |s: &str| -> Vec<u8> {
        s.as_bytes()
            .chunks_exact(2)
            .map(|h| u8::from_str_radix(std::str::from_utf8(h).unwrap(), 16).unwrap())
            .collect()
    };
    let (a, b) = (colors(a), colors(b));
    assert_eq!(a.len(), b.len());
    a.chunks_exact(4)
        .zip(b.chunks_exact(4))
        .filter(|(p, q)| (0..3).any(|k| p[k].abs_diff(q[k]) > 8))
        .count()
}

#[test]
fn a_fault_in_any_function_that_programs_call_leaves_them_the_drivers_images_and_errors() {
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/faults.py");
    let place = folder();
    let places: Vec<&str> = HOOKS.lines().chain(OTHERS).chain(LATER).collect();
    let run =
        |through: Option<&[&str]>, places: &[&str]| -> (BTreeMap<String, Seen>, Vec<String>) {
            std::fs::write(place.path().join("list"), places.join("\n")).expect("written");
            let run = Run { x: &x, folder: place.path(), through, environment: &[] };
            let (output, report) =
                run.faulty_program(&python, &[script.to_str().expect("UTF-8"), "list", "out"]);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success() && said.is_empty(), "{}: {said}", output.status);
            let text = std::fs::read_to_string(place.path().join("out")).expect("what was seen");
            (serde_json::from_str(&text).expect("JSON"), report.faults)
        };
    let (native, _) = run(None, &places);
    let (preloaded, others): (Vec<&str>, Vec<&str>) =
        places.iter().copied().partition(|p| PRELOADED.contains(p));
    let (mut ours, mut faults) = run(Some(&[]), &others);
    let (more, more_faults) = run(Some(&["--via", "preload"]), &preloaded);
    ours.extend(more);
    faults.extend(more_faults);
    // Silhouettes come from two rasterizers where rays drew before the fault; see `metrics`.
    const SILHOUETTES: usize = 128 * 128 / 200;
    let mut wrong = Vec::new();
    for name in &places {
        let (a, b) = (&native[*name], &ours[*name]);
        let entry = name.split(':').next().unwrap_or(name);
        let logged = faults.iter().any(|f| f.contains(&format!("{entry:?}")));
        if let Some(why) = a.died.as_ref().or(b.died.as_ref()) {
            wrong.push(format!("{name}: {why}"));
            continue;
        }
        let first = off(&a.first, &b.first);
        if !logged || first > SILHOUETTES || a.next != b.next || a.errors != b.errors {
            let next = off(&a.next, &b.next);
            wrong.push(format!(
                "{name}: logged {logged}, {first} pixels of that frame, {next} of the next, errors \
                 {:?} and {:?}",
                a.errors, b.errors
            ));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), places.len(), wrong.join("\n"));
}

#[test]
fn a_shader_that_the_driver_refuses_costs_no_draw_and_is_named() {
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/hard_cases.py");
    let place = folder();
    for case in ["plain", "lists_over_several_frames"] {
        let picture = |through, environment: &[(&str, &str)]| {
            let run = Run { x: &x, folder: place.path(), through, environment };
            let (output, report) =
                run.program(&python, &[script.to_str().expect("UTF-8"), case, "out"]);
            assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
            (std::fs::read(place.path().join("out")).expect("a picture"), report)
        };
        let (native, _) = picture(None, &[]);
        let (ours, report) = picture(Some(&[]), &[("GLURAY_INJECT_FAULT", "shader")]);
        assert!(native == ours, "{case}: every pixel is the driver's");
        assert_eq!(report.traced_draws, 0, "{case}: nothing is swallowed");
        let passed = report.passed_reasons.get("the driver refuses our shader or its textures");
        assert!(passed.is_some_and(|n| *n > 0), "{case}: {:?}", report.passed_reasons);
        let told =
            |p: &String| p.contains("refuses our shader") && p.contains("GLURAY_INJECT_FAULT");
        assert!(
            report.problems.iter().any(told),
            "{case}: in the driver's words: {:?}",
            report.problems
        );
    }
}
