//! `bench report`.

use super::{ReportArgs, default_dir, print};
use crate::{record, report};
use anyhow::Context as _;
use std::path::{Path, PathBuf};

pub(super) fn report(args: &ReportArgs) -> anyhow::Result<()> {
    let dir = args.dir.clone().unwrap_or_else(default_dir);
    let page = args.out.clone().unwrap_or_else(|| dir.join("index.html"));
    write_page(&dir, &page)?;
    print(&page.display().to_string())
}

/// Makes the page of all records in a folder.
pub(super) fn write_page(dir: &Path, page: &Path) -> anyhow::Result<PathBuf> {
    let records = record::read_dir(dir)?;
    anyhow::ensure!(
        !records.is_empty(),
        "`{}` holds no records; `bench run ID` writes some, `bench list` names them",
        dir.display()
    );
    std::fs::write(page, report::page(&records))
        .with_context(|| format!("cannot write the report `{}`", page.display()))?;
    Ok(page.to_path_buf())
}
