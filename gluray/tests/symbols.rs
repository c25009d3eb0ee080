//! Which symbols the shared library has for programs, and that the program `gluray` has none.
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

use std::collections::BTreeSet;
use std::path::Path;

/// Every OpenGL, GLX and EGL entry point.
const NAMES: &str = include_str!("../src/interpose/symbols/names.txt");
/// How programs and GLVND look the entry points up.
const LOOK_UPS: [&str; 3] = ["__egl_Main", "__glx_Main", "dlsym"];

/// Types of sections (System V ABI, "Sections").
const SYMBOL_TABLE: u64 = 2;
const DYNAMIC_SYMBOLS: u64 = 11;

/// The global symbols that an ELF file for 64 bits defines, from its sections of this type.
fn defined(file: &Path, kind: u64) -> BTreeSet<String> {
    let bytes = std::fs::read(file).unwrap_or_else(|e| {
        panic!("{}: {e}; `cargo build -p gluray-interposer` makes the library", file.display())
    });
    assert_eq!(bytes[..6], *b"\x7fELF\x02\x01", "{}: 64 bits, little-endian", file.display());
    let number = |at: usize, size: usize| {
        bytes[at..at + size].iter().rev().fold(0, |n, byte| n << 8 | u64::from(*byte))
    };
    let at = |n: u64| usize::try_from(n).expect("an offset in the file");
    let section = |i: u64| at(number(0x28, 8) + i * number(0x3a, 2));
    let mut names = BTreeSet::new();
    for table in (0..number(0x3c, 2)).map(section).filter(|s| number(s + 4, 4) == kind) {
        let strings = at(number(section(number(table + 40, 4)) + 24, 8));
        let (start, size) = (at(number(table + 24, 8)), at(number(table + 32, 8)));
        for symbol in (start..start + size).step_by(24) {
            let (is_local, is_undefined) =
                (bytes[symbol + 4] >> 4 == 0, number(symbol + 6, 2) == 0);
            if is_local || is_undefined {
                continue;
            }
            let name = &bytes[strings + at(number(symbol, 4))..];
            let length = name.iter().position(|b| *b == 0).expect("names end with a zero");
            names.insert(String::from_utf8_lossy(&name[..length]).into_owned());
        }
    }
    names
}

#[test]
fn the_library_exports_every_entry_point_and_nothing_else() {
    let test = std::env::current_exe().expect("this test has a path");
    let library = test.with_file_name("libgluray.so");
    let expected: BTreeSet<String> =
        NAMES.split_whitespace().chain(LOOK_UPS).map(str::to_owned).collect();
    let exported = defined(&library, DYNAMIC_SYMBOLS);
    let differing: Vec<_> = exported.symmetric_difference(&expected).collect();
    assert!(differing.is_empty(), "{differing:?}");
}

#[test]
fn the_program_carries_no_entry_point() {
    let symbols = defined(Path::new(env!("CARGO_BIN_EXE_gluray")), SYMBOL_TABLE);
    assert!(symbols.contains("main"), "the symbols of a program were read");
    let carried: Vec<_> =
        NAMES.split_whitespace().chain(LOOK_UPS).filter(|n| symbols.contains(*n)).collect();
    assert!(carried.is_empty(), "{carried:?}");
}
