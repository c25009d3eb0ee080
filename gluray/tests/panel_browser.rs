//! The panel's page in a real browser, with a program that uses the link.
//!
//! Needs Chromium (`cargo xtask test` installs Debian's). Without it, the test prints that and
//! passes, unless RTSV_REQUIRE_PEERS is set.
#![cfg(feature = "panel")]

#[path = "../../schlieren/tests/serving/browser.rs"]
mod browser;
mod panel_common;

use browser::{Browser, chromium};
use gluray::config::{Mode, Quality, Surface};
use panel_common::{Fake, Panel};
use std::io::Write as _;

/// Saves a screenshot where the person who runs the test requests it.
fn look(b: &mut Browser, name: &str) {
    let picture = b.screenshot();
    if let Some(folder) = std::env::var_os("RTSV_SCREENSHOTS") {
        std::fs::write(
            std::path::PathBuf::from(folder).join(format!("panel-{name}.png")),
            &picture,
        )
        .unwrap();
    }
    assert!(picture.len() > 10_000, "a picture with something on it");
}

/// Sets a control as a user does.
fn set(b: &mut Browser, path: &str, value: &str) {
    b.evaluate(&format!(
        "(() => {{ const e = document.querySelector('[data-path=\"{path}\"] \
         input:not([type=range]), [data-path=\"{path}\"] select'); if (e.type === 'checkbox') {{ \
         if (String(e.checked) !== '{value}') e.click(); return; }} e.value = '{value}'; \
         e.dispatchEvent(new Event('input', {{ bubbles: true }})); e.dispatchEvent(new \
         Event('change', {{ bubbles: true }})); }})()"
    ));
}

fn text(b: &mut Browser, id: &str) -> String {
    b.evaluate(&format!("document.getElementById('{id}').innerText")).as_str().unwrap().to_owned()
}

#[test]
fn programs_appear_are_changed_live_and_show_what_it_costs() {
    let program = match chromium() {
        Ok(program) => program,
        Err(why) => {
            assert!(
                std::env::var_os("RTSV_REQUIRE_PEERS").is_none(),
                "Chromium is required: {why}"
            );
            // Not `eprintln!`: libtest captures it.
            let _ = writeln!(std::io::stderr(), "skipped: {why}");
            return;
        }
    };
    let scenes = tempfile::tempdir().unwrap();
    let p = Panel::start();
    let mut b = Browser::open(&program, &p.url());
    b.wait_for(
        "document.readyState === 'complete' && document.body.innerText.includes('No program yet')",
    );

    // A program that starts later appears automatically, with its numbers.
    let gmsh = Fake::start("gmsh", p.endpoint(), scenes.path());
    b.wait_for(
        "document.querySelectorAll('nav button').length === 1 && \
                document.querySelector('nav button').innerText.startsWith('gmsh')",
    );
    b.wait_for("Number(document.getElementById('times').dataset.frames) > 8");
    for word in ["frames per second", "1024 × 1024", "match", "1.40 M"] {
        assert!(text(&mut b, "numbers").contains(word), "{word}: {}", text(&mut b, "numbers"));
    }
    assert!(text(&mut b, "reasons").contains("lines and points"));
    assert!(
        b.evaluate(
            "document.querySelector('[data-path=\"effects.shadows\"]').classList.contains('idle')"
        ) == true,
        "no shadows in mode match, and the page shows it"
    );
    let before = text(&mut b, "rays-legend");
    assert!(before.contains("primary") && !before.contains("occlusion"), "{before}");

    // Mode, effect, quality, switch and light all arrive; the cost is shown.
    set(&mut b, "mode", "rich");
    gmsh.until(|s| s.mode == Mode::Rich);
    set(&mut b, "effects.ambient_occlusion_samples", "64");
    set(&mut b, "quality", "best");
    set(&mut b, "effects.shadows", "false");
    set(&mut b, "lights.added", "0.7");
    set(&mut b, "material.mirror", "0.25");
    gmsh.until(|s| {
        s.effects.ambient_occlusion_samples == 64
            && s.quality == Quality::Best
            && !s.effects.shadows
            && s.lights.added == 0.7
            && s.material.mirror == Some(0.25)
    });
    b.wait_for(
        "document.getElementById('rays-legend').innerText.includes('ambient occlusion') && \
                document.getElementById('numbers').innerText.includes('rich')",
    );
    b.wait_for("document.querySelector('[data-path=\"effects.shadows\"]').classList.contains('changed') && !document.querySelector('[data-path=\"effects.shadows\"]').classList.contains('idle')");
    assert!(
        b.evaluate(
            "document.querySelector('[data-path=\"effects.ambient_occlusion_samples\"] \
                    input').value"
        ) == "64"
    );
    // So that the charts have data.
    b.wait_for("Number(document.getElementById('times').dataset.frames) > 30");
    look(&mut b, "rich");

    // One object becomes glass of another colour; all others are unchanged.
    assert_eq!(b.evaluate("document.querySelectorAll('.object').length"), 30);
    b.evaluate("document.querySelector('.object').click()");
    let key = b
        .evaluate("document.querySelector('.object[aria-pressed=true]').dataset.key")
        .as_str()
        .unwrap()
        .to_owned();
    set(&mut b, &format!("objects.{key}.surface"), "glass");
    set(&mut b, &format!("objects.{key}.color"), "#ff8000");
    gmsh.until(|s| {
        s.material_of(&key).surface == Some(Surface::Glass)
            && s.material_of(&key)
                .color
                .is_some_and(|c| c[0] == 1.0 && (c[1] - 0.502).abs() < 0.001)
    });
    assert_eq!(gmsh.settings().material_of("other").surface, None);
    b.wait_for("document.querySelectorAll('.object.changed').length === 1");
    look(&mut b, "object");

    // One change is undone, then the object, then all.
    b.evaluate("document.querySelector('[data-path=\"material.mirror\"] .undo').click()");
    gmsh.until(|s| s.material.mirror.is_none() && s.mode == Mode::Rich);
    b.evaluate("document.getElementById('object-reset').click()");
    gmsh.until(|s| s.objects.is_empty());

    // Invalid input is reported on the page and changes nothing.
    set(&mut b, "samples", "0");
    b.wait_for(
        "document.getElementById('message').innerText.includes('`samples` is 0; give a \
                whole number from 1 to 4096')",
    );
    assert_eq!(gmsh.settings().samples, 1);
    set(&mut b, "samples", "2");
    gmsh.until(|s| s.samples == 2);
    b.wait_for("document.getElementById('message').hidden");

    // Exports the scene and the changes as files.
    b.evaluate("document.getElementById('export').click()");
    b.wait_for("document.getElementById('exported').innerText.startsWith('written: ')");
    assert_eq!(std::fs::read_dir(scenes.path()).unwrap().count(), 1);
    let toml = b
        .evaluate("fetch(document.getElementById('toml').href).then(r => r.text())")
        .as_str()
        .unwrap()
        .to_owned();
    assert!(
        toml.contains("[program.gmsh]")
            && toml.contains("mode = \"rich\"")
            && toml.contains("samples = 2"),
        "{toml}"
    );

    // A second program has its own settings; the end of the first one is noticed, and switching off
    // takes one click.
    let octave = Fake::start("octave", p.endpoint(), scenes.path());
    b.wait_for("document.querySelectorAll('nav button').length === 2");
    b.evaluate("document.querySelectorAll('nav button')[1].click()");
    b.wait_for(
        "document.querySelector('nav \
                button[aria-selected=true]').innerText.startsWith('octave') && \
                document.querySelector('[data-path=mode] select').value === 'match'",
    );
    set(&mut b, "enabled", "false");
    octave.until(|s| !s.enabled);
    assert!(gmsh.settings().enabled && gmsh.settings().mode == Mode::Rich);
    b.wait_for("!document.getElementById('reset').disabled");
    b.evaluate("document.getElementById('reset').click()");
    octave.until(|s| s.enabled);
    drop(gmsh);
    b.wait_for("document.querySelector('nav button').classList.contains('ended')");
    look(&mut b, "two-programs");

    // Only the requests that were rejected on purpose may cause errors.
    let others: Vec<&String> = b.page_errors.iter().filter(|c| !c.contains("422")).collect();
    assert!(others.is_empty(), "{others:?}");
    drop(p);
    b.wait_for("!document.getElementById('lost').hidden");
}
