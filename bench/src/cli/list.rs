//! `bench list`.

use super::{Common, print};
use crate::experiments;
use serde_json::json;

pub(super) fn list(common: Common) -> anyhow::Result<()> {
    if common.json {
        let list: Vec<_> = experiments::ALL
            .iter()
            .map(|e| json!({ "id": e.id, "chapter": e.chapter, "title": e.title }))
            .collect();
        return print(&serde_json::to_string_pretty(&list)?);
    }
    let width = experiments::ALL.iter().map(|e| e.id.len()).max().unwrap_or(0);
    for e in experiments::ALL {
        print(&format!("{:width$}  chapter {}  {}", e.id, e.chapter, e.title))?;
    }
    Ok(())
}
