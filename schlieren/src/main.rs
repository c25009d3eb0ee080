//! Runs the program `schlieren`; see [`schlieren::cli`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    schlieren::cli::main()
}
