//! Peers: software of others that some tests and measurements compare with. None of it is linked or shipped.
//!
//! Debian packages come with apt-get; Python wheels go into `target/peers/venv`, where `cargo clean` removes them.
//! Tests learn about peers only through the variables of [`Peers::environment`]; CONTRIBUTING.md documents these.

use std::fmt::Write as _;
use std::fs;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::runner::first_line_of;

/// Debian 12 packages, and what each is for.
const PACKAGES: &[(&str, &str)] = &[
    ("libembree-dev", "Embree 3.13.5, the CPU ray tracing kernels that rt-core is measured against"),
    (
        "mesa-vulkan-drivers",
        "lavapipe, a Vulkan device on the CPU that schlieren's GPU kernels are tested on",
    ),
    ("openmpi-bin", "Open MPI 4, over which composite runs; nothing is built with it"),
    ("mpich", "MPICH 4, the other MPI that the same program must run over"),
    ("libsimgrid-dev", "SimGrid's SMPI, which runs composite on 128 simulated nodes"),
    ("paraview", "IceT, the compositing library that composite is measured against, and its MPI layer"),
    ("python3-venv", "a place for the wheels below"),
    ("chromium", "the browser that schlieren's interactive page is tested in"),
];

/// Wheels, with the versions that our numbers were measured with, and what each is for.
const WHEELS: &[(&str, &str, &str)] = &[
    ("numpy", "2.4.6", "arrays for the two below"),
    ("vtk", "9.7.2", "reads what we write, writes what we read"),
    ("embreex", "4.4.0.post1", "brings Embree 4.4 as a shared library"),
];

/// Whether missing peers may be installed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Install {
    /// apt-get and pip may be called.
    Allowed,
    /// Only what is there is used.
    Forbidden,
}

/// The peers that were found. A field is `None` when there is no such peer.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Peers {
    /// `target/peers`.
    folder: PathBuf,
    /// Shared library of Embree 3.
    embree3: Option<PathBuf>,
    /// Shared library of Embree 4.
    embree4: Option<PathBuf>,
    /// Chromium's program.
    chromium: Option<PathBuf>,
    /// Open MPI's launcher.
    openmpi: Option<PathBuf>,
    /// MPICH's launcher.
    mpich: Option<PathBuf>,
    /// SimGrid's launcher.
    smpirun: Option<PathBuf>,
    /// Shared library of IceT's core.
    icet: Option<PathBuf>,
    /// The virtual environment's Python, with all [`WHEELS`] in their versions.
    python: Option<PathBuf>,
    /// What went wrong or was not allowed while installing.
    notes: Vec<String>,
}

impl Peers {
    /// Every peer by name.
    fn named(&self) -> [(&'static str, &Option<PathBuf>); 8] {
        [
            ("Embree 3", &self.embree3),
            ("Embree 4", &self.embree4),
            ("Chromium", &self.chromium),
            ("Open MPI", &self.openmpi),
            ("MPICH", &self.mpich),
            ("SimGrid", &self.smpirun),
            ("IceT", &self.icet),
            ("Python with VTK", &self.python),
        ]
    }

    /// Names of the peers that were not found.
    pub(crate) fn missing(&self) -> Vec<&'static str> {
        self.named().into_iter().filter(|(_, path)| path.is_none()).map(|(name, _)| name).collect()
    }

    /// The variables through which tests find the peers.
    pub(crate) fn environment(&self, require: bool) -> Vec<(&'static str, PathBuf)> {
        let mut variables = vec![("RTSV_PEERS", self.folder.clone())];
        let found = [
            ("RTSV_EMBREE3", &self.embree3),
            ("RTSV_EMBREE4", &self.embree4),
            ("RTSV_CHROMIUM", &self.chromium),
            ("RTSV_OPENMPI", &self.openmpi),
            ("RTSV_MPICH", &self.mpich),
            ("RTSV_SMPIRUN", &self.smpirun),
            ("RTSV_ICET", &self.icet),
            ("RTSV_PYTHON", &self.python),
        ];
        variables.extend(found.into_iter().filter_map(|(name, path)| Some((name, path.clone()?))));
        if require {
            variables.push(("RTSV_REQUIRE_PEERS", PathBuf::from("1")));
        }
        variables
    }

    /// One line per peer, and the notes.
    pub(crate) fn describe(&self) -> String {
        let mut text = String::new();
        for (name, path) in self.named() {
            let place = path.as_ref().map_or("not found".to_owned(), |p| p.display().to_string());
            writeln!(text, "peer {name:<16} {place}").expect("writing to a String cannot fail");
        }
        for note in &self.notes {
            writeln!(text, "note: {note}").expect("writing to a String cannot fail");
        }
        text
    }
}

/// Finds the peers, after installing those that are missing where that is allowed. Never fails: what is missing
/// stays missing, with a note.
pub(crate) fn set_up(root: &Path, install: Install) -> Peers {
    let folder = root.join("target/peers");
    let venv = folder.join("venv");
    let mut notes = Vec::new();
    if install == Install::Allowed {
        install_packages(&mut notes);
        if let Err(e) = install_wheels(&venv, &mut notes) {
            notes.push(e);
        }
    }
    let python = venv.join("bin/python");
    Peers {
        embree3: system_library_folders().iter().find_map(|d| library_in(d, "libembree3.so")),
        embree4: wheel_library(&venv, "embreex.libs", "libembree4"),
        chromium: program("chromium"),
        openmpi: program("mpirun.openmpi"),
        mpich: program("mpirun.mpich"),
        smpirun: program("smpirun"),
        icet: system_library_folders().iter().find_map(|d| library_in(d, "libvtkIceTCore-pv")),
        python: wheels_are_there(&python).then_some(python),
        folder,
        notes,
    }
}

// ---- Debian packages ------------------------------------------------------------------------------------------

fn install_packages(notes: &mut Vec<String>) {
    let missing: Vec<&str> = PACKAGES.iter().map(|(p, _)| *p).filter(|p| !package_is_there(p)).collect();
    if missing.is_empty() {
        return;
    }
    let list = missing.join(" ");
    if first_line_of("apt-get", &["--version"]).is_none() {
        notes.push(format!("no apt-get here; on Debian 12 these packages would be installed: {list}"));
        return;
    }
    let Some(root_prefix) = root_prefix() else {
        notes.push(format!("neither root nor sudo; this would be installed: apt-get install {list}"));
        return;
    };
    // The lists may be empty (fresh container) or old; without an update the packages may not be found.
    for args in [vec!["update"], [&["install", "-y", "--no-install-recommends"], &missing[..]].concat()] {
        let mut line = root_prefix.clone();
        line.extend(["apt-get", "-o", "DPkg::Lock::Timeout=300", "-q"]);
        line.extend(args);
        println!("==> set-up: {}", line.join(" "));
        let status = Command::new(line[0]).args(&line[1..]).env("DEBIAN_FRONTEND", "noninteractive").status();
        if !status.as_ref().is_ok_and(|s| s.success()) {
            notes.push(format!("`{}` failed: {status:?}", line.join(" ")));
        }
    }
}

fn package_is_there(package: &str) -> bool {
    first_line_of("dpkg-query", &["-W", "-f", "${db:Status-Status}\n", package]).as_deref()
        == Some("installed")
}

/// What to put before a command to run it as root: nothing, or sudo; `None` when there is no way. Without a terminal
/// sudo must not ask for a password, or the run would wait for ever.
fn root_prefix() -> Option<Vec<&'static str>> {
    if first_line_of("id", &["-u"]).as_deref() == Some("0") {
        return Some(vec![]);
    }
    if std::io::stdin().is_terminal() && first_line_of("sudo", &["--version"]).is_some() {
        return Some(vec!["sudo"]);
    }
    first_line_of("sudo", &["-n", "true"]).map(|_| vec!["sudo", "-n"])
}

// ---- Python wheels --------------------------------------------------------------------------------------------

fn install_wheels(venv: &Path, notes: &mut Vec<String>) -> Result<(), String> {
    let python = venv.join("bin/python");
    if wheels_are_there(&python) {
        return Ok(());
    }
    if first_line_of(&python, &["-c", "import pip"]).is_none() {
        let Some(base) = base_python() else {
            return Err(
                "no Python 3 with the modules venv and ensurepip: no wheels were installed".to_owned()
            );
        };
        run_noted(Command::new(base).args(["-m", "venv", "--clear"]).arg(venv))?;
    }
    // --no-deps: vtk asks for matplotlib (60 MB with its own dependencies) for text in formulas, which nothing here draws.
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--disable-pip-version-check", "--only-binary=:all:", "--no-deps"]);
    pip.args(WHEELS.iter().map(|(name, version, _)| format!("{name}=={version}")));
    run_noted(&mut pip)?;
    if !wheels_are_there(&python) {
        notes.push("pip succeeded, but the wheels cannot be imported in the versions asked for".to_owned());
    }
    Ok(())
}

fn run_noted(command: &mut Command) -> Result<(), String> {
    println!("==> set-up: {command:?}");
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{command:?} failed: {status}")),
        Err(e) => Err(format!("{command:?} does not start: {e}")),
    }
}

/// A Python that can make virtual environments: Debian's own before others, because apt-get can complete that one.
fn base_python() -> Option<&'static str> {
    ["/usr/bin/python3", "python3"]
        .into_iter()
        .find(|p| first_line_of(p, &["-c", "import venv, ensurepip"]).is_some())
}

/// True when every wheel is there in its version and can be imported.
fn wheels_are_there(python: &Path) -> bool {
    let mut script =
        "from importlib.metadata import version\nfrom vtkmodules import vtkCommonCore\n".to_owned();
    for (name, version, _) in WHEELS {
        writeln!(script, "assert version('{name}') == '{version}'").expect("writing to a String cannot fail");
    }
    python.is_file() && first_line_of(python, &["-c", &script]).is_some()
}

/// A program of a Debian package.
fn program(name: &str) -> Option<PathBuf> {
    Some(Path::new("/usr/bin").join(name)).filter(|path| path.is_file())
}

// ---- Shared libraries -----------------------------------------------------------------------------------------

fn system_library_folders() -> Vec<PathBuf> {
    let multiarch = format!("/usr/lib/{}-linux-gnu", std::env::consts::ARCH);
    [multiarch.as_str(), "/usr/lib64", "/usr/lib", "/usr/local/lib"].map(PathBuf::from).to_vec()
}

/// The file in `folder` whose name starts with `prefix`; of several the shortest, which is the link without version.
fn library_in(folder: &Path, prefix: &str) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).ok()?.filter_map(Result::ok).map(|e| e.path());
    let names = entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix)));
    names.min_by_key(|p| (p.as_os_str().len(), p.clone()))
}

/// A library that a wheel brings: `venv/lib/python3.*/site-packages/FOLDER/PREFIX*`.
fn wheel_library(venv: &Path, folder: &str, prefix: &str) -> Option<PathBuf> {
    let mut pythons: Vec<PathBuf> =
        fs::read_dir(venv.join("lib")).ok()?.filter_map(|e| Some(e.ok()?.path())).collect();
    pythons.sort();
    pythons.iter().find_map(|p| library_in(&p.join("site-packages").join(folder), prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_see_only_the_peers_that_were_found() {
        let peers = Peers {
            folder: "peers".into(),
            embree3: Some("libembree3.so".into()),
            notes: vec!["why".to_owned()],
            ..Peers::default()
        };
        assert_eq!(peers.missing(), ["Embree 4", "Chromium", "Open MPI", "MPICH", "SimGrid", "IceT", "Python with VTK"]);
        let names = |require| peers.environment(require).into_iter().map(|(n, _)| n).collect::<Vec<_>>();
        assert_eq!(names(false), ["RTSV_PEERS", "RTSV_EMBREE3"]);
        assert_eq!(names(true), ["RTSV_PEERS", "RTSV_EMBREE3", "RTSV_REQUIRE_PEERS"]);
        assert!(peers.describe().contains("Embree 4         not found\n"), "{}", peers.describe());
        assert!(peers.describe().contains("note: why\n"), "{}", peers.describe());
    }

    #[test]
    fn the_link_without_version_is_preferred() {
        let folder = std::env::temp_dir().join(format!("xtask-peers-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a temporary folder");
        for name in ["libx.so.3", "libx.so", "liby.so"] {
            fs::write(folder.join(name), "").expect("a temporary file");
        }
        assert_eq!(library_in(&folder, "libx.so"), Some(folder.join("libx.so")));
        assert_eq!(library_in(&folder, "libz.so"), None);
        fs::remove_dir_all(&folder).expect("a temporary folder");
    }

    #[test]
    fn forbidding_installation_installs_nothing() {
        let root = std::env::temp_dir().join(format!("xtask-no-install-{}", std::process::id()));
        let peers = set_up(&root, Install::Forbidden);
        assert!(!root.exists(), "something was written");
        assert_eq!(peers.python, None);
        assert_eq!(peers.embree4, None);
    }
}
