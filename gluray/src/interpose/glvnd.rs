//! Finds the vendor's driver that GLVND would take without us.
//!
//! GLX (libglvnd 1.6, `src/GLX/libglxmapping.c`): `__GLX_FORCE_VENDOR_LIBRARY_n` for screen n,
//! `__GLX_VENDOR_LIBRARY_NAME`, the names that the X server gives for the screen
//! (`GLX_EXT_libglvnd`), `indirect`. EGL (`src/EGL/libeglvendor.c`): the files named in
//! `__EGL_VENDOR_LIBRARY_FILENAMES`, or those in the folders of `__EGL_VENDOR_LIBRARY_DIRS` in the
//! order of their names. All of them are loaded, and the first that accepts a display gets it.

mod server;

use std::path::{Path, PathBuf};

/// A driver that may be taken, and the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vendor {
    /// `mesa` of `libGLX_mesa.so.0`. For EGL, the name or the path of a library.
    pub name: String,
    /// The source of the name.
    pub why: String,
}

/// Our own variables, in which `gluray run` keeps the former values of GLVND's.
const OURS: &str = "gluray";
/// The folders of EGL vendors' files in GLVND as distributions build it.
const EGL_FOLDERS: &str = "/etc/glvnd/egl_vendor.d:/usr/share/glvnd/egl_vendor.d";

fn vendor(name: &str, why: impl Into<String>) -> Option<Vendor> {
    let is_other = !name.is_empty() && !name.contains(OURS);
    is_other.then(|| Vendor { name: name.to_owned(), why: why.into() })
}

/// The number of the screen in `:7.1`; 0 without one.
pub(crate) fn screen_of(display: &str) -> u32 {
    let number = display.rsplit_once(':').map_or("", |(_, n)| n);
    number.split_once('.').and_then(|(_, screen)| screen.parse().ok()).unwrap_or(0)
}

/// The GLX vendors in the order in which they are tried. `get` reads variables.
pub fn glx_vendors(get: impl Fn(&str) -> Option<String>) -> Vec<Vendor> {
    let display = get("DISPLAY").unwrap_or_default();
    let names = if display.is_empty() {
        Err("DISPLAY is not set".into())
    } else {
        let authority = get("XAUTHORITY").map(PathBuf::from);
        let authority =
            authority.or_else(|| get("HOME").map(|h| Path::new(&h).join(".Xauthority")));
        server::vendor_names(&display, authority.as_deref())
    };
    glx_order(get, &display, names)
}

fn glx_order(
    get: impl Fn(&str) -> Option<String>,
    display: &str,
    names: Result<Vec<String>, String>,
) -> Vec<Vendor> {
    // `gluray run` keeps in our variables what it replaces in GLVND's.
    let forced = format!("__GLX_FORCE_VENDOR_LIBRARY_{}", screen_of(display));
    let variables = ["GLURAY_GLX_VENDOR", forced.as_str(), "__GLX_VENDOR_LIBRARY_NAME"];
    let mut out: Vec<Vendor> = variables
        .iter()
        .filter_map(|v| vendor(&get(v)?, format!("the variable {v} names it")))
        .collect();
    let without = match names {
        Ok(names) => {
            let why = format!("the X server at {display} names it for the screen");
            out.extend(names.iter().filter_map(|n| vendor(n, why.as_str())));
            format!("the X server at {display} names no vendor that is here")
        }
        Err(why) => format!("no X server names a vendor ({why})"),
    };
    for name in ["indirect", "mesa"] {
        out.extend(vendor(name, format!("{without}; GLVND takes this then")));
    }
    out
}

/// The libraries of EGL vendors in the order in which they are asked for a display. `get` reads
/// variables.
pub fn egl_vendors(get: impl Fn(&str) -> Option<String>) -> Vec<Vendor> {
    if let Some(names) = get("GLURAY_EGL_VENDOR").filter(|v| !v.is_empty()) {
        let why = "the variable GLURAY_EGL_VENDOR names it";
        return names.split(':').filter_map(|n| vendor(n, why)).collect();
    }
    let of_variable = |name: &str| get(name).filter(|v| !v.is_empty());
    let files: Vec<PathBuf> = match of_variable("__EGL_VENDOR_LIBRARY_FILENAMES") {
        Some(files) => files.split(':').map(PathBuf::from).collect(),
        None => {
            let folders =
                of_variable("__EGL_VENDOR_LIBRARY_DIRS").unwrap_or_else(|| EGL_FOLDERS.to_owned());
            folders.split(':').flat_map(|folder| files_in(Path::new(folder))).collect()
        }
    };
    files.iter().filter_map(|file| of_file(file)).collect()
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let is_json = |p: &PathBuf| p.extension().is_some_and(|e| e == "json");
    let mut files: Vec<PathBuf> = entries.map(|e| e.path()).filter(is_json).collect();
    files.sort();
    files
}

/// The library that a vendor's file names. `None` when GLVND would skip the file.
fn of_file(file: &Path) -> Option<Vendor> {
    let text = std::fs::read_to_string(file).ok()?;
    let json: serde_json::Value = serde_json::from_str(&text).ok()?;
    json["file_format_version"].as_str().filter(|v| v.starts_with("1.0."))?;
    let library = json["ICD"]["library_path"].as_str()?;
    // With a slash, but not at its beginning, the path is relative to the file.
    let path = match library.contains('/') && !library.starts_with('/') {
        true => file.parent()?.join(library).to_str()?.to_owned(),
        false => library.to_owned(),
    };
    vendor(&path, format!("{} names it", file.display()))
}

/// The library of an EGL vendor by name (`mesa`), or the path itself.
pub(crate) fn egl_library(name: &str) -> String {
    if name.contains('/') || name.contains(".so") {
        name.to_owned()
    } else {
        format!("libEGL_{name}.so.0")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(all: &[Vendor]) -> Vec<&str> {
        all.iter().map(|v| v.name.as_str()).collect()
    }

    fn of<'a>(variables: &'a [(&'a str, &'a str)]) -> impl Fn(&str) -> Option<String> + 'a {
        |name| variables.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned())
    }

    #[test]
    fn glx_vendors_come_by_the_screens_variable_by_the_variable_and_by_the_server() {
        let server = || Ok(vec!["nvidia".to_owned(), "mesa".to_owned()]);
        let all = [
            ("__GLX_FORCE_VENDOR_LIBRARY_1", "forced"),
            ("__GLX_FORCE_VENDOR_LIBRARY_0", "other"),
            ("__GLX_VENDOR_LIBRARY_NAME", "named"),
        ];
        let order = glx_order(of(&all), ":3.1", server());
        assert_eq!(names(&order), ["forced", "named", "nvidia", "mesa", "indirect", "mesa"]);
        assert_eq!(names(&glx_order(of(&all[2..]), ":3", server()))[..2], ["named", "nvidia"]);
        let by_server = glx_order(of(&[]), ":3", server());
        assert_eq!(names(&by_server), ["nvidia", "mesa", "indirect", "mesa"]);
        assert!(by_server[0].why.contains("X server at :3"), "{}", by_server[0].why);
        let alone =
            glx_order(of(&[("__GLX_VENDOR_LIBRARY_NAME", "gluray")]), ":3", Err("no GLX".into()));
        assert_eq!(names(&alone), ["indirect", "mesa"]);
        assert!(alone[0].why.contains("no GLX"), "{}", alone[0].why);
        let ours = glx_order(of(&[("GLURAY_GLX_VENDOR", "asked")]), ":3", server());
        assert_eq!(names(&ours)[..2], ["asked", "nvidia"]);
    }

    #[test]
    fn egl_vendors_come_by_files_in_the_order_of_folders_and_names() {
        let place = tempfile::tempdir().expect("a folder");
        let file = |folder: &str, name: &str, library: &str, version: &str| {
            let at = place.path().join(folder);
            std::fs::create_dir_all(&at).expect("a folder");
            let json = serde_json::json!({
                "file_format_version": version, "ICD": { "library_path": library }
            });
            std::fs::write(at.join(name), json.to_string()).expect("a file");
        };
        file("a", "50_mesa.json", "libEGL_mesa.so.0", "1.0.0");
        file("a", "10_nvidia.json", "libEGL_nvidia.so.0", "1.0.0");
        file("a", "20_later.json", "libEGL_later.so.0", "2.0.0");
        file("a", "30_text.txt", "libEGL_text.so.0", "1.0.0");
        file("b", "00_first.json", "./libEGL_beside.so", "1.0.1");
        let at = |name: &str| place.path().join(name).to_str().expect("UTF-8").to_owned();
        let folders = format!("{}:{}:/nowhere", at("a"), at("b"));
        let found = egl_vendors(of(&[("__EGL_VENDOR_LIBRARY_DIRS", &folders)]));
        let beside = at("b/./libEGL_beside.so");
        assert_eq!(names(&found), ["libEGL_nvidia.so.0", "libEGL_mesa.so.0", beside.as_str()]);
        assert!(found[0].why.contains("10_nvidia.json"), "{}", found[0].why);
        let files = format!("{}:{}", at("b/00_first.json"), at("a/10_nvidia.json"));
        let both = [
            ("__EGL_VENDOR_LIBRARY_DIRS", folders.as_str()),
            ("__EGL_VENDOR_LIBRARY_FILENAMES", &files),
        ];
        assert_eq!(names(&egl_vendors(of(&both))), [beside.as_str(), "libEGL_nvidia.so.0"]);
        let named = egl_vendors(of(&[("GLURAY_EGL_VENDOR", "mesa:/opt/libEGL_x.so")]));
        assert_eq!(names(&named), ["mesa", "/opt/libEGL_x.so"]);
        assert_eq!(egl_library("mesa"), "libEGL_mesa.so.0");
    }

    #[test]
    fn screens_are_those_of_displays() {
        let screens = [":7", ":7.1", "host:0.2", "", "unix:3"].map(screen_of);
        assert_eq!(screens, [0, 1, 2, 0, 0]);
    }
}
