//! Programs with several threads. Each thread has its own context or none, and sees what other
//! threads write to textures.

mod common;

use common::cases::{assert_agrees, read};
use common::{Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::path::Path;

/// Draws a case natively and through gluray; asserts that the images agree and that nothing was
/// printed. `None` without the peers.
fn draw(case: &str) -> Option<Report> {
    draw_with(case, &[])
}

/// The same with options of `gluray run`.
fn draw_with(case: &str, options: &[&str]) -> Option<Report> {
    let python = peer("RTSV_SYSTEM_PYTHON")?;
    let x = Xvfb::start()?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/threads.py");
    let place = folder();
    let run = |through: Option<&[&str]>, out: &str| {
        let run = Run { x: &x, folder: place.path(), through, environment: &[] };
        let (output, report) = run.program(&python, &[script.to_str().expect("UTF-8"), case, out]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && said.is_empty(), "{case}: {}: {said}", output.status);
        (read(&place.path().join(out)).pop().expect("a picture"), report)
    };
    let (native, _) = run(None, "native");
    let (ours, report) = run(Some(options), "ours");
    assert!(report.traced_draws > 0, "{case}: {report:?}");
    // Depths agree to four steps of 24 bits: see `assert_agrees`.
    assert_agrees(case, &native, &ours, 4.0);
    Some(report)
}

#[test]
fn a_thread_without_a_context_does_nothing_to_the_primitive_of_another() {
    draw("a_thread_without_a_context");
    // GLVND answers such a thread itself: its calls reach gluray only if it is loaded first.
    draw_with("a_thread_without_a_context", &["--via", "preload"]);
}

#[test]
fn contexts_that_threads_make_current_in_turns_keep_their_own_images() {
    draw("contexts_made_current_in_turns");
    draw_with("contexts_made_current_in_turns", &["--via", "preload"]);
}

#[test]
fn contexts_of_two_threads_do_not_read_textures_that_nobody_writes_again() {
    let Some(report) = draw("textures_that_nobody_writes") else { return };
    // Each context reads the texture once, and possibly again after the other's set-up.
    assert!((2..=6).contains(&report.textures_read), "{} in 61 frames", report.textures_read);
}

#[test]
fn a_texture_that_another_thread_writes_is_drawn_as_it_was_written() {
    draw("a_texture_that_another_thread_writes");
}

#[test]
fn a_texture_that_another_thread_draws_into_is_seen_while_its_framebuffer_stays_bound() {
    draw("a_texture_that_another_thread_draws_into");
}

#[test]
fn texels_that_are_written_while_they_are_read_are_seen_in_the_end() {
    draw("a_texture_that_is_written_while_it_is_drawn_with");
}
