//! Ray-parallel mode in real programs: the image does not depend on the number of processes, even
//! when helpers are lost.

mod common;

use common::{Picture, Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn scene() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/vtk_scene.py");
    path.to_str().expect("UTF-8").to_owned()
}

/// The image of VTK's script, with options of `gluray run` and the sockets of helpers.
fn picture(x: &Xvfb, python: &Path, options: &[&str], sockets: Option<&str>) -> (Picture, Report) {
    let place = folder();
    let home = [("HOME", place.path().to_str().expect("UTF-8"))];
    let environment: Vec<(&str, &str)> =
        home.into_iter().chain(sockets.map(|s| ("GLURAY_RANKS", s))).collect();
    let run = Run { x, folder: place.path(), through: Some(options), environment: &environment };
    let (output, report) = run.program(python, &[&scene()]);
    let file = place.path().join("out.png");
    assert!(file.is_file(), "{}", String::from_utf8_lossy(&output.stderr));
    (Picture::read(&file), report)
}

fn programs() -> Option<(Xvfb, PathBuf)> {
    // The system's Python has ParaView's VTK; its rendering needs an X server.
    peer("RTSV_PVBATCH")?;
    Some((Xvfb::start()?, peer("RTSV_SYSTEM_PYTHON")?))
}

#[test]
fn a_program_draws_the_same_bits_on_any_number_of_ranks() {
    let Some((x, python)) = programs() else { return };
    for mode in ["match", "rich", "path"] {
        let (one, report) = picture(&x, &python, &["--mode", mode], None);
        assert!(report.ranks.is_empty() && report.traced_draws > 0);
        let counts: &[&str] = if mode == "match" { &["2", "3", "4", "7"] } else { &["3"] };
        for ranks in counts {
            let (many, report) = picture(&x, &python, &["--mode", mode, "--ranks", ranks], None);
            assert!(one.pixels == many.pixels, "{mode} on {ranks} ranks");
            assert_eq!(report.problems, Vec::<String>::new());
            assert_eq!(report.ranks.len().to_string(), *ranks);
            for r in &report.ranks {
                assert!(r.pictures > 0 && r.trace_ms > 0.0, "{mode}: {r:?}");
                assert!(r.rays > 1000 && r.builds > 0, "{mode}: {r:?}");
                assert!(
                    r.rank == 0 || (r.sent_bytes > 10_000 && r.received_bytes > 10_000),
                    "{mode}: {r:?}"
                );
            }
        }
    }
}

#[test]
fn helpers_that_go_or_lie_or_are_not_there_cost_no_pixel_and_are_named() {
    let Some((x, python)) = programs() else { return };
    let (one, _) = picture(&x, &python, &["--mode", "match"], None);
    let place = folder();
    let name = |n: &str| place.path().join(n).to_str().expect("UTF-8").to_owned();
    let (gone, liar, missing) = (name("gone"), name("liar"), name("missing"));
    let listeners = [&gone, &liar].map(|s| UnixListener::bind(s).expect("a socket"));
    let [first, second] = listeners;
    // One takes a part of the first request and leaves; the other answers with noise.
    std::thread::spawn(move || {
        let (mut stream, _) = first.accept().expect("a program");
        stream.read_exact(&mut [0; 1000]).expect("the beginning of an order");
    });
    std::thread::spawn(move || {
        let (mut stream, _) = second.accept().expect("a program");
        let mut answer = vec![2_u8, 0, 0, 0, 0, 0, 0, 0];
        answer.extend(5000_u64.to_ne_bytes());
        answer.extend(vec![0x5a; 5000]);
        stream.write_all(&answer).expect("noise");
        // Remaining requests are not answered.
        while matches!(stream.read(&mut [0; 1 << 16]), Ok(n) if n > 0) {}
    });
    let sockets = format!("{gone}:{missing}:{liar}");
    let (ours, report) = picture(&x, &python, &["--mode", "match"], Some(&sockets));
    assert!(one.pixels == ours.pixels, "{report:?}");
    let lost = report.ranks.iter().filter(|r| r.lost.is_some()).count();
    assert_eq!(lost, 2, "{:?}", report.ranks);
    for words in ["no helper at", "helper rank 1 was lost", "helper rank 2 was lost"] {
        assert!(
            report.problems.iter().any(|p| p.contains(words)),
            "{words}: {:?}",
            report.problems
        );
    }
}

#[test]
fn helpers_end_with_whoever_started_them_and_leave_no_socket() {
    let place = folder();
    let socket = place.path().join("s");
    let mut helper = Command::new(env!("CARGO_BIN_EXE_gluray"))
        .args(["--quiet", "serve-rays", "--until-input-ends", "--socket"])
        .arg(&socket)
        .stdin(Stdio::piped())
        .spawn()
        .expect("a helper");
    let end = Instant::now() + Duration::from_secs(20);
    while !socket.exists() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(socket.exists());
    // A second helper must not take over its socket.
    let second = Command::new(env!("CARGO_BIN_EXE_gluray"))
        .args(["serve-rays", "--socket"])
        .arg(&socket)
        .output()
        .expect("it starts");
    assert_eq!(second.status.code(), Some(1), "{second:?}");
    assert!(String::from_utf8_lossy(&second.stderr).contains("not there yet"), "{second:?}");
    drop(helper.stdin.take());
    assert!(helper.wait().expect("it ends").success());
    assert!(!socket.exists());
}
