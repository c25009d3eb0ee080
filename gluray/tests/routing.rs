//! In mode `match` each frame goes to the driver or to rays, whichever is cheaper, and nobody sees
//! which.

mod common;

use common::cases::{Seen, assert_agrees, read};
use common::{Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::path::Path;

const CHEAPER: &str = "a frame that costs the driver less than rays";

/// The frames of a case; `None` without the peers. `through` are options of `gluray run`.
fn draw(case: &str, through: Option<&[&str]>) -> Option<(Vec<Seen>, Report)> {
    let python = peer("RTSV_SYSTEM_PYTHON")?;
    let x = Xvfb::start()?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/routing_scenes.py");
    let place = folder();
    let environment = [("GLURAY_ALWAYS_TRACE", "")];
    let run = Run { x: &x, folder: place.path(), through, environment: &environment };
    let (output, report) = run.program(&python, &[script.to_str().expect("UTF-8"), case, "out"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "", "we must be silent");
    Some((read(&place.path().join("out")), report))
}

/// The frames of a case, which agree with the driver's: pixel by pixel where the driver draws.
fn agrees(case: &str, is_drivers: impl Fn(usize) -> bool) -> Option<Report> {
    let (native, _) = draw(case, None)?;
    let (ours, report) = draw(case, Some(&[])).expect("it ran before");
    assert_eq!(native.len(), ours.len());
    for (n, (a, b)) in native.iter().zip(&ours).enumerate() {
        let same = a.0.pixels == b.0.pixels && a.1 == b.1;
        assert!(same || !is_drivers(n), "{case}, frame {n}: the driver's picture is another");
        assert_agrees(&format!("{case}, frame {n}"), a, b, 8.0);
    }
    Some(report)
}

fn sides(report: &Report) -> Vec<(&str, bool)> {
    report.routes.iter().map(|r| (r.to.as_str(), r.rays_ms < r.driver_ms)).collect()
}

#[test]
fn frames_of_few_triangles_are_the_drivers_to_the_bit() {
    let Some(report) = agrees("few", |_| true) else { return };
    assert_eq!((report.traced_draws, report.routes.len()), (0, 0), "{report:?}");
    assert!(report.passed_reasons[CHEAPER] > 0 && report.frames >= 8, "{report:?}");
}

#[test]
fn many_triangles_go_to_rays_after_a_frame_and_few_come_back_after_some() {
    // The first heavy frame is the driver's, and so are all from the fourth light one on.
    let Some(report) = agrees("turns", |n| !(7..=20).contains(&n)) else { return };
    assert_eq!(sides(&report), [("rays", true), ("driver", false)], "{report:?}");
    assert!(report.traced_draws > 0 && report.passed_reasons[CHEAPER] > 0, "{report:?}");
    let (_, again) = draw("turns", Some(&[])).expect("it ran before");
    assert_eq!(report.routes, again.routes, "equal calls are decided equally");
    assert_eq!(report.traced_draws, again.traced_draws);
}

#[test]
fn frames_that_change_to_and_fro_change_sides_once() {
    let Some(report) = agrees("flicker", |n| n == 0) else { return };
    assert_eq!(sides(&report), [("rays", true)], "{report:?}");
}

#[test]
fn who_wants_rays_always_gets_them() {
    let Some((_, report)) = draw("few", Some(&["--always-trace"])) else { return };
    assert!(report.traced_draws > 0 && report.routes.is_empty(), "{report:?}");
    assert!(!report.passed_reasons.contains_key(CHEAPER), "{report:?}");
    for mode in ["phong", "rich"] {
        let (_, report) = draw("few", Some(&["--mode", mode])).expect("it ran before");
        assert!(report.traced_draws > 0 && report.routes.is_empty(), "{mode}: {report:?}");
    }
}
