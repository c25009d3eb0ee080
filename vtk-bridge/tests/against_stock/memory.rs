//! The C ABI used by a C program, natively and under valgrind, where every read and write of memory
//! is checked.

use crate::peers::find;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// `c_abi/frames.c`, compiled once, because the file of a running program cannot be overwritten.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(compiled)
}

/// Compiles the program against the library of this build.
fn compiled() -> PathBuf {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("frames");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let library =
        vtk_bridge::setup::layout::library().expect("the library was built with this test");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let made = Command::new(&compiler)
        .args(["-std=c11", "-g", "-O1", "-Wall", "-Werror", "-I"])
        .arg(root.join("include"))
        .arg("-o")
        .arg(&out)
        .arg(root.join("tests/c_abi/frames.c"))
        .arg(&library)
        .arg("-Wl,--allow-shlib-undefined")
        .output()
        .unwrap_or_else(|e| panic!("{compiler}: {e}"));
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    out
}

fn run(command: &mut Command) -> Output {
    let library =
        vtk_bridge::setup::layout::library().expect("the library was built with this test");
    for (name, _) in std::env::vars_os().filter(|(n, _)| n.to_string_lossy().starts_with("RTV_")) {
        command.env_remove(name);
    }
    command.env("LD_LIBRARY_PATH", library.parent().expect("a folder")).env("RTV_THREADS", "2");
    command.output().expect("it starts")
}

#[test]
fn a_c_program_can_use_and_misuse_the_interface() {
    let out = run(&mut Command::new(program()));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success() && out.stdout == b"done\n", "{:?}\n{text}", out.status);
}

#[test]
fn valgrind_finds_no_fault_in_the_c_interface() {
    let Some(valgrind) = find("RTSV_VALGRIND", &["/usr/bin/valgrind"]) else {
        use std::io::Write as _;
        // Valgrind is optional: `a_c_program_can_use_and_misuse_the_interface` runs without it.
        let _ = writeln!(
            std::io::stderr(),
            "skipped: valgrind was not found (apt-get install valgrind)"
        );
        return;
    };
    let mut command = Command::new(valgrind);
    command.args([
        "--error-exitcode=9",
        "--leak-check=full",
        "--errors-for-leak-kinds=definite",
        "--quiet",
    ]);
    let out = run(command.arg(program()));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success() && out.stdout == b"done\n", "{:?}\n{text}", out.status);
}
