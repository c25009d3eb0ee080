//! Tests the requests to `schlieren serve`, from the page and from clients without the token.
#![cfg(feature = "serve")]

mod serving;

use datasets::image_io::{read_exr, read_png};
use serde_json::json;
use serving::{Server, changed};
use std::io::{Read, Write};
use std::time::{Duration, Instant};

const SMALL: [&str; 4] = ["--size", "96x48", "--samples", "16"];

#[test]
fn the_page_and_its_parts_need_nothing_from_elsewhere() {
    let s = Server::start(&SMALL);
    let page = s.get("");
    assert_eq!(page.status, 200);
    assert!(page.head.contains("content-security-policy: default-src 'none'"), "{}", page.head);
    let mut parts = vec![page.text()];
    for part in [
        "page.css",
        "main.js",
        "server.js",
        "units.js",
        "image.js",
        "filter.js",
        "settings.js",
        "curves.js",
        "flow.js",
        "axes.js",
        "legend.js",
        "profile.js",
        "help.js",
        "rows.js",
        "save.js",
    ] {
        let answer = s.get(part);
        assert_eq!(answer.status, 200, "{part}");
        parts.push(answer.text());
    }
    for text in parts {
        assert!(
            !text.contains("http://") && !text.contains("https://") && !text.contains("//cdn"),
            "{text:.80}"
        );
    }
}

#[test]
fn without_the_token_nothing_is_reported() {
    let s = Server::start(&SMALL);
    let wrong = format!("/{}/", "0".repeat(32));
    for path in [
        "/",
        "/state",
        "/frame",
        "//",
        &wrong,
        &format!("{wrong}state"),
        &s.base.to_uppercase()[..9],
    ] {
        let request = format!("GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
        let answer = s.raw(request.as_bytes()).unwrap();
        assert_eq!(answer.status, 403, "{path}");
        assert!(!answer.text().contains(s.base.trim_matches('/')), "{path}");
    }
    let request = format!(
        "POST {wrong}scene HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: \
         2\r\n\r\n{{}}"
    );
    assert_eq!(s.raw(request.as_bytes()).unwrap().status, 403);
    assert!(s.is_healthy());
}

#[test]
fn the_finished_image_is_that_of_render() {
    let s = Server::start(&SMALL);
    let shown = s.finished();
    assert_eq!((shown.info["width"].as_u64(), shown.info["height"].as_u64()), (Some(96), Some(48)));
    assert_eq!(shown.info["samples"], 16);
    assert!(shown.info["deflection_error_rad"].as_f64().unwrap() < 1e-6, "{}", shown.info);
    assert!(
        shown.info["noise_rms"].as_f64().unwrap() > 0.0
            && shown.info["rays"].as_u64().unwrap() > 96 * 48 * 16
    );

    // The saved image has the same pixels, and the saved scene gives the same image again.
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let save = |kind: &str| {
        let answer = s.get(&format!("save/{kind}"));
        assert_eq!(answer.status, 200, "{kind}: {}", answer.text());
        std::fs::write(path(&format!("saved.{kind}")), &answer.body).unwrap();
    };
    for what in ["png", "exr", "toml"] {
        save(what);
    }
    let png = read_png(&path("saved.png")).unwrap();
    assert_eq!((png.width, png.height), (96, 48));
    let exr = read_exr(&path("saved.exr")).unwrap();
    for plane in ["Y", "deflection.X", "phase.Y", "samples.Y", "error.Y"] {
        assert!(exr.plane(plane).is_some(), "{plane}");
    }
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_schlieren"))
        .args(["render", "--quiet", "--scene"])
        .arg(path("saved.toml"))
        .arg("-o")
        .arg(path("again.png"))
        .status()
        .unwrap();
    assert!(status.success());
    let again = read_png(&path("again.png")).unwrap();
    assert_eq!(again.rgba().unwrap(), png.rgba().unwrap());
    let bytes: Vec<u8> =
        again.rgba().unwrap().iter().flat_map(|p| [p[0], p[1], p[2]]).map(srgb).collect();
    assert_eq!(bytes, shown.rgb);
}

fn srgb(v: f32) -> u8 {
    (255.0 * rt_core::colormap::linear_to_srgb(v)).round() as u8
}

#[test]
fn every_technique_and_cutoff_renders() {
    let s = Server::start(&SMALL);
    let mut last = s.finished().rgb;
    for technique in ["shadowgraph", "interferogram", "bos", "volume", "slice", "schlieren"] {
        s.change(&json!({"technique": {"kind": technique}}));
        let shown = s.finished();
        assert_eq!(shown.info["error"], serde_json::Value::Null, "{technique}");
        assert!(changed(&last, &shown.rgb) > 0.02, "{technique} looks like the one before");
        last = shown.rgb;
    }
    for cutoff in [
        json!({"kind": "knife", "angle_deg": 90.0}),
        json!({"kind": "circle", "radius_m": 2e-4}),
        json!({"kind": "complemented-circle", "radius_m": 2e-4}),
        json!({"kind": "color", "radius_m": 2e-4}),
        json!({"kind": "painted", "size_m": [2e-3, 2e-3], "ground_rgb": [0.0, 1.0, 0.0]}),
    ] {
        s.change(&json!({"technique": {"kind": "schlieren", "cutoff": cutoff}}));
        let shown = s.finished();
        assert!(changed(&last, &shown.rgb) > 0.02, "{cutoff}");
        last = shown.rgb;
    }
}

#[test]
fn painting_changes_the_image_where_its_light_is() {
    let s = Server::start(&SMALL);
    // With a clear filter and a small source, the image is white until something is painted.
    s.change(&json!({
        "light": {"source": {"kind": "circle", "diameter_m": 5e-5}},
        "technique": {"kind": "schlieren", "cutoff": {"kind": "painted", "size_m": [2e-3, 2e-3], "ground_rgb": [1, 1, 1]}},
    }));
    let white = s.finished();
    assert!(white.rgb.iter().all(|v| *v > 250));
    assert!((white.light.iter().sum::<f32>() - 1.0).abs() < 0.05, "the light is on the filter");

    // Light left of the blob's middle crosses the filter at a point of its own, away from the axis.
    let at = [0.60, 0.40];
    let traced = s.request("POST", "trace", &json!({ "at": at }).to_string()).json();
    let place = [0, 1].map(|i| traced["filter_m"][i].as_f64().unwrap());
    assert!(place[0].hypot(place[1]) > 5e-5, "{traced}");
    let red = |on: &str, points: serde_json::Value| {
        let body = json!({"on": on, "points": points, "radius_m": 6e-5, "rgb": [1.0, 0.0, 0.0]});
        let answer = s.request("POST", "paint", &body.to_string());
        assert_eq!(answer.status, 200, "{}", answer.text());
        s.finished()
    };
    let by_image = red("picture", json!([at]));
    let pixel = |rgb: &[u8], at: [f64; 2]| {
        let i = 3 * ((at[1] * 48.0) as usize * 96 + (at[0] * 96.0) as usize);
        [rgb[i], rgb[i + 1], rgb[i + 2]]
    };
    let p = pixel(&by_image.rgb, at);
    assert!(p[0] > 240 && p[1] < 80, "{p:?}");
    assert!(
        pixel(&by_image.rgb, [0.05, 0.9]).iter().all(|v| *v > 250),
        "undisturbed light is not painted on"
    );
    assert!(changed(&white.filter, &by_image.filter) > 0.0);

    // Painting at the same point on the filter changes nothing more; painting on the axis makes the
    // background red.
    let by_filter = red("filter", json!([place]));
    assert!(changed(&by_image.rgb, &by_filter.rgb) < 0.01);
    let axis = red("filter", json!([[0.0, 0.0]]));
    let p = pixel(&axis.rgb, [0.05, 0.9]);
    assert!(p[0] > 240 && p[1] < 80, "{p:?}");
}

#[test]
fn curves_make_another_index_and_bodies_stay_shut() {
    let s = Server::start(&SMALL);
    let state = s.get("state").json();
    let names: Vec<&str> =
        state["arrays"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["T", "rho"]);
    let density = s.finished().rgb;
    let knots = json!([[290.0, 0.0], [400.0, 3e-4]]);
    s.change(&json!({"flow": {"multifield": {"fields": {"T": {"knots": knots}}}}}));
    let curves = s.finished();
    assert!(changed(&density, &curves.rgb) > 0.02);
    s.change(&json!({"flow": {"multifield": null}}));
    assert_eq!(s.finished().rgb, density);
}

/// While the first step is shown, the second is read. It is shown without its file, and read again
/// if the file has changed.
#[test]
fn the_next_step_of_a_series_is_read_ahead() {
    let s = Server::start_series(&SMALL);
    let wait_until_read = |step: u64| {
        let end = std::time::Instant::now() + std::time::Duration::from_secs(60);
        while s.get("state").json()["read_ahead"] != json!(step) {
            assert!(std::time::Instant::now() < end, "step {step} is not read");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    };
    let first = s.finished();
    wait_until_read(1);
    let [second, kept] = ["flow-1.vti", "kept.vti"].map(|name| s.folder().join(name));
    std::fs::copy(&second, &kept).unwrap();
    // The same time and length as when it was read.
    let written = std::fs::metadata(&second).unwrap().modified().unwrap();
    let bytes = std::fs::metadata(&second).unwrap().len() as usize;
    std::fs::write(&second, vec![0; bytes]).unwrap();
    std::fs::File::options().write(true).open(&second).unwrap().set_modified(written).unwrap();
    s.change(&json!({"step": 1}));
    let ahead = s.finished();
    assert_eq!(ahead.info["error"], serde_json::Value::Null);
    assert!(changed(&first.rgb, &ahead.rgb) > 0.02);

    // Back, and forth to what has been written since.
    s.change(&json!({"step": 0}));
    assert_eq!(s.finished().rgb, first.rgb);
    std::fs::copy(&kept, &second).unwrap();
    s.change(&json!({"step": 1}));
    assert_eq!(s.finished().rgb, ahead.rgb, "the same picture when it is read as it is shown");
}

#[test]
fn steps_of_a_series_are_read_when_chosen_and_relative_to_the_first() {
    let s = Server::start_series(&SMALL);
    let state = s.get("state").json();
    assert_eq!((&state["times"], &state["step"]), (&json!([0.0, 0.5, 1.0, 1.5]), &json!(0)));
    let first = s.finished();
    assert_eq!(first.info["error"], serde_json::Value::Null);

    // The last step has another image. The saved scene gives the same image, relative to the first
    // step's surroundings.
    assert_eq!(s.change(&json!({"step": 3}))["step"], 3);
    let last = s.finished();
    assert_eq!(last.info["error"], serde_json::Value::Null);
    assert!(changed(&first.rgb, &last.rgb) > 0.02);
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let toml = s.get("save/toml").text();
    let reference =
        toml.lines().find_map(|l| l.strip_prefix("reference_n_minus_1 = ")).expect(&toml);
    // n - 1 of air of 1.2 kg/m3 in red light; for that step's own surroundings it would be 2.48e-4.
    assert!((reference.parse::<f64>().unwrap() - 2.71e-4).abs() < 2e-6, "{reference}");
    assert!(toml.contains("flow-3.vti"), "{toml}");
    std::fs::write(path("saved.toml"), toml).unwrap();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_schlieren"))
        .args(["render", "--quiet", "--scene"])
        .arg(path("saved.toml"))
        .arg("-o")
        .arg(path("again.png"))
        .status()
        .unwrap();
    assert!(status.success());
    let again = read_png(&path("again.png")).unwrap();
    let bytes: Vec<u8> =
        again.rgba().unwrap().iter().flat_map(|p| [p[0], p[1], p[2]]).map(srgb).collect();
    assert_eq!(bytes, last.rgb);

    // Setting and removing transfer functions keeps the step.
    let knots = json!([[290.0, 0.0], [400.0, 3e-4]]);
    let state = s.change(&json!({"flow": {"multifield": {"fields": {"T": {"knots": knots}}}}}));
    assert_eq!(state["step"], 3);
    assert_eq!(s.finished().info["error"], serde_json::Value::Null);
    assert_eq!(s.change(&json!({"flow": {"multifield": null}}))["step"], 3);
    assert_eq!(s.finished().rgb, last.rgb);

    // A missing file is an error of its step only.
    s.change(&json!({"step": 2}));
    assert!(s.finished().info["error"].as_str().is_some_and(|e| e.contains("flow-2.vti")));
    s.change(&json!({"step": 0}));
    assert_eq!(s.finished().rgb, first.rgb);

    for wrong in [json!(4), json!(-1), json!(1.5), json!("1"), json!(null), json!({"a": 1})] {
        let answer = s.request("POST", "scene", &json!({ "step": wrong }).to_string());
        assert_eq!(answer.status, 422, "{wrong}: {}", answer.text());
        assert!(answer.json()["error"].as_str().unwrap().contains("0 to 3"), "{}", answer.text());
    }
    let single = Server::start(&SMALL);
    assert_eq!(single.get("state").json()["times"], json!([]));
    let answer = single.request("POST", "scene", "{\"step\": 0}");
    assert!(answer.status == 422 && answer.text().contains(".pvd"), "{}", answer.text());
}

#[test]
fn bad_requests_get_a_reason_and_harm_nothing() {
    let s = Server::start(&SMALL);
    for (method, path, body, status) in [
        ("POST", "scene", "{", 400),
        ("POST", "scene", "{\"film\": {\"size\": [4000000000, 4000000000]}}", 422),
        ("POST", "scene", "{\"film\": {\"size\": [1e999, 1]}}", 400),
        ("POST", "scene", "{\"flow\": {\"file\": \"/etc/passwd\"}}", 422),
        ("POST", "scene", "{\"view\": {\"direction\": \"up\"}}", 422),
        ("POST", "paint", "{\"on\": \"wall\"}", 400),
        ("POST", "trace", "{\"at\": [7, 7]}", 422),
        ("GET", "frame?after=minus", "", 400),
        ("GET", "save/exe", "", 404),
        ("GET", "nothing", "", 404),
        ("GET", "../../etc/passwd", "", 404),
        ("DELETE", "scene", "", 405),
    ] {
        let answer = s.request(method, path, body);
        assert_eq!(answer.status, status, "{method} {path} {body}: {}", answer.text());
        if status == 422 {
            assert!(answer.json()["error"].as_str().unwrap().len() > 10);
        }
    }
    let deep = "[".repeat(100_000);
    assert_eq!(s.request("POST", "scene", &deep).status, 400);
    let huge = " ".repeat(3 << 20);
    assert_eq!(s.request("POST", "scene", &huge).status, 413);
    // Bytes that are not HTTP, a header without end, and a wrong length.
    for bytes in [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".to_vec(),
        b"GET / HTTP/1.1\r\nX: "
            .iter()
            .copied()
            .chain(std::iter::repeat_n(b'a', 1 << 20))
            .collect(),
        format!(
            "POST {}scene HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999\r\n\r\n",
            s.base
        )
        .into_bytes(),
    ] {
        if let Some(answer) = s.raw(&bytes) {
            assert!((400..500).contains(&answer.status), "{}", answer.head);
        }
    }
    assert_eq!(s.finished().info["error"], serde_json::Value::Null);
}

#[test]
fn dropped_and_idle_connections_are_left_behind() {
    let s = Server::start(&SMALL);
    let _idle: Vec<_> = (0..50).map(|_| s.connect()).collect();
    for _ in 0..20 {
        let mut half = s.connect();
        half.write_all(
            format!(
                "POST {}scene HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\n{{\"film\"",
                s.base
            )
            .as_bytes(),
        )
        .unwrap();
        let mut wait = s.connect();
        wait.write_all(
            format!("GET {}frame?after=999999 HTTP/1.1\r\nHost: x\r\n\r\n", s.base).as_bytes(),
        )
        .unwrap();
        let mut reads_a_little = s.connect();
        reads_a_little
            .write_all(format!("GET {}frame HTTP/1.1\r\nHost: x\r\n\r\n", s.base).as_bytes())
            .unwrap();
        let _ = reads_a_little.read(&mut [0; 10]);
    }
    // A request for a file that takes long, dropped by the client.
    s.change(&json!({"film": {"size": [2048, 2048]}, "sampling": {"method": "photons", "samples": 4096}}));
    let mut gone = s.connect();
    gone.write_all(format!("GET {}save/exr HTTP/1.1\r\nHost: x\r\n\r\n", s.base).as_bytes())
        .unwrap();
    std::thread::sleep(Duration::from_millis(300));
    drop(gone);

    // Requests are answered at once while the rendering thread works…
    let start = Instant::now();
    assert!(s.is_healthy());
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    // …and that thread continues with the next scene.
    s.change(&json!({"film": {"size": [96, 48]}, "sampling": null}));
    assert_eq!(s.finished().info["width"], 96);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_soon_even_while_it_renders_and_someone_waits() {
    let mut s = Server::start(&SMALL);
    s.change(&json!({"film": {"size": [2048, 2048]}, "sampling": {"method": "photons", "samples": 4096}}));
    let mut wait = s.connect();
    wait.write_all(
        format!("GET {}frame?after=999999 HTTP/1.1\r\nHost: x\r\n\r\n", s.base).as_bytes(),
    )
    .unwrap();
    std::thread::sleep(Duration::from_millis(500));
    let start = Instant::now();
    let kill = std::process::Command::new("kill")
        .args(["-INT", &s.child.id().to_string()])
        .status()
        .unwrap();
    assert!(kill.success());
    let status = s.child.wait().unwrap();
    assert_eq!(status.code(), Some(130));
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
}

#[test]
fn a_taken_port_and_a_wrong_flow_are_errors_of_the_command_line() {
    let s = Server::start(&SMALL);
    let run = |args: &[&str]| {
        let out = std::process::Command::new(env!("CARGO_BIN_EXE_schlieren"))
            .args(args)
            .output()
            .unwrap();
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let (code, text) = run(&["serve", "nothing.vti", "--density", "rho", "--listen", &s.address]);
    assert!(code == Some(1) && text.contains("cannot listen"), "{text}");
    let (code, text) = run(&["serve", "nothing.vti", "--density", "rho"]);
    assert!(code == Some(1) && text.contains("nothing.vti"), "{text}");
    let (code, text) = run(&["serve", "--density", "rho"]);
    assert!(code == Some(2) && text.contains("no flow"), "{text}");
}
