//! The subcommands that need no OpenGL, run as from a shell.

use gluray::export::{Object, Scene, write_scene};
use gluray::panel::ObjectInfo;
use gluray::report::Report;
use gluray::timeline::Span;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn gluray(arguments: &[&str], home: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gluray"));
    command
        .args(arguments)
        .env("XDG_STATE_HOME", home)
        .env("XDG_CONFIG_HOME", home)
        .env("XDG_RUNTIME_DIR", home);
    command.env_remove("DISPLAY").env_remove("GLURAY_CONFIG").output().expect("the program starts")
}

fn out(o: &Output) -> String {
    String::from_utf8_lossy(&o.stdout).into_owned()
}

fn err(o: &Output) -> String {
    String::from_utf8_lossy(&o.stderr).into_owned()
}

fn report() -> Report {
    let span = |track: &str, phase: &str, frame, start_ms, ms| Span {
        track: track.into(),
        phase: phase.into(),
        frame,
        start_ms,
        ms,
    };
    Report {
        program: "gmsh".into(),
        mode: "match".into(),
        driver: "llvmpipe".into(),
        frames: 4,
        traced_draws: 12,
        passed_draws: 8,
        passed_reasons: [("no depth test".to_owned(), 6), ("an odd reason".to_owned(), 2)].into(),
        rays: [("primary".to_owned(), 4_000_000)].into(),
        milliseconds: [("trace".to_owned(), 80.0)].into(),
        problems: vec!["gluray.toml: `mode` is 3".into()],
        objects: vec![ObjectInfo {
            key: "3f2a".into(),
            name: "1 draw call".into(),
            triangles: 1000,
            color: None,
        }],
        timeline: vec![
            span("program", "capture", 1, 0.0, 5.0),
            span("program", "trace", 1, 5.0, 20.0),
            span("builds", "best build", 0, 10.0, 40.0),
        ],
        ..Report::default()
    }
}

#[test]
fn explain_says_what_was_traced_what_was_not_and_what_to_do() {
    let home = tempfile::tempdir().unwrap();
    let missing = gluray(&["explain"], home.path());
    assert_eq!(missing.status.code(), Some(1));
    assert!(err(&missing).contains("cure: run a program first"), "{}", err(&missing));

    let last = home.path().join("gluray/last.json");
    std::fs::create_dir_all(last.parent().unwrap()).unwrap();
    std::fs::write(&last, serde_json::to_vec(&report()).unwrap()).unwrap();
    let text = out(&gluray(&["explain"], home.path()));
    for part in [
        "gmsh: mode match",
        "12 draws (3.0 a frame)",
        "4000000 rays: primary",
        "6 no depth test",
        "--trace all",
        "2 an odd reason",
        "20.00 a frame",
        "3f2a",
        "SETTING NOT TAKEN: gluray.toml: `mode` is 3",
    ] {
        assert!(text.contains(part), "{part}:\n{text}");
    }
    let json: Report =
        serde_json::from_str(&out(&gluray(&["explain", "--json"], home.path()))).unwrap();
    assert_eq!(json, report());
    std::fs::write(&last, "{").unwrap();
    let broken = gluray(&["explain"], home.path());
    assert!(
        broken.status.code() == Some(1) && err(&broken).contains("last.json: is no report"),
        "{}",
        err(&broken)
    );
}

#[test]
fn a_run_becomes_a_chart_and_a_trace() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(at("r.json"), serde_json::to_vec(&report()).unwrap()).unwrap();
    let done =
        gluray(&["timeline", &at("r.json"), "-o", &at("a.svg"), "-o", &at("a.json")], home.path());
    assert!(done.status.success(), "{}", err(&done));
    let svg = std::fs::read_to_string(at("a.svg")).unwrap();
    assert!(svg.contains("best build 40.0 ms") && svg.contains("gmsh, mode match"), "{svg}");
    let trace: Value = serde_json::from_slice(&std::fs::read(at("a.json")).unwrap()).unwrap();
    let events = trace["traceEvents"].as_array().unwrap();
    assert_eq!(events.iter().filter(|e| e["ph"] == "X").count(), 3);
    let wrong = gluray(&["timeline", &at("r.json"), "-o", &at("a.png")], home.path());
    assert!(
        wrong.status.code() == Some(2) && err(&wrong).contains(".svg or .json"),
        "{}",
        err(&wrong)
    );
    let empty = gluray(
        &["timeline", &at("r.json"), "-o", &at("a.svg"), "--from", "7", "--to", "7"],
        home.path(),
    );
    assert!(
        empty.status.code() == Some(2) && err(&empty).contains("0.0 to 50.0 ms"),
        "{}",
        err(&empty)
    );
}

#[test]
fn scenes_become_files_that_other_programs_read() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name).to_str().unwrap().to_owned();
    let object = |key: &str, x: f32| Object {
        key: key.into(),
        world_from_object: std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 }),
        color: [1.0, 0.0, 0.0, 1.0],
        positions: vec![[x, 0., 0.], [x + 1., 0., 0.], [x, 1., 0.]],
        indices: vec![[0, 1, 2]],
        normals: vec![[0., 0., 1.]; 3],
        ..Object::default()
    };
    let scene = Scene {
        program: "t".into(),
        frame: 1,
        space: "s".into(),
        objects: vec![object("aa", 0.0), object("bb", 5.0)],
    };
    write_scene(Path::new(&at("s.gluray")), &scene).unwrap();
    for (file, triangles) in [("a.ply", 2), ("a.glb", 2), ("a.vtp", 2), ("a.obj", 2)] {
        let done = gluray(&["export", &at("s.gluray"), "-o", &at(file)], home.path());
        assert!(done.status.success(), "{file}: {}", err(&done));
        let mesh = match datasets::read::open(at(file)).unwrap().content {
            datasets::read::Content::Scene(s) => {
                s.meshes.iter().map(|m| m.mesh.num_triangles()).sum()
            }
            datasets::read::Content::Data(d) => {
                let datasets::model::Dataset::PolyData(p) = &d else { panic!("{file}") };
                assert!(p.attributes.point_array("Normals").is_some(), "{file}");
                assert!(file == "a.ply" || p.attributes.cell_array("object").is_some(), "{file}");
                d.to_trimesh(None).unwrap().0.num_triangles()
            }
        };
        assert_eq!(mesh, triangles, "{file}");
    }
    let list = out(&gluray(&["export", &at("s.gluray"), "--list", "--json"], home.path()));
    assert_eq!(list.lines().count(), 2);
    for (arguments, code, text) in [
        (vec!["export", &at("s.gluray")], 2, "give -o FILE"),
        (vec!["export", &at("s.gluray"), "-o", "a.png"], 2, ".ply, .glb, .vtp, .obj"),
        (
            vec!["export", &at("s.gluray"), "--object", "cc", "-o", &at("b.ply")],
            2,
            "there is no object `cc`",
        ),
        (vec!["export", "-o", &at("b.ply")], 1, "no program has written one"),
        (vec!["export", &at("a.ply"), "-o", &at("b.ply")], 1, "is no scene of gluray"),
    ] {
        let done = gluray(&arguments, home.path());
        assert_eq!(done.status.code(), Some(code), "{arguments:?}: {}", err(&done));
        assert!(err(&done).contains(text), "{arguments:?}: {}", err(&done));
    }
}

#[test]
fn settings_that_make_no_sense_stop_a_run_before_it_starts() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("g.toml");
    std::fs::write(&file, "mode = \"rich\"\n[program.gmsh.effects]\nshadow = true\n").unwrap();
    let mark = home.path().join("started");
    // The library does not exist: options are checked first.
    for (options, text) in [
        (vec!["--set", "samples=0"], "--set: `samples` is 0; give a whole number from 1 to 4096"),
        (vec!["--set", "mode"], "write NAME=VALUE"),
        (vec!["--set", "mods=rich"], "did you mean `mode`?"),
        (
            vec!["--config", file.to_str().unwrap()],
            "[program.gmsh]: `effects.shadow` is no setting; did you mean `effects.shadows`?",
        ),
        (vec!["--config", "/nowhere.toml"], "/nowhere.toml: cannot be read"),
    ] {
        let mut arguments = vec!["run"];
        arguments.extend(options.iter());
        arguments.extend(["--", "touch", mark.to_str().unwrap()]);
        let done = gluray(&arguments, home.path());
        assert_eq!(done.status.code(), Some(2), "{options:?}: {}", err(&done));
        assert!(err(&done).contains(text), "{options:?}: {}", err(&done));
        assert!(!mark.exists(), "{options:?}: the program ran all the same");
    }
}

#[test]
fn the_doctor_lists_variables_and_says_what_will_not_work() {
    let home = tempfile::tempdir().unwrap();
    let list = gluray(&["doctor", "--variables"], home.path());
    assert!(
        list.status.success() && out(&list).contains("GLURAY_EFFECTS_AMBIENT_OCCLUSION_SAMPLES"),
        "{}",
        out(&list)
    );
    std::fs::create_dir_all(home.path().join("gluray")).unwrap();
    std::fs::write(home.path().join("gluray/gluray.toml"), "mode = 3").unwrap();
    let found = gluray(&["doctor", "--json"], home.path());
    assert_eq!(found.status.code(), Some(1));
    let list: Vec<Value> = serde_json::from_str(&out(&found)).unwrap();
    let of = |about: &str| {
        list.iter().find(|f| f["about"] == about).unwrap_or_else(|| panic!("{about}: {list:?}"))
    };
    assert_eq!(
        (&of("display")["grade"], &of("settings")["grade"]),
        (&Value::from("bad"), &Value::from("bad"))
    );
    assert!(of("display")["cure"].as_str().unwrap().contains("Xvfb"));
    assert!(of("settings")["found"].as_str().unwrap().contains("`mode` is 3"));
}

#[test]
fn completions_know_the_subcommands() {
    let home = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let script = out(&gluray(&["completions", shell], home.path()));
        for word in ["doctor", "explain", "export", "timeline", "run"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}

/// Batch systems and `timeout` send TERM to the process that they started, which is gluray.
#[test]
fn a_term_ends_the_program_and_the_report_is_written() {
    let home = tempfile::tempdir().expect("a folder");
    let report = home.path().join("r.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_gluray"));
    command.args(["run", "--report"]).arg(&report).args([
        "--",
        "sh",
        "-c",
        "echo started; exec sleep 600",
    ]);
    command.env("XDG_STATE_HOME", home.path()).env("XDG_CONFIG_HOME", home.path());
    command.env("XDG_RUNTIME_DIR", home.path()).stdout(std::process::Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    let mut line = String::new();
    let stdout = child.stdout.as_mut().expect("a pipe");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut line).expect("a line");
    assert_eq!(line, "started\n");
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("it runs");
    // If the signal were lost, this would wait for ten minutes.
    let status = child.wait().expect("it ends");
    assert_eq!(status.code(), Some(128 + 15), "the program's own end, as a shell tells it");
    let text = std::fs::read_to_string(&report).expect("the report is there");
    assert!(serde_json::from_str::<Report>(&text).is_ok(), "{text}");
}

#[test]
fn run_refuses_variables_of_ours_that_are_no_text_by_name() {
    use std::os::unix::ffi::OsStrExt;
    let no_text = std::ffi::OsStr::from_bytes(b"3f2a.mirror=0.5\xff");
    let mut command = Command::new(env!("CARGO_BIN_EXE_gluray"));
    command
        .args(["run", "--set", "objects.3f2a.mirror=0.3", "--", "true"])
        .env("GLURAY_OBJECTS", no_text);
    let output = command.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let said = err(&output);
    assert!(
        said.contains("`GLURAY_OBJECTS` is not UTF-8") && said.contains("set it to text"),
        "{said}"
    );
}
