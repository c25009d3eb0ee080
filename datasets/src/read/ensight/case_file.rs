//! The case file: names of the other files, and times.

use crate::read::error::{At, Fault};

/// A file name with the time set that it changes with.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Timed {
    pub(super) set: Option<i64>,
    /// The file has all steps of the set, one after the other.
    pub(super) has_all_steps: bool,
    pub(super) name: String,
}

/// An array and its file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) of_elements: bool,
    pub(super) file: Timed,
}

/// Times with the numbers of their files.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct TimeSet {
    pub(super) id: i64,
    steps: usize,
    start: i64,
    increment: i64,
    numbers: Vec<i64>,
    pub(super) times: Vec<f64>,
}

impl TimeSet {
    /// The number in the names of the files of step `i`.
    fn number(&self, i: usize) -> i64 {
        let computed = || self.start.saturating_add(self.increment.saturating_mul(i as i64));
        self.numbers.get(i).copied().unwrap_or_else(computed)
    }

    /// The step that holds at this time: the last that is not later.
    fn step(&self, time: Option<f64>) -> usize {
        let until = |t: f64| self.times.iter().rposition(|x| *x <= t + 1e-6 * t.abs());
        time.and_then(until).unwrap_or(0)
    }
}

/// What a case file says.
#[derive(Debug, Default)]
pub(super) struct CaseFile {
    pub(super) model: Option<Timed>,
    pub(super) variables: Vec<Variable>,
    pub(super) constants: Vec<(String, Vec<f64>)>,
    pub(super) sets: Vec<TimeSet>,
    pub(super) warnings: Vec<String>,
}

const SECTIONS: [&str; 8] =
    ["FORMAT", "GEOMETRY", "VARIABLE", "TIME", "FILE", "MATERIAL", "BLOCK_CONTINUATION", "SCRIPTS"];

impl CaseFile {
    fn set_of(&self, timed: &Timed) -> Option<&TimeSet> {
        match timed.set {
            Some(id) => self.sets.iter().find(|s| s.id == id),
            None => self.sets.first(),
        }
    }

    /// The step of a file at a time, if it has all of them.
    pub(super) fn step_in_file(&self, timed: &Timed, time: Option<f64>) -> Option<usize> {
        timed.has_all_steps.then(|| self.set_of(timed).map_or(0, |set| set.step(time)))
    }

    /// The file of a name at a time.
    pub(super) fn file_at(&self, timed: &Timed, time: Option<f64>) -> Result<String, Fault> {
        let stars = timed.name.bytes().filter(|b| *b == b'*').count();
        if stars == 0 {
            return Ok(timed.name.clone());
        }
        let Some(set) = self.set_of(timed) else {
            let what = format!("`{}` changes with time, but has no time set", timed.name);
            return Err(Fault::new(At::Field("TIME".into()), what, "add its time set"));
        };
        let number = format!("{:0stars$}", set.number(set.step(time)));
        let first = timed.name.find('*').unwrap_or(0);
        let tail = timed.name[first..].trim_start_matches('*');
        Ok(format!("{}{number}{}", &timed.name[..first], tail.replace('*', "")))
    }

    /// All times, in order.
    pub(super) fn times(&self) -> Vec<f64> {
        let mut times: Vec<f64> = self.sets.iter().flat_map(|s| s.times.clone()).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }
}

/// Reads the text of a case file.
pub(super) fn parse(text: &str) -> Result<CaseFile, Fault> {
    let mut case = CaseFile::default();
    let mut section = "";
    let mut gold = false;
    // A list of numbers may go on on lines without a key.
    let mut list = String::new();
    for (i, line) in text.lines().enumerate() {
        let at = At::Line(i as u64 + 1);
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        if let Some(name) = SECTIONS.iter().find(|s| **s == line) {
            (section, list) = (name, String::new());
            continue;
        }
        let Some((key, value)) = line.split_once(':') else {
            match section {
                "TIME" if !list.is_empty() => time_key(&mut case, &list, line, &at)?,
                "FORMAT" | "GEOMETRY" | "VARIABLE" | "TIME" => {
                    let what = format!("`{}` has no key", short(line));
                    return Err(Fault::new(at, what, "write it as `key: value`"));
                }
                _ => {}
            }
            continue;
        };
        let (key, value) = (key.trim().to_ascii_lowercase(), value.trim());
        list.clone_from(&key);
        match section {
            "FORMAT" => {
                let words: Vec<&str> = value.split_whitespace().collect();
                gold |= words.iter().any(|w| w.eq_ignore_ascii_case("gold"));
                if !gold {
                    let cure = "save it as EnSight Gold";
                    return Err(Fault::unsupported(at, format!("type: {}", short(value)), cure));
                }
            }
            "GEOMETRY" if key == "model" => case.model = Some(timed(value, 0, &at)?.1),
            "GEOMETRY" => case.warnings.push(format!("{key} ({}) left out", short(value))),
            "VARIABLE" => variable(&mut case, &key, value, &at)?,
            "TIME" => time_key(&mut case, &key, value, &at)?,
            // Names say which files have all steps; the file says where each begins.
            "FILE" if matches!(&*key, "file set" | "number of steps") => {}
            "FILE" => {
                let what =
                    format!("{key}: {}: steps in several files with some each", short(value));
                let cure = "write all steps to one file, or a file for each (a name with ***)";
                return Err(Fault::unsupported(at, what, cure));
            }
            _ => {
                let warning = format!("section {section} left out");
                if !case.warnings.contains(&warning) {
                    case.warnings.push(warning);
                }
            }
        }
    }
    if !gold {
        let cure = "the section FORMAT must say `type: ensight gold`";
        return Err(Fault::new(At::Field("FORMAT".into()), "there is no type", cure));
    }
    if let Some(set) = case.sets.iter().find(|s| s.times.len() != s.steps) {
        let what =
            format!("time set {}: {} times for {} steps", set.id, set.times.len(), set.steps);
        return Err(Fault::new(At::Field("TIME".into()), what, "list a time for each step"));
    }
    Ok(case)
}

pub(super) fn short(text: &str) -> String {
    text.chars().take(40).collect()
}

/// `[ts] [fs] WORDS... NAME`, with `words` of them before the name.
fn timed(value: &str, words: usize, at: &At) -> Result<(Vec<String>, Timed), Fault> {
    let mut parts: Vec<String> = Vec::new();
    let mut rest = value;
    while !rest.is_empty() {
        let (part, after) = match rest.strip_prefix('"') {
            Some(inside) => inside.split_once('"').unwrap_or((inside, "")),
            None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        parts.push(part.to_string());
        rest = after.trim_start();
    }
    parts.retain(|p| p != "change_coords_only");
    let number = |p: Option<&String>| p.and_then(|p| p.parse::<i64>().ok());
    let (mut set, mut has_all_steps) = (None, false);
    if parts.len() > words + 1 && number(parts.first()).is_some() {
        set = number(parts.first());
        parts.remove(0);
        if parts.len() > words + 1 && number(parts.first()).is_some() {
            has_all_steps = true;
            parts.remove(0);
        }
    }
    if parts.len() < words + 1 {
        let what = format!("`{}` has no name of a file", short(value));
        return Err(Fault::new(at.clone(), what, "add the name of the file"));
    }
    let name = parts.remove(words);
    Ok((parts, Timed { set, has_all_steps, name }))
}

fn variable(case: &mut CaseFile, key: &str, value: &str, at: &At) -> Result<(), Fault> {
    if key == "constant per case" {
        let (words, last) = timed(value, 1, at)?;
        let mut numbers = vec![last.name];
        numbers.extend(words.iter().skip(1).cloned());
        let numbers = numbers.iter().filter_map(|n| n.parse().ok()).collect();
        case.constants.push((words[0].clone(), numbers));
        return Ok(());
    }
    let (kind, of) = key.split_once(" per ").unwrap_or((key, ""));
    let components = match kind {
        "scalar" => 1,
        "vector" => 3,
        "tensor symm" => 6,
        "tensor asym" => 9,
        _ => 0,
    };
    if components == 0 || !matches!(of, "node" | "element") {
        case.warnings.push(format!("variable left out: {key}: {}", short(value)));
        return Ok(());
    }
    let (words, file) = timed(value, 1, at)?;
    let of_elements = of == "element";
    case.variables.push(Variable { name: words[0].clone(), components, of_elements, file });
    Ok(())
}

fn time_key(case: &mut CaseFile, key: &str, value: &str, at: &At) -> Result<(), Fault> {
    let wrong = || {
        let what = format!("{key}: {}", short(value));
        Fault::new(at.clone(), what, "it needs numbers")
    };
    let whole = || value.split_whitespace().next().and_then(|n| n.parse::<i64>().ok());
    if key == "time set" {
        let id = whole().ok_or_else(wrong)?;
        case.sets.push(TimeSet { id, increment: 1, ..TimeSet::default() });
        return Ok(());
    }
    let Some(set) = case.sets.last_mut() else {
        return Err(Fault::new(
            at.clone(),
            format!("{key} without a time set"),
            "add `time set: 1`",
        ));
    };
    match key {
        "number of steps" => {
            let steps = whole().and_then(|n| usize::try_from(n).ok());
            set.steps = steps.ok_or_else(wrong)?;
        }
        "filename start number" => set.start = whole().ok_or_else(wrong)?,
        "filename increment" => set.increment = whole().ok_or_else(wrong)?,
        "filename numbers" => {
            for n in value.split_whitespace() {
                set.numbers.push(n.parse().map_err(|_| wrong())?);
            }
        }
        "time values" => {
            for t in value.split_whitespace() {
                let t = t.parse::<f64>().ok().filter(|t| t.is_finite());
                set.times.push(t.ok_or_else(wrong)?);
            }
        }
        _ => case.warnings.push(format!("{key} of a time set left out")),
    }
    Ok(())
}
