//! The Debian package: the tree in `/usr/lib/rtsv`, and links and texts where Debian has them.

use super::{LIBRARIES, write};
use super::{PROGRAMS, SHELLS, completions, copy, depends, files_with, link, make, read, run_in};
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the programs and libraries. It is the same in every version, so other programs may
/// name `/usr/lib/rtsv/lib/libgluray.so`.
const HOME: &str = "usr/lib/rtsv";

/// Programs whose names are common words have these in `/usr/bin`: ImageMagick has a `composite`.
const LINKS: &[(&str, &str)] =
    &[("composite", "rtsv-composite"), ("datasets", "rtsv-datasets"), ("bench", "rtsv-bench")];

/// Packages that are not needed to start. gluray's programs bring OpenGL themselves; vtk-bridge
/// compiles its shim against the headers of the VTK that is there.
const SUGGESTS: &str = "libgl1, libegl1, libvulkan1, g++, libvtk9-dev, paraview-dev, libglew-dev, \
                        python3-numpy";

const DESCRIPTION: &str = "ray tracing for scientific visualization
 gluray ray traces inside OpenGL programs that are not changed, vtk-bridge
 inside VTK and ParaView; schlieren renders photographs of flows; composite
 joins the images of many nodes; datasets makes, describes and converts data;
 bench measures them all. Everything runs on the CPU.";

/// The name of `program` in `/usr/bin`.
fn link_of(program: &str) -> &str {
    LINKS.iter().find(|(p, _)| *p == program).map_or(program, |(_, link)| link)
}

/// Makes the package of the tree in `out` and returns its path.
pub(super) fn pack(
    tree: &Path,
    out: &Path,
    version: &str,
    maintainer: &str,
) -> Result<PathBuf, String> {
    let name = format!("rtsv_{version}_amd64");
    let stage = out.join(&name);
    if stage.exists() {
        fs::remove_dir_all(&stage).map_err(|e| format!("{}: {e}", stage.display()))?;
    }
    let home = stage.join(HOME);
    make(&home)?;
    for folder in ["bin", "lib", "include", "python"] {
        let from = tree.join(folder).display().to_string();
        run_in(out, "cp", &["-a", &from, &home.display().to_string()])?;
    }
    for program in PROGRAMS {
        let at = stage.join("usr/bin").join(link_of(program));
        link(&format!("../lib/rtsv/bin/{program}"), &at)?;
    }
    let python = stage.join("usr/lib/python3/dist-packages");
    for module in ["rtvtk", "rtsv_composite.py"] {
        link(&format!("../../rtsv/python/{module}"), &python.join(module))?;
    }
    let pkg_config = stage.join("usr/lib/x86_64-linux-gnu/pkgconfig/rtsv-composite.pc");
    write(&pkg_config, &super::pkg_config(&format!("/{HOME}"), version))?;
    shared(tree, &stage)?;

    let programs = PROGRAMS.iter().map(|p| tree.join("bin").join(p));
    let files = programs.chain(LIBRARIES.iter().map(|(_, l)| tree.join("lib").join(l)));
    let depends = depends::of(&files.collect::<Vec<_>>())?;
    let control = control(version, maintainer, &depends, kilobytes(&stage)?);
    write(&stage.join("DEBIAN/control"), &control)?;
    println!("Depends: {depends}");
    let package = format!("{name}.deb");
    run_in(out, "dpkg-deb", &["--build", "--root-owner-group", &name, &package])?;
    fs::remove_dir_all(&stage).map_err(|e| format!("{}: {e}", stage.display()))?;
    Ok(out.join(package))
}

/// Manual pages, completions and licences, in `/usr/share`.
fn shared(tree: &Path, stage: &Path) -> Result<(), String> {
    let [from, to] = [tree, &stage.join("usr")].map(|p| p.join("share"));
    let manual = to.join("man/man1");
    for page in files_with(&from.join("man/man1"), ".1")? {
        copy(&from.join("man/man1").join(&page), &manual.join(page_of(&page)))?;
    }
    run_in(&manual, "gzip", &["-9nr", "."])?;
    for (_, folder, before, behind) in SHELLS {
        for program in PROGRAMS {
            let script = read(&from.join(folder).join(format!("{before}{program}{behind}")))?;
            let name = link_of(program);
            let script = completions::renamed(&script, program, name);
            write(&to.join(folder).join(format!("{before}{name}{behind}")), &script)?;
        }
    }
    let [from, to] = [from, to].map(|p| p.join("doc/rtsv"));
    let mut copyright = "rtsv is under the MIT or the Apache-2.0 licence, as you prefer. The \
                         crates that are linked into it are listed in THIRD-PARTY.txt.gz, with \
                         their licences.\n\n"
        .to_owned();
    for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
        copyright += &read(&from.join(licence))?;
        copyright += "\n";
    }
    write(&to.join("copyright"), &copyright)?;
    for (file, name) in
        [("README.md", None), ("CHANGELOG.md", Some("changelog")), ("THIRD-PARTY.txt", None)]
    {
        let name = name.unwrap_or(file);
        copy(&from.join(file), &to.join(name))?;
        run_in(&to, "gzip", &["-9n", name])?;
    }
    Ok(())
}

/// The file name of a manual page in the package: `bench-run.1` belongs to `rtsv-bench`.
fn page_of(page: &str) -> String {
    let of = |(program, link): &(&str, &str)| {
        let rest = page.strip_prefix(program)?;
        rest.starts_with(['.', '-']).then(|| format!("{link}{rest}"))
    };
    LINKS.iter().find_map(of).unwrap_or_else(|| page.to_owned())
}

/// The text of `DEBIAN/control`.
fn control(version: &str, maintainer: &str, depends: &str, kilobytes: u64) -> String {
    format!(
        "Package: rtsv\nVersion: {version}\nArchitecture: amd64\nSection: science\nPriority: \
         optional\nMaintainer: {maintainer}\nInstalled-Size: \
         {kilobytes}\nDepends: {depends}\nSuggests: {SUGGESTS}\nDescription: {DESCRIPTION}\n"
    )
}

/// The size of all files below `folder`, in units of 1024 bytes, each file rounded up.
fn kilobytes(folder: &Path) -> Result<u64, String> {
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut sum = 0;
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let about = fs::symlink_metadata(&path).map_err(failed)?;
        sum += if about.is_dir() { kilobytes(&path)? } else { about.len().div_ceil(1024) };
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_with_common_names_and_their_pages_get_a_prefix() {
        assert_eq!(link_of("gluray"), "gluray");
        assert_eq!(link_of("composite"), "rtsv-composite");
        assert_eq!(page_of("bench.1"), "rtsv-bench.1");
        assert_eq!(page_of("bench-run.1"), "rtsv-bench-run.1");
        assert_eq!(page_of("gluray-run.1"), "gluray-run.1");
        assert!(LINKS.iter().all(|(program, _)| PROGRAMS.contains(program)));
    }

    #[test]
    fn every_line_of_the_control_file_is_a_field_or_goes_on() {
        let text = control("1.2.3", "Somebody", "libc6 (>= 2.34)", 5);
        for line in text.lines() {
            let field = line.split_once(": ").is_some_and(|(name, value)| {
                name.chars().all(|c| c.is_ascii_alphabetic() || c == '-') && !value.is_empty()
            });
            assert!(field || line.starts_with(' '), "`{line}`");
        }
    }
}
