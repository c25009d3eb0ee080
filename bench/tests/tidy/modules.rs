//! Modules of one folder import each other in one direction, so that a reader knows where to begin.
//!
//! A module and its submodules count as one; only modules in the same folder are compared.

use std::collections::{BTreeMap, BTreeSet};

use crate::counted::exceptions;
use crate::tree::{File, files, words};

/// Number of imports between the modules of a folder that are part of a cycle. Code that two
/// modules need from each other belongs into a third.
const CYCLES: &[(&str, usize)] = &[
    ("composite/src", 4),
    ("datasets/src/model", 2),
    ("datasets/src/read", 2),
    ("gluray/src", 28),
    ("gluray/src/classify/vtk", 4),
    ("gluray/src/cluster", 2),
    ("gluray/src/interpose", 2),
    ("gluray/src/trace", 2),
    ("rt-core/src/bvh", 2),
    ("schlieren/src", 4),
    ("vtk-bridge/src", 4),
];

/// The source files of one member, by module path: `[]` is main.rs, or lib.rs without one.
type Modules<'a> = BTreeMap<Vec<&'a str>, &'a File>;
/// An import between two modules of a folder, with a place where it occurs.
type Imports<'a> = BTreeMap<(&'a str, &'a str), String>;

/// `bvh/layout/mod.rs` as `["bvh", "layout"]`.
fn module_path(path: &str) -> Vec<&str> {
    let mut parts: Vec<&str> = path.trim_end_matches(".rs").split('/').collect();
    let last = parts.last().copied().unwrap_or_default();
    if last == "mod" || (parts.len() == 1 && ["lib", "main"].contains(&last)) {
        parts.pop();
    }
    parts
}

/// Code before the module of unit tests, which may import anything.
fn without_tests(code: &str) -> &str {
    code.find("#[cfg(test)]\nmod tests").map_or(code, |at| &code[..at])
}

/// The paths that begin with `crate` or `super`, each with its offset; groups in braces are
/// expanded.
fn imports(code: &str) -> Vec<(usize, Vec<&str>)> {
    let mut found = Vec::new();
    for start in ["crate", "super"] {
        for at in words(code, start) {
            // `super::super::x` is one path; `$crate` belongs to a macro; `in crate::x` is not an
            // import.
            let before = &code[..at];
            let begins = !["::", "$", "in "].iter().any(|end| before.ends_with(end));
            if begins && code[at + start.len()..].starts_with("::") {
                take_path(code, at, &mut Vec::new(), &mut |path| found.push((at, path.to_vec())));
            }
        }
    }
    found
}

/// Parses one path, or a tree of them, and returns the offset after it.
fn take_path<'a>(
    code: &'a str,
    mut at: usize,
    path: &mut Vec<&'a str>,
    found: &mut impl FnMut(&[&'a str]),
) -> usize {
    let depth = path.len();
    loop {
        at += code[at..].len() - code[at..].trim_start().len();
        if let Some(group) = code[at..].strip_prefix('{') {
            at = code.len() - group.len();
            while !code[at..].starts_with('}') && at < code.len() {
                at = take_path(code, at, path, found);
                // The rest of an element is a new name, `as x`.
                at += code[at..].find([',', '}']).unwrap_or(code.len() - at);
                at += usize::from(code[at..].starts_with(','));
                at += code[at..].len() - code[at..].trim_start().len();
            }
            path.truncate(depth);
            return (at + 1).min(code.len());
        }
        let length = code[at..].find(|c: char| !(c.is_alphanumeric() || c == '_'));
        let name = &code[at..at + length.unwrap_or(code.len() - at)];
        at += name.len();
        path.push(name);
        match code[at..].strip_prefix("::") {
            Some(_) => at += 2,
            None => break,
        }
    }
    found(path);
    path.truncate(depth);
    at
}

/// The module to which a path in `from` leads: the deepest one that exists.
fn target<'a>(modules: &Modules<'a>, from: &[&'a str], path: &[&str]) -> Vec<&'a str> {
    let mut at = from.to_vec();
    for (i, name) in path.iter().enumerate() {
        match *name {
            "crate" if i == 0 => at.clear(),
            "self" if i == 0 => {}
            "super" => drop(at.pop()),
            name => {
                let child = modules
                    .keys()
                    .find(|m| m.len() > at.len() && m.starts_with(&at) && m[at.len()] == name);
                match child {
                    Some(child) => at.push(child[at.len()]),
                    None => break,
                }
            }
        }
    }
    at
}

/// Imports between modules of the same folder, for each folder of a member's sources.
fn folders<'a>(modules: &Modules<'a>) -> BTreeMap<Vec<&'a str>, Imports<'a>> {
    let mut folders: BTreeMap<Vec<&str>, Imports<'_>> = BTreeMap::new();
    for (from, file) in modules {
        for (at, path) in imports(without_tests(&file.code)) {
            let to = target(modules, from, &path);
            let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if let (Some(a), Some(b)) = (from.get(common), to.get(common)) {
                let place = || format!("{}: {}", file.place(at), path.join("::"));
                let folder = folders.entry(from[..common].to_vec()).or_default();
                folder.entry((*a, *b)).or_insert_with(place);
            }
        }
    }
    folders
}

/// The modules that can be reached from a module.
fn reached<'a>(imports: &Imports<'a>, from: &'a str) -> BTreeSet<&'a str> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(module) = open.pop() {
        for (_, to) in imports.keys().filter(|(a, _)| *a == module) {
            if seen.insert(*to) {
                open.push(to);
            }
        }
    }
    seen
}

/// Whether a module is compiled for unit tests only: `#[cfg(test)]` precedes its declaration.
fn is_for_tests(modules: &Modules<'_>, module: &[&str]) -> bool {
    (0..module.len()).any(|depth| {
        let Some(parent) = modules.get(&module[..depth]) else { return false };
        let declaration = format!("mod {};", module[depth]);
        words(&parent.code, "mod").filter(|at| parent.code[*at..].starts_with(&declaration)).any(
            |at| {
                let before = parent.code[..at].trim_end_matches(|c| c != '\n' && c != ']');
                before.trim_end().ends_with("#[cfg(test)]")
            },
        )
    })
}

/// The imports of a member that are part of a cycle: the folder, and the import with its place.
fn import_cycles(member: &str, files: &[File]) -> Vec<(String, String)> {
    let source = format!("{member}/src/");
    let mut modules: Modules<'_> = files
        .iter()
        .filter(|f| f.is_rust())
        .filter_map(|f| Some((module_path(f.path.strip_prefix(&source)?), f)))
        .collect();
    let tests: Vec<_> = modules.keys().filter(|m| is_for_tests(&modules, m)).cloned().collect();
    modules.retain(|m, _| !tests.contains(m));
    let mut found = Vec::new();
    for (folder, imports) in folders(&modules) {
        let folder = (source.clone() + &folder.join("/")).trim_end_matches('/').to_owned();
        for ((from, to), place) in &imports {
            if reached(&imports, to).contains(from) {
                found.push((folder.clone(), format!("{from} -> {to}: {place}")));
            }
        }
    }
    found
}

#[test]
fn modules_of_a_folder_import_in_one_direction() {
    let all = files();
    let members: BTreeSet<&str> = all
        .iter()
        .filter(|f| f.path.ends_with("/src/lib.rs") || f.path == "xtask/src/main.rs")
        .map(File::member)
        .collect();
    assert!(members.len() > 7, "{members:?}");
    let found: Vec<(String, String)> =
        members.iter().flat_map(|m| import_cycles(m, &all)).collect();
    let faults = exceptions("CYCLES", CYCLES, &found);
    assert!(faults.is_empty(), "modules import each other in a cycle\n{}", faults.join("\n"));
}

/// Whether a module, or one that it is in, is declared behind the attribute `gate`.
fn is_behind(modules: &Modules<'_>, module: &[&str], gate: &str) -> bool {
    (0..module.len()).any(|depth| {
        let Some(parent) = modules.get(&module[..depth]) else { return false };
        let name = module[depth];
        ["mod", "pub mod", "pub(crate) mod"]
            .iter()
            .any(|kind| parent.text.contains(&format!("{gate}\n{kind} {name};")))
    })
}

#[test]
fn ray_queries_import_nothing_of_the_renderer() {
    const GATE: &str = "#[cfg(feature = \"render\")]";
    let all = files();
    let source = |f: &'_ File| f.path.strip_prefix("rt-core/src/").map(str::to_owned);
    let paths: Vec<(String, &File)> = all
        .iter()
        .filter(|f| f.is_rust())
        .filter_map(|f| source(f).map(|path| (path, f)))
        .collect();
    let modules: Modules<'_> = paths.iter().map(|(path, f)| (module_path(path), *f)).collect();
    let renderer = |m: &[&str]| is_behind(&modules, m, GATE);
    let (mut queries, mut faults) = (0, Vec::new());
    for (from, file) in modules.iter().filter(|(m, _)| !m.is_empty() && !renderer(m)) {
        queries += 1;
        // The prelude names the renderer's types behind the same gate.
        if from == &["prelude"] {
            continue;
        }
        for (at, path) in imports(without_tests(&file.code)) {
            if renderer(&target(&modules, from, &path)) {
                faults.push(format!("{}: {}", file.place(at), path.join("::")));
            }
        }
    }
    assert!(queries > 30 && queries < modules.len() - 30, "{queries} of {}", modules.len());
    assert!(faults.is_empty(), "a ray query imports the renderer\n{}", faults.join("\n"));
}

#[test]
fn planted_imports_are_read() {
    let code = "use crate::{a::{B, c as d}, e};\nuse super::super::f;\nfn g(h: &crate::i::J<K>) {}\n\
                $crate::l!(); pub(crate) fn m() {} pub(in crate::n) struct O;";
    let read: Vec<String> = imports(code).into_iter().map(|(_, p)| p.join("::")).collect();
    assert_eq!(read, ["crate::a::B", "crate::a::c", "crate::e", "crate::i::J", "super::super::f"]);
}

#[test]
fn planted_cycles_are_found() {
    let found = |files: &[(&str, &str)]| {
        let files: Vec<File> = files.iter().map(|(path, text)| File::new(path, text)).collect();
        import_cycles("m", &files).into_iter().map(|(folder, _)| folder).collect::<Vec<_>>()
    };
    let (lib, b) = (("m/src/lib.rs", "use crate::a::A;"), ("m/src/b.rs", "use crate::c::C;"));
    let inner = ("m/src/a/inner.rs", "use crate::b::B;");
    let outside = ("m/src/d.rs", "use crate::a::A;");
    let back = ("m/src/c.rs", "use super::a::A;");
    assert_eq!(found(&[lib, inner, b, outside, back]), ["m/src"; 3], "a, b and c, but not d");
    let tests = ("m/src/c.rs", "#[cfg(test)]\nmod tests {\n    use crate::a::A;\n}");
    assert_eq!(found(&[lib, inner, b, tests]), [""; 0], "tests use what they like");
    let only_tests = ("m/src/lib.rs", "mod a;\n#[cfg(test)]\npub(crate) mod c;");
    assert_eq!(found(&[only_tests, inner, b, back]), [""; 0], "also in files of their own");
    let parent = ("m/src/a/mod.rs", "use crate::a::inner::I;");
    let child = ("m/src/a/inner.rs", "use super::A; use crate::X;");
    assert_eq!(found(&[lib, parent, child]), [""; 0], "a module and its parts are one thing");
    let twin = ("m/src/a/other.rs", "use super::inner::I;");
    let pair = ("m/src/a/inner.rs", "use super::{other::O, A};");
    assert_eq!(found(&[lib, pair, twin]), ["m/src/a"; 2]);
}
