//! Compiles programs against the library, and runs them alone or under a launcher of MPI.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Far longer than any run needs; one that hangs ends here.
const BOUND_SECS: &str = "150";

/// An MPI: its name, and the variables of its launcher and its compilers.
pub(crate) struct Mpi {
    pub(crate) name: &'static str,
    launcher: &'static str,
    c: &'static str,
    cpp: &'static str,
    fortran: &'static str,
}

pub(crate) const MPIS: [Mpi; 2] = [
    Mpi {
        name: "openmpi",
        launcher: "RTSV_MPIRUN",
        c: "RTSV_MPICC",
        cpp: "RTSV_MPICXX",
        fortran: "RTSV_MPIFORT",
    },
    Mpi {
        name: "mpich",
        launcher: "RTSV_MPIRUN_MPICH",
        c: "RTSV_MPICC_MPICH",
        cpp: "RTSV_MPICXX_MPICH",
        fortran: "RTSV_MPIFORT_MPICH",
    },
];

/// The path in a variable; `None`, with a note, when it is not set and not required.
pub(crate) fn peer(variable: &str) -> Option<PathBuf> {
    use std::io::Write as _;
    let found = std::env::var_os(variable).map(PathBuf::from);
    if found.is_none() {
        let required = std::env::var_os("RTSV_REQUIRE_PEERS").is_some();
        assert!(!required, "{variable} is not set, but RTSV_REQUIRE_PEERS is");
        writeln!(std::io::stderr(), "skipped: {variable} is not set").expect("stderr");
    }
    found
}

pub(crate) fn member() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder of this test run.
pub(crate) fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// A folder with the library under the names that it is installed with.
pub(crate) fn library() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = scratch("lib");
        let test = std::env::current_exe().expect("a test is a file");
        let built = test.with_file_name("librtsv_composite.so");
        let abi = rtsv_composite::RTSV_COMPOSITE_ABI;
        let named = folder.join(format!("librtsv_composite.so.{abi}"));
        // A program of an earlier run may have it open.
        let _ = std::fs::remove_file(&named);
        std::fs::copy(&built, &named).unwrap_or_else(|e| panic!("{}: {e}", built.display()));
        let link = folder.join("librtsv_composite.so");
        let _ = std::fs::remove_file(&link);
        let target = named.file_name().expect("a name");
        std::os::unix::fs::symlink(target, link).expect("a link");
        folder
    })
}

/// Compiles `sources` to `name` with warnings as errors, with the library.
pub(crate) fn compile(compiler: &Path, flags: &[&str], sources: &[&str], name: &str) -> PathBuf {
    let out = scratch("programs").join(name);
    let modules = scratch(&format!("modules-{name}"));
    let mut command = Command::new(compiler);
    command.args(["-g", "-O1", "-Wall", "-Wextra", "-Werror"]).args(flags);
    command.arg("-o").arg(&out).arg(format!("-I{}", member().join("include").display()));
    command.args(sources.iter().map(|source| member().join(source)));
    command.arg(format!("-L{}", library().display())).args(["-lrtsv_composite", "-lm"]);
    command.arg(format!("-Wl,-rpath,{}", library().display())).current_dir(modules);
    let made = command.output().unwrap_or_else(|e| panic!("{}: {e}", compiler.display()));
    assert!(made.status.success(), "{command:?}\n{}", String::from_utf8_lossy(&made.stderr));
    out
}

/// A compiler of C without MPI.
pub(crate) fn cc() -> PathBuf {
    std::env::var_os("CC").map_or_else(|| "cc".into(), PathBuf::from)
}

impl Mpi {
    /// The C program at `source`.
    pub(crate) fn compile_c(&self, source: &str) -> Option<PathBuf> {
        let compiler = peer(self.c)?;
        let stem = Path::new(source).file_stem().expect("a file").to_string_lossy();
        let flags = ["-std=c11", "-pedantic", "-pthread"];
        Some(compile(&compiler, &flags, &[source], &format!("{stem}-{}", self.name)))
    }

    /// The C++ program at `source`.
    pub(crate) fn compile_cpp(&self, source: &str) -> Option<PathBuf> {
        static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
        let compiler = peer(self.cpp)?;
        let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let stem = Path::new(source).file_stem().expect("a file").to_string_lossy();
        let flags = ["-std=c++17", "-pedantic"];
        Some(compile(&compiler, &flags, &[source], &format!("{stem}-{}", self.name)))
    }

    /// The Fortran program at `source`, with the module.
    pub(crate) fn compile_fortran(&self, source: &str) -> Option<PathBuf> {
        let compiler = peer(self.fortran)?;
        // Calls of MPI with arguments of several types, as mpif.h has them.
        let flags = ["-std=f2018", "-fallow-argument-mismatch"];
        let sources = ["include/rtsv_composite.f90", source];
        Some(compile(&compiler, &flags, &sources, &format!("fortran-{}", self.name)))
    }

    /// Runs a program on `ranks` ranks; it must end in time.
    pub(crate) fn run(&self, ranks: usize, words: &[&str]) -> Option<Output> {
        /// Two jobs at once on few processors wait for each other's turns.
        static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
        let launcher = peer(self.launcher)?;
        let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let mut command = Command::new("timeout");
        command.args(["--kill-after=5", BOUND_SECS]).arg(launcher);
        command.args(["-n", &ranks.to_string()]).args(words).stdin(Stdio::null());
        command.envs(ENVIRONMENT).env("RUST_BACKTRACE", "0").env("PYTHONDONTWRITEBYTECODE", "1");
        command.env("RTSV_COMPOSITE_LIBRARY", library().join("librtsv_composite.so"));
        command.env("PYTHONPATH", member().join("python"));
        if self.name == "mpich" {
            // The wheel of mpi4py has a module for each MPI, and looks for MPICH by the name of its
            // own builds, which Debian's library does not have.
            command.env("MPI4PY_MPIABI", "mpich").env("LD_LIBRARY_PATH", mpich_by_its_own_name());
        }
        let output = command.output().expect("coreutils' timeout runs");
        assert!(output.status.code() != Some(124), "{words:?} did not end:\n{}", text(&output));
        Some(output)
    }
}

/// A folder with Debian's `libmpich.so.12` as `libmpi.so.12`.
fn mpich_by_its_own_name() -> PathBuf {
    let folder = scratch("mpich");
    let library = format!("/usr/lib/{}-linux-gnu/libmpich.so.12", std::env::consts::ARCH);
    let link = folder.join("libmpi.so.12");
    // Elsewhere the library has that name already.
    if Path::new(&library).is_file() && !link.exists() {
        std::os::unix::fs::symlink(library, link).expect("a link");
    }
    folder
}

/// For more ranks than processors, as root in a container, on one machine.
const ENVIRONMENT: [(&str, &str); 7] = [
    ("OMPI_MCA_btl", "self,vader"),
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
    ("OMPI_MCA_mpi_yield_when_idle", "1"),
    ("OMPI_MCA_hwloc_base_binding_policy", "none"),
    ("RAYON_NUM_THREADS", "1"),
];

/// All that a program said.
pub(crate) fn text(output: &Output) -> String {
    format!(
        "{}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}
