//! Reports what is installed, what is missing, and how to fix it.

use super::headers::{Flavour, find, places};
use super::layout::{Layout, library};
use serde::Serialize;
use std::process::Command;

/// The result of one check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was checked.
    pub what: String,
    /// True if it is correct.
    pub ok: bool,
    /// The finding and the cure.
    pub text: String,
}

fn finding(what: &str, ok: bool, text: impl Into<String>) -> Finding {
    Finding { what: what.to_owned(), ok, text: text.into() }
}

/// Runs all checks.
pub fn examine(layout: &Layout, variable: impl Fn(&str) -> Option<String>) -> Vec<Finding> {
    let mut out = Vec::new();
    let (flavours, faults) = find(&places(&variable));
    for f in &flavours {
        out.push(of_flavour(layout, f));
    }
    out.extend(faults.iter().map(|f| finding("headers", true, format!("not used: {f}"))));
    if flavours.is_empty() {
        out.push(finding(
            "headers",
            false,
            "none of VTK or ParaView; install libvtk9-dev, or paraview-dev and libglew-dev",
        ));
    }
    let compiler = variable("CXX").unwrap_or_else(|| "g++".to_owned());
    let version =
        Command::new(&compiler).arg("--version").output().ok().filter(|o| o.status.success());
    out.push(match version {
        Some(o) => finding(
            "compiler",
            true,
            String::from_utf8_lossy(&o.stdout).lines().next().unwrap_or("").to_owned(),
        ),
        None => {
            finding("compiler", false, format!("`{compiler}` does not run; apt-get install g++"))
        }
    });
    if let Some(f) = flavours.iter().find(|f| needs_glew(f)) {
        let glew = ["/usr/include/GL/glew.h", "/usr/local/include/GL/glew.h"]
            .iter()
            .any(|p| std::path::Path::new(p).is_file());
        let missing = format!(
            "missing: the headers in {} include it; apt-get install libglew-dev",
            f.include.display()
        );
        out.push(finding("GL/glew.h", glew, if glew { "there".to_owned() } else { missing }));
    }
    out.push(match library() {
        Ok(path) if layout.loader_is(&path) => {
            finding("loader", true, layout.loader().display().to_string())
        }
        Ok(_) if layout.loader().is_file() => {
            finding("loader", false, "older than this program; run `vtk-bridge install`")
        }
        Ok(_) => finding("loader", false, "not installed; run `vtk-bridge install`"),
        Err(e) => finding("loader", false, e.to_string()),
    });
    let path = variable("VTK_AUTOLOAD_PATH").unwrap_or_default();
    let ours = layout.autoload();
    out.push(if path.split(':').any(|p| std::path::Path::new(p) == ours) {
        finding("VTK_AUTOLOAD_PATH", true, "has our folder")
    } else {
        finding(
            "VTK_AUTOLOAD_PATH",
            true,
            "does not have our folder: scripts are not ray traced \
                                            in this shell; `eval \"$(vtk-bridge env --vtk)\"`",
        )
    });
    out.push(match variable("DISPLAY").filter(|d| !d.is_empty()) {
        Some(d) => finding("DISPLAY", true, d),
        None => finding(
            "DISPLAY",
            true,
            "not set: Debian's VTK and ParaView need an X server; `Xvfb :9 -noreset & export \
             DISPLAY=:9`",
        ),
    });
    let (_, faults) = crate::options::Options::parse(
        crate::options::NAMES.iter().filter_map(|(n, ..)| Some(((*n).to_owned(), variable(n)?))),
    );
    out.extend(faults.into_iter().map(|f| finding("options", false, f)));
    out
}

/// True where VTK's own header for OpenGL asks for the system's GLEW. VTK may bring a GLEW of its
/// own, and since 9.4 it uses GLAD.
fn needs_glew(f: &Flavour) -> bool {
    let text = std::fs::read_to_string(f.include.join("vtk_glew.h")).unwrap_or_default();
    text.contains("VTK_MODULE_USE_EXTERNAL_vtkglew 1")
}

fn of_flavour(layout: &Layout, f: &Flavour) -> Finding {
    let name = if f.is_paraview() {
        format!("ParaView {}", &f.name[2..])
    } else {
        format!("VTK {}", f.name)
    };
    let shim = layout.shim(&f.name);
    let age = |p: &std::path::Path| std::fs::metadata(p).and_then(|m| m.modified()).ok();
    let text = match (age(&shim), age(&f.include.join("vtkVersionMacros.h"))) {
        (None, _) => {
            return finding(
                &name,
                false,
                format!(
                    "headers in {}, but no build; run `vtk-bridge install`",
                    f.include.display()
                ),
            );
        }
        (Some(built), Some(headers)) if headers > built => {
            return finding(
                &name,
                false,
                "its headers are newer than our build; run `vtk-bridge install`",
            );
        }
        _ => shim.display().to_string(),
    };
    finding(&name, true, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glew_is_asked_for_only_where_headers_include_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let include = folder.path().to_owned();
        let vtk = Flavour { name: "9.9".to_owned(), include, libraries: "/nowhere".into() };
        assert!(!needs_glew(&vtk), "GLAD");
        for (number, needed) in [("0", false), ("1", true)] {
            let text = format!("#define VTK_MODULE_USE_EXTERNAL_vtkglew {number}\n");
            std::fs::write(vtk.include.join("vtk_glew.h"), text).expect("written");
            assert_eq!(needs_glew(&vtk), needed);
        }
    }
}
