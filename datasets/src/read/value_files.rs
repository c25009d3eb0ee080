//! The files with the values of a volume, where these are not one: slices with numbers in their
//! names, or a list of names. NRRD and MetaImage write both alike.
//!
//! Sources: teem.sourceforge.net/nrrd/format.html, "data file"; the MetaIO documentation at
//! itk.org/Wiki/MetaIO/Documentation, "ElementDataFile".

use super::error::{At, Fault, read_bytes, sibling_path};
use super::volume::{Packing, Volume};
use super::{Content, LoadedFile, ReadError};
use crate::model::Values;
use std::path::Path;

/// Files, at most: more than a volume has slices.
const MOST_FILES: i64 = 1 << 20;

/// The names, if the field that should have one has `NAME%03d FIRST LAST STEP` or `LIST`. Listed
/// names are those on the lines of `rest`.
pub(super) fn names(field: &str, rest: &[u8]) -> Result<Option<Vec<String>>, Fault> {
    let words: Vec<&str> = field.split_ascii_whitespace().collect();
    let wrong = |what: String| {
        let cure =
            "write the name of each file on a line after LIST, or `NAME%03d FIRST LAST STEP`";
        Fault::new(At::Field("the names of the data files".into()), what, cure)
    };
    if words.first() == Some(&"LIST") {
        let text = String::from_utf8_lossy(rest);
        let lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
        let names: Vec<String> = lines.map(str::to_string).collect();
        return match names.len() {
            0 => Err(wrong("the list is empty".into())),
            _ => Ok(Some(names)),
        };
    }
    let numbers: Vec<i64> = words.iter().skip(1).map_while(|w| w.parse().ok()).collect();
    let (Some(pattern), &[first, last, step, ..]) = (words.first(), &numbers[..]) else {
        return Ok(None);
    };
    let Some(pattern) = Pattern::new(pattern) else { return Ok(None) };
    let apart = last.checked_sub(first).and_then(|d| d.checked_div(step));
    match apart.filter(|n| (0..MOST_FILES).contains(n)) {
        Some(n) => Ok(Some((0..=n).map(|i| pattern.name(first + i * step)).collect())),
        None => Err(wrong(format!("{first} to {last} in steps of {step}"))),
    }
}

/// A name with a place for a number, as in C: `%d`, `%i`, `%5d`, `%05d`, `%.5d`.
struct Pattern<'a> {
    before: &'a str,
    after: &'a str,
    digits: usize,
    fill: char,
}

impl Pattern<'_> {
    fn new(text: &str) -> Option<Pattern<'_>> {
        let (before, rest) = text.split_once('%')?;
        let end = rest.find(|c: char| !(c.is_ascii_digit() || c == '.'))?;
        let (digits, after) = (&rest[..end], &rest[end..]);
        let after = after.strip_prefix(['d', 'i', 'u'])?;
        let fill = if digits.starts_with(['0', '.']) { '0' } else { ' ' };
        let digits = digits.trim_start_matches(['0', '.']);
        let digits = if digits.is_empty() { 0 } else { digits.parse().ok()? };
        (digits <= 32).then_some(Pattern { before, after, digits, fill })
    }

    fn name(&self, number: i64) -> String {
        let Pattern { before, after, digits, fill } = *self;
        let sign = if number < 0 { "-" } else { "" };
        let number = number.unsigned_abs().to_string();
        let missing = digits.saturating_sub(number.len() + sign.len());
        let fill_up: String = std::iter::repeat_n(fill, missing).collect();
        match fill {
            '0' => format!("{before}{sign}{fill_up}{number}{after}"),
            _ => format!("{before}{fill_up}{sign}{number}{after}"),
        }
    }
}

/// Reads the volume from these files beside `path`, each of which has the same part of its values.
/// `skip` goes to the values of a file.
pub(super) fn read(
    path: &Path,
    names: &[String],
    volume: Volume,
    packing: Packing,
    format: &'static str,
    skip: impl for<'d> Fn(&'d [u8]) -> Result<&'d [u8], Fault>,
) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, format);
    let count = volume.count().map_err(fault)?;
    let files = names.len() as u64;
    if count % files != 0 {
        let what = format!("{files} files for {count} values");
        let cure = "name as many files as there are slices";
        let at = At::Field("the names of the data files".into());
        return Err(fault(Fault::new(at, what, cure)));
    }
    let (mut values, mut warnings) = (Values::empty(volume.kind), Vec::new());
    for name in names {
        let file = sibling_path(path, name);
        let bytes = read_bytes(&file)?;
        let mut of_file = Vec::new();
        let part = skip(&bytes)
            .and_then(|data| volume.values(data, packing, count / files, &mut of_file))
            .map_err(|f| f.in_file(&file, format))?;
        values.append(&part);
        warnings.extend(of_file.into_iter().map(|w| format!("{name}: {w}")));
    }
    let data = volume.with_values(values).map_err(fault)?;
    let (content, time_steps) = (Content::Data(data), Vec::new());
    Ok(LoadedFile { format, content, warnings, time_steps })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_put_into_names_as_in_c() {
        for (field, expected) in [
            ("s.%d 9 11 1", vec!["s.9", "s.10", "s.11"]),
            ("s%03d.raw 8 12 2", vec!["s008.raw", "s010.raw", "s012.raw"]),
            ("%.4i 1 2 1 2", vec!["0001", "0002"]),
            ("a%3db 2 1 -1", vec!["a  2b", "a  1b"]),
            ("n%03d -1 0 1", vec!["n-01", "n000"]),
        ] {
            assert_eq!(names(field, b"").unwrap().unwrap(), expected, "{field}");
        }
        for one in ["values.raw", "100%.raw", "a b.raw", "s%d", "s%d 1 2", "s%f 1 2 1", "s%d x y z"]
        {
            assert!(names(one, b"").unwrap().is_none(), "{one}");
        }
        const LEAST: &str = "s%d 1 -9223372036854775807 -1";
        for wrong in ["s%d 1 9 0", "s%d 9 1 1", "s%d 0 99999999 1", "LIST", LEAST] {
            assert!(names(wrong, b" \n").is_err(), "{wrong}");
        }
        assert_eq!(
            names("LIST 2", b"a.raw\n\n b c.raw \n").unwrap().unwrap(),
            ["a.raw", "b c.raw"]
        );
    }
}
