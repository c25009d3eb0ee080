//! `gluray panel` as seen by programs, the page and unauthenticated clients.
#![cfg(feature = "panel")]

mod panel_common;

use gluray::config::Mode;
use panel_common::{Fake, PROGRAM, Panel};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use serde_json::json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;
use std::time::Duration;

#[test]
fn a_change_on_the_page_reaches_the_program_and_ends_with_the_panel() {
    let scenes = tempfile::tempdir().unwrap();
    let p = Panel::start();
    let fake = Fake::start("gmsh", p.endpoint(), scenes.path());
    let id = p.until("a program", |list| list.len() == 1)[0]["id"].clone();
    let change = |set: serde_json::Value| {
        p.ask("POST", "change", &json!({"id": id, "set": set}).to_string())
    };
    assert_eq!(
        change(
            json!({"mode": "rich", "effects.ambient_occlusion_samples": 16, "objects.3f2a0000.mirror": 0.5})
        )
        .status,
        200
    );
    fake.until(|s| {
        s.mode == Mode::Rich
            && s.effects.ambient_occlusion_samples == 16
            && s.material_of("3f2a0000").mirror == Some(0.5)
    });
    let list = p.until("confirmed", |list| list[0]["settings"]["mode"] == "rich");
    assert_eq!(list[0]["base"]["mode"], "match");
    p.until("rays", |list| {
        list[0]["recent"]
            .as_array()
            .unwrap()
            .last()
            .is_some_and(|f| f["rays"]["ambient occlusion"].as_u64() > Some(1_000_000))
    });

    let refused = change(json!({"samples": 0, "mode": "phong"}));
    assert_eq!(refused.status, 422);
    assert!(
        refused.body.contains("`samples` is 0; give a whole number from 1 to 4096"),
        "{}",
        refused.body
    );
    assert_eq!(fake.settings().mode, Mode::Rich, "all or nothing");
    let toml = p.ask("GET", &format!("toml?id={id}"), "");
    assert!(
        toml.body.contains("[program.gmsh]")
            && toml.body.contains("ambient_occlusion_samples = 16"),
        "{}",
        toml.body
    );

    assert_eq!(p.ask("POST", "export", &json!({"id": id}).to_string()).status, 200);
    let list = p.until("exported", |list| !list[0]["exported"].is_null());
    let file = list[0]["exported"]["Ok"].as_str().expect("a file").to_owned();
    let ply = scenes.path().join("a.ply");
    let written =
        Command::new(PROGRAM).args(["export", &file, "-q", "-o"]).arg(&ply).output().unwrap();
    assert!(written.status.success(), "{written:?}");
    let read = datasets::read::open(&ply).unwrap();
    let triangles = match read.content {
        datasets::read::Content::Scene(s) => s.meshes[0].mesh.num_triangles(),
        datasets::read::Content::Data(d) => d.to_trimesh(None).unwrap().0.num_triangles(),
    };
    assert_eq!(triangles, 1);

    // When the panel ends, its settings are reset.
    drop(p);
    fake.until(|s| s.mode == Mode::Match && s.objects.is_empty());
}

#[test]
fn unknown_clients_other_hosts_and_other_sites_get_no_answer() {
    let p = Panel::start();
    let own = format!("Host: {}\r\n", p.address);
    let port = p.address.split(':').next_back().unwrap();
    assert_eq!(p.ask("GET", "state", "").status, 200);
    assert_eq!(p.ask_with("GET", "state", &format!("Host: localhost:{port}\r\n"), "").status, 200);
    assert_eq!(
        p.ask_with("GET", "state", &format!("{own}Origin: http://{}\r\n", p.address), "").status,
        200
    );
    for head in [
        String::new(),
        format!("Host: evil.example:{port}\r\n"),
        "Host: 127.0.0.1\r\n".into(),
        format!("{own}Origin: http://evil.example\r\n"),
        format!("{own}Origin: null\r\n"),
        format!("{own}Origin: https://{}\r\n", p.address),
    ] {
        let answer = p.ask_with("GET", "state", &head, "");
        assert!(matches!(answer.status, 400 | 403), "{head:?}: {answer:?}");
        assert!(!answer.body.contains("programs"), "{head:?}");
    }
    let wrong = format!("/{}/", "0".repeat(32));
    for path in ["/", "/state", "//", &wrong, &format!("{wrong}state"), &p.base[..9]] {
        let request = format!("GET {path} HTTP/1.1\r\n{own}Connection: close\r\n\r\n");
        let answer = p.raw(request.as_bytes()).unwrap();
        assert_eq!(answer.status, 403, "{path}");
        assert!(!answer.body.contains(p.base.trim_matches('/')), "{path}");
    }
    let page = p.ask("GET", "", "");
    assert!(page.head.contains("content-security-policy: default-src 'none'"), "{}", page.head);
    for part in ["page.css", "main.js", "server.js", "controls.js", "charts.js", "objects.js"] {
        let text = p.ask("GET", part, "").body;
        assert!(
            !text.is_empty() && !text.contains("http://") && !text.contains("https://"),
            "{part} needs something from elsewhere"
        );
    }
}

#[test]
fn nonsense_requests_are_refused_in_words_and_the_panel_goes_on() {
    let p = Panel::start();
    for (method, path, body, status) in [
        ("POST", "change", "", 400),
        ("POST", "change", "{\"id\":1,\"sett\":{}}", 400),
        ("POST", "change", "{\"id\":1,\"set\":{\"mode\":\"rich\"}}", 404),
        ("POST", "export", "{\"id\":-1}", 400),
        ("GET", "history?id=7", "", 404),
        ("GET", "history", "", 400),
        ("GET", "toml?id=x", "", 400),
        ("GET", "nothing.js", "", 404),
        ("PUT", "change", "{}", 405),
    ] {
        assert_eq!(p.ask(method, path, body).status, status, "{method} {path} {body}");
    }
    let large = format!("{{\"id\":1,\"set\":{{\"mode\":\"{}\"}}}}", "x".repeat(2 << 20));
    assert_eq!(p.ask("POST", "change", &large).status, 413);
    assert_eq!(p.ask("GET", "state", "").status, 200);
}

/// Sends data to the link's port; returns true when the panel closes the connection without an
/// answer.
fn is_shown_the_door(p: &Panel, words: &[u8]) -> bool {
    let mut stream = TcpStream::connect(p.endpoint().address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let _ = stream.write_all(words);
    let _ = stream.shutdown(std::net::Shutdown::Write);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    answer.is_empty() && p.programs().is_empty()
}

#[test]
fn who_does_not_know_the_token_is_no_program() {
    let p = Panel::start();
    let settings = serde_json::to_value(gluray::config::Settings::default()).unwrap();
    let hello = |version: u32, token: &str| {
        let hello = json!({"program": "x", "process": 1, "settings": settings});
        json!({"type": "hello", "version": version, "token": token, "hello": hello}).to_string()
            + "\n"
    };
    let right = p.endpoint().secret.token().to_owned();
    for words in [
        hello(1, &"0".repeat(32)),
        hello(1, ""),
        hello(2, &right),
        "GET / HTTP/1.1\r\n\r\n".into(),
        "{\"type\":\"objects\",\"objects\":[],\"total\":0}\n".into(),
        "x".repeat(3 << 20),
    ] {
        assert!(is_shown_the_door(&p, words.as_bytes()), "{words:.100}");
    }
    // The same message with the right token identifies a program: the test would detect a panel
    // that accepts nobody.
    let mut stream = TcpStream::connect(p.endpoint().address).unwrap();
    stream.write_all(hello(1, &right).as_bytes()).unwrap();
    p.until("a program", |list| list.len() == 1);
    // A program that sends invalid messages is disconnected; the panel stays.
    stream.write_all(b"{\"type\":\"frame\",\"stats\":[]}\n").unwrap();
    p.until("put out", |list| list[0]["running"] == false);
}

#[test]
fn whatever_comes_to_the_link_or_the_page_changes_nothing() {
    // One panel for all cases, ended with the test: a static one would outlive it.
    let p = Panel::start();
    let bytes = prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..500),
        "\\{\"type\":\"(hello|frame|inforce)\"[ -~]{0,120}\\}\n".prop_map(String::into_bytes),
        "(GET|POST) /[ -~]{0,60} HTTP/1.1\r\n([A-Za-z-]{1,12}: [ -~]{0,20}\r\n){0,4}\r\n[ -~]{0,40}"
            .prop_map(String::into_bytes),
    ];
    let mut runner = TestRunner::new(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(40)
    });
    runner
        .run(&bytes, |bytes| {
            prop_assert!(is_shown_the_door(&p, &bytes));
            let mut stream = TcpStream::connect(&p.address).unwrap();
            let _ = stream.write_all(&bytes);
            drop(stream);
            prop_assert!(p.programs().is_empty());
            Ok(())
        })
        .unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn other_machines_are_refused_before_anything_listens() {
    for address in ["0.0.0.0:0", "[::]:0"] {
        let output = Command::new(PROGRAM).args(["panel", "--listen", address]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("loopback"), "{output:?}");
    }
}

#[test]
fn ctrl_c_ends_it_with_130_and_takes_its_file_away() {
    let mut p = Panel::start();
    assert!(p.meeting_file().exists());
    let kill = Command::new("kill").args(["-INT", &p.child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(p.child.wait().unwrap().code(), Some(130));
    assert!(!p.meeting_file().exists());
}
