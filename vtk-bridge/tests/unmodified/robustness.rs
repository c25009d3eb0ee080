//! What programs do to renderers, and data that are no data: nothing crashes, and what can be shown is shown.

use crate::peers::{Program, Run, peers};

/// Runs a script that checks itself and prints `survived`.
fn survives(program: Program, script: &str, run: &Run) {
    let Some(peers) = peers() else { return };
    let file = crate::peers::scripts().join(format!("{script}.py"));
    let output = peers.python(program, run, &[file.to_str().expect("UTF-8")]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("survived"), "{script}: {:?}\n{said}", output.status);
    assert!(!said.contains("internal error"), "{said}");
}

#[test]
fn nan_points_empty_inputs_and_changing_topology() {
    survives(Program::Vtk, "robustness/strange_data", &Run::traced());
}

#[test]
fn five_hundred_actors_deleted_renderers_two_windows_one_pixel_and_8k() {
    survives(Program::Vtk, "robustness/windows", &Run::traced());
}

#[test]
fn domain_sizes_from_1e_minus_20_to_1e20_and_far_origins_show_the_same_picture() {
    survives(Program::Vtk, "robustness/scales", &Run::traced());
}

#[test]
fn only_changed_arrays_are_built_anew() {
    let Some(peers) = peers() else { return };
    let report = peers.out.join("rebuilds.json");
    survives(Program::Vtk, "robustness/rebuilds", &Run::traced().with("RTV_REPORT", report.display()));
}
