//! The same frames under SimGrid's SMPI, the established simulator of MPI programs, to validate our
//! model.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Environment variable with the path of the program `composite`.
const PROGRAM_VARIABLE: &str = "RTSV_COMPOSITE";
/// Environment variable that gives the program `composite` its shared library.
const LIBRARY_VARIABLE: &str = "COMPOSITE_SMPI_LIBRARY";

/// The program `composite`, if it has been built.
fn program() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os(PROGRAM_VARIABLE) {
        return Some(named.into());
    }
    let beside = std::env::current_exe().ok()?.with_file_name("composite");
    beside.is_file().then_some(beside)
}

/// The shared library that was built with a program.
fn library(program: &Path) -> Option<PathBuf> {
    let built = program.with_file_name("examples").join("libcomposite_smpi.so");
    built.is_file().then_some(built)
}

/// Median time in milliseconds of direct send, and of IceT's best strategy, for frames of
/// `composite compare` under SMPI; or the reason why there is none. With `as_built`, an existing
/// library is used. Otherwise `composite` runs cargo to update it, which can take minutes and waits
/// for other cargo processes.
pub(super) fn compare_ms(
    ranks: usize,
    size: u32,
    frames: usize,
    as_built: bool,
) -> Result<[f64; 2], String> {
    let program = program().ok_or_else(|| {
        format!(
            "the program `composite` is not beside this one: cargo build -p composite \
                 --features cli (with the same --release), or name it in {PROGRAM_VARIABLE}"
        )
    })?;
    let mut command = Command::new(&program);
    if as_built && std::env::var_os(LIBRARY_VARIABLE).is_none() {
        let library = library(&program).ok_or(
            "the quick form builds nothing, and the library for SimGrid is not beside the program \
             `composite`: \
             cargo build -p composite --example composite_smpi (with the same --release)",
        )?;
        command.env(LIBRARY_VARIABLE, library);
    }
    let (ranks, size, frames) = (ranks.to_string(), size.to_string(), frames.to_string());
    let output = command
        .args(["compare", "--smpi", "--json", "--quiet", "--scene", "discs"])
        .args(["--ranks", &ranks, "--size", &size, "--frames", &frames])
        .output()
        .map_err(|e| e.to_string())?;
    let stdout = String::from_utf8_lossy(&output.stdout);
    let value: Option<serde_json::Value> = stdout
        .lines()
        .rev()
        .find_map(|l| serde_json::from_str(l).ok())
        .or_else(|| serde_json::from_str(&stdout).ok());
    let row = value.as_ref().map(|v| &v["rows"][0]);
    let number = |name: &str| row.and_then(|r| r[name].as_f64());
    number("ours_ms").zip(number("rival_ms")).map(|(a, b)| [a, b]).ok_or_else(|| {
        let why = String::from_utf8_lossy(&output.stderr);
        let last = why
            .lines()
            .rev()
            .find(|l| !l.trim().is_empty())
            .unwrap_or("no reason given")
            .to_string();
        format!("composite compare --smpi ended with {}: {last}", output.status)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_is_not_beside_its_program_is_not_taken() {
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("composite");
        assert_eq!(library(&program), None);
        let built = folder.path().join("examples");
        std::fs::create_dir(&built).expect("a folder in it");
        assert_eq!(library(&program), None);
        let built = built.join("libcomposite_smpi.so");
        std::fs::write(&built, "").expect("a file in that");
        assert_eq!(library(&program), Some(built));
    }
}
