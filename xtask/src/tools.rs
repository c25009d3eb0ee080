//! Steps that examine the machine: the compiler and its tools, the peers, cargo-deny.

use crate::command::first_line_of;
use crate::step::{Context, Outcome};

/// Checks that the compiler is at least the `rust-version` of the workspace, and that rustfmt and
/// clippy are installed.
pub(crate) fn check_tools(context: &Context<'_>) -> Outcome {
    let manifest = match std::fs::read_to_string(context.root.join("Cargo.toml")) {
        Ok(text) => text,
        Err(e) => return Outcome::Failed(format!("Cargo.toml: {e}")),
    };
    let Some(wanted) =
        manifest.lines().find_map(|l| l.strip_prefix("rust-version = ")).and_then(version_numbers)
    else {
        return Outcome::Failed("Cargo.toml: [workspace.package] has no rust-version".to_owned());
    };
    let Some(rustc) = first_line_of("rustc", &["--version"]) else {
        return Outcome::Failed(
            "rustc does not run; install Rust from https://rustup.rs".to_owned(),
        );
    };
    println!("{rustc}");
    if version_numbers(&rustc).is_none_or(|found| found < wanted) {
        return Outcome::Failed(format!(
            "{rustc} is older than rust-version {}.{}; run `rustup update stable`",
            wanted.0, wanted.1
        ));
    }
    for tool in ["fmt", "clippy"] {
        match first_line_of("cargo", &[tool, "--version"]) {
            Some(version) => println!("{version}"),
            None => {
                return Outcome::Failed(format!(
                    "cargo {tool} is missing; `rustup component add rustfmt clippy`"
                ));
            }
        }
    }
    Outcome::Passed
}

/// Major and minor of the first version number in a text.
fn version_numbers(text: &str) -> Option<(u32, u32)> {
    text.split(|c: char| !(c.is_ascii_digit() || c == '.')).find_map(|word| {
        let mut parts = word.split('.');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    })
}

/// Reports the peers that the tests will find; an error when a required one is missing.
pub(crate) fn report_peers(context: &Context<'_>) -> Outcome {
    print!("{}", context.peers.describe());
    let missing = context.peers.missing();
    match (missing.is_empty(), context.options.require_peers) {
        (true, _) => Outcome::Passed,
        (false, true) => {
            Outcome::PeerMissing(format!("--require-peers, but {} not found", missing.join(", ")))
        }
        (false, false) => {
            Outcome::NotRun(format!("tests that need {} will skip themselves", missing.join(", ")))
        }
    }
}

/// Runs cargo-deny where it is installed. CI does not install it: building it costs 150 CPU-seconds
/// (0.20.2, measured), and its advisory database comes from github.com, which CI cannot reach. The
/// `licences` step checks the same lists.
pub(crate) fn cargo_deny(context: &Context<'_>) -> Outcome {
    if first_line_of("cargo", &["deny", "--version"]).is_none() {
        return Outcome::NotRun(
            "cargo-deny is not installed (`cargo install --locked cargo-deny`)".to_owned(),
        );
    }
    let args = ["deny", "--all-features", "check", "licenses", "bans", "sources"];
    println!("cargo {}", args.join(" "));
    context.cargo(&args, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_compare_as_numbers() {
        assert_eq!(version_numbers("rustc 1.95.0 (59807616e 2026-04-14)"), Some((1, 95)));
        assert_eq!(version_numbers("\"1.95\""), Some((1, 95)));
        assert_eq!(version_numbers("nothing here"), None);
        assert!(version_numbers("1.9") < version_numbers("1.95"));
    }
}
