//! The Debian packages that programs and libraries need, from what their ELF files say.
//!
//! `dpkg-shlibdeps` finds the same, but only where the build-dependencies of Debian packages are
//! installed (`dpkg-dev`, with Perl). Rust links everything but the C library and the unwinder into
//! the file, so the table is short; a library that it does not know is an error.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// Libraries, and the packages of Debian 12 and later that bring them.
const PACKAGES: &[(&str, &str)] = &[
    ("libc.so.6", "libc6"),
    ("libm.so.6", "libc6"),
    ("libdl.so.2", "libc6"),
    ("libpthread.so.0", "libc6"),
    ("ld-linux-x86-64.so.2", "libc6"),
    ("libgcc_s.so.1", "libgcc-s1"),
];

/// The field `Depends` for `files`: packages in order of their names, the C library with the
/// highest version of a symbol that is asked for.
pub(super) fn of(files: &[PathBuf]) -> Result<String, String> {
    let mut packages: BTreeMap<&str, Option<(u32, u32)>> = BTreeMap::new();
    for file in files {
        let text = super::output_of("objdump", &["-p", &file.display().to_string()])?;
        let needs = Needs::read(&text);
        for library in &needs.libraries {
            let known = PACKAGES.iter().find(|(l, _)| l == library);
            let (_, package) = known.ok_or_else(|| {
                format!(
                    "{} needs {library}, whose package is not in xtask/src/dist/depends.rs",
                    file.display()
                )
            })?;
            let version = packages.entry(package).or_default();
            if *package == "libc6" {
                *version = (*version).max(needs.glibc);
            }
        }
    }
    let line = packages.into_iter().map(|(package, version)| match version {
        Some((major, minor)) => format!("{package} (>= {major}.{minor})"),
        None => package.to_owned(),
    });
    Ok(line.collect::<Vec<_>>().join(", "))
}

/// What one file asks of the system.
#[derive(Debug, PartialEq, Eq)]
struct Needs {
    libraries: Vec<String>,
    /// The highest version of glibc's symbols.
    glibc: Option<(u32, u32)>,
}

impl Needs {
    /// Reads the output of `objdump -p`.
    fn read(text: &str) -> Needs {
        let needed = text.lines().filter_map(|l| l.trim().strip_prefix("NEEDED"));
        let libraries = needed.map(|l| l.trim().to_owned()).collect();
        // `0x09691a75 0x00 02 GLIBC_2.34`, below `Version References:`
        let references = text.split_once("Version References:").map_or("", |(_, rest)| rest);
        let versions = references.split_whitespace().filter_map(|w| w.strip_prefix("GLIBC_"));
        let numbers = versions.filter_map(|v| {
            let mut parts = v.split('.');
            Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
        });
        Needs { libraries, glibc: numbers.max() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_and_the_highest_version_of_glibc_are_read() {
        let text = "Dynamic Section:\n  NEEDED               libgcc_s.so.1\n  NEEDED               \
                    libc.so.6\n  SONAME x\n\nVersion References:\n  required from libc.so.6:\n    \
                    0x0969 0x00 09 GLIBC_2.9\n    0x0691 0x00 02 GLIBC_2.34\n    0x1 0x00 03 \
                    GLIBC_2.2.5\n  required from libgcc_s.so.1:\n    0x2 0x00 04 GCC_4.2.0\n";
        let expected = Needs {
            libraries: vec!["libgcc_s.so.1".to_owned(), "libc.so.6".to_owned()],
            glibc: Some((2, 34)),
        };
        assert_eq!(Needs::read(text), expected);
        let nothing = Needs { libraries: Vec::new(), glibc: None };
        assert_eq!(Needs::read("no ELF file"), nothing);
    }

    #[test]
    fn this_program_needs_the_c_library() {
        let program = std::env::current_exe().expect("a program");
        let depends = of(&[program]).expect("objdump, which comes with the linker");
        assert!(depends.starts_with("libc6 (>= 2."), "{depends}");
    }
}
