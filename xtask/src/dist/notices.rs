//! The licences of all crates that are linked into the programs: a table, then every text once.

use super::{output_of, read};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Beginnings of the names of files with licences, in lower case.
const NAMES: &[&str] = &["license", "licence", "copying", "notice", "unlicense", "copyright"];

/// The text for the crates below `members`.
pub(super) fn of(root: &Path, members: &[&str]) -> Result<String, String> {
    let manifest = root.join("Cargo.toml").display().to_string();
    let mut args = vec!["tree", "--manifest-path", &manifest, "-e", "normal", "--prefix", "none"];
    args.extend(["-f", "{p}|{l}|{r}"]);
    members.iter().for_each(|m| args.extend(["-p", m]));
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let crates = crates(&output_of(cargo, &args)?);
    let sources = sources()?;
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut without = Vec::new();
    for c in &crates {
        let folder = sources.iter().map(|s| s.join(c.folder())).find(|p| p.is_dir());
        let folder = folder.ok_or_else(|| {
            format!("the sources of {} {} are not in cargo's registry", c.name, c.version)
        })?;
        let files = licence_files(&folder)?;
        if files.is_empty() {
            without.push(c.folder());
        }
        for file in files {
            texts.entry(read(&file)?.replace("\r\n", "\n")).or_default().push(c.folder());
        }
    }
    Ok(text(&crates, &texts, &without))
}

/// A crate of others.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Crate {
    name: String,
    version: String,
    licence: String,
    repository: String,
}

impl Crate {
    /// Its folder in cargo's registry.
    fn folder(&self) -> String {
        format!("{}-{}", self.name, self.version)
    }
}

/// The crates in the output of `cargo tree`, each once, without those of the workspace.
fn crates(tree: &str) -> BTreeSet<Crate> {
    let of = |line: &str| {
        let mut parts = line.trim_end_matches(" (*)").split('|');
        let mut package = parts.next()?.split(' ');
        let (name, version) = (package.next()?, package.next()?.strip_prefix('v')?);
        // `(/path)` for members; `(proc-macro)` runs in the compiler and is not linked.
        if package.next().is_some() {
            return None;
        }
        let mut rest = parts.map(str::to_owned);
        Some(Crate {
            name: name.to_owned(),
            version: version.to_owned(),
            licence: rest.next()?,
            repository: rest.next().unwrap_or_default(),
        })
    };
    tree.lines().filter_map(of).collect()
}

/// The folders in which cargo unpacks what it downloads.
fn sources() -> Result<Vec<PathBuf>, String> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cargo")));
    let folder = home.ok_or("neither CARGO_HOME nor HOME is set")?.join("registry/src");
    let entries = fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    Ok(entries.filter_map(|e| Some(e.ok()?.path())).collect())
}

/// The files with licences in a crate, sorted; also those in a folder of that name.
fn licence_files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files = Vec::new();
    for path in entries.filter_map(|e| Some(e.ok()?.path())) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        if !NAMES.iter().any(|n| name.starts_with(n)) || name.ends_with(".rs") {
            continue;
        }
        if path.is_dir() {
            let inside = fs::read_dir(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            files.extend(inside.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.is_file()));
        } else {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn text(
    crates: &BTreeSet<Crate>,
    texts: &BTreeMap<String, Vec<String>>,
    without: &[String],
) -> String {
    let mut out =
        "Crates that are linked into the programs and libraries of this package.\n\n".to_owned();
    for Crate { name, version, licence, repository } in crates {
        let _ = writeln!(out, "{name} {version}: {licence}; {repository}");
    }
    if !without.is_empty() {
        let list = without.join(", ");
        let _ = writeln!(out, "\nWithout a text in their packages, under the above: {list}");
    }
    for (text, users) in texts {
        let bar = "-".repeat(80);
        let _ = writeln!(out, "\n{bar}\n{}\n{bar}\n{}", users.join(", "), text.trim_end());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_of_others_are_read_once_and_ours_left_out() {
        let tree = "gluray v0.1.0 (/x/gluray)|MIT|\nglam v0.34.0|MIT OR Apache-2.0|https://g\nglam \
                    v0.34.0|MIT OR Apache-2.0|https://g (*)\nserde_derive v1.0.0 \
                    (proc-macro)|MIT|\nbare v2.0.0|Zlib|\n";
        let names: Vec<_> = crates(tree).into_iter().map(|c| (c.name, c.licence)).collect();
        let expected = [("bare", "Zlib"), ("glam", "MIT OR Apache-2.0")];
        assert_eq!(names, expected.map(|(n, l)| (n.to_owned(), l.to_owned())));
    }

    #[test]
    fn a_text_that_crates_share_is_printed_once_with_their_names() {
        let c = |name: &str| Crate {
            name: name.to_owned(),
            version: "1.0.0".to_owned(),
            licence: "MIT".to_owned(),
            repository: String::new(),
        };
        let users = vec!["a-1.0.0".to_owned(), "b-1.0.0".to_owned()];
        let texts = BTreeMap::from([("The text".to_owned(), users)]);
        let out = text(&BTreeSet::from([c("a"), c("b"), c("c")]), &texts, &["c-1.0.0".to_owned()]);
        assert_eq!(out.matches("The text").count(), 1);
        assert!(out.contains("a-1.0.0, b-1.0.0\n") && out.contains("above: c-1.0.0\n"), "{out}");
    }
}
