//! The paths of the installed files, and their installation.

use super::headers::Flavour;
use super::{SetupError, compile, io};
use crate::loader::SHIM;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// The paths below the installation folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    prefix: PathBuf,
}

/// Result of [`Layout::install`].
#[derive(Debug, Clone, Default, Serialize)]
pub struct Installed {
    /// The installation folder.
    pub prefix: PathBuf,
    /// VTK versions for which a shim was built.
    pub built: Vec<String>,
    /// VTK versions whose shim could not be built, with the reason.
    pub failed: Vec<(String, String)>,
}

impl Installed {
    /// What was done, and how to use it; `layout` is that of the installation.
    pub fn summary(&self, layout: &Layout) -> String {
        let prefix = self.prefix.display();
        if self.built.is_empty() {
            return format!("nothing was built in {prefix}: no script is ray traced");
        }
        format!(
            "installed in {prefix} for VTK {}\nset VTK_AUTOLOAD_PATH={} (eval \"$(vtk-bridge env \
             --vtk)\" does), and scripts are ray traced",
            self.built.join(", "),
            layout.autoload().display()
        )
    }
}

impl Layout {
    /// An installation in `prefix`.
    pub fn at(prefix: PathBuf) -> Layout {
        Layout { prefix }
    }

    /// `RTV_HOME`, or the installation folder in the user's data folder.
    pub fn default_prefix(variable: impl Fn(&str) -> Option<String>) -> PathBuf {
        let set = |name| variable(name).filter(|v: &String| !v.is_empty()).map(PathBuf::from);
        set("RTV_HOME")
            .or_else(|| Some(set("XDG_DATA_HOME")?.join("vtk-bridge")))
            .or_else(|| Some(set("HOME")?.join(".local/share/vtk-bridge")))
            .unwrap_or_else(|| PathBuf::from("/usr/local/lib/vtk-bridge"))
    }

    /// The installation folder.
    pub fn prefix(&self) -> &Path {
        &self.prefix
    }

    /// The folder for `VTK_AUTOLOAD_PATH`.
    pub fn autoload(&self) -> PathBuf {
        self.prefix.join("autoload")
    }

    /// The loader library in that folder.
    pub fn loader(&self) -> PathBuf {
        self.autoload().join("librtv_loader.so")
    }

    /// The library under the name that ANARI's loader expects: `libanari_library_rtv.so`, of the
    /// device `rtv`.
    pub fn anari(&self) -> PathBuf {
        self.prefix.join("anari").join("libanari_library_rtv.so")
    }

    /// The shim of a VTK.
    pub fn shim(&self, flavour: &str) -> PathBuf {
        self.prefix.join("lib").join(flavour).join(SHIM)
    }

    /// The plugin of a ParaView.
    pub fn plugin_folder(&self, flavour: &str) -> PathBuf {
        self.prefix.join("plugins").join(flavour)
    }

    /// VTK versions with a shim.
    pub fn shims(&self) -> Vec<String> {
        let entries = fs::read_dir(self.prefix.join("lib")).into_iter().flatten();
        let mut names: Vec<String> = entries
            .filter_map(|e| Some(e.ok()?.path()))
            .filter(|p| p.join(SHIM).is_file())
            .filter_map(|p| Some(p.file_name()?.to_string_lossy().into_owned()))
            .collect();
        names.sort();
        names
    }

    /// Installs the loader from `library`, and builds a shim for each of `flavours`. If one shim
    /// fails, the others are still built.
    pub fn install(&self, library: &Path, flavours: &[Flavour]) -> Result<Installed, SetupError> {
        let mut done = Installed { prefix: self.prefix.clone(), ..Installed::default() };
        let sources = self.prefix.join("src");
        compile::write_sources(&sources)?;
        let include = self.prefix.join("include");
        fs::create_dir_all(&include).map_err(io(&include, "make the folder"))?;
        let header = include.join("rtv.h");
        fs::write(&header, compile::SOURCES[0].1).map_err(io(&header, "write"))?;
        for flavour in flavours {
            match compile::shim(flavour, &sources, &self.shim(&flavour.name)) {
                Ok(()) => done.built.push(flavour.name.clone()),
                Err(e) => done.failed.push((flavour.name.clone(), e.to_string())),
            }
        }
        self.install_loader(library)?;
        Ok(done)
    }

    /// Copies the library to where VTK finds it, unless it is already there.
    pub fn install_loader(&self, library: &Path) -> Result<(), SetupError> {
        self.put(library, &self.loader())
    }

    /// Copies the library to where ANARI's loader finds it.
    pub fn install_anari(&self, library: &Path) -> Result<(), SetupError> {
        self.put(library, &self.anari())
    }

    fn put(&self, library: &Path, place: &Path) -> Result<(), SetupError> {
        let folder = place.parent().unwrap_or(&self.prefix);
        fs::create_dir_all(folder).map_err(io(folder, "make the folder"))?;
        let beside = place.with_extension("so.new");
        fs::copy(library, &beside).map_err(io(library, "copy"))?;
        fs::rename(&beside, place).map_err(io(place, "put in place"))
    }

    /// True when the shims were built from the sources of this program.
    pub fn sources_are_current(&self) -> bool {
        let same = |(name, text): &(&str, &str)| {
            fs::read_to_string(self.prefix.join("src").join(name)).is_ok_and(|t| t == *text)
        };
        compile::SOURCES.iter().all(same)
    }

    /// True when the installed loader is the library `library`, byte for byte.
    pub fn loader_is(&self, library: &Path) -> bool {
        same(&self.loader(), library)
    }

    /// True when the installed ANARI device is the library `library`, byte for byte.
    pub fn anari_is(&self, library: &Path) -> bool {
        same(&self.anari(), library)
    }
}

/// Whether both files exist and are equal.
fn same(a: &Path, b: &Path) -> bool {
    let read = |p: &Path| fs::read(p).ok();
    read(a).is_some_and(|a| read(b) == Some(a))
}

/// Finds the library that VTK loads: `RTV_LIBRARY`, or next to the program, in `deps` next to it,
/// or in `lib` one folder up.
pub fn library() -> Result<PathBuf, SetupError> {
    if let Some(set) = std::env::var_os("RTV_LIBRARY").filter(|v| !v.is_empty()) {
        return Ok(set.into());
    }
    let program = std::env::current_exe().unwrap_or_default();
    let folder = program.parent().unwrap_or(Path::new("."));
    let name = "libvtk_bridge.so";
    let places =
        [folder.join("deps").join(name), folder.join(name), folder.join("../lib").join(name)];
    // Building only the program renews only one of them.
    let age = |p: &PathBuf| fs::metadata(p).and_then(|m| m.modified()).ok();
    places
        .into_iter()
        .filter(|p| p.is_file())
        .max_by_key(age)
        .ok_or(SetupError::NoLibrary { program })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_installation_that_built_nothing_does_not_say_that_scripts_are_traced() {
        let layout = Layout::at("/p".into());
        let of = |built: &[&str]| {
            let built = built.iter().map(|s| (*s).to_owned()).collect();
            let failed = vec![("9.9".to_owned(), "an error".to_owned())];
            Installed { prefix: "/p".into(), built, failed }.summary(&layout)
        };
        assert_eq!(of(&[]), "nothing was built in /p: no script is ray traced");
        let some = of(&["9.1"]);
        assert!(some.starts_with("installed in /p for VTK 9.1\n"), "{some}");
        assert!(some.ends_with("scripts are ray traced"), "{some}");
    }
}
