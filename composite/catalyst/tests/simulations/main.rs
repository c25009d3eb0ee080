//! A simulation in C that calls Catalyst, and knows nothing of this library.
//!
//! Catalyst is libcatalyst where `RTSV_CATALYST` names the folder it is installed in, and otherwise
//! a stand-in with the same calls: Debian has no libcatalyst. MPI and its compilers are peers
//! (CONTRIBUTING.md).

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};

/// Far longer than any run needs; one that hangs ends here.
const BOUND_SECS: &str = "150";
/// Points along each side, and steps.
const SIZE: [&str; 2] = ["20", "20"];

const MPIS: [(&str, &str, &str); 2] =
    [("openmpi", "RTSV_MPIRUN", "RTSV_MPICC"), ("mpich", "RTSV_MPIRUN_MPICH", "RTSV_MPICC_MPICH")];

/// For more ranks than processors, as root in a container.
const ENVIRONMENT: [(&str, &str); 8] = [
    ("OMPI_MCA_btl", "self,vader"),
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
    ("OMPI_MCA_mpi_yield_when_idle", "1"),
    ("OMPI_MCA_hwloc_base_binding_policy", "none"),
    ("RAYON_NUM_THREADS", "1"),
    ("CATALYST_IMPLEMENTATION_NAME", "rtsv"),
];

const SETTINGS: &str = r#"
[[picture]]
file = "OUT/surface-{step}.png"
channel = "cells"
array = "temperature"
size = [64, 48]
samples = 1

[[picture]]
file = "OUT/isosurface-{step}.png"
channel = "gas"
show = "isosurface"
array = "temperature"
isovalues = [450, 700]
opacity = 0.5
size = [64, 48]
samples = 1

[[picture]]
file = "OUT/volume-{step}.png"
channel = "gas"
show = "volume"
array = "temperature"
size = [64, 48]
every = 2

[[photograph]]
file = "OUT/schlieren-{step}.png"
channel = "gas"
size = [48, 48]
"#;

const FILES: [&str; 7] = [
    "isosurface-000010.png",
    "isosurface-000020.png",
    "schlieren-000010.png",
    "schlieren-000020.png",
    "surface-000010.png",
    "surface-000020.png",
    "volume-000010.png",
];

fn peer(variable: &str) -> Option<PathBuf> {
    use std::io::Write as _;
    let found = std::env::var_os(variable).map(PathBuf::from);
    if found.is_none() {
        let required = std::env::var_os("RTSV_REQUIRE_PEERS").is_some();
        assert!(!required, "{variable} is not set, but RTSV_REQUIRE_PEERS is");
        writeln!(std::io::stderr(), "skipped: {variable} is not set").expect("stderr");
    }
    found
}

fn member() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// An empty folder of this test run.
fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("catalyst-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn said(output: &Output) -> String {
    let [out, err] = [&output.stdout, &output.stderr].map(|b| String::from_utf8_lossy(b));
    format!("{}\n{out}{err}", output.status)
}

fn run(command: &mut Command) {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(output.status.success(), "{command:?}\n{}", said(&output));
}

/// A folder with this library under the name that Catalyst looks for.
fn library(folder: &Path) -> PathBuf {
    let test = std::env::current_exe().expect("a test is a file");
    let built = test.with_file_name("libcatalyst_rtsv.so");
    let lib = folder.join("catalyst");
    std::fs::create_dir_all(&lib).expect("a folder");
    let link = lib.join("libcatalyst-rtsv.so");
    std::os::unix::fs::symlink(&built, link).unwrap_or_else(|e| panic!("{}: {e}", built.display()));
    lib
}

/// Folders of the headers and of the library of Catalyst.
fn catalyst(folder: &Path) -> [PathBuf; 2] {
    if let Some(prefix) = std::env::var_os("RTSV_CATALYST").map(PathBuf::from) {
        return [prefix.join("include/catalyst-2.0"), prefix.join("lib")];
    }
    let stand_in = member().join("tests/simulations/stand_in");
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-o"]);
    run(cc.arg(folder.join("libcatalyst.so")).arg(stand_in.join("catalyst.c")).arg("-ldl"));
    [stand_in, folder.to_owned()]
}

/// The example, compiled by `compiler`.
fn program(compiler: &Path, flags: &[&str], folder: &Path) -> PathBuf {
    let [include, lib] = catalyst(folder);
    let out = folder.join("heat");
    let mut cc = Command::new(compiler);
    cc.args(["-std=c11", "-g", "-O1", "-Wall", "-Wextra", "-Werror"]).args(flags).arg("-o");
    cc.arg(&out).arg(format!("-I{}", include.display())).arg(member().join("examples/c/heat.c"));
    cc.arg(format!("-L{}", lib.display())).arg("-lcatalyst");
    run(cc.arg(format!("-Wl,-rpath,{}", lib.display())));
    out
}

/// Writes the settings; the pictures go to `folder/out`.
fn settings(folder: &Path, text: &str) -> PathBuf {
    let out = folder.join("out");
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir_all(&out).expect("a folder");
    let file = folder.join("pictures.toml");
    let text = text.replace("OUT", &out.display().to_string());
    std::fs::write(&file, text).expect("the settings");
    file
}

/// Starts the words with the library and the settings.
fn started(words: &[&str], folder: &Path, lib: &Path, settings: &Path) -> Output {
    /// Two jobs at once on few processors wait for each other's turns.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", BOUND_SECS]).args(words).stdin(Stdio::null());
    command.envs(ENVIRONMENT).env("CATALYST_IMPLEMENTATION_PATHS", lib);
    command.env("CATALYST_RTSV_SETTINGS", settings).current_dir(folder);
    command.output().expect("coreutils' timeout runs")
}

fn pictures(folder: &Path, what: &str) -> Vec<Vec<u8>> {
    let out = folder.join("out");
    let mut names: Vec<String> = std::fs::read_dir(&out)
        .expect("the folder")
        .map(|f| f.expect("a file").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, FILES, "{what}");
    FILES.iter().map(|f| std::fs::read(out.join(f)).expect("a picture")).collect()
}

/// The pictures of one process without MPI.
fn pictures_of_one_process() -> Vec<Vec<u8>> {
    let folder = scratch("serial");
    let program = program(Path::new("cc"), &["-DSERIAL"], &folder);
    let (lib, settings) = (library(&folder), settings(&folder, SETTINGS));
    let words = [&program.display().to_string(), SIZE[0], SIZE[1]];
    let output = started(&words, &folder, &lib, &settings);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", said(&output));
    pictures(&folder, "one process")
}

#[test]
fn a_simulation_that_calls_catalyst_has_the_pictures_of_one_process_on_any_ranks() {
    let one = pictures_of_one_process();
    // The gas cools down; its walls, which are the surface, stay as they are.
    assert!(one[0] != one[1] && one[2] != one[3] && one[4] == one[5]);
    for (name, launcher, compiler) in MPIS {
        let (Some(launcher), Some(compiler)) = (peer(launcher), peer(compiler)) else { continue };
        let folder = scratch(name);
        let program = program(&compiler, &[], &folder).display().to_string();
        let lib = library(&folder);
        for ranks in ["1", "3", "4"] {
            let settings = settings(&folder, SETTINGS);
            let launcher = launcher.display().to_string();
            let words = [&launcher, "-n", ranks, &program, SIZE[0], SIZE[1]];
            let output = started(&words, &folder, &lib, &settings);
            let what = format!("{ranks} ranks of {name}");
            assert!(output.status.success(), "{what}: {}", said(&output));
            for ((file, a), b) in FILES.iter().zip(&one).zip(pictures(&folder, &what)) {
                assert!(*a == b, "{file} differs on {what}");
            }
        }
    }
}

#[test]
fn what_cannot_be_made_is_said_and_the_simulation_knows() {
    let folder = scratch("faults");
    let program = program(Path::new("cc"), &["-DSERIAL"], &folder).display().to_string();
    let lib = library(&folder);
    let cases = [
        ("picture = 1", "catalyst_initialize: ", "101"),
        ("[[picture]]\nevery = 0", "picture number 1: every is 0", "101"),
        ("[[picture]]\nchannel = \"solid\"", "there is no channel `solid`", "103"),
        ("[[picture]]\nfile = \"no/{step}.png\"\nsize = [8, 8]", "no/000010.png", "103"),
        ("[[photograph]]\narray = \"rho\"", "fields/rho: an array (there are:", "103"),
        ("[[photograph]]\nchannel = \"cells\"", "`uniform` points", "103"),
    ];
    for (text, part, status) in cases {
        let settings = settings(&folder, text);
        let output = started(&[&program, SIZE[0], SIZE[1]], &folder, &lib, &settings);
        let said = said(&output);
        assert!(!output.status.success() && said.contains(part), "{text}: {said}");
        assert!(said.contains(&format!("Catalyst returned {status}")), "{text}: {said}");
    }
    // A file that is not there.
    let output = started(&[&program], &folder, &lib, &folder.join("none.toml"));
    assert!(said(&output).contains("none.toml"), "{}", said(&output));
}

#[test]
fn without_settings_the_first_channel_is_drawn_and_that_is_said() {
    let folder = scratch("default");
    let program = program(Path::new("cc"), &["-DSERIAL"], &folder).display().to_string();
    let lib = library(&folder);
    let output = started(&[&program, "12", "10"], &folder, &lib, Path::new(""));
    let said = said(&output);
    assert!(output.status.success() && said.contains("CATALYST_RTSV_SETTINGS names no"), "{said}");
    assert!(folder.join("rtsv-000010.png").is_file(), "{said}");
}
