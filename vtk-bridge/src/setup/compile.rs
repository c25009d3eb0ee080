//! Compiles the C++ shim. This library contains its sources, and the machine's compiler builds it
//! for each VTK.

use super::headers::Flavour;
use super::{SetupError, io};
use rayon::prelude::*;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The sources with their names.
pub const SOURCES: &[(&str, &str)] = &[
    ("rtv.h", include_str!("../../include/rtv.h")),
    ("rtv_shim.h", include_str!("../../cpp/rtv_shim.h")),
    ("rtv_arrays.h", include_str!("../../cpp/rtv_arrays.h")),
    ("rtv_arrays.cxx", include_str!("../../cpp/rtv_arrays.cxx")),
    ("rtv_blit.cxx", include_str!("../../cpp/rtv_blit.cxx")),
    ("rtv_choice.cxx", include_str!("../../cpp/rtv_choice.cxx")),
    ("rtv_extract.cxx", include_str!("../../cpp/rtv_extract.cxx")),
    ("rtv_factory.cxx", include_str!("../../cpp/rtv_factory.cxx")),
    ("rtv_compositing.h", include_str!("../../cpp/rtv_compositing.h")),
    ("rtv_compositing.cxx", include_str!("../../cpp/rtv_compositing.cxx")),
    ("rtv_glyphs.cxx", include_str!("../../cpp/rtv_glyphs.cxx")),
    ("rtv_renderer.cxx", include_str!("../../cpp/rtv_renderer.cxx")),
    ("rtv_volumes.cxx", include_str!("../../cpp/rtv_volumes.cxx")),
    ("rtv_view.cxx", include_str!("../../cpp/rtv_view.cxx")),
];

/// The modules of VTK that the shim calls.
pub const MODULES: &[&str] = &[
    "RenderingOpenGL2",
    "RenderingCore",
    "FiltersGeometry",
    "CommonExecutionModel",
    "CommonDataModel",
    "CommonTransforms",
    "CommonMath",
    "CommonSystem",
    "CommonCore",
];

/// The library that composites over ranks in floating point, for ParaView only.
const ICET: (&str, &str) = ("rtv_icet.cxx", include_str!("../../cpp/rtv_icet.cxx"));

/// Its file name, in the folder of the shim.
const ICET_FILE: &str = "librtv_icet.so";

/// The modules that it calls.
const ICET_MODULES: &[&str] = &[
    "RemotingViews",
    "RenderingParallel",
    "ParallelCore",
    "IceTCore",
    "RenderingOpenGL2",
    "RenderingCore",
    "CommonMath",
    "CommonCore",
];

/// Writes the sources into `folder`.
pub fn write_sources(folder: &Path) -> Result<(), SetupError> {
    fs::create_dir_all(folder).map_err(io(folder, "make the folder"))?;
    for (name, text) in SOURCES {
        let path = folder.join(name);
        fs::write(&path, text).map_err(io(&path, "write"))?;
    }
    Ok(())
}

/// Compiles the shim for `flavour` into `out`. For ParaView, also compiles the compositing library
/// in the same folder.
pub fn shim(flavour: &Flavour, sources: &Path, out: &Path) -> Result<(), SetupError> {
    let names = SOURCES.iter().map(|(name, _)| *name).filter(|n| n.ends_with(".cxx"));
    let files: Vec<PathBuf> = names.map(|n| sources.join(n)).collect();
    library(flavour, sources, &files, MODULES, out, format!("the shim for VTK {}", flavour.name))?;
    let icet = flavour.include.join("vtkicet/src/include");
    if !flavour.is_paraview() || !icet.is_dir() {
        return Ok(());
    }
    let file = sources.join(ICET.0);
    fs::write(&file, ICET.1).map_err(io(&file, "write"))?;
    let what =
        format!("compositing over ranks for ParaView {}", flavour.name.trim_start_matches("pv"));
    library(flavour, &icet, &[file], ICET_MODULES, &out.with_file_name(ICET_FILE), what)
}

/// Compiles `files`, which call `modules`, into the shared library `out`. `headers` is an
/// additional include folder.
fn library(
    flavour: &Flavour,
    headers: &Path,
    files: &[PathBuf],
    modules: &[&str],
    out: &Path,
    what: String,
) -> Result<(), SetupError> {
    let folder = out.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(io(folder, "make the folder"))?;
    // Build under another name, then rename: a running program keeps the old file.
    let beside = out.with_extension("so.new");
    let compiler = compiler();
    let objects: Vec<PathBuf> = files
        .iter()
        .map(|f| folder.join(f.file_name().unwrap_or_default()).with_extension("o"))
        .collect();
    let compile = |file: &PathBuf, object: &PathBuf| {
        let mut command = Command::new(&compiler);
        command.args(["-std=c++17", "-O2", "-fPIC", "-fvisibility=hidden", "-w", "-c", "-I"]);
        command.arg(headers).arg("-isystem").arg(&flavour.include);
        command.arg(file).arg("-o").arg(object);
        run(&mut command, &compiler.to_string_lossy(), what.clone(), "apt-get install g++")
    };
    let made: Vec<_> = files.par_iter().zip(&objects).map(|(f, o)| compile(f, o)).collect();
    // Report the first error in the order of the files.
    let made: Result<(), SetupError> = made.into_iter().collect();
    let mut command = Command::new(&compiler);
    command.args(["-shared", "-o"]).arg(&beside).args(&objects);
    // VTK's libraries need other VTK libraries, which the process has already loaded. The shim is
    // never unloaded: VTK deletes our factory when the process ends, after ParaView has closed its
    // plugins.
    command.args(["-Wl,--allow-shlib-undefined", "-Wl,-z,nodelete"]);
    command.args(modules.iter().filter_map(|m| flavour.library(m)));
    command.args(["-lGL", "-ldl"]);
    let mut link =
        || run(&mut command, &compiler.to_string_lossy(), what.clone(), "apt-get install g++");
    let linked = made.and_then(|()| link());
    for object in &objects {
        let _ = fs::remove_file(object);
    }
    linked?;
    fs::rename(&beside, out).map_err(io(out, "put in place"))
}

/// The C++ compiler: `CXX`, which may be any path, or g++.
pub(crate) fn compiler() -> OsString {
    std::env::var_os("CXX").filter(|c| !c.is_empty()).unwrap_or_else(|| "g++".into())
}

/// Runs a build command. Its last lines of output are part of the error.
pub(crate) fn run(
    command: &mut Command,
    program: &str,
    what: String,
    cure: &'static str,
) -> Result<(), SetupError> {
    let output = command.output().map_err(|source| SetupError::NoProgram {
        program: program.to_owned(),
        source,
        cure,
    })?;
    if output.status.success() {
        return Ok(());
    }
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().filter(|l| l.contains("rror")).take(15).collect();
    let lines = if lines.is_empty() { text.lines().rev().take(15).collect() } else { lines };
    Err(SetupError::Build { what, output: lines.join("\n"), command: format!("{command:?}") })
}
