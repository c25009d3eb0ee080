//! The driver that gluray loads is the one that GLVND would have chosen. A fake vendor library
//! records whether it was called.

mod common;

use common::metrics::compare;
use common::{Picture, Run, Xvfb, folder, peer};
use std::path::Path;
use std::process::Command;

/// Builds the vendor as a GLX and an EGL library, with an EGL configuration file that precedes
/// Mesa's.
fn build(place: &Path) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/fake_vendor.c");
    for name in ["libGLX_fake.so.0", "libEGL_fake.so.0"] {
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-o"]).arg(place.join(name)).arg(&source).arg("-ldl");
        assert!(compiler.status().expect("a C compiler").success(), "{name} is built");
    }
    let files = place.join("egl_vendor.d");
    std::fs::create_dir(&files).expect("a folder");
    let libraries = [
        ("10_fake.json", place.join("libEGL_fake.so.0")),
        ("50_mesa.json", "libEGL_mesa.so.0".into()),
    ];
    for (name, library) in libraries {
        let json = serde_json::json!({ "file_format_version": "1.0.0", "ICD": { "library_path": library } });
        std::fs::write(files.join(name), json.to_string()).expect("a file");
    }
}

/// Draws a script's image natively and through gluray, with variables for GLVND. Returns the
/// vendor's log of the run through gluray.
fn notes(python: &Path, script: &str, variables: &[(&str, &str)]) -> Option<String> {
    let x = Xvfb::start()?;
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs").join(script);
    let place = folder();
    build(place.path());
    let at = |name: &str| place.path().join(name).to_str().expect("UTF-8").to_owned();
    let (home, files, libraries) = (at(""), at("egl_vendor.d"), at(""));
    let draw = |through, notes: &str| {
        let notes = at(notes);
        let mut environment = vec![
            ("HOME", home.as_str()),
            ("FAKE_VENDOR_NOTES", &notes),
            ("__EGL_VENDOR_LIBRARY_DIRS", &files),
            ("LD_LIBRARY_PATH", &libraries),
        ];
        environment.extend(variables);
        let run = Run { x: &x, folder: place.path(), through, environment: &environment };
        let (output, report) = run.program(python, &[file.to_str().expect("UTF-8")]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = Picture::read(&place.path().join("out.png"));
        // Displays may be queried repeatedly.
        let mut lines: Vec<String> = std::fs::read_to_string(notes)
            .unwrap_or_default()
            .lines()
            .map(|l| format!("{l}\n"))
            .collect();
        lines.dedup();
        (picture, report, lines.concat())
    };
    let (native, _, natively) = draw(None, "native");
    let (ours, report, through) = draw(Some(&[]), "ours");
    assert!(report.traced_draws > 0, "{report:?}");
    compare(&native, &ours).assert_filled(script);
    assert_eq!(through, natively, "GLVND asks the same as we do");
    Some(through)
}

#[test]
fn the_glx_vendor_is_the_one_that_glvnd_would_have_taken() {
    let (Some(python), Some(_)) = (peer("RTSV_SYSTEM_PYTHON"), peer("RTSV_PVBATCH")) else {
        return;
    };
    let by = |variables: &[(&str, &str)]| notes(&python, "vtk_scene.py", variables);
    let Some(named) = by(&[("__GLX_VENDOR_LIBRARY_NAME", "fake")]) else { return };
    assert_eq!(named, "glx\n");
    // The variable of the screen takes precedence over that of all screens, which names a missing
    // library.
    let forced =
        [("__GLX_FORCE_VENDOR_LIBRARY_0", "fake"), ("__GLX_VENDOR_LIBRARY_NAME", "nobody")];
    assert_eq!(by(&forced).as_deref(), Some("glx\n"));
    assert_eq!(by(&[]).as_deref(), Some(""), "the X server names Mesa");
}

#[test]
fn the_egl_vendor_is_the_first_of_glvnds_files_that_has_a_display() {
    let (Some(python), Some(_)) = (peer("RTSV_PYTHON"), peer("RTSV_XVFB")) else { return };
    let by = |variables: &[(&str, &str)]| notes(&python, "egl_scene.py", variables);
    let Some(first) = by(&[]) else { return };
    assert!(first.starts_with("egl\n") && first.contains("egl: a display\n"), "{first}");
    let second = by(&[("FAKE_VENDOR_HAS_NO_DISPLAY", "1")]).expect("it ran before");
    assert!(second.contains("egl: no display\n") && !second.contains("egl: a display"), "{second}");
}
