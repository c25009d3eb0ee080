//! The result of a measurement: one JSON object and one CSV table.
//!
//! A record is self-contained. Every column has a unit and a meaning, the machine and the program's
//! version are included, and `missing` names what could not be measured, with the cure. Reports are
//! made from records alone, so old records can be shown again.

use crate::machine::Machine;
use crate::memory::PeakMemory;
use crate::plot::Plot;
use crate::runner::Ratio;
use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// Version of the record's schema; readers reject other versions.
pub const SCHEMA: &str = "bench-record/1";

/// A column of [`Record::rows`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Key in the rows and header of the CSV column.
    pub name: String,
    /// Unit; empty for names and counts.
    pub unit: String,
    /// Its meaning.
    pub meaning: String,
}

/// One row: a value for some or all of the columns.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Row(pub Map<String, Value>);

impl Row {
    /// An empty row.
    pub fn new() -> Row {
        Row::default()
    }
    /// Returns the row with one more value. Non-finite numbers become null, because JSON cannot
    /// represent them.
    pub fn with(mut self, column: &str, value: impl Into<Value>) -> Row {
        self.0.insert(column.to_string(), value.into());
        self
    }
    /// The value as a number, if it is one.
    pub fn number(&self, column: &str) -> Option<f64> {
        self.0.get(column)?.as_f64()
    }
    /// The value as text, if it is text.
    pub fn text(&self, column: &str) -> Option<&str> {
        self.0.get(column)?.as_str()
    }
}

/// A PNG image next to the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordImage {
    /// Short name; part of the file name.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The file's bytes; stored next to the record, not inside the JSON.
    #[serde(skip)]
    pub png: Vec<u8>,
}

/// A file next to the record that other programs read, or that shows more than a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Attachment {
    /// File name after the experiment's name, with its extension; an SVG is shown in reports.
    pub name: String,
    /// What it contains.
    pub caption: String,
    /// The file's bytes; stored next to the record, not inside the JSON.
    #[serde(skip)]
    pub bytes: Vec<u8>,
}

/// The outcome of one experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`SCHEMA`].
    pub schema: String,
    /// The experiment, as on the command line.
    pub id: String,
    /// What it shows.
    pub title: String,
    /// Chapter of the dissertation.
    pub chapter: u8,
    /// Whether this is the short form, with smaller data and fewer rounds.
    pub quick: bool,
    /// The machine and the time.
    pub machine: Machine,
    /// Objections to the measurement that the command line overrode (`--record-despite-doubts`).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recorded_despite: Vec<String>,
    /// Wall time of the whole experiment, data and builds included.
    pub elapsed_secs: f64,
    /// The most memory that it took; `null` in older records, and where nothing ran.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_memory: Option<PeakMemory>,
    /// Descriptions of the columns.
    pub columns: Vec<Column>,
    /// The measurements.
    pub rows: Vec<Row>,
    /// Comparisons, above 1 where we are faster.
    pub ratios: Vec<Ratio>,
    /// Notes on the measurement, in sentences.
    pub notes: Vec<String>,
    /// What could not be measured, and the cure.
    pub missing: Vec<String>,
    /// Plots of the rows.
    pub plots: Vec<Plot>,
    /// Images.
    // The key in the files of records.
    #[serde(rename = "pictures")]
    pub images: Vec<RecordImage>,
    /// Other files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attachments: Vec<Attachment>,
}

impl Record {
    /// An empty record of an experiment on this machine.
    pub fn new(id: &str, title: &str, chapter: u8, quick: bool, machine: Machine) -> Record {
        Record {
            schema: SCHEMA.into(),
            id: id.into(),
            title: title.into(),
            chapter,
            quick,
            machine,
            recorded_despite: vec![],
            elapsed_secs: 0.0,
            peak_memory: None,
            columns: vec![],
            rows: vec![],
            ratios: vec![],
            notes: vec![],
            missing: vec![],
            plots: vec![],
            images: vec![],
            attachments: vec![],
        }
    }

    /// Describes a column. The order of the calls is the order in the table.
    pub fn column(&mut self, name: &str, unit: &str, meaning: &str) {
        self.columns.push(Column { name: name.into(), unit: unit.into(), meaning: meaning.into() });
    }

    /// Columns that rows use but that are not described, once each; any is a mistake of the
    /// experiment.
    pub fn unexplained_columns(&self) -> Vec<&str> {
        let known = |k: &str| self.columns.iter().any(|c| c.name == k);
        let mut unknown: Vec<&str> = self
            .rows
            .iter()
            .flat_map(|r| r.0.keys())
            .map(String::as_str)
            .filter(|k| !known(k))
            .collect();
        unknown.sort_unstable();
        unknown.dedup();
        unknown
    }

    /// The table as CSV (RFC 4180): comment lines with the machine, a header, one line per row.
    pub fn to_csv(&self) -> String {
        let m = &self.machine;
        let mut s = format!("# {} {}: {}\n", self.schema, self.id, one_line(&self.title));
        let form = if self.quick { "quick" } else { "full" };
        s += &format!(
            "# {form}, {}, {}, {} cores, {}, version {}",
            m.date, m.cpu, m.cores, m.simd, m.version
        );
        s += &m.commit.as_ref().map_or("\n".into(), |c| format!(", commit {c}\n"));
        s += &m.load_1_min.map_or(String::new(), |l| format!("# load {l:.2} when it began\n"));
        if let Some(PeakMemory { allocated_mb, resident_mb }) = self.peak_memory {
            let resident = resident_mb.map_or("not known".into(), |mb| format!("{mb} MB"));
            s += &format!("# peak memory {allocated_mb} MB allocated, {resident} resident\n");
        }
        for doubt in self.doubts() {
            s += &format!("# in doubt: {}\n", one_line(&doubt));
        }
        let head = |c: &Column| {
            if c.unit.is_empty() { c.name.clone() } else { format!("{} [{}]", c.name, c.unit) }
        };
        s += &self.columns.iter().map(|c| csv_field(&head(c))).collect::<Vec<_>>().join(",");
        s += "\n";
        for row in &self.rows {
            let cell = |c: &Column| match row.0.get(&c.name) {
                None | Some(Value::Null) => String::new(),
                Some(Value::String(t)) => csv_field(t),
                Some(v) => csv_field(&v.to_string()),
            };
            s += &self.columns.iter().map(cell).collect::<Vec<_>>().join(",");
            s += "\n";
        }
        s
    }

    /// Writes `ID.json`, `ID.csv`, `ID.IMAGE.png` and the attachments into a directory, which is
    /// created if necessary.
    pub fn write(&self, dir: &Path) -> anyhow::Result<PathBuf> {
        let path = self.write_measurements(dir)?;
        for p in &self.images {
            write_file(dir, &self.image_file(p), &p.png)?;
        }
        Ok(path)
    }

    /// As [`Record::write`], without the images: they are megabytes, and the experiment makes them
    /// again.
    pub fn write_measurements(&self, dir: &Path) -> anyhow::Result<PathBuf> {
        std::fs::create_dir_all(dir).with_context(|| {
            format!(
                "cannot make the directory `{}` for records; name another with --out",
                dir.display()
            )
        })?;
        for a in &self.attachments {
            write_file(dir, &format!("{}.{}", self.id, a.name), &a.bytes)?;
        }
        write_file(dir, &format!("{}.csv", self.id), self.to_csv().as_bytes())?;
        let json = serde_json::to_string_pretty(self).context("cannot write the record as JSON")?;
        write_file(dir, &format!("{}.json", self.id), json.as_bytes())?;
        Ok(dir.join(format!("{}.json", self.id)))
    }

    /// Reads a record back, with its images. A missing image file leaves an empty one.
    pub fn read(path: &Path) -> anyhow::Result<Record> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the record `{}`", path.display()))?;
        let mut r: Record = serde_json::from_str(&text)
            .with_context(|| format!("`{}` is not a record of form {SCHEMA}", path.display()))?;
        anyhow::ensure!(
            r.schema == SCHEMA,
            "`{}` has form `{}`, this program reads `{SCHEMA}`: measure again, or use the version \
             that wrote it ({})",
            path.display(),
            r.schema,
            r.machine.version
        );
        let dir = path.parent().unwrap_or(Path::new("."));
        for i in 0..r.images.len() {
            r.images[i].png =
                std::fs::read(dir.join(r.image_file(&r.images[i]))).unwrap_or_default();
        }
        for a in &mut r.attachments {
            a.bytes = std::fs::read(dir.join(format!("{}.{}", r.id, a.name))).unwrap_or_default();
        }
        Ok(r)
    }

    fn image_file(&self, p: &RecordImage) -> String {
        format!("{}.{}.png", self.id, crate::machine::slug(&p.name))
    }
}

fn write_file(dir: &Path, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
    let path = dir.join(name);
    std::fs::write(&path, bytes).with_context(|| format!("cannot write `{}`", path.display()))
}

/// All records of a directory, by name. JSON of other kinds (a Chrome trace, a program's output) is
/// ignored; a broken record, or a file that is not JSON, is an error.
pub fn read_dir(dir: &Path) -> anyhow::Result<Vec<Record>> {
    let entries = std::fs::read_dir(dir)
        .with_context(|| format!("cannot read the directory `{}`", dir.display()))?;
    let mut paths: Vec<PathBuf> = entries
        .flatten()
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "json"))
        .collect();
    paths.retain(|p| !is_of_another_kind(p));
    paths.sort();
    paths.iter().map(|p| Record::read(p)).collect()
}

/// Whether the file is JSON that does not declare itself a record.
fn is_of_another_kind(path: &Path) -> bool {
    let text = std::fs::read(path).unwrap_or_default();
    serde_json::from_slice::<serde_json::Value>(&text)
        .is_ok_and(|json| json.get("schema").is_none())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Axis, Kind, Scale, Series};

    pub(crate) fn sample() -> Record {
        let mut r = Record::new("fig0.0", "A title, with \"quotes\"", 4, true, Machine::describe());
        r.column("mesh", "", "name of the mesh");
        r.column("time", "ms", "median");
        r.rows.push(Row::new().with("mesh", "wave, 1 \"M\"").with("time", 1.5));
        r.rows.push(Row::new().with("mesh", "wave").with("time", f64::NAN));
        r.ratios.push(Ratio {
            name: "ours".into(),
            baseline: "theirs".into(),
            value: 2.0,
            spread: 0.1,
            low: 1.9,
            high: 2.2,
            rounds: 5,
            in_turns: true,
        });
        r.missing.push("Embree 4 is not installed".into());
        r.plots.push(Plot {
            title: "t".into(),
            kind: Kind::Lines,
            x: Axis { label: "triangles".into(), unit: "".into(), scale: Scale::Log },
            y: Axis { label: "time".into(), unit: "s".into(), scale: Scale::Linear },
            categories: vec![],
            series: vec![Series::new("a", vec![(1.0, 2.0), (10.0, 4.0)])],
            mark: Some(1.0),
        });
        r.images.push(RecordImage {
            name: "The view".into(),
            caption: "c".into(),
            png: vec![1, 2, 3],
        });
        let bytes = b"<svg/>".to_vec();
        r.attachments.push(Attachment { name: "chart.svg".into(), caption: "c".into(), bytes });
        r
    }

    #[test]
    fn a_record_read_back_is_the_same() {
        let dir = tempfile::tempdir().unwrap();
        let r = sample();
        let path = r.write(dir.path()).unwrap();
        assert_eq!(Record::read(&path).unwrap(), r);
        assert_eq!(read_dir(dir.path()).unwrap(), vec![r]);
        assert!(dir.path().join("fig0.0.the-view.png").exists());
    }

    #[test]
    fn records_to_keep_are_whole_but_for_their_images() {
        let dir = tempfile::tempdir().unwrap();
        let mut r = sample();
        let path = r.write_measurements(dir.path()).unwrap();
        assert!(!dir.path().join("fig0.0.the-view.png").exists());
        r.images[0].png.clear();
        assert_eq!(Record::read(&path).unwrap(), r);
    }

    #[test]
    fn csv_quotes_commas_and_leaves_missing_numbers_empty() {
        let csv = sample().to_csv();
        let lines: Vec<&str> = csv.lines().filter(|l| !l.starts_with('#')).collect();
        assert_eq!(lines, ["mesh,time [ms]", "\"wave, 1 \"\"M\"\"\",1.5", "wave,"]);
    }

    #[test]
    fn a_column_nobody_explained_is_found() {
        let mut r = sample();
        assert!(r.unexplained_columns().is_empty());
        r.rows.push(Row::new().with("leaks", 3));
        assert_eq!(r.unexplained_columns(), ["leaks"]);
    }

    #[test]
    fn a_record_of_another_form_is_refused_with_the_file_and_the_form() {
        let dir = tempfile::tempdir().unwrap();
        let mut r = sample();
        r.schema = "bench-record/99".into();
        let e = Record::read(&r.write(dir.path()).unwrap()).unwrap_err().to_string();
        assert!(e.contains("fig0.0.json") && e.contains("bench-record/99"), "{e}");
    }

    #[test]
    fn json_of_other_kinds_beside_records_is_left_alone_and_a_broken_record_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let r = sample();
        let path = r.write(dir.path()).unwrap();
        std::fs::write(dir.path().join("trace.json"), r#"{"traceEvents": []}"#).unwrap();
        assert_eq!(read_dir(dir.path()).unwrap(), vec![r]);
        let text = std::fs::read(&path).unwrap();
        std::fs::write(&path, &text[..text.len() / 2]).unwrap();
        assert!(read_dir(dir.path()).unwrap_err().to_string().contains("fig0.0.json"));
    }

    #[test]
    fn a_directory_that_is_not_there_is_named() {
        let e = read_dir(Path::new("no/such/dir")).unwrap_err().to_string();
        assert!(e.contains("no/such/dir"), "{e}");
    }
}
