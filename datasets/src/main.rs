//! The program `datasets`: lists, generates, describes and converts data sets.
#![forbid(unsafe_code)]

mod program;

use std::process::ExitCode;

fn main() -> ExitCode {
    program::main()
}
