//! Every public item of the libraries appears in an example, a documentation test, a README or the
//! book.

use std::collections::BTreeSet;

use crate::counted::exceptions;
use crate::tree::{File, files};

/// The members that other programs embed, and the number of their public items that do not appear
/// yet.
const NOT_SHOWN: &[(&str, usize)] = &[("composite", 42), ("rt-core", 57), ("schlieren", 124)];

const ITEMS: &[&str] =
    &["fn ", "const fn ", "unsafe fn ", "struct ", "enum ", "trait ", "type ", "const ", "static "];

/// Names of the public items of a source file, with their lines. The lint `unreachable_pub` ensures
/// that `pub` items can be reached from outside.
fn public_items(file: &File) -> Vec<(usize, &str)> {
    let name = |line: &'_ str| {
        let rest = line.strip_prefix("pub ")?;
        let rest = ITEMS.iter().find_map(|kind| rest.strip_prefix(kind))?;
        rest.split(|c: char| !is_word(c)).next().map(str::len).map(|n| (line.len() - rest.len(), n))
    };
    let lines = file.code.lines().enumerate();
    let named = lines.filter_map(|(i, line)| {
        let (at, length) = name(line)?;
        Some((i + 1, &line[at..at + length]))
    });
    named.collect()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The code that a file shows to readers: a whole example, the text between fences or backticks in
/// a document, the fenced parts of Rust's documentation comments.
fn shown(file: &File) -> String {
    if file.path.contains("/examples/") {
        return file.code.clone();
    }
    let (mut in_code, mut code) = (false, String::new());
    for line in file.text.lines() {
        let line = line.trim_start();
        let line = match ["//!", "///"].iter().find_map(|slashes| line.strip_prefix(slashes)) {
            Some(documentation) => documentation.trim_start(),
            None if file.is_rust() => {
                in_code = false;
                continue;
            }
            None => line,
        };
        if line.starts_with("```") {
            in_code = !in_code;
        } else if in_code {
            code.extend([line, "\n"]);
        } else if !file.is_rust() {
            code.extend(line.split('`').skip(1).step_by(2).flat_map(|span| [span, "\n"]));
        }
    }
    code
}

#[test]
fn what_libraries_offer_is_shown() {
    let files = files();
    let readable = |f: &&File| f.is_rust() || f.path.ends_with(".md");
    let code: Vec<String> = files.iter().filter(readable).map(shown).collect();
    let words: BTreeSet<&str> = code.iter().flat_map(|c| c.split(|c| !is_word(c))).collect();
    let members: Vec<&str> = NOT_SHOWN.iter().map(|(member, _)| *member).collect();
    let (mut count, mut found) = (0, Vec::new());
    for file in files.iter().filter(|f| is_offered(&f.path) && members.contains(&f.member())) {
        let items = public_items(file);
        count += items.len();
        for (line, name) in items.into_iter().filter(|(_, name)| !words.contains(name)) {
            found.push((file.member().to_owned(), format!("{}:{line}: {name}", file.path)));
        }
    }
    assert!(count > 400, "only {count} public items were found");
    let faults = exceptions("NOT_SHOWN", NOT_SHOWN, &found);
    assert!(
        faults.is_empty(),
        "public items that no example, documentation test, README or chapter names\n{}",
        faults.join("\n")
    );
}

/// Library code: not a member's program.
fn is_offered(path: &str) -> bool {
    let Some((_, rest)) = path.split_once("/src/") else { return false };
    rest.ends_with(".rs") && rest != "main.rs" && !rest.starts_with("cli")
}

#[test]
fn planted_items_are_distinguished_from_what_is_shown() {
    let source = "//! `Kept` and\n//! ```\n//! shown_here();\n//! ```\npub struct A<T>(T);\n\
                  pub const fn b() {}\npub const C_1: u8 = 0;\npub mod m;\npub(crate) fn d() {}\n\
                  impl A {\n    pub fn e() {}\n}\n// pub fn f() {}\n";
    let file = File::new("rt-core/src/x.rs", source);
    assert_eq!(public_items(&file), [(5, "A"), (6, "b"), (7, "C_1")]);
    assert_eq!(shown(&file), "shown_here();\n");
    let page = File::new("docs/a.md", "Plain `span` words\n```rust\nlet x = Fenced;\n```\n");
    assert_eq!(shown(&page), "span\nlet x = Fenced;\n");
    assert_eq!(shown(&File::new("m/examples/a.rs", "g(); // h")), "g();     ");
}
