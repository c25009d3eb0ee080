//! What the documents say must be there: linked files, chapters, named tests, experiments.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use crate::counted::exceptions;
use crate::tree::{File, files, root, words};

/// Files that documents link to and that are still to be made, and by what.
const PENDING: &[(&str, &str)] = &[];

fn documents() -> Vec<File> {
    files().into_iter().filter(|f| f.path.ends_with(".md")).collect()
}

fn document(path: &str) -> File {
    documents().into_iter().find(|f| f.path == path).unwrap_or_else(|| panic!("{path} is missing"))
}

/// The lines of a document outside its code blocks, with their numbers.
pub(crate) fn prose(file: &File) -> impl Iterator<Item = (usize, &str)> {
    let mut in_code = false;
    file.text.lines().enumerate().filter_map(move |(i, line)| {
        let fence = line.trim_start().starts_with("```");
        in_code ^= fence;
        (!in_code && !fence).then_some((i + 1, line))
    })
}

// ---- Links --------------------------------------------------------------------------------------
/// Relative links of a document: line number and path from the workspace root.
fn links(file: &File) -> Vec<(usize, String)> {
    let folder = file.path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut found = Vec::new();
    for (line_number, line) in prose(file) {
        for (at, _) in line.match_indices("](") {
            let target = line[at + 2..].split(')').next().unwrap_or_default();
            let path = target.split('#').next().unwrap_or_default();
            if path.is_empty() || path.contains("://") || path.starts_with("mailto:") {
                continue;
            }
            found.push((line_number, normalized(folder, path)));
        }
    }
    found
}

/// `path` seen from `folder`, without `.` and `..`.
fn normalized(folder: &str, path: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').filter(|p| !p.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()),
            name => parts.push(name),
        }
    }
    parts.join("/")
}

fn dead_links(file: &File, exists: impl Fn(&str) -> bool) -> Vec<String> {
    let dead = links(file).into_iter().filter(|(_, target)| !exists(target));
    dead.map(|(line, target)| format!("{}:{line}: there is no {target}", file.path)).collect()
}

#[test]
fn links_lead_somewhere() {
    let pending = |path: &str| PENDING.iter().any(|(p, _)| *p == path);
    let exists = |path: &str| root().join(path).exists() || pending(path);
    let faults: Vec<_> = documents().iter().flat_map(|d| dead_links(d, exists)).collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
    for (path, what) in PENDING {
        assert!(
            !root().join(path).exists(),
            "{path} ({what}) is there now: take it out of PENDING"
        );
    }
}

#[test]
fn planted_dead_links_are_found() {
    let text = "[a](../here.md#part) \
                ![b](gone.png)\n```\n[c](code.md)\n```\n[d](https://example.org) [e](#top)\n";
    let faults = dead_links(&File::new("docs/src/x.md", text), |path| path == "docs/here.md");
    assert_eq!(faults, ["docs/src/x.md:1: there is no docs/src/gone.png"]);
}

// ---- The book -----------------------------------------------------------------------------------
/// Chapters that SUMMARY.md lists, or that exist, or whose examples are compiled: all by path from
/// docs/src.
#[test]
fn the_book_is_complete() {
    let summary: BTreeSet<String> =
        links(&document("docs/src/SUMMARY.md")).into_iter().map(|(_, p)| p).collect();
    let chapters = documents()
        .into_iter()
        .filter(|d| d.path.starts_with("docs/src/") && !d.path.ends_with("SUMMARY.md"));
    let chapters: Vec<File> = chapters.collect();
    assert!(chapters.len() > 5, "the book was not found");
    for chapter in &chapters {
        assert!(
            summary.contains(&chapter.path),
            "{} is not in SUMMARY.md, so nobody will find it",
            chapter.path
        );
    }
    let compiled = files()
        .into_iter()
        .find(|f| f.path == "bench/src/book.rs")
        .expect("bench/src/book.rs is missing");
    let lib = files()
        .into_iter()
        .find(|f| f.path == "bench/src/lib.rs")
        .expect("bench/src/lib.rs is missing");
    assert!(
        lib.code.contains("mod book;"),
        "bench/src/lib.rs: add `mod book;`, or the book's examples are not compiled"
    );
    for chapter in chapters.iter().filter(|c| has_rust_examples(c)) {
        let include = format!("\"../../{}\"", chapter.path);
        assert!(
            compiled.text.contains(&include),
            "{}: its Rust examples are not compiled; add it to bench/src/book.rs",
            chapter.path
        );
    }
}

fn has_rust_examples(file: &File) -> bool {
    file.text.lines().any(|l| l.trim_start().starts_with("```rust"))
}

// ---- Invariants and their tests -----------------------------------------------------------------
/// The items of the lists below headings that begin with `## Invariants`.
fn invariants(document: &File) -> Vec<String> {
    let mut items: Vec<String> = Vec::new();
    let (mut in_section, mut in_item) = (false, false);
    for line in document.text.lines() {
        if line.starts_with('#') {
            in_section = line.starts_with("## Invariants");
        }
        match (in_section, line.strip_prefix("- ")) {
            (true, Some(item)) => {
                items.push(item.to_owned());
                in_item = true;
            }
            (true, None) if in_item && line.starts_with("  ") => {
                let item = items.last_mut().expect("an item is open");
                item.push(' ');
                item.push_str(line.trim());
            }
            _ => in_item = false,
        }
    }
    items
}

/// Faults in the invariants of a document. Each ends in `*Test:*` with the names of test functions
/// in backticks, or in `*Not tested yet:*` with the reason.
fn untested_invariants(document: &File, is_test: impl Fn(&str) -> bool) -> (usize, Vec<String>) {
    let path = &document.path;
    let mut faults = Vec::new();
    let items = invariants(document);
    for item in &items {
        let head: String = item.chars().take(80).collect();
        if let Some((_, names)) = item.split_once("*Test:*") {
            let names: Vec<&str> = names.split('`').skip(1).step_by(2).collect();
            if names.is_empty() {
                faults.push(format!("{path}: `{head}...`: `*Test:*` names no test"));
            }
            let missing = names.iter().filter(|n| !is_test(n));
            faults.extend(missing.map(|n| format!("{path}: `{head}...`: there is no test `{n}`")));
        } else if !item.contains("*Not tested yet:*") {
            faults.push(format!("{path}: `{head}...`: neither `*Test:*` nor `*Not tested yet:*`"));
        }
    }
    // A list that nobody reads looks like one that is kept.
    if document.text.contains("*Test:*") && items.is_empty() {
        faults.push(format!("{path}: `*Test:*` outside a list below `## Invariants`"));
    }
    (items.len(), faults)
}

/// What ARCHITECTURE.md and the READMEs of all members call invariants: what moves between them is
/// not lost.
const FEWEST_INVARIANTS: usize = 110;

#[test]
fn invariants_name_their_tests() {
    let all = files();
    let sources: Vec<&File> = all.iter().filter(|f| f.is_rust()).collect();
    let is_test = |name: &str| {
        let head = format!("fn {name}(");
        sources.iter().any(|f| f.code.lines().any(|l| l.trim_start().starts_with(&head)))
    };
    let members: BTreeSet<&str> =
        all.iter().filter(|f| f.path.ends_with("/src/lib.rs")).map(File::member).collect();
    let readmes = members.iter().map(|m| format!("{m}/README.md"));
    let (mut count, mut faults) = (0, Vec::new());
    for path in readmes.chain(["ARCHITECTURE.md".to_owned()]) {
        let (here, wrong) = untested_invariants(&document(&path), is_test);
        if here == 0 {
            faults.push(format!("{path}: no list below `## Invariants`"));
        }
        count += here;
        faults.extend(wrong);
    }
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
    assert!(count >= FEWEST_INVARIANTS, "only {count} invariants were found");
}

#[test]
fn planted_untested_invariants_are_found() {
    let text = "# A\n\n## Invariants of it\n\nWhat holds:\n\n- A. *Test:*\n  `real`, `gone`\n- B.\n\
                - C. *Not tested yet:* why.\n- D. *Test:* soon\n\n## Read on\n\n- not one of \
                them\n";
    let (count, faults) = untested_invariants(&File::new("A.md", text), |name| name == "real");
    assert_eq!(count, 4);
    assert_eq!(faults.len(), 3, "{faults:?}");
    assert!(
        faults[0].contains("`gone`") && faults[1].contains("B.") && faults[2].contains("D."),
        "{faults:?}"
    );
    let lost = File::new("A.md", "## Rules\n\n- A. *Test:* `gone`\n");
    assert_eq!(untested_invariants(&lost, |_| true).1.len(), 1);
}

#[test]
fn architecture_names_every_room() {
    let page = document("ARCHITECTURE.md").text;
    for (room, _) in crate::sources::UNSAFE_MODULES {
        assert!(
            page.contains(&format!("`{room}`")),
            "ARCHITECTURE.md does not say why {room} needs `unsafe`"
        );
    }
}

// ---- READMEs of members -------------------------------------------------------------------------
/// The sections of every member's README, in this order; others may stand between.
const README_SECTIONS: &[&str] = &["## Use it", "## Read on", "## Invariants"];

fn readme_faults(member: &str, folder: &str, text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    if text.lines().next() != Some(&format!("# {member}")) {
        faults.push(format!("{folder}/README.md: the first line is not `# {member}`"));
    }
    let headings: Vec<&str> = text.lines().filter(|l| l.starts_with("## ")).collect();
    let mut from = 0;
    for section in README_SECTIONS {
        match headings[from..].iter().position(|h| h.starts_with(section)) {
            Some(at) => from += at + 1,
            None => faults.push(format!("{folder}/README.md: `{section}` is missing or misplaced")),
        }
    }
    faults
}

#[test]
fn readmes_of_members_have_the_same_order() {
    let faults: Vec<_> = crate::manifests::members()
        .into_iter()
        .flat_map(|(name, member)| {
            let path = format!("{}/README.md", member.folder);
            readme_faults(&name, &member.folder, &document(&path).text)
        })
        .collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn planted_readmes_out_of_order_are_found() {
    let good = "# m\n\n## Use it\n\n## What it does\n\n## Read on\n\n## Invariants\n";
    assert_eq!(readme_faults("m", "m", good), Vec::<String>::new());
    assert_eq!(readme_faults("n", "m", good).len(), 1, "another name");
    assert_eq!(readme_faults("m", "m", &good.replace("## Read on", "## More")).len(), 1);
    let swapped = "# m\n## Read on\n## Use it\n## Invariants\n";
    assert_eq!(readme_faults("m", "m", swapped).len(), 1);
}

// ---- The map of the sources ---------------------------------------------------------------------
/// Files and folders that a document names in backticks, each with its line and the section it
/// stands in.
fn named_paths(file: &File) -> Vec<(usize, &str, &str)> {
    let (mut section, mut found) = ("", Vec::new());
    for (number, line) in prose(file) {
        section = line.strip_prefix("## ").unwrap_or(section);
        for span in line.split('`').skip(1).step_by(2) {
            let plain = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
            let ends = [".rs", ".md", ".py", ".csv", ".json", ".toml", ".wgsl", ".cxx", ".h"];
            if span.chars().all(plain)
                && (span.contains('/') || ends.iter().any(|e| span.ends_with(e)))
            {
                found.push((number, section, span));
            }
        }
    }
    found
}

/// A path is the end of a path of the tree; a bare name is one of the member whose section it
/// stands in.
fn lost_paths(file: &File, tree: &[String]) -> Vec<String> {
    let members: BTreeSet<&str> = tree.iter().filter_map(|p| p.split('/').next()).collect();
    let lost = named_paths(file).into_iter().filter(|(_, section, path)| {
        let path = path.trim_start_matches("../").trim_end_matches('/');
        let anywhere = path.contains('/') || !members.contains(section);
        let of_section = |p: &str| anywhere || p.split('/').next() == Some(section);
        // Folders are what files stand in; `a/b` may be the module `a/b.rs`.
        let (inside, folder) = (format!("/{path}"), format!("/{path}/"));
        let ends = [inside.clone(), inside.clone() + ".rs"];
        !tree.iter().any(|p| {
            let rooted = format!("/{p}");
            rooted.starts_with(&folder)
                || rooted == inside
                || of_section(p)
                    && (rooted.contains(&folder) || ends.iter().any(|e| rooted.ends_with(e)))
        })
    });
    lost.map(|(line, _, path)| format!("{}:{line}: there is no {path}", file.path)).collect()
}

/// Paths that the map still names and that have moved.
const LOST_PATHS: &[(&str, usize)] = &[];

#[test]
fn the_map_of_the_sources_names_what_is_there() {
    let map = document("docs/src/appendix/code_map.md");
    assert!(named_paths(&map).len() > 20, "the map names hardly a file");
    let tree: Vec<String> = files().into_iter().map(|f| f.path).collect();
    let found: Vec<_> =
        lost_paths(&map, &tree).into_iter().map(|fault| (map.path.clone(), fault)).collect();
    let faults = exceptions("LOST_PATHS", LOST_PATHS, &found);
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn planted_lost_paths_are_found() {
    let tree = ["m/src/a/b.rs", "n/src/c.rs", "docs/d.md"].map(str::to_owned);
    let text = "# Map\n## m\n`a/b.rs`, `a/`, `a/b` and `a::b`, `1/2 x`, `docs/d.md`,\n`gone.rs`\n\
                ## n\n`b.rs`, `c.rs`\n## Both\n`b.rs`\n";
    let faults = lost_paths(&File::new("map.md", text), &tree);
    assert_eq!(faults, ["map.md:4: there is no gone.rs", "map.md:6: there is no b.rs"]);
}

// ---- Experiments --------------------------------------------------------------------------------
/// Ids in `bench -- run ID` in a document.
fn experiment_ids(file: &File) -> Vec<String> {
    let commands =
        file.text.match_indices("-p bench -- run ").map(|(at, m)| &file.text[at + m.len()..]);
    let id = |rest: &str| {
        rest.chars().take_while(|c| c.is_alphanumeric() || "_-".contains(*c)).collect::<String>()
    };
    // `run ID` stands for any of them.
    commands.map(id).filter(|i| !i.is_empty() && i != "ID").collect()
}

#[test]
fn experiments_in_the_documents_exist() {
    use std::io::Write as _;
    let output =
        Command::new(env!("CARGO_BIN_EXE_bench")).arg("list").output().expect("bench starts");
    let listed = String::from_utf8_lossy(&output.stdout).into_owned();
    if listed.trim().is_empty() {
        writeln!(std::io::stderr(), "skipped: bench lists no experiments yet")
            .expect("stderr can be written");
        return;
    }
    for document in documents() {
        for id in experiment_ids(&document) {
            assert!(
                words(&listed, &id).next().is_some(),
                "{}: `bench -- run {id}`, but `bench -- list` has no such experiment",
                document.path
            );
        }
    }
}

#[test]
fn planted_experiments_are_read() {
    let text = "`cargo run --release -p bench -- run fig3_5` and `-p bench -- run ID`, -p bench -- \
                run accuracy-ao.";
    assert_eq!(experiment_ids(&File::new("a.md", text)), ["fig3_5", "accuracy-ao"]);
}

// ---- Change log ---------------------------------------------------------------------------------
#[test]
fn the_changelog_has_a_place_for_what_is_new() {
    let log = document("CHANGELOG.md").text;
    let version = format!("## [{}]", env!("CARGO_PKG_VERSION"));
    assert!(
        log.contains("## [Unreleased]") || log.contains(&version),
        "CHANGELOG.md has neither [Unreleased] nor {version}"
    );
    assert!(Path::new(&root()).join("LICENSE-MIT").is_file(), "LICENSE-MIT is missing");
    assert!(root().join("LICENSE-APACHE").is_file(), "LICENSE-APACHE is missing");
}
