//! `bench quote`.

use crate::quote;
use datasets::cli::{CommonArgs, UsageError};
use serde_json::json;

/// Updates the quotations of records in the book, and prints the files that changed.
pub(super) fn quote(common: CommonArgs) -> anyhow::Result<()> {
    let here = std::env::current_dir()?;
    let root =
        here.ancestors().find(|d| d.join("docs/src/SUMMARY.md").exists()).ok_or_else(|| {
            UsageError("the book is not here: start `bench quote` inside the repository".into())
        })?;
    let written = quote::update(root)?;
    common.result(&json!({ "written": written }), || {
        let lines: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        if lines.is_empty() { "nothing has changed".into() } else { lines.join("\n") }
    })
}
