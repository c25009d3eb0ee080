//! Processes that outlive `gluray run`.

mod common;

use common::{Run, Xvfb, folder, peer};
use std::path::Path;
use std::time::{Duration, Instant};

#[test]
fn a_child_that_outlives_the_run_finds_its_vendor_of_egl() {
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/survivor.py");
    let place = folder();
    let runtime = place.path().join("runtime");
    let environment = [("XDG_RUNTIME_DIR", runtime.to_str().expect("UTF-8"))];
    let run = Run {
        x: &x,
        folder: place.path(),
        through: Some(&["--via", "vendor"]),
        environment: &environment,
    };
    let (output, _) = run.program(&python, &[script.to_str().expect("UTF-8"), "found"]);
    assert!(output.status.success(), "{output:?}");
    // The run has ended; only now does the child look for a vendor.
    std::fs::write(place.path().join("go"), "").expect("written");
    let found = place.path().join("found");
    // Long enough for a busy machine.
    let end = Instant::now() + Duration::from_secs(120);
    while !found.exists() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(std::fs::read_to_string(&found).expect("the child writes"), "a context of ours");
}
