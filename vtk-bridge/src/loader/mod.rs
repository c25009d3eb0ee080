//! The library that VTK finds through `VTK_AUTOLOAD_PATH`. It has three functions, and it loads the
//! C++ shim that was built for the VTK in the process.
//!
//! VTK opens every shared library in that folder and asks for its version before it calls
//! `vtkLoad`. A shim linked to one VTK would load that VTK's libraries into a process that runs
//! another VTK, even before VTK asks for the version (observed: ParaView 5.11 crashes when Debian's
//! VTK 9.1 is installed). The folder therefore contains only this library. It needs no VTK, detects
//! which one is loaded, and opens the matching shim.
#![allow(unsafe_code, reason = "symbols that VTK calls, and dlopen")]

mod process;

use crate::capi::guarded;
use std::ffi::{CStr, CString, c_void};
use std::os::raw::c_char;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Name of the shim's file, in a folder named like its flavour of VTK.
pub const SHIM: &str = "librtv_shim.so";

/// Functions of a loaded shim.
struct Shim {
    version: unsafe extern "C" fn() -> *const c_char,
    load: unsafe extern "C" fn() -> *mut c_void,
}

/// The shim for this process, or a message for the user. VTK prints the message as the "version"
/// that it rejects.
fn shim() -> Result<&'static Shim, &'static CStr> {
    static SHIM_OR_REASON: OnceLock<Result<Shim, CString>> = OnceLock::new();
    let found = SHIM_OR_REASON.get_or_init(|| {
        find_and_load().map_err(|reason| {
            use std::io::Write;
            let _ = writeln!(std::io::stderr().lock(), "vtk-bridge: not ray tracing: {reason}");
            CString::new(format!("none, because: {reason}").replace('\0', " ")).unwrap_or_default()
        })
    });
    found.as_ref().map_err(CString::as_c_str)
}

fn find_and_load() -> Result<Shim, String> {
    let modules = process::loaded_files();
    let flavours: Vec<String> = modules.iter().filter_map(|m| flavour_of(m)).collect();
    let home = home().ok_or(
        "cannot find out where this library lies; set RTV_HOME to the folder of `vtk-bridge \
         install`",
    )?;
    let (flavour, path) = choose(&flavours, &home, |p| p.is_file())?;
    process::open_shim(&path).map_err(|e| {
        format!(
            "the build for VTK {flavour}, {}, cannot be used: {e}; run `vtk-bridge install` again",
            path.display()
        )
    })
}

/// Chooses, of the VTK versions in the process, the one for which a shim is installed.
fn choose(
    flavours: &[String],
    home: &Path,
    exists: impl Fn(&Path) -> bool,
) -> Result<(String, PathBuf), String> {
    if flavours.is_empty() {
        return Err("no VTK in this process (no libvtkCommonCore is loaded)".to_owned());
    }
    let candidates: Vec<_> =
        flavours.iter().map(|f| (f.clone(), home.join("lib").join(f).join(SHIM))).collect();
    candidates.iter().find(|(_, p)| exists(p)).cloned().ok_or_else(|| {
        let (f, p) = &candidates[0];
        format!(
            "this is VTK {f}, and there is no build for it at {}; run `vtk-bridge install` (it \
             needs the headers of this VTK; for a VTK \
             from pip there are none: use `python -m rtvtk script.py`)",
            p.display()
        )
    })
}

/// `9.1` of `…/libvtkCommonCore-9.1.so.1`, `pv5.11` of ParaView's; `None` for other files.
pub fn flavour_of(file: &str) -> Option<String> {
    let name = file.rsplit('/').next()?;
    let rest = name.strip_prefix("libvtkCommonCore")?;
    let (flavour, _) = rest.split_once(".so")?;
    if flavour.is_empty() {
        return Some("unnamed".to_owned());
    }
    // Other libraries have names that start with the same letters.
    flavour.strip_prefix('-').map(str::to_owned)
}

/// The folder of `vtk-bridge install`: `RTV_HOME`, or the parent of this library's folder.
fn home() -> Option<PathBuf> {
    if let Some(set) = std::env::var_os("RTV_HOME").filter(|v| !v.is_empty()) {
        return Some(set.into());
    }
    Some(process::own_file()?.parent()?.parent()?.to_owned())
}

/// Answers VTK's query for the VTK version of this build: the shim's answer, or one that no VTK
/// accepts, with the reason.
#[allow(non_snake_case, reason = "VTK's name")]
#[unsafe(no_mangle)]
pub extern "C" fn vtkGetFactoryVersion() -> *const c_char {
    match guarded(Err(INTERNAL), shim) {
        // SAFETY: the shim's own function of this signature, which returns a literal.
        Ok(s) => unsafe { (s.version)() },
        Err(reason) => reason.as_ptr(),
    }
}

/// The answer after a panic, which was reported.
const INTERNAL: &CStr = c"none, because of an internal error of vtk-bridge";

/// Answers the query for the compiler, of VTK before 9.1. The shim is compiled on the machine where
/// it runs.
#[allow(non_snake_case, reason = "VTK's name")]
#[unsafe(no_mangle)]
pub extern "C" fn vtkGetFactoryCompilerUsed() -> *const c_char {
    c"c++".as_ptr()
}

/// The object factory, or null without a shim. VTK does not ask for it in that case.
#[allow(non_snake_case, reason = "VTK's name")]
#[unsafe(no_mangle)]
pub extern "C" fn vtkLoad() -> *mut c_void {
    match guarded(Err(INTERNAL), shim) {
        // SAFETY: the shim's own function of this signature; VTK takes over the factory.
        Ok(s) => unsafe { (s.load)() },
        Err(_) => std::ptr::null_mut(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flavours_are_read_from_file_names() {
        assert_eq!(
            flavour_of("/usr/lib/x86_64-linux-gnu/libvtkCommonCore-9.1.so.1").as_deref(),
            Some("9.1")
        );
        assert_eq!(flavour_of("/x/libvtkCommonCore-pv5.11.so.1").as_deref(), Some("pv5.11"));
        assert_eq!(flavour_of("libvtkCommonCore.so").as_deref(), Some("unnamed"));
        assert_eq!(flavour_of("/x/libvtkCommonCorePython3.11-9.1.so"), None);
        assert_eq!(flavour_of("/x/libvtkRenderingCore-9.1.so"), None);
    }

    #[test]
    fn a_missing_build_is_a_message_with_the_cure() {
        let e =
            choose(&["9.4".to_owned()], Path::new("home"), |_| false).expect_err("there is none");
        assert!(e.contains("VTK 9.4") && e.contains("vtk-bridge install"), "{e}");
        let both = ["9.1".to_owned(), "pv5.11".to_owned()];
        let found =
            choose(&both, Path::new("h"), |p| p.starts_with("h/lib/pv5.11")).expect("one is there");
        assert_eq!(found.0, "pv5.11");
        assert!(choose(&[], Path::new("h"), |_| true).is_err());
    }

    #[test]
    fn without_vtk_nothing_is_loaded_and_the_answer_says_why() {
        // SAFETY: a text that ends with zero and lives as long as the process.
        let version =
            unsafe { CStr::from_ptr(vtkGetFactoryVersion()) }.to_string_lossy().into_owned();
        assert!(version.contains("no VTK in this process"), "{version}");
        assert!(vtkLoad().is_null());
    }
}
