//! The subcommands of `gluray`.

pub(crate) mod doctor;
pub(crate) mod explain;
pub(crate) mod run;

use std::path::PathBuf;

/// Where the account of the last run is kept.
pub(crate) fn last_report() -> PathBuf {
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).filter(|p| p.is_absolute());
    let home = || PathBuf::from(std::env::var_os("HOME").unwrap_or_default()).join(".local/state");
    state.unwrap_or_else(home).join("gluray/last.json")
}

/// The shared library that belongs to this program.
pub(crate) fn library() -> Option<PathBuf> {
    let exe = std::env::current_exe().ok()?;
    let folder = exe.parent()?;
    let places = [folder.to_owned(), folder.join("deps"), folder.join("../lib"), folder.join("..")];
    let named = std::env::var_os("GLURAY_LIBRARY").map(PathBuf::from);
    named.into_iter().chain(places.map(|p| p.join("libgluray.so"))).find(|p| p.is_file())
}

/// True when OpenGL here is GLVND's, which takes vendor libraries.
pub(crate) fn has_glvnd() -> bool {
    let folders = ["/usr/lib/x86_64-linux-gnu", "/usr/lib64", "/usr/lib", "/lib64", "/usr/lib/aarch64-linux-gnu"];
    folders.iter().any(|f| PathBuf::from(f).join("libGLdispatch.so.0").exists())
}
