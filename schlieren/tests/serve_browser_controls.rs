//! Uses the page in a real browser as an experimentalist does: fits, zooms, reads values, asks what
//! a technique is, chooses arrays, mistypes, and keeps files.
//!
//! Needs Chromium, as `serve_browser` does.
#![cfg(feature = "serve")]

#[path = "serving/browser.rs"]
mod browser;
mod serving;
#[path = "serving/window.rs"]
mod window;

use browser::Browser;
use serde_json::Value;
use serving::Server;
use window::{chromium_or_skip, differs, inside, look, rect, wait_until_final};

/// Types into a field that has the focus, as Enter leaves it.
fn type_into(b: &mut Browser, name: &str, text: &str) {
    b.evaluate(&format!(
        "(() => {{ const i = document.querySelector('[name=\"{name}\"]'); i.focus(); i.value = \
         '{text}'; i.dispatchEvent(new Event('change')); }})()"
    ));
}

fn choose(b: &mut Browser, name: &str, value: &str) {
    b.evaluate(&format!(
        "(() => {{ const i = document.querySelector('select[name=\"{name}\"]'); i.value = \
         '{value}'; i.dispatchEvent(new Event('change')); }})()"
    ));
}

fn value_of(b: &mut Browser, name: &str) -> Value {
    b.evaluate(&format!("document.querySelector('[name=\"{name}\"]').value"))
}

fn open(options: &[&str]) -> Option<(Server, Browser)> {
    let program = chromium_or_skip()?;
    let s = Server::start(options);
    let mut b = Browser::open(&program, &s.url());
    b.wait_for("document.readyState === 'complete' && document.body.dataset.finished === 'true'");
    wait_until_final(&mut b);
    Some((s, b))
}

/// Refusals are answers, which the browser writes to its console; all else is an error.
fn assert_no_errors(b: &Browser) {
    let errors: Vec<&String> = b.page_errors.iter().filter(|c| !c.contains("422")).collect();
    assert!(errors.is_empty(), "{errors:?}");
}

/// Whether the canvas of the axes has ink in a rectangle beside the image.
fn has_ink(b: &mut Browser, left: f64, top: f64, width: f64, height: f64) -> bool {
    b.evaluate(&format!(
        "(() => {{ const c = document.getElementById('axes'); const s = \
         c.getBoundingClientRect(), d = c.getContext('2d').getImageData({left} - s.left, {top} - \
         s.top, {width}, {height}).data; return d.some(v => v > 60); }})()"
    )) == true
}

#[test]
fn the_flow_fills_its_frame_and_is_zoomed_with_named_axes() {
    let Some((s, mut b)) = open(&["--samples", "4"]) else { return };
    let image = rect(&mut b, "image");
    assert!((image[2] / image[3] - 2.0).abs() < 0.05, "the flow is twice as long: {image:?}");
    assert_eq!(b.evaluate("getComputedStyle(document.getElementById('time')).display"), "none");
    let first = look(&mut b, "fitted");
    let under = [image[0], image[1] + image[3] + 3.0];
    assert!(has_ink(&mut b, under[0], under[1], image[2], 30.0), "numbers below the image");
    assert!(has_ink(&mut b, image[0] - 50.0, image[1], 45.0, image[3]), "and left of it");

    // The wheel zooms around the pointer, and the pointer reads values in the flow's coordinates.
    b.wheel(inside(image, 0.65, 0.4), -300.0);
    b.wait_for("fetch('state').then(r => r.json()).then(s => s.scene.film.field_of_view_m < 0.15)");
    wait_until_final(&mut b);
    let zoomed = look(&mut b, "zoomed");
    assert!(differs(&first, &zoomed, image, [0.2, 0.2, 0.8, 0.8]) > 0.03);
    b.hover(inside(image, 0.65, 0.4));
    b.wait_for("document.getElementById('here').innerText.includes('deflected')");
    let here = b.evaluate("document.getElementById('here').innerText").to_string();
    // The blob's middle, where it was before the zoom.
    assert!(here.contains("x 30.") || here.contains("x 29."), "{here}");
    assert!(here.contains("y 10.") || here.contains("y 9."), "{here}");
    b.evaluate("document.getElementById('whole').click()");
    b.wait_for("fetch('state').then(r => r.json()).then(s => s.fit)");
    wait_until_final(&mut b);
    let whole = look(&mut b, "whole");
    assert!(differs(&first, &whole, image, [0.0, 0.0, 0.8, 0.8]) < 1e-3);

    // Light along x sees the flow's square end.
    b.evaluate("document.querySelector('[data-view=x]').click()");
    b.wait_for(
        "fetch('state').then(r => r.json()).then(s => s.scene.film.size.join() === '512,512')",
    );
    wait_until_final(&mut b);
    let image = rect(&mut b, "image");
    assert!((image[2] / image[3] - 1.0).abs() < 0.05, "{image:?}");
    look(&mut b, "along-x");
    assert!(s.is_healthy());
    assert_no_errors(&b);
}

#[test]
fn values_are_read_along_a_line_and_techniques_are_explained() {
    let Some((_s, mut b)) = open(&["--size", "384x192", "--samples", "16"]) else { return };
    let words = b.evaluate("document.getElementById('legend-words').innerText").to_string();
    assert!(words.contains("rad"), "the legend has its unit: {words}");

    b.evaluate("document.querySelector('input[value=profile]').click()");
    b.wait_for("document.getElementById('profile-here').innerText.includes('rad at')");
    let image = rect(&mut b, "image");
    b.drag(&[inside(image, 0.3, 0.4), inside(image, 0.6, 0.4), inside(image, 0.9, 0.4)]);
    // The profile is below the window's edge.
    b.evaluate("document.getElementById('profile').scrollIntoView({ block: 'center' })");
    let plot = rect(&mut b, "profile");
    let mut read = |part: f64| {
        b.hover(inside(plot, part, 0.5));
        b.wait_for("document.getElementById('profile-here').innerText.includes('mm (x')");
        b.evaluate("document.getElementById('profile-here').innerText").to_string()
    };
    let (left, right) = (read(0.3), read(0.7));
    assert!(left != right && left.contains("deflection, right"), "{left} {right}");
    choose(&mut b, "quantity", "light");
    b.wait_for("document.getElementById('profile-here').innerText.includes('% of white')");
    look(&mut b, "profile");
    b.evaluate("document.getElementById('profile-csv').click()");
    b.wait_for("(document.body.dataset.saved || '').includes('schlieren-profile.csv')");
    // Fringes have a phase, in several wavelengths colours of paths; dots move.
    choose(&mut b, "technique", "interferogram");
    type_into(&mut b, "wavelengths", "450, 550, 650");
    wait_until_final(&mut b);
    b.wait_for(
        "document.getElementById('legend-words').innerText.includes('optical path at 450 nm')",
    );
    choose(&mut b, "quantity", "phase");
    b.wait_for("document.getElementById('profile-here').innerText.match(/phase .* λ at/) !== null");
    look(&mut b, "phase");
    choose(&mut b, "technique", "bos");
    wait_until_final(&mut b);
    b.wait_for("[...document.getElementById('quantity').options].some(o => o.value === 'dots')");
    choose(&mut b, "quantity", "dots");
    b.wait_for("document.getElementById('profile-here').innerText.match(/dots .*m at/) !== null");
    look(&mut b, "dots");
    choose(&mut b, "technique", "schlieren");
    wait_until_final(&mut b);
    b.wait_for("document.getElementById('legend-words').innerText.includes('at 450 nm, up to')");
    look(&mut b, "white-light");
    b.evaluate("document.querySelector('input[value=orbit]').click()");

    // Each technique says what it is while the pointer is on it, and goes when it leaves.
    b.evaluate("scrollTo(0, 0)");
    for (technique, word) in [("bos", "dots"), ("shadowgraph", "second derivative")] {
        let at = b.evaluate(&format!(
            "(() => {{ const r = document.querySelector('option[value={technique}]')\
             .getBoundingClientRect(); return [r.left + 20, r.top + r.height / 2]; }})()"
        ));
        b.hover([0, 1].map(|i| at[i].as_f64().unwrap()));
        b.wait_for(&format!(
            "!document.getElementById('tip').hidden && \
             document.getElementById('tip').innerText.includes('{word}')"
        ));
    }
    look(&mut b, "explained");
    b.hover([5.0, 5.0]);
    b.wait_for("document.getElementById('tip').hidden");
    assert_no_errors(&b);
}

#[test]
fn what_was_mistyped_says_why_and_goes_back() {
    let Some((s, mut b)) = open(&["--size", "192x96", "--samples", "4"]) else { return };
    for (name, text, word) in [
        ("tolerance", "small", "is not a number"),
        ("tolerance", "-1", "march.tolerance_rad"),
        ("exposure", "-2", "film.exposure"),
        ("exposure", "", "a number is missing"),
        ("pixels", "12", "not a scene"),
        ("smoothing", "-3", "flow.smoothing_nodes"),
    ] {
        let before = value_of(&mut b, name);
        type_into(&mut b, name, text);
        b.wait_for(&format!(
            "!document.getElementById('message').hidden && \
             document.getElementById('message').innerText.includes('{word}')"
        ));
        b.wait_for(&format!("document.querySelector('[name={name}]').value === {before}"));
    }
    // What fails only when the flow is read can be taken back.
    choose(&mut b, "index from", "n − 1");
    b.wait_for("document.querySelector('#message button')?.innerText === 'go back'");
    look(&mut b, "failed");
    b.evaluate("document.querySelector('#message button').click()");
    b.wait_for("fetch('state').then(r => r.json()).then(s => s.scene.flow.density === 'rho')");
    wait_until_final(&mut b);
    b.wait_for("document.getElementById('message').hidden");

    // The warning of the command line, in the page's words.
    type_into(&mut b, "tolerance", "1e-13");
    b.wait_for("document.getElementById('warnings').innerText.includes('above the tolerance of')");
    let warnings = b.evaluate("document.getElementById('warnings').innerText").to_string();
    assert!(warnings.contains("“resample to”") && !warnings.contains("--tolerance"), "{warnings}");
    assert!(s.is_healthy());
    assert_no_errors(&b);
}

#[test]
fn vectors_are_drawn_and_files_are_kept() {
    let Some((_s, mut b)) = open(&["--size", "384x192", "--samples", "16"]) else { return };
    choose(&mut b, "technique", "bos");
    b.wait_for("document.body.innerText.includes('dot spacing')");
    wait_until_final(&mut b);
    let (image, bare) = (rect(&mut b, "image"), look(&mut b, "bos"));
    for style in ["arrows", "lic"] {
        choose(&mut b, "vectors", style);
        b.wait_for(&format!(
            "fetch('state').then(r => r.json()).then(s => s.overlay === '{style}')"
        ));
        wait_until_final(&mut b);
        let drawn = look(&mut b, style);
        assert!(differs(&bare, &drawn, image, [0.2, 0.1, 0.9, 0.9]) > 0.01, "{style}");
        let words = b.evaluate("document.getElementById('legend-words').innerText").to_string();
        assert!(words.contains("scale is in the lower left corner"), "{words}");
    }
    for (files, name) in
        [("png toml", "schlieren.png schlieren.toml"), ("sheet", "schlieren-sheet.png")]
    {
        b.evaluate(&format!("document.querySelector('[data-save=\"{files}\"]').click()"));
        b.wait_for(&format!("(document.body.dataset.saved || '').includes('{name}')"));
    }
    b.wait_for("document.getElementById('message').hidden");
    // A file that cannot be made says why.
    type_into(&mut b, "wavelengths", "500, 600");
    wait_until_final(&mut b);
    b.evaluate("document.querySelector('[data-save=sheet]').click()");
    b.wait_for("document.getElementById('message').innerText.includes('one wavelength')");
    assert_no_errors(&b);
}
