//! Frame reuse: an unchanged frame shows the earlier image without new rays, and a changed one
//! never does.

mod common;

use common::cases::{Seen, assert_agrees, read};
use common::{Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::path::Path;

/// The second and the third frame of each case.
type Frames = Vec<[Seen; 2]>;

/// Frames of a group, natively and through gluray; `None` without the peers.
fn frames(group: &str) -> Option<(Frames, Frames, Report)> {
    let python = peer("RTSV_SYSTEM_PYTHON")?;
    let x = Xvfb::start()?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/again_scenes.py");
    let place = folder();
    let draw = |through, out: &str| {
        let run = Run { x: &x, folder: place.path(), through, environment: &[] };
        let (output, report) = run.program(&python, &[script.to_str().expect("UTF-8"), group, out]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut seen = read(&place.path().join(out)).into_iter();
        let mut pairs = Vec::new();
        while let (Some(second), Some(third)) = (seen.next(), seen.next()) {
            pairs.push([second, third]);
        }
        (pairs, report)
    };
    let (native, _) = draw(None, "native");
    let (ours, report) = draw(Some(&[]), "ours");
    assert_eq!(native.len(), ours.len());
    for (case, (a, b)) in native.iter().zip(&ours).enumerate() {
        for frame in 0..2 {
            assert_agrees(
                &format!("case {case} of {group}, frame {}", frame + 2),
                &a[frame],
                &b[frame],
                4.0,
            );
        }
    }
    Some((native, ours, report))
}

#[test]
fn a_frame_that_comes_again_is_shown_without_rays_whatever_is_drawn_around_it() {
    let Some((_, ours, report)) = frames("AGAIN") else { return };
    let [second, third] = &ours[0];
    assert!(second.0.pixels == third.0.pixels && second.1 == third.1, "nothing has changed");
    // Two frames of each of five cases; the driver's draw with a program divides each frame into
    // two.
    assert_eq!((ours.len(), report.pictures_again), (5, 20), "{report:?}");
}

#[test]
fn a_frame_of_which_one_thing_has_changed_is_never_the_one_before() {
    let Some((native, _, report)) = frames("CHANGES") else { return };
    for (case, [second, third]) in native.iter().enumerate() {
        let differs = second.0.pixels != third.0.pixels || second.1 != third.1;
        assert!(differs, "case {case} changes the driver's picture");
    }
    // Before the change each frame was reused, and none after it.
    assert_eq!(report.pictures_again, native.len() as u64, "{report:?}");
}
