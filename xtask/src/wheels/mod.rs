//! `cargo xtask wheels`, and the step `wheels` of CI: the Python packages with native modules, each
//! as a wheel and as a source archive, installed in fresh environments and tested there.
//!
//! maturin makes them and checks each wheel against the policy in its `pyproject.toml`, as
//! auditwheel would: `manylinux_2_34` for rt_core, which is glibc 2.34 or later (Debian 12, Ubuntu
//! 22.04, RHEL 9), and `manylinux_2_35` for schlieren, whose `hypot` has a new version there. An
//! older one needs a build on an older system.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::first_line_of;
use crate::main_job;
use crate::step::{Context, Outcome};

const MATURIN: &str = "maturin==1.16.0";
/// A Python package of the workspace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Package {
    /// What Python imports.
    name: &'static str,
    folder: &'static str,
    /// The member of the workspace.
    member: &'static str,
    /// What the parts of the package that adapt others are for. Debian's Python gets it, and the
    /// other interpreters test the package alone.
    adapted: &'static [&'static str],
    reference: Reference,
}

/// The program whose answers the tests compare bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Reference {
    /// What cargo builds.
    target: &'static [&'static str],
    /// Where it lies in the folder of the profile.
    path: &'static str,
    /// The variable that tells the tests.
    variable: &'static str,
}

const PACKAGES: &[Package] = &[
    Package {
        name: "rt_core",
        folder: "rt-core/python",
        member: "rt-core-python",
        // Open3D is not here: its wheel has 400 MB.
        adapted: &["trimesh", "rtree", "scipy", "embreex", "pyvista"],
        reference: Reference {
            target: &["-p", "rt-core", "--example", "bits"],
            path: "examples/bits",
            variable: "RTSV_RT_CORE_BITS",
        },
    },
    Package {
        name: "schlieren",
        folder: "schlieren/python",
        member: "schlieren-python",
        adapted: &["pyvista", "xarray", "matplotlib"],
        reference: Reference {
            target: &["-p", "schlieren", "--bin", "schlieren"],
            path: "schlieren",
            variable: "RTSV_SCHLIEREN_PROGRAM",
        },
    },
];
/// Largest wheel of a release build, in bytes.
const LARGEST: u64 = 6_000_000;
/// Interpreters that are looked for, and those of pyenv. The first is Debian's.
const PYTHONS: &[&str] =
    &["/usr/bin/python3", "python3.10", "python3.11", "python3.12", "python3.13", "python3.14"];
/// Seconds that the package takes to import beyond numpy, the least of five, and the packages
/// that are installed beside it.
const FRESH: &str = "
import subprocess, sys, importlib.metadata as m
name = sys.argv[1]
def least(code):
    run = 'import time, numpy; t = time.perf_counter(); ' + code + '; print(time.perf_counter() - t)'
    return min(float(subprocess.check_output([sys.executable, '-c', run])) for _ in range(5))
seconds = least('import ' + name)
others = {d.metadata['Name'].lower() for d in m.distributions()} - {'pip', 'setuptools', 'wheel'}
print(f'import {seconds:.3f} s beyond numpy; installed: {sorted(others)}')
assert seconds <= 0.1, 'the import takes more than 0.1 s'
assert others == {'numpy', name}, 'numpy alone should be needed'
";

/// Options of `cargo xtask wheels`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct WheelsOptions {
    /// Cargo's profile.
    profile: String,
    /// Folder for the wheels; `None` is `wheels/dist` in the build folder.
    out: Option<PathBuf>,
    /// The packages to build.
    packages: Vec<Package>,
}

impl WheelsOptions {
    /// Reads the options from the words behind `wheels`.
    pub(crate) fn parse(words: &[String]) -> Result<WheelsOptions, String> {
        let mut options =
            WheelsOptions { profile: "release".to_owned(), out: None, packages: PACKAGES.to_vec() };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            let mut value = |example: &str| {
                words.next().cloned().ok_or(format!("`{word}` needs a value, as in `{example}`"))
            };
            match word.as_str() {
                "--profile" => options.profile = value("--profile dev")?,
                "--out" => options.out = Some(value("--out /tmp/wheels")?.into()),
                "--package" => {
                    let name = value("--package schlieren")?;
                    options.packages.retain(|p| p.name == name);
                    if options.packages.is_empty() {
                        let names: Vec<&str> = PACKAGES.iter().map(|p| p.name).collect();
                        return Err(format!(
                            "there is no package `{name}`; there are: {}",
                            names.join(", ")
                        ));
                    }
                }
                other => {
                    return Err(format!(
                        "`wheels` does not know `{other}`; see `cargo xtask help`"
                    ));
                }
            }
        }
        Ok(options)
    }
}

/// The step of CI: with the profile that the other steps have built with.
pub(crate) fn check(context: &Context<'_>) -> Outcome {
    if context.options.keep_machine {
        return Outcome::NotRun("it installs packages from PyPI, which was forbidden".to_owned());
    }
    let build = main_job::build_folder(context.root, crate::build_folder_named());
    let options =
        WheelsOptions { profile: "dev".to_owned(), out: None, packages: PACKAGES.to_vec() };
    match run(context.root, &build, &options) {
        Ok(()) => Outcome::Passed,
        Err(why) => Outcome::Failed(why),
    }
}

/// Builds, installs, tests, and prints sizes and times.
pub(crate) fn run(root: &Path, build: &Path, options: &WheelsOptions) -> Result<(), String> {
    let work = build.join("wheels");
    let out = options.out.clone().unwrap_or_else(|| work.join("dist"));
    let out = std::path::absolute(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    let tools = environment(&work.join("tools"), PYTHONS[0])?;
    pip(&tools, &[MATURIN])?;
    let found = interpreters();
    let newest: Vec<&str> = found.iter().map(|(_, version)| version.as_str()).collect();
    println!("{} (looked for {} and pyenv's)", newest.join(", "), PYTHONS.join(", "));
    if found.is_empty() {
        return Err("no Python of 3.10 or later was found; install python3-venv".to_owned());
    }
    for package in &options.packages {
        println!("\n{}", package.name);
        let maturin = tools.join("bin/maturin");
        let wheel = make(package, root, build, options, &maturin, &out.join(package.name))?;
        let reference = reference_program(package, root, build, &options.profile)?;
        for (number, (python, version)) in found.iter().enumerate() {
            println!("\n{}, {version}: {python}", package.name);
            let adapted = number == 0;
            let venv = match package.name {
                // bench finds it there.
                "rt_core" if adapted => build.join(main_job::RT_CORE_PYTHON),
                name => work.join(format!("{name} {version}").replace(' ', "-")),
            };
            let venv = environment(&venv, python)?;
            test(package, root, &wheel, &reference, &venv, adapted)?;
        }
    }
    Ok(())
}

/// The wheel; and the source archive, which is built too.
fn make(
    package: &Package,
    root: &Path,
    build: &Path,
    options: &WheelsOptions,
    maturin: &Path,
    out: &Path,
) -> Result<PathBuf, String> {
    let manifest = root.join(package.folder).join("Cargo.toml").display().to_string();
    let place = out.display().to_string();
    let _ = fs::remove_dir_all(out);
    let mut wheel = Command::new(maturin);
    wheel.args(["build", "--locked", "--profile", &options.profile]);
    wheel.args(["-m", &manifest, "--out", &place]);
    // Lines of code for a debugger would be most of the wheel.
    run_it(wheel.current_dir(root).env("CARGO_PROFILE_RELEASE_DEBUG", "none"))?;
    let mut sdist = Command::new(maturin);
    run_it(sdist.current_dir(root).args(["sdist", "-m", &manifest, "--out", &place]))?;
    let wheel = find(out, ".whl")?;
    let archive = find(out, ".tar.gz")?;
    for file in [&wheel, &archive] {
        let bytes = fs::metadata(file).map_err(|e| format!("{}: {e}", file.display()))?.len();
        println!("{} ({:.2} MB)", file.display(), bytes as f64 / 1e6);
        if options.profile == "release" && bytes > LARGEST {
            return Err(format!("{} is larger than 6 MB", file.display()));
        }
    }
    build_archive(package, &archive, &build.join("wheels"), build)?;
    Ok(wheel)
}

/// Installs the wheel in a fresh environment and runs the package's tests there.
fn test(
    package: &Package,
    root: &Path,
    wheel: &Path,
    reference: &Path,
    venv: &Path,
    adapted: bool,
) -> Result<(), String> {
    pip(venv, &[&wheel.display().to_string()])?;
    let program = venv.join("bin/python");
    run_it(Command::new(&program).args(["-c", FRESH, package.name]))?;
    let tools: &[&str] = if adapted { package.adapted } else { &[] };
    pip(venv, &[&["pytest"], tools].concat())?;
    let mut tests = Command::new(&program);
    tests.args(["-B", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs"]);
    // Not in the package's folder, whose Python files have no native module beside them.
    let folder = root.join(package.folder).join("tests");
    run_it(tests.current_dir(folder).env(package.reference.variable, reference))
}

/// The interpreters of this machine that the wheel is for, one of each version.
fn interpreters() -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let named = PYTHONS.iter().map(|python| (*python).to_owned());
    for python in named.chain(of_pyenv()) {
        let Some(version) = first_line_of(&python, &["--version"]) else { continue };
        if is_supported(&version) && found.iter().all(|(_, v)| minor(v) != minor(&version)) {
            found.push((python, version));
        }
    }
    found
}

/// Interpreters that pyenv keeps; its command `python3.12` runs only what a folder asks for.
fn of_pyenv() -> Vec<String> {
    let home = std::env::home_dir().unwrap_or_default().join(".pyenv");
    let root = std::env::var_os("PYENV_ROOT").map_or(home, PathBuf::from);
    let folders = fs::read_dir(root.join("versions")).into_iter().flatten().flatten();
    let mut pythons: Vec<String> =
        folders.map(|f| f.path().join("bin/python3").display().to_string()).collect();
    pythons.sort();
    pythons
}

/// The minor version in `Python 3.11.2`.
fn minor(version: &str) -> Option<u32> {
    version.strip_prefix("Python 3.")?.split('.').next()?.parse().ok()
}

fn is_supported(version: &str) -> bool {
    minor(version).is_some_and(|m| m >= 10)
}

/// A fresh environment of an interpreter.
fn environment(folder: &Path, python: &str) -> Result<PathBuf, String> {
    let _ = fs::remove_dir_all(folder);
    run_it(Command::new(python).args(["-m", "venv"]).arg(folder))?;
    Ok(folder.to_owned())
}

fn pip(venv: &Path, packages: &[&str]) -> Result<(), String> {
    let mut pip = Command::new(venv.join("bin/python"));
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    run_it(pip.args(packages))
}

/// Whether cargo alone takes the source archive: maturin's part is only to pack what it makes.
fn build_archive(
    package: &Package,
    archive: &Path,
    work: &Path,
    build: &Path,
) -> Result<(), String> {
    let folder = work.join("sdist").join(package.name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut tar = Command::new("tar");
    run_it(tar.arg("xzf").arg(archive).arg("--strip-components=1").arg("-C").arg(&folder))?;
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // Not `--locked`: the lock file also names what other members need, and cargo leaves it out.
    cargo.args(["check", "-p", package.member, "--target-dir"]);
    let build = std::path::absolute(build).map_err(|e| format!("{}: {e}", build.display()))?;
    run_it(cargo.arg(build).current_dir(&folder))
}

/// Builds the program that the tests compare with.
fn reference_program(
    package: &Package,
    root: &Path,
    build: &Path,
    profile: &str,
) -> Result<PathBuf, String> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--profile", profile]);
    run_it(cargo.args(package.reference.target).current_dir(root))?;
    // The profile `dev` builds in `debug`.
    let folder = build.join(if profile == "dev" { "debug" } else { profile });
    std::path::absolute(folder.join(package.reference.path)).map_err(|e| e.to_string())
}

/// The file in `folder` that ends with `ending`.
fn find(folder: &Path, ending: &str) -> Result<PathBuf, String> {
    let files = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files = files.filter_map(|f| Some(f.ok()?.path()));
    let found = files.find(|f| f.to_string_lossy().ends_with(ending));
    found.ok_or_else(|| format!("{}: maturin made no file *{ending}", folder.display()))
}

/// Runs a command that has to succeed.
fn run_it(command: &mut Command) -> Result<(), String> {
    let name = format!("{command:?}").chars().take(200).collect::<String>();
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{name}: {status}")),
        Err(e) => Err(format!("{name}: {e}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_of_python_are_read_and_old_ones_left_out() {
        assert_eq!(minor("Python 3.11.2"), Some(11));
        assert_eq!(minor("Python 2.7.18"), None);
        for (version, supported) in
            [("Python 3.9.18", false), ("Python 3.10.13", true), ("Python 3.14.0rc1", true)]
        {
            assert_eq!(is_supported(version), supported, "{version}");
        }
    }

    #[test]
    fn options_of_wheels_are_read() {
        let parse = |text: &str| {
            WheelsOptions::parse(&text.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
        };
        assert_eq!(parse("").unwrap().profile, "release");
        assert_eq!(parse("--profile dev").unwrap().profile, "dev");
        assert_eq!(parse("").unwrap().packages.len(), PACKAGES.len());
        assert_eq!(parse("--package schlieren").unwrap().packages, [PACKAGES[1]]);
        assert!(parse("--package vtk").unwrap_err().contains("rt_core, schlieren"));
        assert!(parse("--profile").is_err() && parse("--fast").is_err());
    }
}
