//! The step `main-job`: what `cargo run --release -p bench` does for users, with the programs that
//! the tests were built with.
//!
//! Nothing has to be compiled that the step `build-tests` has not: a release build takes ten
//! minutes on two cores. The dev profile optimises all members, but keeps their checks, so numbers
//! measured here mean nothing; what is checked is that every experiment runs to its end.

use crate::runner::{self, Context, Outcome};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What bench is told: nothing, which is the quick form of every experiment.
pub(crate) const ARGUMENTS: &[&str] = &[];

/// Runs the program `bench` of the build folder.
pub(crate) fn run(context: &Context<'_>) -> Outcome {
    // Nothing to do after `build-tests`; alone, this step builds what it runs, with the features
    // that the tests have.
    let built = runner::cargo(context, &["test", "--workspace", "--no-run", "--quiet"], &[]);
    if built != Outcome::Passed {
        return built;
    }
    let bench = build_folder(context.root, std::env::var_os("CARGO_TARGET_DIR").map(PathBuf::from))
        .join("debug")
        .join(format!("bench{}", std::env::consts::EXE_SUFFIX));
    println!("{}", bench.display());
    let mut command = Command::new(&bench);
    command.args(ARGUMENTS).current_dir(context.root);
    command.envs(context.peers.environment(context.options.require_peers));
    match command.status() {
        Ok(status) if status.success() => Outcome::Passed,
        Ok(status) => Outcome::Failed(format!("the main job: {status}")),
        Err(e) => Outcome::Failed(format!("`{}` does not start: {e}", bench.display())),
    }
}

/// Where cargo builds; a relative folder is one of the root, in which cargo is started.
fn build_folder(root: &Path, named: Option<PathBuf>) -> PathBuf {
    root.join(named.unwrap_or_else(|| "target".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_build_folder_is_the_one_that_cargo_is_told() {
        let root = Path::new("/r");
        assert_eq!(build_folder(root, None), Path::new("/r/target"));
        assert_eq!(build_folder(root, Some("b".into())), Path::new("/r/b"));
        assert_eq!(build_folder(root, Some("/elsewhere".into())), Path::new("/elsewhere"));
    }
}
