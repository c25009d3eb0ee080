//! Quotes tables and plots from the records in `bench/runs` in documents.
//!
//! A pair of comments in a document names the quotation, and [`update`] writes the text between
//! them:
//!
//! ```text
//! <!-- record accuracy-sampling: table sampling, samples, time where quantity = antialiasing -->
//! <!-- end record -->
//! <!-- record accuracy-sampling: plot antialiasing -->
//! <!-- end record -->
//! ```
//!
//! `table` names columns and selects rows (`where mode = fast | slow` takes either). `plot` names
//! the beginning of a plot's title. The newest record of that name is used, and reasons to distrust
//! it appear below the quotation. The test `documents_quote_their_records` fails when a document
//! and its record differ.

use crate::doubts::MOST_LOAD_PER_CORE;
use crate::plot::Plot;
use crate::record::{Column, Record, Row};
use anyhow::{Context as _, bail, ensure};
use serde_json::Value;
use std::path::{Path, PathBuf};

const OPENING: &str = "<!-- record ";
const CLOSING: &str = "<!-- end record -->";

/// A file that [`update`] would write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quotation {
    /// Path of the file, relative to the root of the repository.
    pub path: PathBuf,
    /// Its required content.
    pub text: String,
}

/// Writes each document of `docs/src` that quotes records, and the plots that it shows, if they are
/// out of date. Returns their paths relative to `root`.
///
/// # Errors
/// A quotation that cannot be parsed or names a missing record, column or plot; a file that cannot
/// be read or written.
pub fn update(root: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut written = vec![];
    for file in stale_quotations(root)? {
        let path = root.join(&file.path);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make the folder `{}`", folder.display()))?;
        }
        std::fs::write(&path, &file.text)
            .with_context(|| format!("cannot write `{}`", path.display()))?;
        written.push(file.path);
    }
    Ok(written)
}

/// The files that [`update`] would change.
///
/// # Errors
/// As [`update`].
pub fn stale_quotations(root: &Path) -> anyhow::Result<Vec<Quotation>> {
    let mut files = vec![];
    for path in documents(&root.join("docs/src"))? {
        let text = read(&path)?;
        if text.contains(OPENING) {
            let from_root = path.strip_prefix(root).unwrap_or(&path).to_path_buf();
            files.extend(
                quotations_filled(root, &from_root, &text)
                    .with_context(|| format!("`{}`", from_root.display()))?,
            );
        }
    }
    files.retain(|f| std::fs::read_to_string(root.join(&f.path)).ok().as_deref() != Some(&f.text));
    Ok(files)
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read `{}`", path.display()))
}

/// All Markdown files of a folder and its subfolders, by name.
fn documents(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder)
        .with_context(|| format!("cannot read the folder `{}`", folder.display()))?;
    let mut found = vec![];
    for path in entries.flatten().map(|e| e.path()) {
        if path.is_dir() {
            found.extend(documents(&path)?);
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// The document with its quotations filled in, and its plots.
fn quotations_filled(root: &Path, path: &Path, text: &str) -> anyhow::Result<Vec<Quotation>> {
    let mut plots = vec![];
    let mut filled = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(OPENING) {
        let (before, marked) = rest.split_at(at);
        let (head, body) = marked
            .split_once("-->")
            .with_context(|| format!("`{}`: a comment without `-->`", first_line(marked)))?;
        let (_, after) = body
            .split_once(CLOSING)
            .with_context(|| format!("`{}`: `{CLOSING}` is missing", first_line(marked)))?;
        let (content, plot) = quotation(root, path, head[OPENING.len()..].trim())
            .with_context(|| format!("`{}`", first_line(marked)))?;
        plots.extend(plot);
        filled += &format!("{before}{head}-->\n{content}{CLOSING}");
        rest = after;
    }
    filled += rest;
    plots.push(Quotation { path: path.to_path_buf(), text: filled });
    Ok(plots)
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// The text for `ID: table ...` or `ID: plot ...`, and the file of the plot.
fn quotation(
    root: &Path,
    path: &Path,
    request: &str,
) -> anyhow::Result<(String, Option<Quotation>)> {
    let (id, what) =
        request.split_once(':').context("a quotation is `ID: table ...` or `ID: plot ...`")?;
    let (record, folder) = newest(root, id.trim())?;
    let levels = path.components().count().saturating_sub(1);
    let up = "../".repeat(levels);
    let folder = folder.strip_prefix(root).unwrap_or(&folder).display().to_string();
    let machine = &record.machine;
    let doubts = doubts_summary(&record);
    let source = format!(
        "*Measured on {}, {}, {} cores: [{id}]({up}{folder}/{id}.csv).{doubts}*\n",
        machine.day(),
        machine.cpu,
        machine.cores,
    );
    let what = what.trim();
    if let Some(request) = what.strip_prefix("table ") {
        return Ok((format!("\n{}\n{source}\n", table(&record, request)?), None));
    }
    if let Some(title) = what.strip_prefix("plot ") {
        let plot = plot_with_title(&record, title.trim())?;
        let name = format!("{id}-{}.svg", crate::machine::slug(title.trim()));
        let to_images = "../".repeat(levels.saturating_sub(2));
        let image = format!("\n![{}]({to_images}img/{name})\n\n{source}\n", plot.title);
        let file = Quotation { path: Path::new("docs/src/img").join(name), text: opaque(plot) };
        return Ok((image, Some(file)));
    }
    bail!("`{what}` is neither `table COLUMNS` nor `plot TITLE`")
}

/// The objections to a record, in one line.
fn doubts_summary(record: &Record) -> String {
    let machine = &record.machine;
    let mut why = vec![];
    if machine.commit.is_none() || machine.is_dirty() {
        why.push("no commit has the program that measured it".to_owned());
    }
    let busy = |load: &f64| *load > MOST_LOAD_PER_CORE * machine.cores as f64;
    why.extend(machine.load_1_min.filter(busy).map(|load| format!("the load was {load:.2}")));
    if !machine.optimised {
        why.push("it was a debug build".to_owned());
    }
    if why.is_empty() { String::new() } else { format!(" In doubt: {}.", why.join("; ")) }
}

/// The newest record with this id, by when it was measured: two machines may have a folder of one
/// day each, and their names say nothing of the order.
fn newest(root: &Path, id: &str) -> anyhow::Result<(Record, PathBuf)> {
    let runs = root.join("bench/runs");
    let entries = std::fs::read_dir(&runs)
        .with_context(|| format!("cannot read the folder `{}`", runs.display()))?;
    let folders = entries.flatten().map(|e| e.path());
    let records = folders.filter(|f| f.join(format!("{id}.json")).is_file()).map(|folder| {
        let record = Record::read(&folder.join(format!("{id}.json")))?;
        Ok((record, folder))
    });
    let records = records.collect::<anyhow::Result<Vec<_>>>()?;
    let newest = records
        .into_iter()
        .max_by(|(a, in_a), (b, in_b)| (&a.machine.date, in_a).cmp(&(&b.machine.date, in_b)));
    newest.with_context(|| {
        format!("`{}` has no record `{id}`: measure with --record", runs.display())
    })
}

fn plot_with_title<'r>(record: &'r Record, title: &str) -> anyhow::Result<&'r Plot> {
    record.plots.iter().find(|p| p.title.starts_with(title)).with_context(|| {
        let titles: Vec<&str> = record.plots.iter().map(|p| p.title.as_str()).collect();
        format!("`{}` has no plot `{title}`; it has: {}", record.id, titles.join("; "))
    })
}

/// The plot on a white background: as a separate file, it cannot adapt to the colours of the page.
fn opaque(plot: &Plot) -> String {
    let svg = plot.to_svg().replace("currentColor", "#222222");
    match svg.find('>') {
        Some(at) => {
            let (head, rest) = svg.split_at(at + 1);
            format!("{head}<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>{rest}\n")
        }
        None => svg,
    }
}

/// The rows of `COLUMN, COLUMN where COLUMN = VALUE and COLUMN = VALUE` as a Markdown table.
fn table(record: &Record, request: &str) -> anyhow::Result<String> {
    let (columns, conditions) = request.split_once(" where ").unwrap_or((request, ""));
    let known = |name: &str| {
        record.columns.iter().find(|c| c.name == name).with_context(|| {
            let names: Vec<&str> = record.columns.iter().map(|c| c.name.as_str()).collect();
            format!("`{}` has no column `{name}`; it has: {}", record.id, names.join(", "))
        })
    };
    let columns: Vec<&Column> =
        columns.split(',').map(|c| known(c.trim())).collect::<Result<_, _>>()?;
    let mut wanted = vec![];
    for condition in conditions.split(" and ").filter(|c| !c.trim().is_empty()) {
        let (name, value) = condition
            .split_once('=')
            .with_context(|| format!("`{}` is not `COLUMN = VALUE`", condition.trim()))?;
        wanted.push((known(name.trim())?.name.as_str(), value.trim()));
    }
    let rows: Vec<&Row> = record
        .rows
        .iter()
        .filter(|r| wanted.iter().all(|(name, values)| is_one_of(r, name, values)))
        .collect();
    ensure!(!rows.is_empty(), "`{}` has no row with {}", record.id, conditions.trim());

    let head = |c: &&Column| match c.unit.as_str() {
        "" => c.name.replace('_', " "),
        unit => format!("{} [{unit}]", c.name.replace('_', " ")),
    };
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut s = line(columns.iter().map(head).collect());
    s += &line(vec!["---".to_owned(); columns.len()]);
    for row in rows {
        s += &line(columns.iter().map(|c| cell(row, &c.name)).collect());
    }
    Ok(s)
}

/// Whether the cell equals one of `values`, which are separated by ` | `.
fn is_one_of(row: &Row, column: &str, values: &str) -> bool {
    let cell = cell(row, column);
    values.split(" | ").any(|v| v.trim() == cell)
}

fn cell(row: &Row, column: &str) -> String {
    match row.0.get(column) {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(Value::Number(n)) => n.as_f64().map_or_else(String::new, significant),
        Some(other) => other.to_string(),
    }
}

/// Three significant digits; whole numbers are unchanged.
fn significant(x: f64) -> String {
    if x == x.trunc() && x.abs() < 1e9 {
        return format!("{x:.0}");
    }
    if !(1e-3..1e6).contains(&x.abs()) {
        return format!("{x:.1e}");
    }
    let before_the_point = x.abs().log10().floor() as i32 + 1;
    format!("{x:.*}", usize::try_from(3 - before_the_point).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::plot::{Axis, Series};

    /// A repository with one document and two records of one experiment.
    fn repository(document: &str) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (day, time) in [("2026-01-01-a", 1.0), ("2026-01-02-b", 0.123_456)] {
            let mut r = Record::new("speed", "How fast", 4, true, Machine::describe());
            r.column("mesh", "", "which");
            r.column("time", "ms", "median");
            r.rows.push(Row::new().with("mesh", "small").with("time", time));
            r.rows.push(Row::new().with("mesh", "large").with("time", 1e-7));
            let mut plot =
                Plot::lines("time of frames", Axis::linear("n", ""), Axis::linear("t", "ms"));
            plot.series.push(Series::new("ours", vec![(1.0, time)]));
            r.plots.push(plot);
            r.write(&root.path().join("bench/runs").join(day)).unwrap();
        }
        std::fs::create_dir_all(root.path().join("docs/src/bench")).unwrap();
        std::fs::write(root.path().join("docs/src/bench/page.md"), document).unwrap();
        root
    }

    #[test]
    fn a_document_gets_the_rows_of_the_newest_record_and_is_then_up_to_date() {
        let root = repository(
            "a\n<!-- record speed: table mesh, time where mesh = small -->\nold\n<!-- end record \
             -->\nb\n",
        );
        assert_eq!(update(root.path()).unwrap(), [Path::new("docs/src/bench/page.md")]);
        let text = std::fs::read_to_string(root.path().join("docs/src/bench/page.md")).unwrap();
        assert!(
            text.contains("| mesh | time [ms] |\n| --- | --- |\n| small | 0.123 |\n\n*Measured"),
            "{text}"
        );
        assert!(text.contains("(../../../bench/runs/2026-01-02-b/speed.csv)"), "{text}");
        assert!(
            !text.contains("old") && text.starts_with("a\n") && text.ends_with("-->\nb\n"),
            "{text}"
        );
        assert_eq!(stale_quotations(root.path()).unwrap(), []);
    }

    #[test]
    fn of_two_machines_on_one_day_the_later_record_is_quoted() {
        let root = repository(
            "<!-- record speed: table mesh, time where mesh = small -->\n<!-- end record -->\n",
        );
        let earlier = root.path().join("bench/runs/2026-01-02-b");
        let later = root.path().join("bench/runs/2026-01-02-a");
        let mut record = Record::read(&earlier.join("speed.json")).unwrap();
        record.machine.date = format!("{}+", record.machine.date);
        record.write(&later).unwrap();
        update(root.path()).unwrap();
        let text = std::fs::read_to_string(root.path().join("docs/src/bench/page.md")).unwrap();
        assert!(text.contains("(../../../bench/runs/2026-01-02-a/speed.csv)"), "{text}");
    }

    #[test]
    fn a_condition_takes_either_of_two_values_and_no_others() {
        let root = repository(
            "<!-- record speed: table mesh, time where mesh = small | huge -->\n<!-- end record \
             -->\n",
        );
        update(root.path()).unwrap();
        let text = std::fs::read_to_string(root.path().join("docs/src/bench/page.md")).unwrap();
        assert!(text.contains("| small |") && !text.contains("| large |"), "{text}");
    }

    #[test]
    fn what_speaks_against_a_record_stands_below_its_quotation() {
        let mut record = Record::new("speed", "How fast", 4, true, Machine::describe());
        (record.machine.commit, record.machine.dirty) = (Some("97db1462332d".into()), Some(false));
        (record.machine.cores, record.machine.optimised) = (2, true);
        record.machine.load_1_min = Some(1.5);
        assert_eq!(doubts_summary(&record), "");
        record.machine.load_1_min = Some(3.31);
        assert_eq!(doubts_summary(&record), " In doubt: the load was 3.31.");
        record.machine.dirty = Some(true);
        record.machine.optimised = false;
        let all = doubts_summary(&record);
        assert!(
            all.contains("no commit") && all.contains("3.31") && all.contains("debug"),
            "{all}"
        );
    }

    #[test]
    fn a_number_that_differs_from_the_record_is_found() {
        let root = repository("<!-- record speed: table mesh, time -->\n<!-- end record -->\n");
        update(root.path()).unwrap();
        let path = root.path().join("docs/src/bench/page.md");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("0.123", "0.124")).unwrap();
        assert_eq!(stale_quotations(root.path()).unwrap().len(), 1);
    }

    #[test]
    fn a_plot_becomes_a_file_on_white_that_the_document_shows() {
        let root = repository("<!-- record speed: plot time of -->\n<!-- end record -->\n");
        assert_eq!(update(root.path()).unwrap().len(), 2);
        let text = std::fs::read_to_string(root.path().join("docs/src/bench/page.md")).unwrap();
        assert!(text.contains("![time of frames](../img/speed-time-of.svg)"), "{text}");
        let svg =
            std::fs::read_to_string(root.path().join("docs/src/img/speed-time-of.svg")).unwrap();
        assert!(svg.contains("#ffffff") && !svg.contains("currentColor"), "{svg}");
    }

    #[test]
    fn what_is_not_there_is_named_with_what_is() {
        for (request, named) in [
            ("speed: table tyme", "mesh, time"),
            ("speed: plot frames", "time of frames"),
            ("sped: table time", "no record `sped`"),
            ("speed: table time where mesh = huge", "no row with mesh = huge"),
            ("speed: chart", "neither `table COLUMNS` nor `plot TITLE`"),
        ] {
            let root = repository(&format!("<!-- record {request} -->\n<!-- end record -->\n"));
            let error = format!("{:#}", update(root.path()).unwrap_err());
            assert!(error.contains(named) && error.contains("page.md"), "{error}");
        }
        let root = repository("<!-- record speed: table time -->\n");
        assert!(format!("{:#}", update(root.path()).unwrap_err()).contains("end record"));
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases =
            [(0.0, "0"), (17.0, "17"), (123.456, "123"), (1.2345, "1.23"), (0.01234, "0.0123")];
        for (x, text) in
            cases.into_iter().chain([(2.5e-7, "2.5e-7"), (1234.5, "1234"), (-0.5, "-0.500")])
        {
            assert_eq!(significant(x), text);
        }
    }

    #[test]
    fn documents_quote_their_records() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let paths: Vec<PathBuf> =
            stale_quotations(root).unwrap().into_iter().map(|f| f.path).collect();
        assert!(
            paths.is_empty(),
            "{paths:?} differ from their records: `cargo xtask book` writes them anew"
        );
    }
}
