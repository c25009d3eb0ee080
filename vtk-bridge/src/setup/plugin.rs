//! ParaView's plugin: a panel for the options, and the override without `VTK_AUTOLOAD_PATH`. It is
//! compiled like the shim.

use super::headers::Flavour;
use super::layout::Layout;
use super::{SetupError, compile, io};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// The plugin's own sources with their names.
const SOURCES: &[(&str, &str)] = &[
    ("rtv_plugin.cxx", include_str!("../../cpp/plugin/rtv_plugin.cxx")),
    ("rtv_view_options.cxx", include_str!("../../cpp/plugin/rtv_view_options.cxx")),
    ("rtv_view_options.h", include_str!("../../cpp/plugin/rtv_view_options.h")),
    ("rtv_view_properties.h", include_str!("../../cpp/plugin/rtv_view_properties.h")),
];

/// The modules of ParaView and its VTK that the plugin calls.
const MODULES: &[&str] = &[
    "RemotingCore",
    "RemotingClientServerStream",
    "RenderingCore",
    "CommonExecutionModel",
    "CommonCore",
    "sys",
];

/// The plugin's file; ParaView calls the plugin by this name.
const FILE: &str = "VtkBridge.so";

/// Builds the plugin for `flavour` and installs it in its folder. Returns the file.
pub fn install(layout: &Layout, flavour: &Flavour) -> Result<PathBuf, SetupError> {
    let sources = layout.prefix().join("src").join("plugin");
    fs::create_dir_all(&sources).map_err(io(&sources, "make the folder"))?;
    for (name, text) in SOURCES {
        let path = sources.join(name);
        fs::write(&path, text).map_err(io(&path, "write"))?;
    }
    let folder = layout.plugin_folder(&flavour.name);
    fs::create_dir_all(&folder).map_err(io(&folder, "make the folder"))?;
    let out = folder.join(FILE);
    // Build outside the folder, because ParaView tries to load every library in it.
    let beside = layout.prefix().join("VtkBridge.so.new");
    let compiler = compile::compiler();
    let mut command = Command::new(&compiler);
    command.args(["-std=c++17", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-w"]);
    command.arg(format!("-DRTV_FLAVOUR=\"{}\"", flavour.name));
    command.arg("-I").arg(layout.prefix().join("include")).arg("-isystem").arg(&flavour.include);
    command.arg("-o").arg(&beside);
    command.args(SOURCES.iter().filter(|(n, _)| n.ends_with(".cxx")).map(|(n, _)| sources.join(n)));
    // Never unloaded: VTK keeps pointers to its functions after ParaView has closed its plugins.
    command
        .args(["-Wl,--allow-shlib-undefined", "-Wl,-z,nodelete"])
        .args(MODULES.iter().filter_map(|m| flavour.library(m)))
        .arg("-ldl");
    let what = format!("the plugin for ParaView {}", flavour.name.trim_start_matches("pv"));
    compile::run(&mut command, &compiler.to_string_lossy(), what, "apt-get install g++")?;
    fs::rename(&beside, &out).map_err(io(&out, "put in place"))?;
    Ok(out)
}
