//! The rows of the book's table of systems, each written by the run that it tells of.

use std::fs;
use std::path::Path;

/// The page, from the root of the workspace.
pub(super) const PAGE: &str = "docs/src/systems.md";

/// Writes `row` over the row that ends in the comment of `key`.
pub(super) fn record(page: &Path, key: &str, row: &str) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: {e}", page.display());
    let text = fs::read_to_string(page).map_err(failed)?;
    let text = with_row(&text, key, row).ok_or_else(|| {
        format!("{}: no row ends in `<!-- {key} -->`; add one for it", page.display())
    })?;
    fs::write(page, text).map_err(failed)
}

/// `text` with another row for `key`; `None` when there is none.
fn with_row(text: &str, key: &str, row: &str) -> Option<String> {
    let mark = format!("<!-- {key} -->");
    let mut found = false;
    let mut line_of = |line: &str| {
        if !line.trim_end().ends_with(&mark) {
            return line.to_owned();
        }
        found = true;
        format!("{row} {mark}\n")
    };
    let text = text.split_inclusive('\n').map(&mut line_of).collect();
    found.then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_writes_its_own_row_and_no_other() {
        let text = "| a | b |\n|---|---|\n| old | x | <!-- system one -->\n| y | z | <!-- system \
                    one paraview -->\nend\n";
        let new = with_row(text, "system one", "| new | 2 |").expect("the row is there");
        assert_eq!(new, text.replace("| old | x |", "| new | 2 |"));
        assert_eq!(with_row(text, "system two", "| new |"), None);
    }

    #[test]
    fn the_book_has_a_row_for_every_suite() {
        let page = crate::workspace_root().join(PAGE);
        let text = fs::read_to_string(page).expect("the page is there");
        for suite in super::super::suites::SUITES {
            for with in ["", " paraview"] {
                let key = format!("system {}{with}", suite.name);
                assert!(with_row(&text, &key, "").is_some(), "{key}");
            }
        }
    }
}
