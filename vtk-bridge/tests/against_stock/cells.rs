//! Cells in every array type and storage of VTK, read by the shim's own code in a separate program
//! (`tests/cpp/cell_arrays.cxx`), for each VTK with headers on this machine.

use crate::peers;
use std::path::{Path, PathBuf};
use std::process::Command;
use vtk_bridge::setup::headers::{Flavour, find, places};

/// Libraries of VTK that the program calls.
const MODULES: &[&str] = &[
    "sys",
    "RenderingCore",
    "CommonExecutionModel",
    "CommonDataModel",
    "CommonTransforms",
    "CommonMath",
    "CommonCore",
];

/// The output of the program for this VTK.
fn checked(flavour: &Flavour) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program =
        Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cell_arrays-{}", flavour.name));
    let libraries = MODULES.iter().map(|m| {
        flavour.library(m).unwrap_or_else(|| panic!("VTK {} has no library {m}", flavour.name))
    });
    let made = Command::new(std::env::var_os("CXX").unwrap_or_else(|| "g++".into()))
        .args(["-std=c++17", "-O1", "-w", "-I"])
        .arg(root.join("include"))
        .arg("-I")
        .arg(root.join("cpp"))
        .arg("-isystem")
        .arg(&flavour.include)
        .arg("-o")
        .arg(&program)
        .args([root.join("tests/cpp/cell_arrays.cxx"), root.join("cpp/rtv_arrays.cxx")])
        .arg("-Wl,--allow-shlib-undefined")
        .args(libraries)
        .output()
        .expect("the C++ compiler starts");
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    assert!(made.status.success(), "VTK {}: {}", flavour.name, text(&made.stderr));
    let out = Command::new(&program)
        .env("LD_LIBRARY_PATH", &flavour.libraries)
        .output()
        .expect("the program was compiled");
    let printed = text(&out.stdout) + &text(&out.stderr);
    assert!(out.status.success(), "VTK {}: {:?}\n{printed}", flavour.name, out.status);
    printed
}

#[test]
fn cells_are_read_by_the_width_of_their_own_arrays_in_every_storage() {
    let debian = peers::vtk91().and_then(|root| peers::vtk_headers(&root));
    let known: Vec<PathBuf> =
        debian.into_iter().chain(places(|name| std::env::var(name).ok())).collect();
    let (flavours, _) = find(&known);
    if flavours.is_empty() {
        return peers::skip("no VTK with headers was found (set RTSV_VTK91 or RTV_VTK_INCLUDE)");
    }
    for flavour in &flavours {
        let printed = checked(flavour);
        assert!(
            printed.contains("ok: Int32") && printed.contains("ok: Int64"),
            "VTK {}: {printed}",
            flavour.name
        );
    }
}
