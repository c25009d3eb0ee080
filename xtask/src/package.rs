//! The step `package`: every published member makes a complete package.
//!
//! Cargo's own verification would compile every package and all its dependencies again. The common
//! faults are cheaper to find: a file outside the package, a licence or a README missing from it,
//! or a package above the registry's size limit.

use std::path::Path;
use std::process::Command;

use crate::step::{Context, Outcome};

/// The registry's limit, in bytes. Cargo compares the compressed package; this check compares its
/// contents.
const LARGEST_BYTES: u64 = 10 << 20;
/// Files that every package must contain.
const REQUIRED: &[&str] = &["README.md", "LICENSE-MIT", "LICENSE-APACHE"];
/// Arguments of `cargo package`, in addition to the members to leave out.
const ARGUMENTS: &[&str] = &["package", "--workspace", "--no-verify", "--allow-dirty", "--quiet"];

/// Checks the files of each package, then makes the packages.
pub(crate) fn check(context: &Context<'_>) -> Outcome {
    let read = |path: &str| std::fs::read_to_string(context.root.join(path));
    let members = match read("Cargo.toml") {
        Ok(manifest) => members(&manifest),
        Err(e) => return Outcome::Failed(format!("Cargo.toml: {e}")),
    };
    let mut faults = Vec::new();
    let mut arguments: Vec<String> = ARGUMENTS.iter().map(|a| (*a).to_owned()).collect();
    for member in &members {
        let manifest = match read(&format!("{member}/Cargo.toml")) {
            Ok(manifest) => manifest,
            Err(e) => return Outcome::Failed(format!("{member}/Cargo.toml: {e}")),
        };
        let name = name(&manifest).to_owned();
        if manifest.lines().any(|l| l == "publish = false") {
            arguments.extend(["--exclude".to_owned(), name]);
            continue;
        }
        let files = match list(context.root, &name) {
            Ok(files) => files,
            Err(e) => return Outcome::Failed(e),
        };
        let folder = context.root.join(member);
        let bytes: u64 =
            files.iter().filter_map(|f| Some(folder.join(f).metadata().ok()?.len())).sum();
        println!("{member}: {} files, {:.1} MiB", files.len(), bytes as f64 / (1 << 20) as f64);
        let found = faults_of(&files, bytes, |f| std::fs::read_to_string(folder.join(f)).ok());
        faults.extend(found.into_iter().map(|f| format!("{member}: {f}")));
    }
    faults.iter().for_each(|f| println!("{f}"));
    if !faults.is_empty() {
        return Outcome::Failed(format!("{} faults in packages", faults.len()));
    }
    println!("cargo {}", arguments.join(" "));
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    context.cargo(&arguments, &[])
}

/// The folders in `members = [...]` of the root's manifest.
fn members(manifest: &str) -> Vec<String> {
    let list = manifest.split_once("\nmembers = [").and_then(|(_, rest)| rest.split_once(']'));
    list.map_or(Vec::new(), |(l, _)| l.split('"').skip(1).step_by(2).map(str::to_owned).collect())
}

/// The name of the package with this manifest.
fn name(manifest: &str) -> &str {
    let line = manifest.lines().find_map(|l| l.strip_prefix("name = \""));
    line.map_or("", |l| l.trim_end_matches('"'))
}

/// The files of the package `member`, by path from its folder.
fn list(root: &Path, member: &str) -> Result<Vec<String>, String> {
    let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["package", "--list", "--allow-dirty", "-p", member])
        .current_dir(root)
        .output()
        .map_err(|e| format!("cargo does not start: {e}"))?;
    if !output.status.success() {
        return Err(format!("{member}: {}", String::from_utf8_lossy(&output.stderr)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect())
}

/// Faults of a package with these files.
fn faults_of(files: &[String], bytes: u64, read: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let has = |path: &str| files.iter().any(|f| f == path);
    let missing = REQUIRED.iter().filter(|f| !has(f));
    let mut faults: Vec<String> = missing.map(|f| format!("{f} is not in the package")).collect();
    if bytes > LARGEST_BYTES {
        faults.push(format!("{bytes} bytes; the registry takes {LARGEST_BYTES}: exclude files"));
    }
    for file in files.iter().filter(|f| f.ends_with(".rs")) {
        for target in read(file).map_or(Vec::new(), |text| included(file, &text)) {
            if !has(&target) {
                faults.push(format!("{file} includes {target}, which is not in the package"));
            }
        }
    }
    faults
}

/// The files that a source file includes or declares as modules, by path from the member's folder.
/// A path that begins above the member keeps its dots.
fn included(file: &str, text: &str) -> Vec<String> {
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let heads = ["include_str!(", "include_bytes!(", "include!(", "#[path = "];
    let code = text.lines().filter(|l| !l.trim_start().starts_with("//"));
    let named = code.flat_map(|line| {
        let after = heads.iter().filter_map(|head| Some(line.split_once(head)?.1));
        after.filter_map(|rest| Some(rest.strip_prefix('"')?.split_once('"')?.0))
    });
    named.map(|path| resolved(folder, path)).collect()
}

/// Resolves `path` relative to `folder`, without `.` and, as far as `folder` reaches, without `..`.
fn resolved(folder: &str, path: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').filter(|p| !p.is_empty()).collect();
    for part in path.split('/').filter(|p| *p != ".") {
        match (part, parts.last()) {
            ("..", Some(last)) if *last != ".." => drop(parts.pop()),
            _ => parts.push(part),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn owned(names: &[&str]) -> Vec<String> {
        names.iter().map(|n| (*n).to_owned()).collect()
    }

    #[test]
    fn members_of_the_real_workspace_are_read() {
        let root = crate::workspace_root();
        let manifest = std::fs::read_to_string(root.join("Cargo.toml")).expect("a manifest");
        let members = members(&manifest);
        assert!(members.len() >= 8 && members.contains(&"bench".to_owned()), "{members:?}");
        for member in members {
            let manifest = std::fs::read_to_string(root.join(&member).join("Cargo.toml"));
            let name = name(&manifest.expect(&member)).to_owned();
            assert_eq!(name, member.replace('/', "-"));
        }
    }

    #[test]
    fn includes_are_followed_from_the_file_that_has_them() {
        let text = "const A: &str = include_str!(\"../b/c.txt\");\n#[path = \"../../d/e.rs\"]\n\
                    // include_str!(\"gone.txt\")\n\
                    include!(concat!(env!(\"OUT_DIR\"), \"/x.rs\"));\n";
        assert_eq!(included("src/a/mod.rs", text), ["src/b/c.txt", "d/e.rs"]);
        assert_eq!(included("tests/x.rs", text), ["b/c.txt", "../d/e.rs"]);
    }

    #[test]
    fn planted_faults_of_a_package_are_found() {
        let whole =
            owned(&["README.md", "LICENSE-MIT", "LICENSE-APACHE", "src/lib.rs", "src/a.md"]);
        let source = |path: &'static str| move |_: &str| Some(format!("include_str!(\"{path}\")"));
        assert_eq!(faults_of(&whole, 1, source("a.md")), Vec::<String>::new());
        let outside = faults_of(&whole, 1, source("../../docs/a.md"));
        assert_eq!(outside, ["src/lib.rs includes ../docs/a.md, which is not in the package"]);
        assert_eq!(faults_of(&whole[1..], 1, source("a.md")), ["README.md is not in the package"]);
        assert_eq!(faults_of(&whole, LARGEST_BYTES + 1, source("a.md")).len(), 1);
    }

    #[test]
    fn packages_are_made_and_not_only_listed() {
        assert!(!ARGUMENTS.contains(&"--list") && ARGUMENTS.contains(&"--no-verify"));
    }
}
