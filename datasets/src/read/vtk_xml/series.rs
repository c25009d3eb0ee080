//! ParaView's file series (`.vtu.series`, `.vtm.series` and so on): times and names of VTK files as
//! JSON.
//!
//! Source: ParaView's documentation, "JSON based new meta file format for series added in ParaView
//! 5.5".

use super::parallel;
use crate::read::error::{At, Fault, read_bytes, sibling_path};
use crate::read::{Content, LoadedFile, ReadError, TimeStep};
use serde::Deserialize;
use std::path::Path;

pub(crate) const FORMAT: &str = "VTK file series";

#[derive(Deserialize)]
struct Series {
    #[serde(rename = "file-series-version")]
    version: String,
    files: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    name: String,
    time: f64,
}

/// Reads one time of a series, by default the first.
pub(crate) fn read(path: &Path, time: Option<f64>) -> Result<LoadedFile, ReadError> {
    let bytes = read_bytes(path)?;
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let series: Series = serde_json::from_slice(&bytes).map_err(|e| {
        let cure = "it needs `file-series-version` and `files`, a list of `name` and `time`";
        fault(Fault::new(At::Line(e.line() as u64), e.to_string(), cure))
    })?;
    if !series.version.starts_with("1.") {
        let at = At::Field("`file-series-version`".into());
        let cure = "write the series with version 1.0";
        return Err(fault(Fault::unsupported(at, format!("`{}`", series.version), cure)));
    }
    let step = |e: Entry| TimeStep { time: e.time, part: 0, path: sibling_path(path, &e.name) };
    let mut steps: Vec<TimeStep> = series.files.into_iter().map(step).collect();
    steps.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut warnings = Vec::new();
    let data = parallel::at_time(path, &steps, time, 0, &mut warnings)?;
    let (format, content) = (FORMAT, Content::Data(data));
    Ok(LoadedFile { format, content, warnings, time_steps: steps })
}
