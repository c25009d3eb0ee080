//! Drives the page in a real browser: looks, orbits, paints and switches techniques. The window
//! must change where it should.
//!
//! Needs Chromium (`cargo xtask test` installs Debian's). Without it the test prints that it is
//! skipped and passes, unless RTSV_REQUIRE_PEERS is set.
#![cfg(feature = "serve")]

#[path = "serving/browser.rs"]
mod browser;
mod serving;

use browser::{Browser, chromium};
use datasets::image_io::{LayeredImage, read_png};
use serving::Server;
use std::io::Write as _;

/// A screenshot of the window.
struct Window {
    image: LayeredImage,
    rgba: Vec<[f32; 4]>,
}

/// Left, top, width and height, in pixels of the window.
type Rect = [f64; 4];

fn rect(b: &mut Browser, id: &str) -> Rect {
    let r = b.evaluate(&format!(
        "(() => {{ const r = document.getElementById('{id}').getBoundingClientRect(); return \
         [r.left, r.top, r.width, r.height]; }})()"
    ));
    [0, 1, 2, 3].map(|i| r[i].as_f64().unwrap())
}

fn look(b: &mut Browser, name: &str) -> Window {
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
fn differs(a: &Window, b: &Window, r: Rect, part: [f64; 4]) -> f64 {
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
fn wait_until_final(b: &mut Browser) {
    b.wait_for(
        "fetch('state').then(r => r.json()).then(s => document.body.dataset.finished === 'true' && \
         Number(document.body.dataset.generation) === s.generation)",
    );
}

fn inside(r: Rect, x: f64, y: f64) -> [f64; 2] {
    [r[0] + x * r[2], r[1] + y * r[3]]
}

#[test]
fn looking_orbiting_painting_and_switching() {
    let program = match chromium() {
        Ok(program) => program,
        Err(why) => {
            assert!(
                std::env::var_os("RTSV_REQUIRE_PEERS").is_none(),
                "Chromium is required: {why}"
            );
            // Not `eprintln!`, whose output libtest captures.
            let _ = writeln!(std::io::stderr(), "skipped: {why}");
            return;
        }
    };
    let s = Server::start_series(&[
        "--size",
        "384x192",
        "--samples",
        "16",
        "--source",
        "circle:0.05mm",
    ]);
    let mut b = Browser::open(&program, &s.url());
    b.wait_for("document.readyState === 'complete' && document.body.dataset.finished === 'true'");
    let first = look(&mut b, "first");
    let (image, filter) = (rect(&mut b, "image"), rect(&mut b, "filter"));
    assert!(image[2] > 300.0 && (image[2] / image[3] - 2.0).abs() < 0.05, "{image:?}");
    let text = b.evaluate("document.body.innerText").to_string();
    for word in [
        "orbit",
        "knife",
        "samples per second",
        "error of deflections",
        "noise",
        "rad",
        "mm",
        "transfer functions",
    ] {
        assert!(text.contains(word), "the page lacks `{word}`: {text}");
    }

    // Orbit: the blob moves.
    b.drag(&[
        inside(image, 0.4, 0.5),
        inside(image, 0.45, 0.5),
        inside(image, 0.55, 0.55),
        inside(image, 0.6, 0.6),
    ]);
    wait_until_final(&mut b);
    let orbited = look(&mut b, "orbited");
    let direction = s.get("state").json()["scene"]["view"]["direction"].to_string();
    assert!(direction.contains(','), "{direction}");
    assert!(differs(&first, &orbited, image, [0.2, 0.2, 0.8, 0.8]) > 0.03);
    b.evaluate("document.querySelector('[data-view=z]').click()");
    wait_until_final(&mut b);
    let back = look(&mut b, "back");
    assert!(
        differs(&first, &back, image, [0.0, 0.0, 1.0, 0.8]) < 1e-3,
        "the same view is the same image"
    );

    // Paint on the filter: a red dab in the middle colours undisturbed light in the image, and the
    // middle of the filter.
    b.evaluate("document.getElementById('clear-white').click()");
    wait_until_final(&mut b);
    let clear = look(&mut b, "clear");
    b.drag(&[
        inside(filter, 0.5, 0.4),
        inside(filter, 0.5, 0.45),
        inside(filter, 0.5, 0.5),
        inside(filter, 0.5, 0.6),
    ]);
    b.wait_for(
        "fetch('state').then(r => r.json()).then(s => s.scene.technique.cutoff.strokes.length > 0)",
    );
    wait_until_final(&mut b);
    let painted = look(&mut b, "painted-filter");
    let corner = [0.02, 0.05, 0.2, 0.4];
    assert!(differs(&clear, &painted, image, corner) > 0.9, "undisturbed light is painted on");
    assert!(differs(&clear, &painted, filter, [0.45, 0.45, 0.55, 0.55]) > 0.3);
    assert!(
        differs(&clear, &painted, filter, [0.05, 0.05, 0.3, 0.3]) < 0.01,
        "the rest of the filter is as it was"
    );

    // Paint on the image: the pixels under the brush change.
    b.evaluate("document.getElementById('clear-white').click()");
    wait_until_final(&mut b);
    b.evaluate(
        "document.querySelector('input[value=paint]').click(); const r = \
                document.getElementById('radius'); r.value = 0.05; r.dispatchEvent(new \
                Event('input'))",
    );
    b.drag(&[inside(image, 0.59, 0.38), inside(image, 0.6, 0.4), inside(image, 0.61, 0.42)]);
    b.wait_for(
        "fetch('state').then(r => r.json()).then(s => s.scene.technique.cutoff.strokes.length > 0)",
    );
    wait_until_final(&mut b);
    let on_image = look(&mut b, "painted-image");
    assert!(differs(&clear, &on_image, image, [0.59, 0.38, 0.61, 0.42]) > 0.8, "under the brush");

    // Switch the technique: the image and the settings change.
    b.evaluate(
        "const t = document.querySelector('select[name=technique]'); t.value = \
                'interferogram'; t.dispatchEvent(new Event('change'))",
    );
    b.wait_for("document.body.innerText.includes('fringe spacing')");
    wait_until_final(&mut b);
    let switched = look(&mut b, "interferogram");
    assert!(differs(&on_image, &switched, image, [0.3, 0.1, 0.9, 0.9]) > 0.2);
    assert!(
        b.evaluate("document.querySelector('input[value=paint]').disabled") == true,
        "no filter to paint on"
    );

    // Another time: the blob has moved.
    b.evaluate(
        "const step = document.getElementById('step'); step.value = 3; \
                step.dispatchEvent(new Event('input'))",
    );
    b.wait_for("document.getElementById('when').innerText.includes('4 of 4')");
    wait_until_final(&mut b);
    let later = look(&mut b, "later");
    assert!(differs(&switched, &later, image, [0.1, 0.1, 0.9, 0.9]) > 0.1);

    // An invalid value gives a message on the page, and the page continues.
    b.evaluate(
        "const w = document.querySelector('input[name=wavelengths]'); w.value = '0.5'; \
                w.dispatchEvent(new Event('change'))",
    );
    b.wait_for("document.getElementById('message').innerText.includes('wavelengths_nm')");
    wait_until_final(&mut b);
    let refused: Vec<&String> = b.page_errors.iter().filter(|c| !c.contains("422")).collect();
    assert!(refused.is_empty(), "{refused:?}");
}
