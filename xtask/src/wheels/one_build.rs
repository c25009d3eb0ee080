//! What maturin calls as cargo in CI: it builds what `build-tests` builds, and shows maturin one
//! package.
//!
//! maturin calls `cargo rustc` for one package. The packages that it needs then have other features
//! than in the step `build-tests`, where all members and their tests ask for some; so cargo
//! compiled rt-core twice more, and datasets and schlieren once. With all members and their tests,
//! only what Python's interface needs is left to compile. `cargo xtask wheels`, which makes
//! what is published, calls cargo itself.

use std::ffi::{OsStr, OsString};
use std::io::Write as _;
use std::process::{Command, ExitCode, Stdio};

use crate::selection::OTHERS;

/// The variable that holds the real cargo, and makes this program stand in for it.
pub(crate) const CARGO: &str = "XTASK_ONE_BUILD_CARGO";

/// The targets of `build-tests`, and the libraries that have no tests: those of Python.
const TARGETS: &[&str] = &["--lib", "--bins", "--tests"];

/// Runs the command that maturin gives.
pub(crate) fn run(cargo: &OsStr, args: impl Iterator<Item = OsString>) -> ExitCode {
    let args: Vec<String> = args.map(|a| a.to_string_lossy().into_owned()).collect();
    let mut command = Command::new(cargo);
    command.env_remove("CARGO").env_remove(CARGO);
    let Some(manifest) = manifest_of(&args) else {
        let status = command.args(&args).status();
        return exit_code(status.ok().and_then(|s| s.code()));
    };
    command.arg("build").args(OTHERS).args(TARGETS).args([
        "--message-format",
        "json-render-diagnostics",
        "--locked",
    ]);
    let output = match command.stdin(Stdio::null()).stderr(Stdio::inherit()).output() {
        Ok(output) => output,
        Err(e) => {
            eprintln!("{}: {e}", cargo.display());
            return ExitCode::FAILURE;
        }
    };
    let mut out = std::io::stdout().lock();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        if is_of(line, manifest) && writeln!(out, "{line}").is_err() {
            return ExitCode::FAILURE;
        }
    }
    exit_code(output.status.code())
}

fn exit_code(code: Option<i32>) -> ExitCode {
    ExitCode::from(code.and_then(|c| u8::try_from(c).ok()).unwrap_or(1))
}

/// The manifest of the package that is to be built; `None` for other commands.
fn manifest_of(args: &[String]) -> Option<&str> {
    let at = args.iter().position(|a| a == "--manifest-path")?;
    let manifest = args.get(at + 1)?;
    (args.first()? == "rustc").then_some(manifest)
}

/// Whether a message of cargo is of this package, or of no package.
fn is_of(line: &str, manifest: &str) -> bool {
    let of_package = line.contains(&format!("\"manifest_path\":\"{manifest}\""));
    of_package || line.contains("\"reason\":\"build-finished\"")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maturin_s_build_is_known_and_other_commands_are_passed_on() {
        let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let build = words("rustc --profile dev --manifest-path /a/Cargo.toml --lib -- -C strip=x");
        assert_eq!(manifest_of(&build), Some("/a/Cargo.toml"));
        for other in ["metadata --manifest-path /a/Cargo.toml", "--version", "rustc --lib"] {
            assert_eq!(manifest_of(&words(other)), None, "{other}");
        }
    }

    #[test]
    fn maturin_sees_one_package() {
        let of = |name: &str| {
            format!("{{\"reason\":\"compiler-artifact\",\"manifest_path\":\"/{name}/Cargo.toml\"}}")
        };
        assert!(is_of(&of("a"), "/a/Cargo.toml") && !is_of(&of("b"), "/a/Cargo.toml"));
        assert!(is_of("{\"reason\":\"build-finished\",\"success\":true}", "/a/Cargo.toml"));
    }
}
