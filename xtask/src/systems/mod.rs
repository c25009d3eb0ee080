//! Other releases of Debian: `cargo xtask systems`, and the step `next-systems` of CI.
//!
//! A small system of the other release is made in `target/systems/SUITE` by debootstrap. The
//! checkout and the build folder are mounted in it at their own paths, so the test programs that
//! are built here run there as they are: against that release's VTK, Mesa, OpenGL programs and
//! C++ compiler.
//!
//! What a suite installs and runs is a list in [`suites`]. Only tests that compare with stock
//! programs are run; those of their files that are not run are printed by name.

mod book;
mod chroot;
mod outcome;
mod suites;

use crate::selection::OTHERS;
use crate::step::{Context, Outcome};
use chroot::Chroot;
use outcome::Tested;
use std::path::{Path, PathBuf};
use std::process::Command;
use suites::{Programs, SUITES, Suite};

/// Options of `cargo xtask systems`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SystemsOptions {
    /// The release, by Debian's name.
    suite: String,
    /// ParaView and its comparisons too: 1.8 GB more.
    paraview: bool,
    /// Write the result into the book.
    record: bool,
}

impl SystemsOptions {
    /// Reads the options from the words behind `systems`.
    pub(crate) fn parse(words: &[String]) -> Result<SystemsOptions, String> {
        let known = || SUITES.iter().map(|s| s.name).collect::<Vec<_>>().join(", ");
        let mut options =
            SystemsOptions { suite: SUITES[0].name.to_owned(), paraview: false, record: false };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            match word.as_str() {
                "--suite" => {
                    let name = words.next().ok_or("`--suite` needs a name, as in `trixie`")?;
                    if !SUITES.iter().any(|s| s.name == name) {
                        return Err(format!("`--suite {name}`: there are {}", known()));
                    }
                    options.suite.clone_from(name);
                }
                "--paraview" => options.paraview = true,
                "--record" => options.record = true,
                other => {
                    return Err(format!(
                        "`systems` does not know `{other}`; see `cargo xtask help`"
                    ));
                }
            }
        }
        Ok(options)
    }
}

/// Where things are, and whether the machine may be changed.
#[derive(Debug)]
pub(crate) struct Place<'a> {
    /// The workspace.
    pub(crate) root: &'a Path,
    /// Cargo's build folder.
    pub(crate) build: PathBuf,
    /// Whether packages may be installed on this machine (debootstrap).
    pub(crate) may_install: bool,
}

impl<'a> Place<'a> {
    /// In cargo's build folder of the workspace `root`.
    pub(crate) fn of(root: &'a Path, may_install: bool) -> Place<'a> {
        let build = crate::main_job::build_folder(root, crate::build_folder_named());
        Place { root, build, may_install }
    }
}

/// The step that [`prepare`] saves time for.
pub(crate) const STEP: &str = "next-systems";

/// Makes the system that [`check`] needs, beside other steps: it mostly waits for the network.
/// What fails here fails again in `check`, which reports it.
pub(crate) fn prepare(root: &Path, may_install: bool) {
    let place = Place::of(root, may_install);
    if chroot::allowed(place.may_install).is_ok() {
        let _ = Chroot::make(&place, &SUITES[0], false);
    }
}

/// The step `next-systems`: the first suite without ParaView, with the tests that `build-tests`
/// built.
pub(crate) fn check(context: &Context<'_>) -> Outcome {
    let place = Place::of(context.root, !context.options.keep_machine);
    let suite = SUITES[0].name.to_owned();
    let options = SystemsOptions { suite, paraview: false, record: false };
    run(&place, &options)
}

/// Runs what `options` ask for.
pub(crate) fn run(place: &Place<'_>, options: &SystemsOptions) -> Outcome {
    let Some(suite) = SUITES.iter().find(|s| s.name == options.suite) else {
        return Outcome::Failed(format!("no suite `{}`", options.suite));
    };
    if let Err(why) = chroot::allowed(place.may_install) {
        return Outcome::NotRun(format!("{} was not tried: {why}", suite.title));
    }
    match tested(place, suite, options) {
        Ok(faults) if faults.is_empty() => Outcome::Passed,
        Ok(faults) => Outcome::Failed(format!("{}: {}", suite.title, faults.join(", "))),
        Err(why) => Outcome::Failed(format!("{}: {why}", suite.title)),
    }
}

/// Makes the system and runs the tests there. The result names the tests that failed.
fn tested(
    place: &Place<'_>,
    suite: &Suite,
    options: &SystemsOptions,
) -> Result<Vec<String>, String> {
    let programs = test_programs(place.root, suite)?;
    let paraview = options.paraview;
    let chroot = Chroot::make(place, suite, paraview)?;
    let versions = chroot.versions();
    println!("{}: {versions}", suite.title);
    let mut faults = Vec::new();
    let mut shares = Vec::new();
    let parts = suite.parts.iter().filter(|p| !p.paraview || paraview);
    let mut skipped = Vec::new();
    for part in parts {
        let program = test_program(&programs, part.test)?;
        let output = chroot.run(program, part)?;
        let tested = Tested::read(&output);
        faults.extend(tested.faults(part.test, suite.known));
        shares.push(format!("{} of {}", tested.share(), part.tells));
        skipped.extend(tested.skipped.iter().map(|s| format!("{}: {s}", part.test)));
    }
    println!("\nNot run on {}:", suite.title);
    suite.left_out.iter().for_each(|what| println!("  {what}"));
    if !paraview {
        println!("  ParaView's comparisons: cargo xtask systems --suite {} --paraview", suite.name);
    }
    skipped.iter().for_each(|what| println!("  {what}"));
    for (test, why) in suite.known {
        println!("  known to differ, {test}: {why}");
    }
    let row = format!("| {} | {versions} | {} |", suite.title, shares.join("; "));
    println!("\n{row}");
    if options.record {
        let key = format!("system {}{}", suite.name, if paraview { " paraview" } else { "" });
        book::record(&place.root.join(book::PAGE), &key, &row)?;
    }
    Ok(faults)
}

/// Builds the test programs of `suite`.
fn test_programs(root: &Path, suite: &Suite) -> Result<Programs, String> {
    // As `build-tests` does: with other features, everything would be built again.
    let mut args = [&["test", "--no-run"][..], &OTHERS].concat();
    for part in suite.parts {
        if !args.contains(&part.test) {
            args.extend(["--test", part.test]);
        }
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    println!("cargo {}", args.join(" "));
    let output = Command::new(cargo).args(&args).current_dir(root).output();
    let output = output.map_err(|e| format!("cargo does not start: {e}"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("`cargo {}`: {}\n{text}", args.join(" "), output.status));
    }
    Ok(executables(&text).into_iter().map(|p| root.join(p)).collect())
}

/// The paths in lines like `  Executable tests/main.rs (target/debug/deps/main-0123)`.
fn executables(text: &str) -> Programs {
    let lines = text.lines().filter_map(|l| l.trim().strip_prefix("Executable "));
    lines.filter_map(|l| Some(l.rsplit_once('(')?.1.strip_suffix(')')?.into())).collect()
}

/// The one test program of this name. Two members may have one each, and cargo does not say whose.
fn test_program<'a>(programs: &'a Programs, name: &str) -> Result<&'a PathBuf, String> {
    let found: Vec<&PathBuf> = programs.iter().filter(|p| named(p, name)).collect();
    match found[..] {
        [program] => Ok(program),
        [] => Err(format!("cargo built no test program {name}")),
        _ => Err(format!("{} members have a test program {name}: rename one", found.len())),
    }
}

/// Whether `program` is cargo's file of the test `name`: `name-0123456789abcdef`.
fn named(program: &Path, name: &str) -> bool {
    let file = program.file_name().unwrap_or_default().to_string_lossy();
    file.rsplit_once('-').is_some_and(|(stem, _)| stem == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_programs_are_found_in_what_cargo_prints() {
        let text = "   Compiling gluray v0.1.0\n    Finished `test` profile\n  Executable unittests \
                    src/lib.rs (target/debug/deps/gluray-01ab)\n  Executable tests/programs.rs \
                    (/t/debug/deps/programs-23cd)\n";
        let found = executables(text);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(named(&found[1], "programs") && !named(&found[1], "program"));
        assert!(named(Path::new("/t/against_stock-77"), "against_stock"));
    }

    #[test]
    fn two_test_programs_of_one_name_are_not_taken_for_each_other() {
        let programs = ["/t/programs-01", "/t/programs-02", "/t/traps-03"].map(Into::into).into();
        assert!(test_program(&programs, "programs").unwrap_err().starts_with("2 members"));
        assert_eq!(test_program(&programs, "traps").unwrap(), Path::new("/t/traps-03"));
        assert!(test_program(&programs, "modes").unwrap_err().contains("no test program modes"));
    }

    #[test]
    fn options_of_systems_are_read_and_wrong_ones_refused() {
        let parsed = |line: &str| {
            SystemsOptions::parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
        };
        let plain = SystemsOptions { suite: "trixie".to_owned(), paraview: false, record: false };
        assert_eq!(parsed(""), Ok(plain));
        let all = SystemsOptions { suite: "forky".to_owned(), paraview: true, record: true };
        assert_eq!(parsed("--suite forky --paraview --record"), Ok(all));
        for wrong in ["--suite", "--suite sarge", "now"] {
            assert!(parsed(wrong).is_err(), "{wrong}");
        }
    }
}
