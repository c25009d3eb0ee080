//! `bench`: measures every table and figure of the dissertation, and error against time. See `bench
//! --help`.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    bench::cli::main()
}
