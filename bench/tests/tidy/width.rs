//! Lines are at most 100 characters wide where they can be broken.

use crate::counted::exceptions;
use crate::documents::prose;
use crate::tree::{File, files};

/// Maximum width of a line in characters, as in rustfmt.toml.
const WIDEST: usize = 100;

/// Number of lines per file that could be broken but are not yet.
const WIDE_LINES: &[(&str, usize)] = &[
    ("composite/src/pixel.rs", 1),
    ("composite/src/shared/blended.rs", 1),
    ("composite/tests/hard_cases.rs", 1),
    ("composite/tests/hostile.rs", 1),
    ("composite/tests/shared.rs", 1),
    ("datasets/src/generate/thermal_plume.rs", 1),
    ("datasets/src/read/open.rs", 1),
    ("gluray/src/host/config/mod.rs", 1),
    ("gluray/src/host/export/format.rs", 3),
    ("gluray/src/host/panel/link.rs", 2),
    ("gluray/src/host/panel/protocol.rs", 1),
    ("gluray/src/interpose/symbols/current_context.rs", 1),
    ("gluray/src/interpose/symbols/hooks.rs", 28),
    ("gluray/src/trace/fragment_batch.rs", 1),
    ("gluray/src/trace/lighting/gouraud.rs", 1),
    ("gluray/src/trace/lighting/powers.rs", 1),
    ("rt-core/src/camera.rs", 1),
    ("rt-core/tests/hard_cases/random.rs", 1),
    ("schlieren/src/index/csv.rs", 1),
    ("schlieren/src/optics.rs", 1),
    ("schlieren/src/serve/worker.rs", 1),
    ("vtk-bridge/src/setup/mod.rs", 1),
];

fn is_wide(line: &str) -> bool {
    line.chars().count() > WIDEST
}

/// Wide lines, with their numbers.
fn wide_lines(file: &File) -> Vec<usize> {
    if file.is_rust() {
        let lines = file.text.lines().zip(file.code.lines()).enumerate();
        let wide = lines.filter(|(_, (text, code))| is_wide(text) && rust_can_break(text, code));
        wide.map(|(i, _)| i + 1).collect()
    } else if file.path.ends_with(".md") {
        let mut in_record = false;
        let outside = prose(file).filter(|(_, line)| {
            in_record = (in_record || line.starts_with("<!-- record"))
                && !line.starts_with("<!-- end record");
            !in_record
        });
        let wide = outside.filter(|(_, line)| is_wide(line) && prose_can_break(line));
        wide.map(|(number, _)| number).collect()
    } else {
        vec![]
    }
}

/// Whether a wide line of Rust can be broken: table rows, drawings, addresses and literals cannot.
fn rust_can_break(text: &str, code: &str) -> bool {
    if let Some(comment) = text.trim_start().strip_prefix("//") {
        let row = comment.trim_start_matches(['/', '!']).trim_start().starts_with('|');
        return !row && !text.contains("──") && !text.contains("://");
    }
    let inside_a_literal = code.trim().is_empty();
    !inside_a_literal && !code.contains('"')
}

/// Whether a wide line of a document can be broken; a link counts as one word, even if its text has
/// several.
fn prose_can_break(line: &str) -> bool {
    let line = line.trim_start();
    !line.starts_with('|') && !line.contains("](") && !line.contains("://")
}

#[test]
fn lines_fit_a_page() {
    let place = |file: &File, line| (file.path.clone(), format!("{}:{line}", file.path));
    let found: Vec<_> = files()
        .iter()
        .flat_map(|f| wide_lines(f).into_iter().map(move |line| place(f, line)))
        .collect();
    let faults = exceptions("WIDE_LINES", WIDE_LINES, &found);
    assert!(faults.is_empty(), "lines wider than {WIDEST}\n{}", faults.join("\n"));
}

#[test]
fn planted_wide_lines_are_found() {
    let long = "x ".repeat(60);
    let rust = |text: String| wide_lines(&File::new("m/src/x.rs", &text));
    for bad in [format!("let a = {long};"), format!("/// {long}"), format!("f(); // \"{long}\"")] {
        assert_eq!(rust(format!("fn f() {{}}\n{bad}\n")), [2], "{bad}");
    }
    for good in [
        format!("let a = \"{long}\";"),
        format!("let a = \"\n{long}\n\";"),
        format!("//! | {long} |"),
        format!("//! a ── b {long}"),
        format!("// https://example.org/ {long}"),
        "ä".repeat(WIDEST),
    ] {
        assert_eq!(rust(good.clone()), Vec::<usize>::new(), "{good}");
    }
    let text = format!(
        "{long}\n| {long} |\n[{long}](a.md)\n```\n{long}\n```\n<!-- record a: {long} -->\n{long}\n\
         <!-- end record -->\n- {long}\n"
    );
    assert_eq!(wide_lines(&File::new("a.md", &text)), [1, 10]);
}
