//! Parts of a measurement that are kept while it runs, so that hours are not lost with a run that
//! ends early: by Ctrl-C, or by the kernel for want of memory. `bench run --resume` takes them.

use crate::machine::Machine;
use crate::memory::PeakMemory;
use crate::record::{Record, Row};
use crate::runner::Ratio;
use anyhow::Context as _;
use datasets::cli::UsageError;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Version of the file's form; others are refused.
const FORM: &str = "bench-checkpoint/1";

/// The parts of one experiment that are measured, in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// [`FORM`]. Not `schema`: the file is not a record.
    form: String,
    id: String,
    quick: bool,
    thesis: bool,
    /// The machine when the first part was begun.
    machine: Machine,
    parts: Vec<Part>,
    #[serde(skip)]
    path: PathBuf,
}

/// What one part added to the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Part {
    name: String,
    secs: f64,
    peak_memory: PeakMemory,
    rows: Vec<Row>,
    ratios: Vec<Ratio>,
    notes: Vec<String>,
    missing: Vec<String>,
}

/// How much a record has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    rows: usize,
    ratios: usize,
    notes: usize,
    missing: usize,
    others: usize,
}

impl Extent {
    pub(crate) fn of(record: &Record) -> Extent {
        Extent {
            rows: record.rows.len(),
            ratios: record.ratios.len(),
            notes: record.notes.len(),
            missing: record.missing.len(),
            others: record.plots.len() + record.images.len() + record.attachments.len(),
        }
    }
}

impl Checkpoint {
    /// A checkpoint without parts, for a run of this form on this machine. Its file is written with
    /// the first part, over that of an earlier run.
    pub fn new(dir: &Path, id: &str, quick: bool, thesis: bool, machine: Machine) -> Checkpoint {
        Checkpoint {
            form: FORM.into(),
            id: id.into(),
            quick,
            thesis,
            machine,
            parts: vec![],
            path: dir.join(format!("{id}.checkpoint.json")),
        }
    }

    /// The checkpoint with the parts that an earlier run left in the folder, if there are any.
    ///
    /// # Errors
    /// When its file cannot be read, or was left by another form of the experiment, by other code,
    /// or on another machine: the rows would not belong together.
    pub fn with_earlier_parts(mut self) -> anyhow::Result<Checkpoint> {
        let text = match std::fs::read_to_string(&self.path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(self),
            Err(e) => return Err(e).with_context(|| self.path.display().to_string()),
        };
        let refused = |why: String| {
            let file = self.path.display();
            UsageError(format!("{file}: {why}; omit --resume to measure everything"))
        };
        let earlier: Checkpoint = serde_json::from_str(&text)
            .map_err(|e| refused(format!("not a checkpoint of form {FORM} ({e})")))?;
        if let Some((what, then, now)) = earlier.difference(&self) {
            return Err(
                refused(format!("left by a run with {what} {then}, and now it is {now}")).into()
            );
        }
        self.parts = earlier.parts;
        self.machine = earlier.machine;
        Ok(self)
    }

    /// The first thing in which two runs differ that must not, with its two values.
    fn difference(&self, other: &Checkpoint) -> Option<(&'static str, String, String)> {
        let traits = |c: &Checkpoint| {
            let m = &c.machine;
            let form = match (c.quick, c.thesis) {
                (true, _) => "--quick",
                (_, true) => "--thesis",
                _ => "the full size",
            };
            let memory = format!("{:.0} GiB of memory", m.memory_gib);
            let commit = m.commit.clone().unwrap_or_else(|| "unknown".into());
            let tree = if m.dirty == Some(true) { "with changes" } else { "as committed" };
            [
                ("the form", c.form.clone()),
                ("the experiment", c.id.clone()),
                ("the size", form.into()),
                ("the processor", format!("{}, {}", m.cpu, m.simd)),
                ("the machine", format!("{} cores, {memory}", m.cores)),
                ("the commit", commit),
                ("the tree", tree.into()),
                ("the build", (if m.optimised { "release" } else { "debug" }).into()),
            ]
        };
        let both = traits(self).into_iter().zip(traits(other));
        both.into_iter().find(|(a, b)| a.1 != b.1).map(|(a, b)| (a.0, a.1, b.1))
    }

    /// The names of the parts that it has.
    pub fn names(&self) -> Vec<&str> {
        self.parts.iter().map(|part| part.name.as_str()).collect()
    }

    /// Adds the part of that name to the record. Whether there is one.
    pub(crate) fn restore(&self, name: &str, record: &mut Record) -> bool {
        let Some(part) = self.parts.iter().find(|part| part.name == name) else { return false };
        record.rows.extend(part.rows.iter().cloned());
        record.ratios.extend(part.ratios.iter().cloned());
        record.notes.extend(part.notes.iter().cloned());
        record.missing.extend(part.missing.iter().cloned());
        true
    }

    /// Keeps what the record has beyond `before` as the part of that name, in the file too.
    ///
    /// # Errors
    /// When the file cannot be written, or when the part added a plot, an image or an attachment,
    /// which a checkpoint does not keep.
    pub(crate) fn keep(
        &mut self,
        name: &str,
        record: &Record,
        before: Extent,
        secs: f64,
        peak_memory: PeakMemory,
    ) -> anyhow::Result<()> {
        let now = Extent::of(record);
        anyhow::ensure!(
            now.others == before.others,
            "part `{name}` of `{}` adds a plot, an image or a file, which no checkpoint keeps",
            self.id
        );
        self.parts.push(Part {
            name: name.into(),
            secs,
            peak_memory,
            rows: record.rows[before.rows..].to_vec(),
            ratios: record.ratios[before.ratios..].to_vec(),
            notes: record.notes[before.notes..].to_vec(),
            missing: record.missing[before.missing..].to_vec(),
        });
        self.write().with_context(|| format!("cannot keep part `{name}` of `{}`", self.id))
    }

    /// Writes the file beside its place and moves it there: a program that is killed meanwhile
    /// leaves the last one whole.
    fn write(&self) -> anyhow::Result<()> {
        let dir = self.path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        let unfinished = self.path.with_extension("json.unfinished");
        let json = serde_json::to_string_pretty(self)?;
        std::fs::write(&unfinished, json).with_context(|| unfinished.display().to_string())?;
        std::fs::rename(&unfinished, &self.path).with_context(|| self.path.display().to_string())
    }

    /// What the earlier run took for its parts, in seconds, and the most memory that it held.
    pub(crate) fn cost(&self) -> (f64, Option<PeakMemory>) {
        let secs = self.parts.iter().map(|part| part.secs).sum();
        (secs, self.parts.iter().map(|part| part.peak_memory).reduce(PeakMemory::max))
    }

    /// A note for the record: which parts an earlier run measured. `None` when it has none.
    pub(crate) fn note(&self) -> Option<String> {
        (!self.parts.is_empty()).then(|| {
            format!(
                "Continued (--resume): a run that began on {} and ended early measured {}.",
                self.machine.date,
                self.names().join(", ")
            )
        })
    }

    /// Removes the file: the experiment is complete.
    pub fn remove(&self) {
        // It may never have been written; and one that stays is overwritten by the next run.
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn empty(dir: &Path) -> Checkpoint {
        Checkpoint::new(dir, "fig4.7", false, true, Machine::describe())
    }

    fn record() -> Record {
        Record::new("fig4.7", "Builds", 4, false, Machine::describe())
    }

    const MEMORY: PeakMemory = PeakMemory { allocated_mb: 1.0, resident_mb: Some(2.0) };

    fn kept(dir: &Path) -> Record {
        let (mut checkpoint, mut record) = (empty(dir), record());
        record.notes.push("what every run says".into());
        for (i, name) in ["1 million", "2 million"].into_iter().enumerate() {
            let before = Extent::of(&record);
            record.rows.push(Row::new().with("triangles", i + 1).with("time", f64::NAN));
            record.missing.push(format!("a renderer at {name}"));
            checkpoint.keep(name, &record, before, 2.0, MEMORY).unwrap();
        }
        record
    }

    #[test]
    fn parts_come_back_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let measured = kept(dir.path());
        let checkpoint = empty(dir.path()).with_earlier_parts().unwrap();
        assert_eq!(checkpoint.names(), ["1 million", "2 million"]);
        assert_eq!(checkpoint.cost(), (4.0, Some(MEMORY)));
        let mut record = record();
        assert!(checkpoint.restore("1 million", &mut record));
        assert!(checkpoint.restore("2 million", &mut record));
        assert!(!checkpoint.restore("4 million", &mut record));
        assert_eq!((&record.rows, &record.missing), (&measured.rows, &measured.missing));
        assert_eq!(record.notes, [] as [&str; 0], "what the run says itself is not kept twice");
        assert!(checkpoint.note().unwrap().ends_with("measured 1 million, 2 million."));
        checkpoint.remove();
        let none = empty(dir.path()).with_earlier_parts().unwrap();
        assert_eq!((none.names().len(), none.note()), (0, None));
    }

    #[test]
    fn parts_of_other_code_sizes_or_machines_are_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        kept(dir.path());
        type Change = fn(&mut Checkpoint);
        let cases: [(Change, &str); 4] = [
            (|c| c.machine.commit = Some("0123abc".into()), "the commit"),
            (|c| c.thesis = false, "the size"),
            (|c| c.machine.cores += 1, "the machine"),
            (|c| c.machine.optimised ^= true, "the build"),
        ];
        for (change, named) in cases {
            let mut now = empty(dir.path());
            change(&mut now);
            let why = now.with_earlier_parts().unwrap_err();
            assert!(why.is::<UsageError>());
            let why = why.to_string();
            assert!(why.contains(named) && why.contains("omit --resume"), "{why}");
        }
    }

    #[test]
    fn a_file_of_something_else_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        for text in ["", "{}", "{\"form\": 3", "[1, 2]"] {
            std::fs::write(dir.path().join("fig4.7.checkpoint.json"), text).unwrap();
            let why = empty(dir.path()).with_earlier_parts().unwrap_err().to_string();
            assert!(why.contains("fig4.7.checkpoint.json: not a checkpoint"), "{why}");
        }
    }

    #[test]
    fn images_are_not_lost_in_silence() {
        let dir = tempfile::tempdir().unwrap();
        let (mut checkpoint, mut record) = (empty(dir.path()), record());
        let before = Extent::of(&record);
        let image =
            crate::record::RecordImage { name: "view".into(), caption: "c".into(), png: vec![1] };
        record.images.push(image);
        let why = checkpoint.keep("view", &record, before, 0.0, MEMORY).unwrap_err();
        assert!(why.to_string().contains("adds a plot, an image or a file"));
    }
}
