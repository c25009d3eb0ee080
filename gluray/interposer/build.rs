//! Link arguments of the shared library, and a warning where it has no entry points.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let target = |key: &str| std::env::var(format!("CARGO_CFG_TARGET_{key}")).unwrap_or_default();
    if (target("ARCH").as_str(), target("OS").as_str()) != ("x86_64", "linux") {
        println!(
            "cargo:warning=gluray runs in programs for x86-64 Linux alone: this libgluray has no \
             entry points"
        );
        return;
    }
    // Without -Bsymbolic the addresses of our own functions bind to libGL's of the same name when
    // we are a vendor library: an endless loop of jumps. nodelete: our threads must not lose their
    // code.
    println!("cargo:rustc-cdylib-link-arg=-Wl,-Bsymbolic");
    println!("cargo:rustc-cdylib-link-arg=-Wl,-z,nodelete");
}
