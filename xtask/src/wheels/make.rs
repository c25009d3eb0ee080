//! A package's wheel and source archive: made, measured, and the archive built.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::selection::OTHERS;

use super::packages::{Builder, Package};
use super::{WheelsOptions, one_build, run_it};

/// Largest wheel of a release build, in bytes.
const LARGEST: u64 = 6_000_000;

/// Where things are while packages are made.
pub(super) struct Places<'a> {
    pub(super) root: &'a Path,
    /// Cargo's build folder.
    pub(super) build: &'a Path,
    /// The environment with maturin and auditwheel.
    pub(super) tools: &'a Path,
    /// Where this package's wheel and archive go.
    pub(super) out: &'a Path,
}

/// Makes the wheel, and the source archive, which is built too. Returns the wheel.
pub(super) fn make(
    package: &Package,
    places: &Places<'_>,
    options: &WheelsOptions,
) -> Result<PathBuf, String> {
    let _ = fs::remove_dir_all(places.out);
    fs::create_dir_all(places.out).map_err(|e| format!("{}: {e}", places.out.display()))?;
    match package.builder {
        Builder::Maturin => with_maturin(package, places, &options.profile)?,
        Builder::Own => with_backend(package, places, &options.profile)?,
    }
    let wheel = find(places.out, ".whl")?;
    let archive = find(places.out, ".tar.gz")?;
    for file in [&wheel, &archive] {
        let bytes = fs::metadata(file).map_err(|e| format!("{}: {e}", file.display()))?.len();
        println!("{} ({:.2} MB)", file.display(), bytes as f64 / 1e6);
        if options.profile == "release" && bytes > LARGEST {
            return Err(format!("{} is larger than 6 MB", file.display()));
        }
    }
    check_policy(&wheel, places.tools)?;
    build_archive(package, &archive, places)?;
    Ok(wheel)
}

/// A build without what only debuggers read, which would be most of the wheel.
fn without_debug_info(command: &mut Command) -> &mut Command {
    let plain =
        [("CARGO_PROFILE_RELEASE_DEBUG", "none"), ("CARGO_PROFILE_RELEASE_STRIP", "symbols")];
    command.envs(plain)
}

fn with_maturin(package: &Package, places: &Places<'_>, profile: &str) -> Result<(), String> {
    let maturin = places.tools.join("bin/maturin");
    let manifest = places.root.join(package.folder).join("Cargo.toml").display().to_string();
    let place = places.out.display().to_string();
    let mut wheel = Command::new(&maturin);
    wheel.args(["build", "--locked", "--profile", profile, "-m", &manifest, "--out", &place]);
    if profile == "dev" {
        let this = std::env::current_exe().map_err(|e| format!("this program: {e}"))?;
        wheel.env("CARGO", this).env(one_build::CARGO, cargo().get_program());
    }
    run_it(without_debug_info(wheel.current_dir(places.root)))?;
    let mut sdist = Command::new(&maturin);
    run_it(sdist.current_dir(places.root).args(["sdist", "-m", &manifest, "--out", &place]))
}

fn with_backend(package: &Package, places: &Places<'_>, profile: &str) -> Result<(), String> {
    let name = format!("lib{}.so", package.member.replace('-', "_"));
    let library = if profile == "dev" {
        build_tests(places.root)?;
        absolute(&places.build.join("debug/deps").join(name))?
    } else {
        let mut library = cargo();
        library.args(["build", "--locked", "--profile", profile, "-p", package.member, "--lib"]);
        let alone = ["--no-default-features", "--target-dir"];
        library.args(alone).arg(absolute(places.build)?).current_dir(places.root);
        run_it(without_debug_info(&mut library))?;
        absolute(&places.build.join(profile).join(name))?
    };
    let folder = places.root.join(package.folder);
    let mut python = Command::new(absolute(&places.tools.join("bin/python"))?);
    let program = "import backend, sys; print(backend.build_wheel(sys.argv[1])); \
                   print(backend.build_sdist(sys.argv[1]))";
    python.args(["-B", "-c", program]).arg(places.out).env("RTVTK_LIBRARY", library);
    run_it(python.current_dir(folder))
}

/// Builds what `build-tests` does; nothing is left to do after that step. A single target of it
/// would have other features of some packages, and rt-core would be compiled once more.
fn build_tests(root: &Path) -> Result<(), String> {
    run_it(cargo().args(arguments_of_tests()).current_dir(root))
}

/// What cargo is asked for by [`build_tests`].
pub(super) fn arguments_of_tests() -> Vec<&'static str> {
    [&["test", "--no-run", "--quiet"][..], &OTHERS].concat()
}

/// Whether auditwheel finds that the wheel keeps to the policy in its name.
fn check_policy(wheel: &Path, tools: &Path) -> Result<(), String> {
    let python = tools.join("bin/python");
    let shown = Command::new(python).args(["-m", "auditwheel", "show"]).arg(wheel).output();
    let shown = shown.map_err(|e| format!("auditwheel: {e}"))?;
    let said = String::from_utf8_lossy(&shown.stdout).replace('\n', " ");
    if !shown.status.success() {
        let why = String::from_utf8_lossy(&shown.stderr);
        return Err(format!("auditwheel show {}: {said}{why}", wheel.display()));
    }
    let name = wheel.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let policy = policy_in(&said).ok_or_else(|| format!("auditwheel names no policy: {said}"))?;
    if !name.contains(policy) {
        return Err(format!("auditwheel finds {policy}, and the wheel is named {name}"));
    }
    println!("auditwheel: {policy}");
    Ok(())
}

/// The policy that auditwheel's sentence names in quotes.
fn policy_in(said: &str) -> Option<&str> {
    said.split('"').find(|word| word.starts_with("manylinux_"))
}

/// Whether cargo alone takes the source archive: the packager's part is only to pack what it makes.
fn build_archive(package: &Package, archive: &Path, places: &Places<'_>) -> Result<(), String> {
    let folder = places.build.join("wheels/sdist").join(package.name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut tar = Command::new("tar");
    // `m`: the archive's times are always the same, and cargo would take an older check for this.
    run_it(tar.arg("xzmf").arg(archive).arg("--strip-components=1").arg("-C").arg(&folder))?;
    let mut cargo = cargo();
    // Not `--locked`: the lock file also names what other members need, and cargo leaves it out.
    cargo.args(["check", "-p", package.member, "--lib", "--target-dir"]);
    run_it(cargo.arg(absolute(places.build)?).current_dir(&folder))
}

pub(super) fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

pub(super) fn absolute(path: &Path) -> Result<PathBuf, String> {
    std::path::absolute(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// The file in `folder` that ends with `ending`.
fn find(folder: &Path, ending: &str) -> Result<PathBuf, String> {
    let files = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files = files.filter_map(|f| Some(f.ok()?.path()));
    let found = files.find(|f| f.to_string_lossy().ends_with(ending));
    found.ok_or_else(|| format!("{}: no file *{ending} was made", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_policy_is_read_from_what_auditwheel_says() {
        let said = "a.whl is consistent with the following platform tag: \
                    \"manylinux_2_34_x86_64\".  The wheel references external versioned symbols \
                    in these system-provided shared libraries: libc.so.6";
        assert_eq!(policy_in(said), Some("manylinux_2_34_x86_64"));
        assert_eq!(policy_in("is consistent with \"linux_x86_64\""), None);
    }
}
