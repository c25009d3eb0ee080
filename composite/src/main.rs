//! The program `composite`; see [`composite::cli`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    composite::cli::main(std::env::args_os()).into()
}
