//! The program `composite` as a shared library with a `main`, for SimGrid's `smpirun`: it loads one
//! private copy for each simulated rank. Built by `cargo build -p composite --example
//! composite_smpi`; `composite compare --smpi` does that itself.
//!
//! This is an example because a package has only one library, which programs link and which must
//! not have a `main`.
#![deny(unsafe_code)]
#![allow(unsafe_code, reason = "the one function that SimGrid calls")]

// A test harness has a `main` of its own; the library's export is tested from outside (tests/mpi).
#[cfg(not(test))]
mod exported {
    use std::ffi::{CStr, OsString, c_char, c_int};
    use std::os::unix::ffi::OsStringExt as _;

    /// Called by SimGrid once for each rank.
    ///
    /// # Safety
    /// As of every `main`: `argv` holds `argc` strings.
    // SAFETY: SimGrid looks up this name in this library, and no other library of the process is
    // searched for it.
    #[unsafe(no_mangle)]
    pub(crate) unsafe extern "C" fn main(argc: c_int, argv: *const *const c_char) -> c_int {
        let argument = |i: usize| {
            // SAFETY: one of the `argc` strings.
            let bytes = unsafe { CStr::from_ptr(*argv.add(i)) }.to_bytes();
            OsString::from_vec(bytes.to_vec())
        };
        let arguments: Vec<OsString> =
            (0..usize::try_from(argc).unwrap_or(0)).map(argument).collect();
        let status = std::panic::catch_unwind(|| composite::cli::main(arguments));
        status.map_or(101, |status| c_int::from(status as u8))
    }
}
