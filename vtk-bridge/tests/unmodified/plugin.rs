//! ParaView's plugin: built, found through PV_PLUGIN_PATH, and its panel's properties set from a script.

use crate::peers::{Program, Run, peers};
use std::process::Command;

#[test]
fn the_panel_s_properties_change_the_picture() {
    let Some(peers) = peers() else { return };
    let mut install = Command::new(env!("CARGO_BIN_EXE_vtk-bridge"));
    install.args(["install", "--quiet", "--plugin", "--prefix"]).arg(peers.out.join("plugin home"));
    let output = install.output().expect("vtk-bridge runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let home = peers.out.join("plugin home");
    let file = crate::peers::scripts().join("paraview/panel.py");
    let run = Run::plain()
        .with("PV_PLUGIN_PATH", home.join("plugins/pv5.11").display())
        .with("RTV_HOME", home.display());
    let output = peers.python(Program::ParaView, &run, &[file.to_str().expect("UTF-8")]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("survived"), "{said}");
}
