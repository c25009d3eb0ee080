//! `cargo xtask dist`: a tarball and a Debian package of the programs, for machines without Rust.
//!
//! ```text
//! TREE/bin          the programs                          (deb: links in /usr/bin)
//! TREE/lib          libgluray.so and libvtk_bridge.so     (the programs look in ../lib)
//!                   librtsv_composite.so, with a file for pkg-config
//!                   catalyst/libcatalyst-rtsv.so          (Catalyst looks for it by this name)
//! TREE/python       rtvtk, for the wheel of VTK           (deb: a link in Python's folder)
//!                   rtsv_composite.py                     (deb: likewise)
//! TREE/include      the C interfaces of vtk-bridge and of composite, the latter for Fortran too
//! TREE/share        manual pages, completions, licences   (deb: in /usr/share)
//! ```
//!
//! In the Debian package the tree lies in `/usr/lib/rtsv`. A tarball works in any folder.
//!
//! The package is written by hand and not by cargo-deb: cargo-deb packs one member and has its
//! metadata in that member's manifest, while this is one package of eight members; it would have to
//! be built from 150 crates first; and `dpkg-deb` is on every Debian. What cargo-deb would find by
//! itself, the packages that are depended on, is [`depends`].

mod completions;
mod debian;
mod depends;
mod notices;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The programs, and the member that builds each.
const PROGRAMS: &[&str] = &["gluray", "schlieren", "composite", "vtk-bridge", "datasets", "bench"];

/// The shared libraries as cargo names them, built by members `gluray-interposer`, `vtk-bridge`,
/// `composite-capi` and `composite-catalyst`, and their files in `lib`.
const LIBRARIES: &[(&str, &str)] = &[
    ("libgluray.so", "libgluray.so"),
    ("libvtk_bridge.so", "libvtk_bridge.so"),
    (COMPOSITE, COMPOSITE),
    ("libcatalyst_rtsv.so", "catalyst/libcatalyst-rtsv.so"),
];

/// The C interface of composite. Programs are linked with this name, and ask for the one with the
/// number of the interface when they run.
const COMPOSITE: &str = "librtsv_composite.so";

/// The members with something to ship.
const MEMBERS: &[&str] = &[
    "gluray",
    "gluray-interposer",
    "schlieren",
    "composite",
    "composite-capi",
    "composite-catalyst",
    "vtk-bridge",
    "datasets",
    "bench",
];

/// Members that build a library alone.
#[cfg(test)]
const WITHOUT_PROGRAM: &[&str] = &["gluray-interposer", "composite-capi", "composite-catalyst"];

/// The shells with completions: name for the program's subcommand, folder below `share`, and what
/// goes before and behind the program's name.
const SHELLS: &[(&str, &str, &str, &str)] = &[
    ("bash", "bash-completion/completions", "", ""),
    ("zsh", "zsh/vendor-completions", "_", ""),
    ("fish", "fish/vendor_completions.d", "", ".fish"),
];

/// Options of `cargo xtask dist`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct DistOptions {
    /// Cargo's profile.
    pub(crate) profile: String,
    /// Folder for the packages; `None` is `dist` in the build folder.
    pub(crate) out: Option<PathBuf>,
}

impl DistOptions {
    /// Reads the options from the words behind `dist`.
    pub(crate) fn parse(words: &[String]) -> Result<DistOptions, String> {
        let mut options = DistOptions { profile: "release".to_owned(), out: None };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            let mut value = |example: &str| {
                words.next().cloned().ok_or(format!("`{word}` needs a value, as in `{example}`"))
            };
            match word.as_str() {
                "--profile" => options.profile = value("--profile dev")?,
                "--out" => options.out = Some(value("--out /tmp/packages")?.into()),
                other => {
                    return Err(format!("`dist` does not know `{other}`; see `cargo xtask help`"));
                }
            }
        }
        Ok(options)
    }
}

/// Builds, packs, and prints the packages and their sizes.
pub(crate) fn run(root: &Path, build: &Path, options: &DistOptions) -> Result<(), String> {
    if cfg!(not(all(target_arch = "x86_64", target_os = "linux"))) {
        return Err("packages are made on x86-64 Linux, where gluray runs".to_owned());
    }
    let read = |path: &str| read(&root.join(path));
    let manifest = read("Cargo.toml")?;
    let version = version(&manifest).ok_or("Cargo.toml: there is no version")?;
    let maintainer = first_author(&manifest).ok_or("Cargo.toml: there are no authors")?;
    let mut cargo = vec!["build", "--profile", &options.profile];
    MEMBERS.iter().for_each(|m| cargo.extend(["-p", m]));
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    run_in(root, program, &cargo)?;

    // The profile `dev` builds in `debug`, for historical reasons.
    let built = build.join(if options.profile == "dev" { "debug" } else { &options.profile });
    let out = options.out.clone().unwrap_or_else(|| build.join("dist"));
    let out = std::path::absolute(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    let name = format!("rtsv-{version}-x86_64-linux");
    let tree = out.join(&name);
    if tree.exists() {
        fs::remove_dir_all(&tree).map_err(|e| format!("{}: {e}", tree.display()))?;
    }
    fill(root, &built, &tree, &version)?;

    let tarball = format!("{name}.tar.gz");
    let mut tar = vec!["--sort=name", "--owner=0", "--group=0", "--numeric-owner"];
    tar.extend(["-czf", &tarball, &name]);
    run_in(&out, "tar", &tar)?;
    let package = debian::pack(&tree, &out, &version, &maintainer)?;
    for file in [out.join(tarball), package] {
        let bytes = fs::metadata(&file).map_err(|e| format!("{}: {e}", file.display()))?.len();
        println!("{} ({:.1} MB)", file.display(), bytes as f64 / 1e6);
    }
    Ok(())
}

/// Fills the tree from what was built.
fn fill(root: &Path, built: &Path, tree: &Path, version: &str) -> Result<(), String> {
    let [bin, lib] = ["bin", "lib"].map(|d| tree.join(d));
    for program in PROGRAMS {
        copy(&built.join(program), &bin.join(program))?;
        run_in(tree, "strip", &[&format!("bin/{program}")])?;
    }
    for (library, file) in LIBRARIES {
        copy(&built.join(library), &lib.join(file))?;
        // What programs look up by name stays.
        run_in(tree, "strip", &["--strip-unneeded", &format!("lib/{file}")])?;
    }
    copy(&root.join("vtk-bridge/include/rtv.h"), &tree.join("include/rtv.h"))?;
    interface_of_composite(root, tree, version)?;
    let package = root.join("vtk-bridge/python/rtvtk");
    for file in files_with(&package, ".py")? {
        copy(&package.join(&file), &tree.join("python/rtvtk").join(&file))?;
    }
    link("../../lib/libvtk_bridge.so", &tree.join("python/rtvtk/libvtk_bridge.so"))?;

    let manual = tree.join("share/man/man1");
    make(&manual)?;
    for program in PROGRAMS {
        let path = bin.join(program).display().to_string();
        run_in(tree, &path, &["man", &manual.display().to_string()])?;
        for (shell, folder, before, behind) in SHELLS {
            let script = output_of(&path, &["completions", shell])?;
            let file = tree.join("share").join(folder).join(format!("{before}{program}{behind}"));
            write(&file, &script)?;
        }
    }
    let documents = tree.join("share/doc/rtsv");
    for file in ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"] {
        copy(&root.join(file), &documents.join(file))?;
    }
    write(&documents.join("THIRD-PARTY.txt"), &notices::of(root, MEMBERS)?)
}

/// What programs need that use composite from C, Fortran or Python.
fn interface_of_composite(root: &Path, tree: &Path, version: &str) -> Result<(), String> {
    let member = root.join("composite/capi");
    for file in ["rtsv_composite.h", "rtsv_composite.f90"] {
        copy(&member.join("include").join(file), &tree.join("include").join(file))?;
    }
    let module = "python/rtsv_composite.py";
    copy(&member.join(module), &tree.join(module))?;
    let header = read(&tree.join("include/rtsv_composite.h"))?;
    let abi = abi_of(&header).ok_or("rtsv_composite.h: there is no RTSV_COMPOSITE_ABI")?;
    link(COMPOSITE, &tree.join("lib").join(format!("{COMPOSITE}.{abi}")))?;
    write(&tree.join("lib/pkgconfig/rtsv-composite.pc"), &pkg_config("${pcfiledir}/../..", version))
}

/// The number of the interface in its header.
fn abi_of(header: &str) -> Option<&str> {
    let line = header.lines().find_map(|l| l.strip_prefix("#define RTSV_COMPOSITE_ABI "))?;
    Some(line.trim_end_matches('u'))
}

/// The file for pkg-config. The library is in no folder of the system, so programs remember where.
fn pkg_config(prefix: &str, version: &str) -> String {
    format!(
        "prefix={prefix}\nName: rtsv-composite\nDescription: sort-last compositing and rendering \
         of scenes that no process has whole\nVersion: {version}\nCflags: \
         -I${{prefix}}/include\nLibs: -L${{prefix}}/lib -Wl,-rpath,${{prefix}}/lib \
         -lrtsv_composite\n"
    )
}

/// The version in `[workspace.package]`.
fn version(manifest: &str) -> Option<String> {
    let section = manifest.split_once("[workspace.package]")?.1;
    let line = section.lines().find_map(|l| l.strip_prefix("version = \""))?;
    Some(line.trim_end_matches('"').to_owned())
}

/// The first of the authors in `[workspace.package]`: who maintains the packages. The name stands
/// as it is there, with an address only where the manifest has one.
fn first_author(manifest: &str) -> Option<String> {
    let section = manifest.split_once("[workspace.package]")?.1;
    let line = section.lines().find_map(|l| l.strip_prefix("authors = [\""))?;
    Some(line.split_once('"')?.0.to_owned()).filter(|author| !author.is_empty())
}

// ---- Files --------------------------------------------------------------------------------------
fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn make(folder: &Path) -> Result<(), String> {
    fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    make(path.parent().unwrap_or(Path::new(".")))?;
    fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    make(to.parent().unwrap_or(Path::new(".")))?;
    let copied = fs::copy(from, to).map(drop);
    copied.map_err(|e| format!("{} cannot become {}: {e}", from.display(), to.display()))
}

/// A symbolic link at `at` to `target`, which is relative to the folder of the link.
fn link(target: &str, at: &Path) -> Result<(), String> {
    make(at.parent().unwrap_or(Path::new(".")))?;
    let _ = fs::remove_file(at);
    std::os::unix::fs::symlink(target, at).map_err(|e| format!("{}: {e}", at.display()))
}

/// The names of the files in `folder` that end in `ending`, sorted.
fn files_with(folder: &Path, ending: &str) -> Result<Vec<String>, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let names = entries.filter_map(|e| e.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|n| n.ends_with(ending)).collect();
    names.sort();
    Ok(names)
}

// ---- Programs -----------------------------------------------------------------------------------
/// Runs a program in `folder`; an error when it does not end with 0.
fn run_in(
    folder: &Path,
    program: impl AsRef<std::ffi::OsStr>,
    args: &[&str],
) -> Result<(), String> {
    let program = program.as_ref();
    let shown = format!("{} {}", program.to_string_lossy(), args.join(" "));
    println!("==> {shown}");
    match Command::new(program).args(args).current_dir(folder).stdin(Stdio::null()).status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{shown}`: {status}")),
        Err(e) => Err(format!("`{shown}` does not start: {e}")),
    }
}

/// What a program prints; an error when it does not end with 0.
fn output_of(program: impl AsRef<std::ffi::OsStr>, args: &[&str]) -> Result<String, String> {
    let program = program.as_ref();
    let shown = format!("{} {}", program.to_string_lossy(), args.join(" "));
    let output = Command::new(program).args(args).stdin(Stdio::null()).output();
    let output = output.map_err(|e| format!("`{shown}` does not start: {e}"))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!("`{shown}`: {}\n{errors}", output.status));
    }
    String::from_utf8(output.stdout).map_err(|e| format!("`{shown}`: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(line: &str) -> Result<DistOptions, String> {
        DistOptions::parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn options_of_dist_are_read_and_wrong_ones_refused() {
        let release = DistOptions { profile: "release".to_owned(), out: None };
        assert_eq!(parsed(""), Ok(release));
        let other = DistOptions { profile: "dev".to_owned(), out: Some("/x".into()) };
        assert_eq!(parsed("--profile dev --out /x"), Ok(other));
        for wrong in ["--profile", "--out", "now"] {
            assert!(parsed(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_interface_of_composite_has_a_number_and_a_file_for_pkg_config() {
        let header = crate::workspace_root().join("composite/capi/include/rtsv_composite.h");
        let header = read(&header).expect("a header");
        assert!(abi_of(&header).is_some_and(|abi| abi.parse::<u32>().is_ok()));
        assert_eq!(abi_of("#define RTSV_COMPOSITE_ABI 3u\n"), Some("3"));
        let file = pkg_config("/usr/x", "1.2.3");
        let line = |l: &str| file.lines().any(|line| line == l);
        assert!(line("prefix=/usr/x") && line("Version: 1.2.3"), "{file}");
        assert!(line("Cflags: -I${prefix}/include"), "{file}");
    }

    #[test]
    fn the_version_is_that_of_the_workspace() {
        let manifest = read(&crate::workspace_root().join("Cargo.toml")).expect("a manifest");
        let version = version(&manifest).expect("a version");
        assert!(version.split('.').count() == 3, "{version}");
    }

    #[test]
    fn the_maintainer_is_the_manifests_author_and_no_placeholder() {
        let manifest = read(&crate::workspace_root().join("Cargo.toml")).expect("a manifest");
        let author = first_author(&manifest).expect("an author");
        assert!(!author.contains("example."), "{author}");
        let two = "[workspace.package]\nauthors = [\"A B <a@b.org>\", \"C\"]\n";
        assert_eq!(first_author(two).as_deref(), Some("A B <a@b.org>"));
        assert_eq!(first_author("[workspace.package]\nauthors = [\"\"]\n"), None);
    }

    #[test]
    fn what_is_packed_is_what_members_build() {
        for member in MEMBERS.iter().filter(|m| !WITHOUT_PROGRAM.contains(m)) {
            assert!(PROGRAMS.contains(member), "{member} builds no program that is shipped");
            let folder = crate::workspace_root().join(member);
            assert!(folder.join("Cargo.toml").is_file(), "{member}");
        }
    }
}
