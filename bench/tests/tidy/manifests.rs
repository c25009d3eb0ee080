//! Rules for the Cargo.toml files: dependencies between members, and the place of versions.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;

use crate::tree::{File, root};

/// When a member may depend on another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum May {
    /// Always.
    Use,
    /// Only as an optional dependency (or in tests): the member must build without it.
    UseBehindAFeature,
}

/// The allowed dependencies of ARCHITECTURE.md. A new line here is a decision; record it there.
const ALLOWED_DEPENDENCIES: &[(&str, May, &[&str])] = &[
    ("rt-core", May::Use, &[]),
    ("rt-core-python", May::Use, &["rt-core", "rt-core-python-work"]),
    ("rt-core-python-work", May::Use, &[]),
    ("datasets", May::Use, &["rt-core"]),
    ("schlieren", May::Use, &["rt-core", "datasets"]),
    ("schlieren-python", May::Use, &["schlieren", "datasets", "rt-core-python-work"]),
    ("composite", May::UseBehindAFeature, &["rt-core", "datasets", "schlieren"]),
    ("composite-capi", May::Use, &["composite", "rt-core", "schlieren"]),
    ("composite-catalyst", May::Use, &["composite", "rt-core", "datasets", "schlieren"]),
    ("gluray", May::Use, &["rt-core", "composite", "datasets"]),
    // For the tests alone: they run programs with the shared library.
    ("gluray", May::UseBehindAFeature, &["gluray-interposer"]),
    ("gluray-interposer", May::Use, &["gluray"]),
    ("vtk-bridge", May::Use, &["rt-core"]),
    ("vtk-bridge", May::UseBehindAFeature, &["datasets"]),
    ("bench", May::Use, &["rt-core", "datasets", "schlieren", "composite", "gluray", "vtk-bridge"]),
];

/// A dependency of one member on another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Dependency {
    from: String,
    to: String,
    /// Whether the dependency is optional, or for tests only.
    weak: bool,
}

/// A member of the workspace.
#[derive(Debug, Clone)]
pub(crate) struct Member {
    /// Path from the workspace root.
    pub(crate) folder: String,
    dependencies: Vec<Dependency>,
}

/// The members by name, with their dependencies on each other, according to cargo.
pub(crate) fn members() -> BTreeMap<String, Member> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
        .current_dir(root())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("cargo metadata prints JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let text = |v: &serde_json::Value| v.as_str().unwrap_or_default().to_owned();
    let workspace = text(&metadata["workspace_root"]);
    let dependency = |from: &str, d: &serde_json::Value| Dependency {
        from: from.to_owned(),
        to: text(&d["name"]),
        weak: d["optional"] == true || d["kind"] == "dev",
    };
    let own = |d: &&serde_json::Value| !d["path"].is_null();
    packages
        .iter()
        .map(|p| {
            let name = text(&p["name"]);
            let dependencies = p["dependencies"].as_array().expect("dependencies");
            let dependencies =
                dependencies.iter().filter(own).map(|d| dependency(&name, d)).collect();
            let manifest = PathBuf::from(text(&p["manifest_path"]));
            let folder = manifest.parent().and_then(|f| f.strip_prefix(&workspace).ok());
            let folder = folder.expect("members lie in the workspace").display().to_string();
            (name, Member { folder, dependencies })
        })
        .collect()
}

fn fault(dependency: &Dependency) -> Option<String> {
    let Dependency { from, to, weak } = dependency;
    let rules = || {
        ALLOWED_DEPENDENCIES
            .iter()
            .filter(|(f, _, targets)| f == from && targets.contains(&to.as_str()))
    };
    if rules().any(|(_, may, _)| *may == May::Use || *weak) {
        return None;
    }
    Some(match rules().next() {
        Some(_) => format!("{from} may use {to} only behind a feature (`optional = true`)"),
        None => format!("{from} may not use {to}: ARCHITECTURE.md does not allow it"),
    })
}

#[test]
fn dependencies_point_down() {
    let members = members();
    let known: Vec<&str> = ALLOWED_DEPENDENCIES.iter().map(|(f, ..)| *f).collect();
    for name in members.keys() {
        assert!(
            known.contains(&name.as_str()),
            "member {name} has no line in ALLOWED_DEPENDENCIES and none in ARCHITECTURE.md"
        );
    }
    let faults: Vec<_> = members.values().flat_map(|m| &m.dependencies).filter_map(fault).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(
        members["bench"].dependencies.iter().any(|a| a.to == "rt-core"),
        "bench's dependencies were not read"
    );
}

#[test]
fn planted_dependencies_are_found() {
    let dependency =
        |from: &str, to: &str, weak| Dependency { from: from.to_owned(), to: to.to_owned(), weak };
    assert!(
        fault(&dependency("rt-core", "datasets", false))
            .is_some_and(|f| f.contains("does not allow"))
    );
    assert!(fault(&dependency("rt-core", "datasets", true)).is_some(), "not even in its tests");
    assert!(fault(&dependency("datasets", "bench", true)).is_some(), "nothing depends on bench");
    assert!(
        fault(&dependency("composite", "rt-core", false)).is_some_and(|f| f.contains("feature"))
    );
    assert_eq!(fault(&dependency("composite", "rt-core", true)), None);
    assert_eq!(fault(&dependency("gluray", "composite", false)), None);
    assert!(fault(&dependency("gluray", "gluray-interposer", false)).is_some(), "in tests alone");
}

// ---- Versions, lints and licences are defined once, in the root ---------------------------------
/// What a member's Cargo.toml must inherit but does not, including dependencies.
fn not_inherited(manifest: &File) -> Vec<String> {
    let mut faults = Vec::new();
    for key in ["version", "edition", "rust-version", "license"] {
        if !manifest.text.lines().any(|l| l == format!("{key}.workspace = true")) {
            faults.push(format!("{}: `{key}.workspace = true` is missing", manifest.path));
        }
    }
    if !manifest.text.contains("[lints]\nworkspace = true") {
        faults.push(format!("{}: `[lints] workspace = true` is missing", manifest.path));
    }
    let mut in_dependencies = false;
    for (number, line) in manifest.text.lines().enumerate() {
        if line.starts_with('[') {
            in_dependencies = line.trim_end_matches(']').ends_with("dependencies");
        } else if in_dependencies
            && line.contains('=')
            && !line.starts_with('#')
            && !line.contains("workspace = true")
        {
            faults.push(format!(
                "{}:{}: `{line}`: versions stand in the root, [workspace.dependencies]; write \
                 `NAME.workspace = true`",
                manifest.path,
                number + 1
            ));
        }
    }
    faults
}

#[test]
fn versions_stand_in_the_root() {
    let read = |path: &str| {
        std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
    };
    let manifests = members().into_values().map(|m| format!("{}/Cargo.toml", m.folder));
    let faults: Vec<_> =
        manifests.flat_map(|path| not_inherited(&File::new(&path, &read(&path)))).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(
        !read("xtask/Cargo.toml").contains("dependencies]"),
        "xtask starts in seconds because it has no dependencies"
    );
}

#[test]
fn planted_versions_are_found() {
    let good = "[package]\nversion.workspace = true\nedition.workspace = \
                true\nrust-version.workspace = true\n\
                license.workspace = true\n[dependencies]\n# glam = \"0.1\"\nglam.workspace = true\n\
                [lints]\nworkspace = true\n";
    assert_eq!(not_inherited(&File::new("m/Cargo.toml", good)), Vec::<String>::new());
    let bad = good.replace("glam.workspace = true", "glam = \"0.34\"").replace("edition.", "#");
    let faults = not_inherited(&File::new("m/Cargo.toml", &bad));
    assert_eq!(faults.len(), 2, "{faults:?}");
    assert!(faults[1].starts_with("m/Cargo.toml:8: `glam"), "{faults:?}");
}
