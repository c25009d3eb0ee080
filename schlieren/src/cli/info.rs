//! Implements `schlieren info`: what a flow's file holds, and a command that renders it.

use super::units;
use crate::input::{Contents, contents};
use clap::Args;
use datasets::cli::CommonArgs;
use datasets::read::OpenOptions;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Options of `schlieren info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  schlieren info flow.vtu
  schlieren info --json flow.vtu | jq -r .command")]
pub(super) struct InfoArgs {
    /// The flow, of any format that `schlieren render` reads
    file: PathBuf,
    /// Distance between the points of a file that does not say it (NumPy, raw, NRRD, MetaImage,
    /// NetCDF without coordinates)
    #[arg(long, value_name = "DX,DY,DZ", value_parser = units::three)]
    spacing: Option<[f64; 3]>,
    /// Position of the first point of such a file
    #[arg(long, value_name = "X,Y,Z", value_parser = units::three, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// For a table of points in no order (.csv .tsv .txt): how many times as wide as the cells
    /// around it a place without points is a hole; `inf` keeps the whole convex hull [default: 2.7]
    #[arg(long, value_name = "SPACINGS")]
    gap: Option<f64>,
}

#[derive(Serialize)]
struct Info<'a> {
    file: &'a Path,
    #[serde(flatten)]
    contents: &'a Contents,
    /// A command that renders the flow, quoted for a shell.
    command: Option<String>,
}

pub(super) fn info(common: CommonArgs, args: &InfoArgs) -> anyhow::Result<()> {
    let InfoArgs { spacing, origin, gap, .. } = *args;
    let open = OpenOptions { time: None, spacing, origin, gap };
    let contents = contents(&args.file, &open)?;
    let command = command(&args.file, &open, &contents);
    let info = Info { file: &args.file, contents: &contents, command };
    common.result(&info, || text(&info))
}

/// A command that renders the file.
fn command(file: &Path, open: &OpenOptions, contents: &Contents) -> Option<String> {
    let guess = contents.guess.as_ref()?;
    let mut words = vec!["schlieren".into(), "render".into(), file.display().to_string()];
    for (option, value) in &guess.options {
        words.push((*option).to_owned());
        words.extend(Some(value.clone()).filter(|v| !v.is_empty()));
    }
    for (option, value) in [("--spacing", open.spacing), ("--origin", open.origin)] {
        if let Some([x, y, z]) = value {
            words.push(format!("{option}={x},{y},{z}"));
        }
    }
    words.extend(open.gap.map(|gap| format!("--gap={gap}")));
    words.extend(["-o".into(), "flow.png".into()]);
    Some(words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" "))
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A number with six significant digits.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    match rounded.abs() {
        0.0 | 1e-4..1e7 => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

fn text(info: &Info<'_>) -> String {
    let c = info.contents;
    let mut lines = vec![format!(
        "{}: {}, {} points, {} cells",
        info.file.display(),
        c.kind,
        c.points,
        c.cells
    )];
    if let Some([x, y, z]) = c.size {
        let unit = c.guess.as_ref().map_or(1.0, |g| g.length_unit_m);
        let unit = if unit == 1.0 { "m, if its unit is the metre" } else { "in its own unit" };
        lines.push(match c.planar {
            // Without the side across the plane.
            true if x == 0.0 => format!("  size {y:.4} x {z:.4}, two-dimensional, {unit}"),
            true if y == 0.0 => format!("  size {x:.4} x {z:.4}, two-dimensional, {unit}"),
            true => format!("  size {x:.4} x {y:.4}, two-dimensional, {unit}"),
            false => format!("  size {x:.4} x {y:.4} x {z:.4} {unit}"),
        });
    }
    for a in &c.arrays {
        let of = if a.per_point { "points" } else { "cells" };
        let values = match a.values {
            Some([low, median, high]) => {
                format!("{} to {}, median {}", number(low), number(high), number(median))
            }
            None => "no finite value".into(),
        };
        let components = match a.components {
            1 => String::new(),
            n => format!(", {n} components, lengths"),
        };
        let meaning = match a.meaning.and_then(|m| serde_json::to_value(m).ok()) {
            Some(m) => format!(": {}", m.as_str().unwrap_or_default().replace('-', " ")),
            None => String::new(),
        };
        lines.push(format!("  array `{}` of {of}{components} {values}{meaning}", a.name));
    }
    lines.extend(c.notes.iter().map(|n| format!("  note: {n}")));
    if let Some(command) = &info.command {
        lines.extend(["To render it:".into(), format!("  {command}")]);
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_significant_digits() {
        for (value, text) in [
            (11_882.41, "11882.4"),
            (0.0, "0"),
            (-300.0, "-300"),
            (2.5e-7, "2.5e-7"),
            (1.234_567_8e20, "1.23457e20"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn words_for_a_shell() {
        assert_eq!(quoted("a/b-c.vtu"), "a/b-c.vtu");
        assert_eq!(quoted("my flow's.vtu"), r"'my flow'\''s.vtu'");
        assert_eq!(quoted(""), "''");
    }
}
