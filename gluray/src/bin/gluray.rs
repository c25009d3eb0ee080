//! The program `gluray`; see [`gluray::cli`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    gluray::cli::main()
}
