//! Link options of the shared library.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // ANARI's loader closes a device's library when the program unloads it, while threads of the
    // renderer's pool still wait inside: the library must stay mapped until the process ends.
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-z,nodelete");
    }
}
