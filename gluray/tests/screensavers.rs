//! xscreensaver's hacks, which use many kinds of fixed function. Each must give the driver's image,
//! traced or passed through.

mod common;

use common::metrics::compare;
use common::{Picture, Run, Xvfb, folder, peer};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Name, tested frame, and whether rays must draw some of it. What the driver alone draws must be
/// equal bit for bit.
const HACKS: &[(&str, &str, bool)] = &[
    // Lists with names from glGenLists and state between their primitives.
    ("gears", "3", true),
    // Fog; quads of which some are clipped.
    ("atunnel", "4", true),
    // Quads in lists, textures without lighting.
    ("blocktube", "3", false),
    // Arrays in lists between lines without normals.
    ("handsy", "3", false),
    // A texture that is bound right after a draw with another.
    ("sballs", "2", true),
    // Hundreds of objects around and behind the viewer.
    ("flyingtoasters", "25", true),
    // Ten thousand triangles, each with a matrix of its own.
    ("splodesic", "2", true),
    ("engine", "3", true),
    ("geodesic", "3", true),
    ("voronoi", "3", true),
    ("superquadrics", "3", true),
];

fn clock(place: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/stopped_clock.c");
    let library = place.join("stopped_clock.so");
    let mut compiler = Command::new("cc");
    compiler.args(["-O1", "-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl");
    let output = compiler.output().expect("a C compiler, which the package g++ brings");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    library
}

#[test]
fn screensavers_draw_the_drivers_images() {
    let (Some(gears), Some(_)) = (peer("RTSV_XSCREENSAVER"), peer("RTSV_XSCREENSAVER_EXTRA"))
    else {
        return;
    };
    let Some(x) = Xvfb::start() else { return };
    let place = folder();
    let clock = clock(place.path());
    let mut faults = Vec::new();
    for (name, frame, traced) in HACKS {
        let run = |through, out: &str| {
            let out = place.path().join(out);
            // Preloaded into the hack alone, by env(1), not into gluray.
            let preload = format!("LD_PRELOAD={}", clock.display());
            let hack = gears.with_file_name(name);
            let (hack, out_text) = (hack.to_str().expect("UTF-8"), out.to_str().expect("UTF-8"));
            let environment = [("OUT", out_text), ("FRAME", *frame), ("HOME", "/nonexistent")];
            let run = Run { x: &x, folder: place.path(), through, environment: &environment };
            let arguments = [&preload, hack, "-geometry", "640x480"];
            let (_, report) = run.program(Path::new("/usr/bin/env"), &arguments);
            (Picture::read(&out), report)
        };
        let (native, _) = run(None, &format!("{name}-native.ppm"));
        let (ours, report) = run(Some(&[]), &format!("{name}-ours.ppm"));
        let m = compare(&native, &ours);
        let good = m.raw <= 0.2 && m.tolerant <= 0.02 && m.interior <= 1.0 && m.interior_p99 <= 4.0;
        let same = native.pixels == ours.pixels;
        if !good || (report.traced_draws > 0) != *traced || !(same || *traced) {
            faults
                .push(format!("{name}: {m:?}, {} draws traced, same: {same}", report.traced_draws));
        }
    }
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}
