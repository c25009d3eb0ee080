//! The name that programs ask for at run time: it ends with the number of the interface.

/// RTSV_COMPOSITE_ABI of `src/types.rs`; a test compares them.
const ABI: u32 = 0;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("linux") {
        return;
    }
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,librtsv_composite.so.{ABI}");
    // Ranks may hold messages of MPI, and rayon's threads wait inside: the library must stay mapped
    // until the process ends (Python modules are unloaded before).
    println!("cargo:rustc-cdylib-link-arg=-Wl,-z,nodelete");
}
