//! `bench list`.

use crate::experiments;
use datasets::cli::CommonArgs;
use serde::Serialize;

#[derive(Serialize)]
struct Entry {
    id: &'static str,
    chapter: u8,
    title: &'static str,
}

pub(super) fn list(common: CommonArgs) -> anyhow::Result<()> {
    let entry =
        |e: &experiments::Experiment| Entry { id: e.id, chapter: e.chapter, title: e.title };
    let entries: Vec<Entry> = experiments::ALL.iter().map(entry).collect();
    common.result(&entries, || {
        let width = entries.iter().map(|e| e.id.len()).max().unwrap_or(0);
        let line = |e: &Entry| format!("{:width$}  chapter {}  {}", e.id, e.chapter, e.title);
        entries.iter().map(line).collect::<Vec<_>>().join("\n")
    })
}
