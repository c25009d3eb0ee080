//! Rules for the content and the length of Rust sources.

use crate::tree::{File, files, words};

/// The only places where `unsafe` is allowed, and why it cannot be avoided there. ARCHITECTURE.md
/// explains each.
pub(crate) const UNSAFE_MODULES: &[(&str, &str)] = &[
    ("rt-core/src/simd", "vector loads and huge pages below the safe SIMD layer"),
    (
        "gluray/interposer/src/entry_points",
        "exported OpenGL symbols, called by programs we do not know",
    ),
    ("gluray/src/interpose/symbols", "OpenGL's hooks, called by programs we do not know"),
    ("gluray/src/driver", "calls into the real OpenGL library"),
    ("gluray/src/interpose/client_memory", "vertex arrays that live in the program's own memory"),
    ("vtk-bridge/src/capi", "the C ABI for VTK and ParaView"),
    ("vtk-bridge/src/loader", "finds the VTK that is in the process and loads what fits it"),
    ("vtk-bridge/src/anari/abi", "the C++ vtables through which ANARI programs call a device"),
    ("vtk-bridge/src/anari/memory", "elements of arrays that ANARI programs read and write"),
    (
        "composite/examples/composite_smpi",
        "the function `main` of a shared library, which SimGrid's smpirun calls",
    ),
    ("composite/src/comm/mpi", "calls into an MPI library found at run time"),
    ("composite/capi/src/capi", "the C ABI for programs with MPI"),
    ("composite/catalyst/src/api", "Catalyst's functions, and Conduit's nodes in a simulation"),
    (
        "composite/src/icet",
        "calls into IceT, found at run time; a comparison with IceT is a call into it",
    ),
    ("bench/src/baselines", "calls into C libraries that we measure against"),
];

/// Maximum length of a file, in lines, without its module of unit tests.
const LONGEST: usize = 600;
/// Maximum median length of the files.
const LONGEST_MEDIAN: usize = 300;
/// Files that may be longer, and why.
const LONG_FILES: &[(&str, &str)] = &[];

/// The faults that `check` finds in all `.rs` files.
fn all_faults(check: impl Fn(&File) -> Vec<String>) -> Vec<String> {
    files().iter().filter(|f| f.is_rust()).flat_map(check).collect()
}

fn assert_none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

// ---- unsafe -------------------------------------------------------------------------------------
fn may_be_unsafe(path: &str) -> bool {
    UNSAFE_MODULES.iter().any(|(module, _)| {
        path.strip_prefix(module)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('/') || rest == ".rs")
    })
}

fn unsafe_outside(file: &File) -> Vec<String> {
    if may_be_unsafe(&file.path) {
        return vec![];
    }
    let places = words(&file.code, "unsafe").map(|at| file.place(at));
    places
        .map(|p| format!("{p}: `unsafe` outside the modules that ARCHITECTURE.md lists"))
        .collect()
}

fn unguarded_root(file: &File) -> Vec<String> {
    let Some(path) = file.path.strip_prefix(file.member()) else { return vec![] };
    let is_root = path == "/src/lib.rs" || path == "/src/main.rs" || path.starts_with("/src/bin/");
    // xtask forbids it in its Cargo.toml.
    if !is_root || file.member() == "xtask" || file.code.contains("#![forbid(unsafe_code)]") {
        return vec![];
    }
    let has_unsafe_module =
        UNSAFE_MODULES.iter().any(|(module, _)| module.starts_with(&format!("{}/", file.member())));
    match has_unsafe_module && file.code.contains("#![deny(unsafe_code)]") {
        true => vec![],
        false => vec![format!("{}: begin with `#![forbid(unsafe_code)]`", file.path)],
    }
}

#[test]
fn unsafe_stays_in_its_modules() {
    assert_none(&all_faults(unsafe_outside));
    assert_none(&all_faults(unguarded_root));
}

#[test]
fn planted_unsafe_is_found() {
    let faults = |path: &str, text: &str| {
        let file = File::new(path, text);
        [unsafe_outside(&file), unguarded_root(&file)].concat()
    };
    assert_eq!(faults("datasets/src/gen/fire.rs", "fn f() {\n    unsafe { g() }\n}").len(), 1);
    assert_eq!(faults("rt-core/src/simd/load.rs", "unsafe { g() }"), Vec::<String>::new());
    assert_eq!(faults("rt-core/src/simd.rs", "unsafe { g() }"), Vec::<String>::new());
    assert_eq!(
        faults("rt-core/src/simd_tables.rs", "unsafe { g() }").len(),
        1,
        "a module is not a prefix"
    );
    assert_eq!(
        faults("datasets/src/lib.rs", "#![deny(unsafe_code)]").len(),
        1,
        "no unsafe module, so forbid"
    );
    assert_eq!(faults("bench/src/lib.rs", "#![deny(unsafe_code)]"), Vec::<String>::new());
    assert_eq!(
        faults("bench/src/main.rs", "// #![forbid(unsafe_code)]").len(),
        1,
        "a comment forbids nothing"
    );
}

// ---- Which code may do I/O ----------------------------------------------------------------------
/// Modules of std that access resources outside the process.
const OUTSIDE: &[&str] = &["fs", "net", "io", "process"];
const PRINTING: &[&str] = &["print!", "println!", "eprint!", "eprintln!", "dbg!"];

/// Uses of `std::MODULE`, also in `use std::{MODULE, ...}`.
fn uses_of_std(file: &File, modules: &[&str]) -> Vec<String> {
    let code = &file.code;
    let mut faults = Vec::new();
    for module in modules {
        let direct = words(code, "std").filter(|at| {
            let rest = code[at + 3..].trim_start().strip_prefix("::").map(str::trim_start);
            rest.is_some_and(|r| words(r, module).next() == Some(0))
        });
        let grouped = code.match_indices("use std::{").filter(|(at, _)| {
            let group = &code[*at..code[*at..].find(';').map_or(code.len(), |end| at + end)];
            words(group, module).next().is_some()
        });
        for at in direct.chain(grouped.map(|(at, _)| at)) {
            faults.push(format!("{}: std::{module}", file.place(at)));
        }
    }
    faults
}

fn prints(file: &File) -> Vec<String> {
    let at = |word: &'static str| {
        let calls = words(&file.code, word.trim_end_matches('!'))
            .filter(move |at| file.code[*at..].starts_with(word));
        calls.map(move |at| format!("{}: {word}", file.place(at)))
    };
    PRINTING.iter().flat_map(|w| at(w)).collect()
}

fn io_in_rt_core(file: &File) -> Vec<String> {
    if !file.path.starts_with("rt-core/src/") {
        return vec![];
    }
    [uses_of_std(file, OUTSIDE), prints(file)].concat()
}

#[test]
fn rt_core_does_no_io() {
    assert_none(&all_faults(io_in_rt_core));
}

/// Whether a file is library code: not a program, not the shared command-line conventions, not
/// bench and xtask, which are programs.
fn is_library(path: &str) -> bool {
    let Some((member, rest)) = path.split_once("/src/") else { return false };
    let program = rest == "main.rs"
        || rest.starts_with("bin/")
        || rest.starts_with("cli/")
        || rest == "cli.rs";
    !program && !["bench", "xtask"].contains(&member)
}

fn library_faults(file: &File) -> Vec<String> {
    if !is_library(&file.path) {
        return vec![];
    }
    let ends = ["process::exit", "process::abort"].into_iter();
    let ends =
        ends.flat_map(|w| words(&file.code, w).map(move |at| format!("{}: {w}", file.place(at))));
    prints(file).into_iter().chain(ends).collect()
}

#[test]
fn libraries_do_not_print_or_exit() {
    assert_none(&all_faults(library_faults));
}

#[test]
fn planted_io_is_found() {
    let io = |text: &str| io_in_rt_core(&File::new("rt-core/src/render.rs", text)).len();
    assert_eq!(io("use std::fs::File;"), 1);
    assert_eq!(io("use std::{\n    collections::BTreeMap,\n    fs,\n};"), 1);
    assert_eq!(io("let x = std::net::TcpStream::connect(a);"), 1);
    assert_eq!(io("println!(\"x\"); eprintln!();"), 2);
    assert_eq!(
        io("// std::fs\nuse std::fmt; let offs = std::env::var(\"RTSV_SIMD\"); print_it();"),
        0
    );
    let library =
        |path: &str| library_faults(&File::new(path, "eprintln!(); std::process::exit(1)")).len();
    assert_eq!(library("datasets/src/read/obj.rs"), 2);
    assert_eq!(library("datasets/src/cli/progress.rs"), 0);
    assert_eq!(library("schlieren/src/main.rs"), 0);
}

// ---- composite's core ---------------------------------------------------------------------------
fn composite_faults(file: &File) -> Vec<String> {
    let Some(path) = file.path.strip_prefix("composite/src/") else { return vec![] };
    let mut faults = Vec::new();
    let outer = path.starts_with("render")
        || path.starts_with("cli")
        || path == "main.rs"
        || path.starts_with("bin/");
    if !outer {
        let names = ["rt_core", "datasets"].into_iter();
        faults.extend(
            names.flat_map(|n| {
                words(&file.code, n).map(move |at| format!("{}: {n}", file.place(at)))
            }),
        );
    }
    if !outer && !path.starts_with("comm/mpi/") {
        // Names of MPI functions would be strings for dlsym, so the whole text without comments is
        // searched.
        let lines =
            file.text.lines().filter(|l| !l.trim_start().starts_with("//") && l.contains("MPI_"));
        faults.extend(lines.map(|l| format!("{}: `{}` outside comm/mpi", file.path, l.trim())));
    }
    faults
}

#[test]
fn composite_core_knows_no_rays_and_no_mpi() {
    assert_none(&all_faults(composite_faults));
}

#[test]
fn planted_rays_and_mpi_in_composite_are_found() {
    let faults = |path: &str, text: &str| composite_faults(&File::new(path, text)).len();
    assert_eq!(faults("composite/src/op.rs", "use rt_core::frame::Frame;"), 1);
    assert_eq!(faults("composite/src/render.rs", "use rt_core::frame::Frame;"), 0);
    assert_eq!(
        faults("composite/src/comm/threads.rs", "// unlike MPI_Send\nsym(\"MPI_Init\");"),
        1
    );
    assert_eq!(faults("composite/src/comm/mpi/library.rs", "sym(\"MPI_Init\");"), 0);
}

// ---- Length -------------------------------------------------------------------------------------
/// Number of lines before the module of unit tests.
fn length(file: &File) -> usize {
    let lines: Vec<&str> = file.text.lines().collect();
    let tests =
        lines.windows(2).position(|w| w[0] == "#[cfg(test)]" && w[1].starts_with("mod tests"));
    tests.unwrap_or(lines.len())
}

fn too_long(file: &File, allowed: &[(&str, &str)]) -> Option<String> {
    let lines = length(file);
    match (lines > LONGEST, allowed.iter().any(|(path, _)| *path == file.path)) {
        (true, false) => {
            Some(format!("{}: {lines} lines; split it, or give a reason in LONG_FILES", file.path))
        }
        (false, true) => Some(format!("{}: {lines} lines; take it out of LONG_FILES", file.path)),
        _ => None,
    }
}

#[test]
fn no_file_is_too_long() {
    use std::io::Write as _;
    let files: Vec<File> = files().into_iter().filter(File::is_rust).collect();
    let faults: Vec<_> = files.iter().filter_map(|f| too_long(f, LONG_FILES)).collect();
    assert_none(&faults);
    for (path, reason) in LONG_FILES {
        assert!(files.iter().any(|f| f.path == *path), "LONG_FILES: {path} does not exist");
        assert!(!reason.is_empty(), "LONG_FILES: {path} needs a reason");
    }
    let mut lengths: Vec<usize> =
        files.iter().filter(|f| f.path.contains("/src/")).map(length).collect();
    lengths.sort_unstable();
    let (median, longest) = (lengths[lengths.len() / 2], lengths[lengths.len() - 1]);
    // Bypasses libtest's capture, because the number is also of interest when the test passes.
    writeln!(
        std::io::stderr(),
        "{} files in src folders: median {median} lines, longest {longest}",
        lengths.len()
    )
    .expect("stderr can be written");
    assert!(median <= LONGEST_MEDIAN, "median length is {median} lines, above {LONGEST_MEDIAN}");
}

#[test]
fn planted_long_files_are_found() {
    let file = |lines: usize, tests: usize| {
        let text =
            "x\n".repeat(lines) + "#[cfg(test)]\nmod tests {\n" + &"y\n".repeat(tests) + "}\n";
        File::new("rt-core/src/x.rs", &text)
    };
    assert_eq!(too_long(&file(600, 500), &[]), None, "tests do not count");
    assert!(too_long(&file(601, 0), &[]).is_some());
    assert_eq!(too_long(&file(601, 0), &[("rt-core/src/x.rs", "a table")]), None);
    assert!(
        too_long(&file(10, 0), &[("rt-core/src/x.rs", "a table")]).is_some(),
        "stale exception"
    );
}

// ---- Loose ends ---------------------------------------------------------------------------------
fn loose_ends(file: &File) -> Vec<String> {
    let code = &file.code;
    let mut faults = Vec::new();
    for (word, call) in [("todo", "todo!"), ("unimplemented", "unimplemented!"), ("dbg", "dbg!")] {
        for at in words(code, word).filter(|at| code[*at..].starts_with(call)) {
            faults.push(format!(
                "{}: `{call}`: finish it, or return an error that says what cannot be done",
                file.place(at)
            ));
        }
    }
    for (at, _) in code.match_indices("#[ignore]") {
        faults.push(format!(
            "{}: `#[ignore]` without reason; write `#[ignore = \"why, and how to run it\"]`",
            file.place(at)
        ));
    }
    for (at, open) in
        ["[allow(", "[expect(", ", allow(", ", expect("].iter().flat_map(|w| code.match_indices(w))
    {
        // Only in attributes: `#[`, `#![` or inside cfg_attr.
        let before = code[..at].trim_end();
        let in_attribute = before.ends_with('#') || before.ends_with("#!") || open.starts_with(',');
        let list = &code[at..code[at..].find(']').map_or(code.len(), |end| at + end)];
        if in_attribute
            && !list.contains("reason =")
            && (open.starts_with('[') || is_in_cfg_attr(code, at))
        {
            faults.push(format!("{}: an exception without `reason = \"...\"`", file.place(at)));
        }
    }
    faults
}

fn is_in_cfg_attr(code: &str, at: usize) -> bool {
    code[..at].rfind("#[cfg_attr(").is_some_and(|open| !code[open..at].contains(']'))
}

#[test]
fn nothing_is_left_loose() {
    assert_none(&all_faults(loose_ends));
}

#[test]
fn planted_loose_ends_are_found() {
    let count = |text: &str| loose_ends(&File::new("m/src/x.rs", text)).len();
    for bad in [
        "fn f() { todo!() }",
        "unimplemented!(\"later\")",
        "#[ignore]\nfn f() {}",
        "#[allow(dead_code)]",
        "#![expect(clippy::exit)]",
        "#[cfg_attr(unix, allow(dead_code))]",
    ] {
        assert_eq!(count(bad), 1, "{bad}");
    }
    for good in [
        "// todo!()",
        "let s = \"todo!()\"; my_todo!();",
        "#[ignore = \"needs 40 GB; run with --ignored\"]",
        "#[allow(dead_code, reason = \"read by C\")]",
        "#[expect(\n    clippy::exit,\n    reason = \"main\"\n)]",
        "value.expect(\"a value\"); f(a, expect(b));",
    ] {
        assert_eq!(count(good), 0, "{good}");
    }
}

/// Beginnings of paths that exist on one machine only, composed so that this file does not contain
/// them.
fn machine_paths() -> Vec<String> {
    ["work", "root", "home", "Users"].iter().map(|folder| format!("/{folder}/")).collect()
}

fn names_a_machine(file: &File) -> Vec<String> {
    let mut faults = Vec::new();
    for path in machine_paths() {
        for (at, _) in file.text.match_indices(&path) {
            // `frame/work/x` or `https://x.org/home/` are not such paths.
            if !file.text[..at].ends_with(|c: char| c.is_alphanumeric() || "._-}*".contains(c)) {
                faults.push(format!("{}: `{path}` is a path of one machine", file.place(at)));
            }
        }
    }
    faults
}

#[test]
fn no_file_names_a_machine() {
    let faults: Vec<_> = files().iter().flat_map(names_a_machine).collect();
    assert_none(&faults);
}

#[test]
fn planted_machine_paths_are_found() {
    let home = machine_paths().remove(2);
    assert_eq!(names_a_machine(&File::new("a.md", &format!("see `{home}me/x`"))).len(), 1);
    assert_eq!(
        names_a_machine(&File::new("a.md", &format!("https://example.org{home}x"))).len(),
        0
    );
}
