//! ParaView's plugin, compiled like the shim: with ParaView's headers and nothing else.

use super::headers::Flavour;
use super::layout::Layout;
use super::{SetupError, compile, io};
use std::fs;
use std::path::PathBuf;

/// The page of settings, for ParaView and its Python.
const PANEL: &str = include_str!("../../cpp/plugin/rtv_panel.xml");

/// Builds the plugin for `flavour` and puts it into its folder. Returns the file.
pub fn install(layout: &Layout, flavour: &Flavour) -> Result<PathBuf, SetupError> {
    let sources = layout.prefix().join("src");
    compile::write_sources(&sources)?;
    let panel = format!("static const char* const RtvPanelXML = R\"xml({PANEL})xml\";\n");
    for (name, text) in
        [("rtv_plugin.cxx", include_str!("../../cpp/plugin/rtv_plugin.cxx")), ("rtv_panel.h", &panel)]
    {
        let path = sources.join(name);
        fs::write(&path, text).map_err(io(&path, "write"))?;
    }
    let out = layout.plugin_folder(&flavour.name).join("RtvBridge.so");
    let modules = ["RemotingCore", "RemotingClientServerStream"];
    let what = format!("the plugin for ParaView {}", flavour.name.trim_start_matches("pv"));
    compile::library(flavour, &sources, &[sources.join("rtv_plugin.cxx")], &modules, &out, what)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::PANEL;

    #[test]
    fn every_property_of_the_panel_has_its_command_and_the_same_default() {
        let code = include_str!("../../cpp/plugin/rtv_plugin.cxx");
        let mut properties = 0;
        for line in PANEL.lines().filter(|l| l.contains("command=\"")) {
            let value = |key: &str| line.split(&format!("{key}=\"")).nth(1)?.split('"').next();
            let (command, default) =
                (value("command").expect("a command"), value("default_values").expect("a default"));
            let entry = code
                .lines()
                .find(|l| l.contains(&format!("\"{command}\"")))
                .unwrap_or_else(|| panic!("{command}"));
            let written = entry.split(", ").nth(2).expect("a default");
            assert_eq!(written.parse::<f64>(), default.parse::<f64>(), "{command}");
            let option = entry.split('"').nth(3).expect("an option");
            assert!(crate::options::NAMES.iter().any(|(n, ..)| *n == option), "{option}");
            properties += 1;
        }
        assert_eq!(properties, code.matches("{ \"Set").count());
    }
}
