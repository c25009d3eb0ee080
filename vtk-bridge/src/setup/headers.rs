//! Finds the VTK installations with headers on this machine.

use crate::loader::flavour_of;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// A VTK that a shim can be compiled for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Flavour {
    /// Version as in the names of its libraries: `9.1`, `pv5.11`.
    pub name: String,
    /// Folder of vtkObjectFactory.h.
    pub include: PathBuf,
    /// Folder of libvtkCommonCore.
    pub libraries: PathBuf,
}

impl Flavour {
    /// True for the VTK inside ParaView.
    pub fn is_paraview(&self) -> bool {
        self.name.starts_with("pv")
    }

    /// The file of VTK module `module`: the link without a version, or the library itself.
    pub fn library(&self, module: &str) -> Option<PathBuf> {
        let stem = if self.name == "unnamed" {
            format!("libvtk{module}.so")
        } else {
            format!("libvtk{module}-{}.so", self.name)
        };
        let plain = self.libraries.join(&stem);
        if plain.exists() {
            return Some(plain);
        }
        let names = fs::read_dir(&self.libraries).ok()?.filter_map(|e| Some(e.ok()?.path()));
        names
            .filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(&stem)))
            .min()
    }
}

/// Folders to search: those of `RTV_VTK_INCLUDE` (separated by colons), those next to the libraries
/// of `LD_LIBRARY_PATH`, and the system's.
pub fn places(variable: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
    let list = |name| {
        let value = variable(name).unwrap_or_default();
        value.split(':').filter(|p| !p.is_empty()).map(PathBuf::from).collect::<Vec<_>>()
    };
    let own = list("RTV_VTK_INCLUDE").into_iter();
    // From PREFIX/lib/MACHINE or PREFIX/lib to PREFIX/include.
    let beside = list("LD_LIBRARY_PATH");
    let beside =
        beside.iter().flat_map(|p| p.ancestors().skip(1).take(2).map(|a| a.join("include")));
    let system =
        ["/usr/include", "/usr/local/include", "/opt/vtk/include", "/opt/paraview/include"];
    let mut inside: Vec<PathBuf> = beside
        .chain(system.map(PathBuf::from))
        .filter_map(|d| fs::read_dir(d).ok())
        .flatten()
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| {
            let name = p.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("vtk-") || name.starts_with("paraview-")
        })
        .collect();
    inside.sort();
    inside.dedup();
    own.chain(inside).collect()
}

/// The VTK installations whose headers and libraries both exist. The second list gives the problems
/// of the other folders.
pub fn find(places: &[PathBuf]) -> (Vec<Flavour>, Vec<String>) {
    let (mut found, mut faults) = (Vec::<Flavour>::new(), Vec::new());
    for place in places {
        match look_at(place) {
            Ok(f) if found.iter().any(|known| known.name == f.name) => {
                faults.push(format!(
                    "{}: VTK {} was found before; this one is not used",
                    place.display(),
                    f.name
                ));
            }
            Ok(f) => found.push(f),
            Err(fault) => faults.push(format!("{}: {fault}", place.display())),
        }
    }
    (found, faults)
}

/// True for the headers of a ParaView that is linked with the system's VTK (Debian's 6.1): they are
/// without VTK's own, which lie in a folder of their own.
pub fn shares_vtk(include: &Path) -> bool {
    include.join("vtkSMProxy.h").is_file() && !include.join("vtkObjectFactory.h").is_file()
}

fn look_at(include: &Path) -> Result<Flavour, String> {
    if shares_vtk(include) {
        return Err("this ParaView uses the system's VTK, whose build serves it (install \
                    libvtk9-dev); the plugin and compositing in floating point are built only for \
                    a ParaView with its own VTK"
            .to_owned());
    }
    for header in ["vtkObjectFactory.h", "vtkOpenGLRenderer.h"] {
        if !include.join(header).is_file() {
            return Err(format!("there is no {header}"));
        }
    }
    // PREFIX/include/vtk-9.1 belongs to PREFIX/lib, /lib64 or Debian's /lib/MACHINE.
    let prefix = include.ancestors().nth(2).ok_or("the folder has no prefix")?;
    let machine = format!("lib/{}-linux-gnu", std::env::consts::ARCH);
    let wanted = include.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let wanted = wanted
        .strip_prefix("paraview-")
        .map(|v| format!("pv{v}"))
        .or_else(|| Some(wanted.strip_prefix("vtk-")?.to_owned()));
    for folder in [machine.as_str(), "lib64", "lib"].map(|l| prefix.join(l)) {
        let entries =
            fs::read_dir(&folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path()));
        let mut names: Vec<String> =
            entries.filter_map(|p| flavour_of(&p.to_string_lossy())).collect();
        names.sort();
        names.dedup();
        let name = match &wanted {
            Some(w) => {
                names.into_iter().find(|n| n == w || (n == "unnamed" && !w.starts_with("pv")))
            }
            None => names.into_iter().next(),
        };
        if let Some(name) = name {
            return Ok(Flavour { name, include: include.to_owned(), libraries: folder });
        }
    }
    Err(format!("headers, but no libvtkCommonCore for them below {}", prefix.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_find_their_libraries_and_others_say_what_is_missing() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let make = |p: &str| {
            let path = root.path().join(p);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(&path, "").expect("written");
        };
        for v in ["vtk-9.1", "paraview-5.11", "vtk-9.4"] {
            make(&format!("include/{v}/vtkObjectFactory.h"));
            make(&format!("include/{v}/vtkOpenGLRenderer.h"));
        }
        make("lib/libvtkCommonCore-9.1.so.1");
        make("lib/libvtkCommonCore-pv5.11.so");
        let places = ["vtk-9.1", "paraview-5.11", "vtk-9.4", "nothing"]
            .map(|p| root.path().join("include").join(p));
        let (found, faults) = find(&places);
        let names: Vec<_> = found.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["9.1", "pv5.11"]);
        assert_eq!(
            found[0].library("CommonCore"),
            Some(root.path().join("lib/libvtkCommonCore-9.1.so.1"))
        );
        assert!(
            faults[0].contains("no libvtkCommonCore") && faults[1].contains("vtkObjectFactory.h"),
            "{faults:?}"
        );
        make("include/paraview-6.1/vtkSMProxy.h");
        let split = root.path().join("include/paraview-6.1");
        let (found, faults) = find(&[split]);
        assert!(found.is_empty() && faults[0].contains("uses the system's VTK"), "{faults:?}");
    }
}
