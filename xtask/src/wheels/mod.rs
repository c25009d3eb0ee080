//! `cargo xtask wheels`, and the step `wheels` of CI: the Python packages with native modules, each
//! as a wheel and as a source archive, installed in fresh environments and tested there.
//!
//! maturin makes rt_core and schlieren, and rtvtk's own backend rtvtk. auditwheel checks that each
//! keeps to the policy in its name: `manylinux_2_34`, which is glibc 2.34 or later (Debian 12,
//! Ubuntu 22.04, RHEL 9), and `manylinux_2_35` for schlieren, whose `hypot` has a new version
//! there. An older one needs a build on an older system.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::first_line_of;
use crate::main_job;
use crate::side_by_side;
use crate::step::{Context, Outcome};

mod make;
pub(crate) mod one_build;
mod packages;

use make::{Places, absolute, arguments_of_tests, cargo, make};
use packages::{PACKAGES, Package, Reference};

/// What makes wheels of native modules, and what checks them.
const TOOLS: &[&str] = &["maturin==1.16.0", "auditwheel==6.8.2"];
/// Interpreters that are looked for, and those of pyenv. The first is Debian's.
const PYTHONS: &[&str] =
    &["/usr/bin/python3", "python3.10", "python3.11", "python3.12", "python3.13", "python3.14"];
/// A test of rt-core that `build-tests` has built.
const WITH_FEATURES_OF_TESTS: &str = "hard_cases";
/// That nothing but numpy is installed beside the package. What the import loads is tested in
/// Python, and how long it takes is measured by bench's experiment `python`.
const ALONE: &str = "
import sys, importlib.metadata as m
name = sys.argv[1]
__import__(name)
others = {d.metadata['Name'].lower() for d in m.distributions()} - {'pip', 'setuptools', 'wheel'}
print(f'installed: {sorted(others)}')
assert others == set(sys.argv[1:]), 'no other packages should be needed'
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
    pip(&tools, TOOLS)?;
    let found = interpreters();
    let newest: Vec<&str> = found.iter().map(|(_, version)| version.as_str()).collect();
    println!("{} (looked for {} and pyenv's)", newest.join(", "), PYTHONS.join(", "));
    if found.is_empty() {
        return Err("no Python of 3.10 or later was found; install python3-venv".to_owned());
    }
    for package in &options.packages {
        println!("\n{}", package.name);
        let out = out.join(package.name);
        let places = Places { root, build, tools: &tools, out: &out };
        let wheel = make(package, &places, options)?;
        let reference = package.reference.map(|reference| {
            let program = reference_program(&reference, root, build, &options.profile);
            program.map(|program| (reference.variable, program))
        });
        let reference = reference.transpose()?;
        let numbered: Vec<_> = found.iter().enumerate().collect();
        let tested = side_by_side::each(&numbered, side_by_side::at_once(), |item| {
            let (number, (python, version)) = *item;
            let beside = match number {
                0 => package.adapted,
                _ => package.others[(number - 1) % package.others.len()],
            };
            let venv = match number {
                // bench finds it there.
                0 => build.join(package.environment),
                _ => work.join(format!("{} {version}", package.name).replace(' ', "-")),
            };
            let venv = environment(&venv, python)?;
            let said = test(package, root, &wheel, reference.as_ref(), &venv, beside)?;
            println!("\n{}, {version}: {python}\n{said}", package.name);
            Ok::<_, String>(())
        });
        tested.into_iter().collect::<Result<Vec<()>, String>>()?;
    }
    Ok(())
}

/// Installs the wheel in a fresh environment and runs the package's tests there. Returns what they
/// print.
fn test(
    package: &Package,
    root: &Path,
    wheel: &Path,
    reference: Option<&(&str, PathBuf)>,
    venv: &Path,
    beside: &[&str],
) -> Result<String, String> {
    let file = wheel.display().to_string();
    let program = venv.join("bin/python");
    if package.alone_with.is_empty() {
        pip(venv, &[&[file.as_str(), "pytest"], beside].concat())?;
    } else {
        pip(venv, &[&file])?;
        let alone = [&["-c", ALONE, package.name], package.alone_with].concat();
        output_of(Command::new(&program).args(alone))?;
        pip(venv, &[&["pytest"], beside].concat())?;
    }
    let mut tests = Command::new(&program);
    tests.args(["-B", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs"]);
    // Not in the package's folder, whose Python files have no native module beside them.
    let folder = root.join(package.folder).join("tests");
    tests.envs(reference.map(|(variable, program)| (variable, program)));
    output_of(tests.current_dir(folder))
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

/// Builds the program that the tests compare with.
fn reference_program(
    reference: &Reference,
    root: &Path,
    build: &Path,
    profile: &str,
) -> Result<PathBuf, String> {
    run_it(cargo().args(arguments_of_reference(reference, profile)).current_dir(root))?;
    // The profile `dev` builds in `debug`.
    let folder = build.join(if profile == "dev" { "debug" } else { profile });
    absolute(&folder.join(reference.path))
}

/// What cargo is asked for to build the program. For the profile `dev` that is one that
/// `build-tests` has built, except for an example.
fn arguments_of_reference<'a>(reference: &Reference, profile: &'a str) -> Vec<&'a str> {
    let build: &[&str] = match (profile, reference.is_example()) {
        ("dev", false) => return arguments_of_tests(),
        // A test beside the example: cargo then asks for the features that tests need, and compiles
        // the example alone. Without one it compiles rt-core once more.
        ("dev", true) => &["build", "--workspace", "--test", WITH_FEATURES_OF_TESTS],
        _ => &["build", "--workspace", "--profile", profile],
    };
    [build, reference.target].concat()
}

/// What a command that has to succeed prints. Where it fails this is in the error.
fn output_of(command: &mut Command) -> Result<String, String> {
    let name = format!("{command:?}").chars().take(200).collect::<String>();
    let output = command.output().map_err(|e| format!("{name}: {e}"))?;
    let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let all = said(&output.stdout) + &said(&output.stderr);
    if output.status.success() { Ok(all) } else { Err(format!("{all}\n{name}: {}", output.status)) }
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
    fn an_example_that_tests_compare_with_is_built_where_no_other_step_does() {
        let references: Vec<Reference> = PACKAGES.iter().filter_map(|p| p.reference).collect();
        assert!(references.iter().any(Reference::is_example));
        for reference in &references {
            for profile in ["dev", "release"] {
                let arguments = arguments_of_reference(reference, profile);
                let names_it = reference.target.iter().all(|word| arguments.contains(word));
                let of_tests = profile == "dev" && !reference.is_example();
                assert_eq!(names_it, !of_tests, "{profile}: {arguments:?}");
            }
        }
        let test = format!("rt-core/tests/{WITH_FEATURES_OF_TESTS}/main.rs");
        assert!(crate::workspace_root().join(test).is_file());
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
        assert!(parse("--package vtk").unwrap_err().contains("rt_core, schlieren, rtvtk"));
        assert!(parse("--profile").is_err() && parse("--fast").is_err());
    }
}
