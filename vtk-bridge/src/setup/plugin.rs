//! ParaView's plugin: built with cmake where ParaView's development files are.

use super::headers::Flavour;
use super::layout::Layout;
use super::{SetupError, compile, io};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// The plugin's own sources, by name.
const SOURCES: &[(&str, &str)] = &[
    ("CMakeLists.txt", include_str!("../../cpp/plugin/CMakeLists.txt")),
    ("RtvBridge/CMakeLists.txt", include_str!("../../cpp/plugin/RtvBridge/CMakeLists.txt")),
    ("RtvBridge/paraview.plugin", include_str!("../../cpp/plugin/RtvBridge/paraview.plugin")),
    ("RtvBridge/rtv_bridge.xml", include_str!("../../cpp/plugin/RtvBridge/rtv_bridge.xml")),
    ("RtvBridge/RtvModule/CMakeLists.txt", include_str!("../../cpp/plugin/RtvBridge/RtvModule/CMakeLists.txt")),
    ("RtvBridge/RtvModule/vtk.module", include_str!("../../cpp/plugin/RtvBridge/RtvModule/vtk.module")),
    ("RtvBridge/RtvModule/vtkRtvSettings.h", include_str!("../../cpp/plugin/RtvBridge/RtvModule/vtkRtvSettings.h")),
    ("RtvBridge/RtvModule/vtkRtvSettings.cxx", include_str!("../../cpp/plugin/RtvBridge/RtvModule/vtkRtvSettings.cxx")),
];

/// Builds the plugin for `flavour` and puts it into its folder. Returns the file.
pub fn install(layout: &Layout, flavour: &Flavour) -> Result<PathBuf, SetupError> {
    let source = layout.prefix().join("src").join("plugin");
    for (name, text) in SOURCES {
        let path = source.join(name);
        let folder = path.parent().unwrap_or(&source);
        fs::create_dir_all(folder).map_err(io(folder, "make the folder"))?;
        fs::write(&path, text).map_err(io(&path, "write"))?;
    }
    compile::write_sources(&source.join("shim"))?;
    let build = layout.prefix().join("src").join(format!("plugin-{}", flavour.name));
    let what = || format!("the plugin for ParaView {}", flavour.name.trim_start_matches("pv"));
    let cure = "apt-get install cmake ninja-build";
    let mut configure = Command::new("cmake");
    configure.arg("-S").arg(&source).arg("-B").arg(&build).arg("-DCMAKE_BUILD_TYPE=Release");
    compile::run(&mut configure, "cmake", what(), cure)?;
    let mut make = Command::new("cmake");
    make.arg("--build").arg(&build);
    compile::run(&mut make, "cmake", what(), cure)?;
    let folder = layout.plugin_folder(&flavour.name);
    fs::create_dir_all(&folder).map_err(io(&folder, "make the folder"))?;
    let made = find(&build, "RtvBridge.so").ok_or_else(|| SetupError::Build {
        what: what(),
        output: "cmake succeeded, but RtvBridge.so is not there".to_owned(),
        command: format!("{make:?}"),
    })?;
    let to = folder.join("RtvBridge.so");
    fs::copy(&made, &to).map_err(io(&to, "write"))?;
    Ok(to)
}

fn find(folder: &std::path::Path, name: &str) -> Option<PathBuf> {
    let entries: Vec<PathBuf> = fs::read_dir(folder).ok()?.filter_map(|e| Some(e.ok()?.path())).collect();
    let here = entries.iter().find(|p| p.is_file() && p.file_name().is_some_and(|n| n == name));
    here.cloned().or_else(|| entries.iter().filter(|p| p.is_dir()).find_map(|p| find(p, name)))
}
