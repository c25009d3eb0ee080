//! Checks the packages that we build with against the lists in deny.toml, using only `cargo tree`.
//!
//! cargo-deny checks more (advisories, sources, other platforms) but takes minutes to build and
//! needs github.com; this check takes a second and runs everywhere. Both read the same deny.toml.

use std::collections::BTreeSet;
use std::process::Command;

use crate::step::{Context, Outcome};

/// Runs the step `licences`.
pub(crate) fn check(context: &Context<'_>) -> Outcome {
    let deny = match std::fs::read_to_string(context.root.join("deny.toml")) {
        Ok(text) => text,
        Err(e) => return Outcome::Failed(format!("deny.toml: {e}")),
    };
    let args = [
        "tree",
        "--workspace",
        "--all-features",
        "-e",
        "normal,build,dev",
        "--prefix",
        "none",
        "-f",
        "{p}|{l}",
    ];
    println!("cargo {}", args.join(" "));
    let tree = match Command::new("cargo").args(args).current_dir(context.root).output() {
        Ok(output) if output.status.success() => {
            String::from_utf8_lossy(&output.stdout).into_owned()
        }
        Ok(output) => {
            return Outcome::Failed(format!(
                "cargo tree: {}",
                String::from_utf8_lossy(&output.stderr)
            ));
        }
        Err(e) => return Outcome::Failed(format!("cargo tree does not start: {e}")),
    };
    let (packages, faults) = faults(&tree, &allowed_licences(&deny), &banned_crates(&deny));
    if faults.is_empty() {
        println!("{packages} packages, all under licences that deny.toml allows");
        return Outcome::Passed;
    }
    faults.iter().for_each(|f| println!("{f}"));
    Outcome::Failed(format!("{} of {packages} packages are against deny.toml", faults.len()))
}

/// Number of packages in the output of `cargo tree`, and one line per forbidden package.
fn faults(
    tree: &str,
    allowed: &BTreeSet<String>,
    banned: &BTreeSet<String>,
) -> (usize, Vec<String>) {
    // A repeated package ends in "(*)", after the licence.
    let packages: BTreeSet<&str> =
        tree.lines().map(|l| l.trim_end_matches(" (*)")).filter(|l| !l.is_empty()).collect();
    let mut faults = Vec::new();
    for line in &packages {
        let (package, licence) = line.split_once('|').unwrap_or((line, ""));
        let name = package.split(' ').next().unwrap_or_default();
        if banned.contains(name) {
            faults.push(format!("{package}: banned; deny.toml says why"));
        }
        match satisfied(licence, allowed) {
            Ok(true) => {}
            Ok(false) => faults.push(format!("{package}: licence `{licence}` is not allowed")),
            Err(e) => faults.push(format!("{package}: licence `{licence}` cannot be read: {e}")),
        }
    }
    (packages.len(), faults)
}

// ---- The two lists of deny.toml -----------------------------------------------------------------
/// The strings of `allow = [...]` in section `[licenses]`.
fn allowed_licences(deny: &str) -> BTreeSet<String> {
    let lines = section(deny, "[licenses]")
        .skip_while(|l| !l.starts_with("allow = ["))
        .take_while(|l| *l != "]");
    lines.filter_map(|l| Some(l.trim().strip_prefix('"')?.split_once('"')?.0.to_owned())).collect()
}

/// The names in `{ crate = "NAME"` in section `[bans]`.
fn banned_crates(deny: &str) -> BTreeSet<String> {
    let lines = section(deny, "[bans]");
    lines
        .filter_map(|l| Some(l.trim().strip_prefix("{ crate = \"")?.split_once('"')?.0.to_owned()))
        .collect()
}

fn section<'a>(deny: &'a str, head: &'a str) -> impl Iterator<Item = &'a str> {
    deny.lines().skip_while(move |l| *l != head).skip(1).take_while(|l| !l.starts_with('['))
}

// ---- SPDX expressions ---------------------------------------------------------------------------
/// Whether the allowed licences satisfy an SPDX expression. The slash in old manifests means OR.
fn satisfied(expression: &str, allowed: &BTreeSet<String>) -> Result<bool, String> {
    let spaced = expression
        .replace('/', " OR ")
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace(" WITH ", "+WITH+");
    let words: Vec<String> =
        spaced.split_whitespace().map(|w| w.replace("+WITH+", " WITH ")).collect();
    let mut rest = words.as_slice();
    let value = any_of(&mut rest, allowed)?;
    if let Some(extra) = rest.first() {
        Err(format!("`{extra}` was not expected"))
    } else {
        Ok(value)
    }
}

fn any_of(rest: &mut &[String], allowed: &BTreeSet<String>) -> Result<bool, String> {
    let mut value = all_of(rest, allowed)?;
    while rest.first().is_some_and(|w| w == "OR") {
        *rest = &rest[1..];
        value |= all_of(rest, allowed)?;
    }
    Ok(value)
}

fn all_of(rest: &mut &[String], allowed: &BTreeSet<String>) -> Result<bool, String> {
    let mut value = one(rest, allowed)?;
    while rest.first().is_some_and(|w| w == "AND") {
        *rest = &rest[1..];
        value &= one(rest, allowed)?;
    }
    Ok(value)
}

fn one(rest: &mut &[String], allowed: &BTreeSet<String>) -> Result<bool, String> {
    let (word, after) = rest.split_first().ok_or("it ends too early")?;
    *rest = after;
    match word.as_str() {
        "(" => {}
        ")" | "OR" | "AND" => return Err(format!("`{word}` was not expected")),
        licence => return Ok(allowed.contains(licence)),
    }
    let value = any_of(rest, allowed)?;
    match rest.split_first() {
        Some((close, after)) if close == ")" => {
            *rest = after;
            Ok(value)
        }
        _ => Err("a parenthesis is not closed".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|n| (*n).to_owned()).collect()
    }

    #[test]
    fn expressions_are_evaluated() {
        let allowed = set(&["MIT", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"]);
        for (expression, expected) in [
            ("MIT", true),
            ("MIT OR GPL-3.0-only", true),
            ("Apache-2.0/MIT", true),
            ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
            ("MIT AND GPL-3.0-only", false),
            ("GPL-3.0-only OR MIT AND MPL-2.0", false),
            ("Apache-2.0 WITH LLVM-exception", true),
            ("Apache-2.0", false),
        ] {
            assert_eq!(satisfied(expression, &allowed), Ok(expected), "{expression}");
        }
        for broken in ["", "(MIT", "MIT MIT", "MIT OR", ")"] {
            assert!(satisfied(broken, &allowed).is_err(), "`{broken}` should be refused");
        }
    }

    #[test]
    fn a_banned_and_a_copyleft_package_are_found_once_each() {
        let tree = "good v1.0.0|MIT\nvtkio v0.6.3|MIT\nfar v2.0.0|GPL-3.0-only\nfar \
                    v2.0.0|GPL-3.0-only (*)\nbare v1.0.0|\n";
        let (packages, faults) = faults(tree, &set(&["MIT"]), &set(&["vtkio"]));
        assert_eq!(packages, 4);
        assert_eq!(faults.len(), 3, "{faults:?}");
        for name in ["vtkio v0.6.3: banned", "far v2.0.0: licence", "bare v1.0.0: licence"] {
            assert!(faults.iter().any(|f| f.starts_with(name)), "{name} in {faults:?}");
        }
    }

    #[test]
    fn the_real_deny_toml_has_both_lists() {
        let deny = std::fs::read_to_string(crate::workspace_root().join("deny.toml"))
            .expect("deny.toml is there");
        assert!(allowed_licences(&deny).contains("MIT"));
        assert!(allowed_licences(&deny).contains("Apache-2.0"));
        assert!(banned_crates(&deny).contains("vtkio"));
        assert!(!banned_crates(&deny).contains("MIT"));
    }
}
