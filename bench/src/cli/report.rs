//! `bench report`.

use super::{ReportArgs, default_dir};
use crate::{record, report};
use anyhow::Context as _;
use datasets::cli::{CommonArgs, CureExt as _};
use serde_json::json;
use std::path::{Path, PathBuf};

pub(super) fn report(common: CommonArgs, args: &ReportArgs) -> anyhow::Result<()> {
    let dir = args.dir.clone().unwrap_or_else(default_dir);
    let page = args.out.clone().unwrap_or_else(|| dir.join("index.html"));
    write_page(&dir, &page)?;
    common.result(&json!({ "report": page }), || page.display().to_string())
}

/// Writes the page for all records in a folder.
pub(super) fn write_page(dir: &Path, page: &Path) -> anyhow::Result<PathBuf> {
    let cure = "`bench run ID` writes records, `bench list` names the experiments";
    let records = record::read_dir(dir).cure(cure)?;
    if records.is_empty() {
        return Err(anyhow::anyhow!("`{}` holds no records", dir.display())).cure(cure);
    }
    std::fs::write(page, report::page(&records))
        .with_context(|| format!("cannot write the report `{}`", page.display()))?;
    Ok(page.to_path_buf())
}
