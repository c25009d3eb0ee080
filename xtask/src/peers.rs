//! Peers: third-party software that some tests and measurements compare with. None of it is linked
//! or shipped.
//!
//! Debian packages are installed with apt-get; Python wheels are installed in `target/peers/venv`,
//! where `cargo clean` removes them. Tests find peers only through the variables of
//! [`Peers::environment`], which CONTRIBUTING.md documents.

use std::fmt::Write as _;
use std::fs;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::first_line_of;

/// Debian 12 packages, and the purpose of each.
const PACKAGES: &[(&str, &str)] = &[
    (
        "libembree-dev",
        "Embree 3.13.5, the CPU ray tracing kernels that rt-core is measured against",
    ),
    (
        "mesa-vulkan-drivers",
        "lavapipe, a Vulkan device on the CPU that schlieren's GPU kernels are tested on",
    ),
    ("python3-venv", "a place for the wheels below"),
    ("chromium", "the browser that schlieren's interactive page is tested in"),
    ("openmpi-bin", "Open MPI, one of the MPIs that composite runs over"),
    ("mpich", "MPICH, the other"),
    ("libopenmpi-dev", "its compilers, for the programs in C and Fortran that use composite"),
    ("libmpich-dev", "the same of MPICH"),
    ("gfortran", "the compiler of Fortran behind both"),
    ("libsimgrid-dev", "SMPI, which runs 128 simulated ranks on one machine"),
    ("g++", "compiles vtk-bridge's C++ shim, as on the machines of users"),
    ("xvfb", "the X server of all programs below"),
    ("mesa-utils", "glxgears"),
    (
        "paraview",
        "ParaView 5.11, which vtk-bridge and gluray work in, and its IceT, which composite is \
         measured against",
    ),
    ("python3-paraview", "pvbatch, and VTK 9.2 in Python"),
    (
        "paraview-dev",
        "the headers that vtk-bridge's C++ shim and ParaView plugin are compiled with",
    ),
    ("valgrind", "watches a C program that uses and misuses vtk-bridge's C interface"),
    ("libglew-dev", "headers that paraview-dev includes but does not depend on"),
    ("cmake", "configures the ParaView plugin"),
    ("gmsh", "an OpenGL program with vertex arrays"),
    ("geomview", "an OpenGL program in immediate mode"),
    ("fonts-freefont-otf", "the fonts that Octave draws with"),
    ("octave", "an OpenGL program with materials per vertex"),
    ("openscad", "an OpenGL program that renders off the screen"),
    ("pymol", "an OpenGL program with fog"),
    ("piglit", "tests of OpenGL itself"),
    ("xscreensaver-gl", "small animated OpenGL programs of all kinds"),
    ("xscreensaver-gl-extra", "more of them"),
];

/// Debian packages that conflict with some above, so they are unpacked in `target/peers/vtk91`
/// instead of installed.
const UNPACKED: &[&str] = &["libvtk9-dev", "python3-vtk9", "libvtk9.1", "libvtk9.1-qt", "vtk9"];

/// Programs: name, environment variable for the tests, and Debian's path.
const PROGRAMS: &[(&str, &str, &str)] = &[
    ("Chromium", "RTSV_CHROMIUM", "/usr/bin/chromium"),
    ("Open MPI", "RTSV_MPIRUN", "/usr/bin/mpirun.openmpi"),
    ("MPICH", "RTSV_MPIRUN_MPICH", "/usr/bin/mpirun.mpich"),
    ("SMPI", "RTSV_SMPIRUN", "/usr/bin/smpirun"),
    ("Open MPI's C", "RTSV_MPICC", "/usr/bin/mpicc.openmpi"),
    ("Open MPI's C++", "RTSV_MPICXX", "/usr/bin/mpicxx.openmpi"),
    ("Open MPI's Fortran", "RTSV_MPIFORT", "/usr/bin/mpifort.openmpi"),
    ("MPICH's C", "RTSV_MPICC_MPICH", "/usr/bin/mpicc.mpich"),
    ("MPICH's C++", "RTSV_MPICXX_MPICH", "/usr/bin/mpicxx.mpich"),
    ("MPICH's Fortran", "RTSV_MPIFORT_MPICH", "/usr/bin/mpifort.mpich"),
    ("Xvfb", "RTSV_XVFB", "/usr/bin/Xvfb"),
    ("ParaView", "RTSV_PVBATCH", "/usr/bin/pvbatch"),
    ("Debian's Python", "RTSV_SYSTEM_PYTHON", "/usr/bin/python3"),
    ("gmsh", "RTSV_GMSH", "/usr/bin/gmsh"),
    ("geomview", "RTSV_GEOMVIEW", "/usr/bin/geomview"),
    ("Octave", "RTSV_OCTAVE", "/usr/bin/octave"),
    ("OpenSCAD", "RTSV_OPENSCAD", "/usr/bin/openscad"),
    ("PyMOL", "RTSV_PYMOL", "/usr/bin/pymol"),
    ("glxgears", "RTSV_GLXGEARS", "/usr/bin/glxgears"),
    ("xscreensaver-gl", "RTSV_XSCREENSAVER", "/usr/libexec/xscreensaver/gears"),
    ("xscreensaver-gl-extra", "RTSV_XSCREENSAVER_EXTRA", "/usr/libexec/xscreensaver/sballs"),
];

/// Wheels, with the versions of our measurements, and the purpose of each.
const WHEELS: &[(&str, &str, &str)] = &[
    ("numpy", "2.4.6", "arrays for the two below"),
    ("vtk", "9.7.2", "reads what we write, writes what we read"),
    ("embreex", "4.4.0.post1", "brings Embree 4.4 as a shared library"),
    ("pynari", "1.2.6", "an ANARI program, and a device to compare with"),
    ("mpi4py", "4.1.2", "MPI in Python, for programs that use composite; of either MPI"),
];

/// Whether missing peers may be installed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Install {
    /// apt-get and pip may be called.
    Allowed,
    /// Only installed peers are used.
    Forbidden,
}

/// One peer, found or not.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Peer {
    /// Name for messages.
    name: &'static str,
    /// Environment variable for tests.
    variable: &'static str,
    /// `None` when it was not found.
    path: Option<PathBuf>,
}

/// The peers that were found and those that were not.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Peers {
    /// The folder `target/peers`.
    folder: PathBuf,
    /// All peers.
    all: Vec<Peer>,
    /// Failures, and installations that were not allowed.
    notes: Vec<String>,
}

impl Peers {
    /// Names of the peers that were not found.
    pub(crate) fn missing(&self) -> Vec<&'static str> {
        self.all.iter().filter(|p| p.path.is_none()).map(|p| p.name).collect()
    }

    /// The variables through which tests find the peers.
    pub(crate) fn environment(&self, require: bool) -> Vec<(&'static str, PathBuf)> {
        let mut variables = vec![("RTSV_PEERS", self.folder.clone())];
        variables.extend(self.all.iter().filter_map(|p| Some((p.variable, p.path.clone()?))));
        if require {
            variables.push(("RTSV_REQUIRE_PEERS", PathBuf::from("1")));
        }
        variables
    }

    /// One line per peer, and the notes.
    pub(crate) fn describe(&self) -> String {
        let mut text = String::new();
        for Peer { name, path, .. } in &self.all {
            let place = path.as_ref().map_or("not found".to_owned(), |p| p.display().to_string());
            writeln!(text, "peer {name:<16} {place}").expect("writing to a String cannot fail");
        }
        for note in &self.notes {
            writeln!(text, "note: {note}").expect("writing to a String cannot fail");
        }
        text
    }
}

/// Finds the peers and, if allowed, first installs the missing ones. Never fails: a peer that
/// cannot be installed stays missing, with a note.
pub(crate) fn set_up(root: &Path, install: Install) -> Peers {
    let folder = root.join("target/peers");
    let venv = folder.join("venv");
    let mut notes = Vec::new();
    if install == Install::Allowed {
        install_packages(&mut notes);
        if let Err(e) = unpack_packages(&folder.join("vtk91")) {
            notes.push(e);
        }
        if let Err(e) = install_wheels(&venv, &mut notes) {
            notes.push(e);
        }
    }
    let python = venv.join("bin/python");
    let unpacked = folder.join("vtk91");
    let in_system = |name: &str| system_library_folders().iter().find_map(|d| library_in(d, name));
    let mut all = vec![
        Peer { name: "Embree 3", variable: "RTSV_EMBREE3", path: in_system("libembree3.so") },
        Peer {
            name: "Embree 4",
            variable: "RTSV_EMBREE4",
            path: wheel_library(&venv, "embreex.libs", "libembree4"),
        },
        Peer { name: "IceT", variable: "RTSV_ICET", path: in_system("libvtkIceTCore-pv5.11.so.1") },
        Peer {
            name: "VTK 9.1",
            variable: "RTSV_VTK91",
            path: vtk91_is_there(&unpacked).then_some(unpacked),
        },
        Peer { name: "piglit", variable: "RTSV_PIGLIT", path: piglit() },
        Peer {
            name: "Python with VTK",
            variable: "RTSV_PYTHON",
            path: wheels_are_there(&python).then_some(python),
        },
    ];
    all.extend(PROGRAMS.iter().map(|&(name, variable, path)| {
        let path = Some(PathBuf::from(path)).filter(|p| p.is_file());
        Peer { name, variable, path }
    }));
    Peers { folder, all, notes }
}

// ---- Debian packages ----------------------------------------------------------------------------
fn install_packages(notes: &mut Vec<String>) {
    let missing: Vec<&str> =
        PACKAGES.iter().map(|(p, _)| *p).filter(|p| !package_is_there(p)).collect();
    if missing.is_empty() {
        return;
    }
    let list = missing.join(" ");
    if first_line_of("apt-get", &["--version"]).is_none() {
        notes.push(format!(
            "no apt-get here; on Debian 12 these packages would be installed: {list}"
        ));
        return;
    }
    let Some(root_prefix) = root_prefix() else {
        notes.push(format!(
            "neither root nor sudo; this would be installed: apt-get install {list}"
        ));
        return;
    };
    // The package lists may be empty (fresh container) or old; without an update, packages may not
    // be found.
    for args in
        [vec!["update"], [&["install", "-y", "--no-install-recommends"], &missing[..]].concat()]
    {
        let mut line = root_prefix.clone();
        line.extend(["apt-get", "-o", "DPkg::Lock::Timeout=300", "-q"]);
        line.extend(args);
        println!("==> set-up: {}", line.join(" "));
        let status = Command::new(line[0])
            .args(&line[1..])
            .env("DEBIAN_FRONTEND", "noninteractive")
            .status();
        if !status.as_ref().is_ok_and(|s| s.success()) {
            notes.push(format!("`{}` failed: {status:?}", line.join(" ")));
        }
    }
}

/// Downloads [`UNPACKED`] and unpacks them below `root`, which needs no privileges and installs
/// nothing.
fn unpack_packages(root: &Path) -> Result<(), String> {
    if vtk91_is_there(root) || first_line_of("apt-get", &["--version"]).is_none() {
        return Ok(());
    }
    let failed = |e: std::io::Error| format!("{}: {e}", root.display());
    let downloads = root.join("downloads");
    fs::create_dir_all(&downloads).map_err(failed)?;
    run_noted(
        Command::new("apt-get").args(["-q", "download"]).args(UNPACKED).current_dir(&downloads),
    )?;
    for entry in fs::read_dir(&downloads).map_err(failed)? {
        let package = entry.map_err(failed)?.path();
        run_noted(Command::new("dpkg").arg("-x").args([&package, root]))?;
    }
    fs::remove_dir_all(&downloads).map_err(failed)
}

fn vtk91_is_there(root: &Path) -> bool {
    root.join("usr/lib/python3/dist-packages/vtkmodules").is_dir()
        && root.join("usr/include/vtk-9.1").is_dir()
}

/// The folder of piglit's test programs.
fn piglit() -> Option<PathBuf> {
    system_library_folders().iter().map(|d| d.join("piglit/bin")).find(|p| p.is_dir())
}

fn package_is_there(package: &str) -> bool {
    first_line_of("dpkg-query", &["-W", "-f", "${db:Status-Status}\n", package]).as_deref()
        == Some("installed")
}

/// The prefix to run a command as root: nothing, or sudo; `None` when neither works. Without a
/// terminal, sudo must not ask for a password, because the run would wait forever.
fn root_prefix() -> Option<Vec<&'static str>> {
    if first_line_of("id", &["-u"]).as_deref() == Some("0") {
        return Some(vec![]);
    }
    if std::io::stdin().is_terminal() && first_line_of("sudo", &["--version"]).is_some() {
        return Some(vec!["sudo"]);
    }
    first_line_of("sudo", &["-n", "true"]).map(|_| vec!["sudo", "-n"])
}

// ---- Python wheels ------------------------------------------------------------------------------
fn install_wheels(venv: &Path, notes: &mut Vec<String>) -> Result<(), String> {
    let python = venv.join("bin/python");
    if wheels_are_there(&python) {
        return Ok(());
    }
    if first_line_of(&python, &["-c", "import pip"]).is_none() {
        let Some(base) = base_python() else {
            return Err(
                "no Python 3 with the modules venv and ensurepip: no wheels were installed"
                    .to_owned(),
            );
        };
        run_noted(Command::new(base).args(["-m", "venv", "--clear"]).arg(venv))?;
    }
    // --no-deps: vtk depends on matplotlib (60 MB with its own dependencies) for text in formulas,
    // which nothing here draws.
    let mut pip = Command::new(&python);
    pip.args([
        "-m",
        "pip",
        "install",
        "--disable-pip-version-check",
        "--only-binary=:all:",
        "--no-deps",
    ]);
    pip.args(WHEELS.iter().map(|(name, version, _)| format!("{name}=={version}")));
    run_noted(&mut pip)?;
    if !wheels_are_there(&python) {
        notes.push(
            "pip succeeded, but the wheels cannot be imported in the versions asked for".to_owned(),
        );
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

/// A Python that can create virtual environments. Debian's own is preferred, because apt-get can
/// complete it.
fn base_python() -> Option<&'static str> {
    ["/usr/bin/python3", "python3"]
        .into_iter()
        .find(|p| first_line_of(p, &["-c", "import venv, ensurepip"]).is_some())
}

/// Whether every wheel is installed in its version and can be imported.
fn wheels_are_there(python: &Path) -> bool {
    let mut script =
        "from importlib.metadata import version\nfrom vtkmodules import vtkCommonCore\n".to_owned();
    for (name, version, _) in WHEELS {
        writeln!(script, "assert version('{name}') == '{version}'")
            .expect("writing to a String cannot fail");
    }
    python.is_file() && first_line_of(python, &["-c", &script]).is_some()
}

// ---- Shared libraries ---------------------------------------------------------------------------
fn system_library_folders() -> Vec<PathBuf> {
    let multiarch = format!("/usr/lib/{}-linux-gnu", std::env::consts::ARCH);
    [multiarch.as_str(), "/usr/lib64", "/usr/lib", "/usr/local/lib"].map(PathBuf::from).to_vec()
}

/// The file in `folder` whose name starts with `prefix`; of several the shortest, which is the link
/// without version.
fn library_in(folder: &Path, prefix: &str) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).ok()?.filter_map(Result::ok).map(|e| e.path());
    let names =
        entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix)));
    names.min_by_key(|p| (p.as_os_str().len(), p.clone()))
}

/// A library in a wheel: `venv/lib/python3.*/site-packages/FOLDER/PREFIX*`.
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
            all: vec![
                Peer {
                    name: "Embree 3",
                    variable: "RTSV_EMBREE3",
                    path: Some("libembree3.so".into()),
                },
                Peer { name: "Embree 4", variable: "RTSV_EMBREE4", path: None },
            ],
            notes: vec!["why".to_owned()],
        };
        assert_eq!(peers.missing(), ["Embree 4"]);
        let names =
            |require| peers.environment(require).into_iter().map(|(n, _)| n).collect::<Vec<_>>();
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
        for missing in ["Embree 4", "VTK 9.1", "Python with VTK"] {
            assert!(peers.missing().contains(&missing), "{missing} in an empty folder");
        }
    }

    #[test]
    fn names_and_variables_of_peers_are_unique() {
        let all = set_up(Path::new("nowhere"), Install::Forbidden).all;
        for (i, peer) in all.iter().enumerate() {
            assert!(peer.variable.starts_with("RTSV_"), "{}", peer.variable);
            assert!(
                all[..i].iter().all(|p| p.name != peer.name && p.variable != peer.variable),
                "{} twice",
                peer.name
            );
        }
    }
}
