//! Looks at the window of a browser: screenshots, places, and what differs between two of them.
#![allow(dead_code, reason = "each test binary uses its part")]

use crate::browser::{Browser, chromium};
use datasets::image_io::{LayeredImage, read_png};
use std::io::Write as _;
use std::path::PathBuf;

/// The Chromium to test with; without one the test says so and passes, unless peers are required.
pub(crate) fn chromium_or_skip() -> Option<PathBuf> {
    match chromium() {
        Ok(program) => Some(program),
        Err(why) => {
            assert!(
                std::env::var_os("RTSV_REQUIRE_PEERS").is_none(),
                "Chromium is required: {why}"
            );
            // Not `eprintln!`, whose output libtest captures.
            let _ = writeln!(std::io::stderr(), "skipped: {why}");
            None
        }
    }
}

/// A screenshot of the window.
pub(crate) struct Window {
    image: LayeredImage,
    rgba: Vec<[f32; 4]>,
}

/// Left, top, width and height, in pixels of the window.
pub(crate) type Rect = [f64; 4];

pub(crate) fn rect(b: &mut Browser, id: &str) -> Rect {
    let r = b.evaluate(&format!(
        "(() => {{ const r = document.getElementById('{id}').getBoundingClientRect(); return \
         [r.left, r.top, r.width, r.height]; }})()"
    ));
    [0, 1, 2, 3].map(|i| r[i].as_f64().unwrap())
}

pub(crate) fn look(b: &mut Browser, name: &str) -> Window {
    let dir = tempfile::tempdir().unwrap();
    // Screenshots are kept when RTSV_SCREENSHOTS names a folder.
    let keep = std::env::var_os("RTSV_SCREENSHOTS").map(std::path::PathBuf::from);
    let path = keep.unwrap_or_else(|| dir.path().to_path_buf()).join(format!("serve-{name}.png"));
    std::fs::write(&path, b.screenshot()).unwrap();
    let image = read_png(&path).unwrap();
    Window { rgba: image.rgba().unwrap(), image }
}

/// Fraction of the pixels that differ visibly in the part `[left, top, right, bottom]` (as
/// fractions) of a rectangle.
pub(crate) fn differs(a: &Window, b: &Window, r: Rect, part: [f64; 4]) -> f64 {
    let x = [0, 2].map(|i| (r[0] + part[i] * r[2]) as usize);
    let y = [1, 3].map(|i| (r[1] + part[i] * r[3]) as usize);
    let width = a.image.width as usize;
    let (mut changed, mut all) = (0, 0);
    for j in y[0]..y[1] {
        for i in x[0]..x[1] {
            let [p, q] = [a, b].map(|w| w.rgba[j * width + i]);
            all += 1;
            changed += usize::from((0..3).any(|c| (p[c] - q[c]).abs() > 0.02));
        }
    }
    f64::from(changed as u32) / f64::from(all.max(1))
}

/// Waits until the page shows the final image of the program's current scene.
pub(crate) fn wait_until_final(b: &mut Browser) {
    b.wait_for(
        "fetch('state').then(r => r.json()).then(s => document.body.dataset.finished === 'true' && \
         Number(document.body.dataset.generation) === s.generation)",
    );
}

pub(crate) fn inside(r: Rect, x: f64, y: f64) -> [f64; 2] {
    [r[0] + x * r[2], r[1] + y * r[3]]
}
