//! Drives the page in a real browser: looks, orbits, paints and switches techniques. The window
//! must change where it should.
//!
//! Needs Chromium (`cargo xtask test` installs Debian's). Without it the test prints that it is
//! skipped and passes, unless RTSV_REQUIRE_PEERS is set.
#![cfg(feature = "serve")]

#[path = "serving/browser.rs"]
mod browser;
mod serving;
#[path = "serving/window.rs"]
mod window;

use browser::Browser;
use serving::Server;
use window::{chromium_or_skip, differs, inside, look, rect, wait_until_final};

#[test]
fn looking_orbiting_painting_and_switching() {
    let Some(program) = chromium_or_skip() else { return };
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
