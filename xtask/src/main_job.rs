//! The step `main-job`: runs what `cargo run --release -p bench` does for users, with the binaries
//! that the tests were built with.
//!
//! Nothing needs to be compiled beyond the step `build-tests`: a release build takes ten minutes on
//! two cores. The dev profile optimises all members but keeps their checks, so the measured times
//! are meaningless. The step checks that every experiment runs to its end.

use crate::selection::OTHERS;
use crate::step::{Context, Outcome};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Arguments of bench: none, which runs the quick form of every experiment.
pub(crate) const ARGUMENTS: &[&str] = &[];

/// The environments in the build folder that the step `wheels` installs the Python packages in,
/// with the packages that bench compares them with.
pub(crate) const RT_CORE_PYTHON: &str = "wheels/adapted";
pub(crate) const SCHLIEREN_PYTHON: &str = "wheels/schlieren";
pub(crate) const RTVTK_PYTHON: &str = "wheels/rtvtk";
/// How bench is told.
const PYTHONS: [(&str, &str); 3] = [
    ("RTSV_RT_CORE_PYTHON", RT_CORE_PYTHON),
    ("RTSV_SCHLIEREN_PYTHON", SCHLIEREN_PYTHON),
    ("RTSV_RTVTK_PYTHON", RTVTK_PYTHON),
];

/// Runs the program `bench` of the build folder.
pub(crate) fn run(context: &Context<'_>) -> Outcome {
    // A no-op after `build-tests`. When run alone, this step builds what it needs, with the
    // features of the tests.
    let args = [&["test", "--no-run", "--quiet"][..], &OTHERS].concat();
    let built = context.cargo(&args, &[]);
    if built != Outcome::Passed {
        return built;
    }
    let bench = build_folder(context.root, crate::build_folder_named())
        .join("debug")
        .join(format!("bench{}", std::env::consts::EXE_SUFFIX));
    println!("{}", bench.display());
    let mut command = Command::new(&bench);
    command.args(ARGUMENTS).current_dir(context.root);
    command.envs(context.peers.environment(context.options.require_peers));
    let build = build_folder(context.root, crate::build_folder_named());
    for (variable, environment) in PYTHONS {
        let python = build.join(environment).join("bin/python");
        if python.is_file() {
            command.env(variable, python);
        }
    }
    match command.status() {
        Ok(status) if status.success() => Outcome::Passed,
        Ok(status) => Outcome::Failed(format!("the main job: {status}")),
        Err(e) => Outcome::Failed(format!("`{}` does not start: {e}", bench.display())),
    }
}

/// The directory where cargo builds; a relative path is relative to the root, where cargo is
/// started.
pub(crate) fn build_folder(root: &Path, named: Option<PathBuf>) -> PathBuf {
    root.join(named.unwrap_or_else(|| "target".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_build_folder_is_the_configured_one() {
        let root = Path::new("/r");
        assert_eq!(build_folder(root, None), Path::new("/r/target"));
        assert_eq!(build_folder(root, Some("b".into())), Path::new("/r/b"));
        assert_eq!(build_folder(root, Some("/elsewhere".into())), Path::new("/elsewhere"));
    }
}
