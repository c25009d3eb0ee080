//! Tecplot's files: text (`.dat`, `.tec`) and binary (`.plt`). Zones become blocks.
//!
//! Coordinates are the variables named X, Y and Z. Variables without values in a zone (passive
//! ones) are left out there. Polygons, polyhedra and mixed elements are refused by name.

mod binary;
mod binary_header;
mod binary_input;
mod scanner;
mod shapes;
mod text;
mod text_zone;
mod zone;

use super::error::{At, Fault, read_bytes};
use super::options::step_at;
use super::{Content, LoadedFile, OpenOptions, ReadError, TimeStep, time_axis};
use crate::model::{Block, Dataset};
use std::path::Path;
use zone::Zone;

pub(crate) const FORMAT: &str = "Tecplot";

/// The cure for a file that is none of Tecplot's.
const FORMAT_CURE: &str = "give a Tecplot file: text with TITLE, VARIABLES and ZONE, or binary \
                           (.plt)";

/// What a file holds.
#[derive(Debug, Default)]
struct File {
    title: String,
    variables: Vec<String>,
    zones: Vec<Zone>,
    warnings: Vec<String>,
}

/// Whether the first bytes are those of a Tecplot file.
pub(crate) fn begins_as_tecplot(head: &[u8]) -> bool {
    head.starts_with(binary::MAGIC) || text::begins_as_tecplot(&String::from_utf8_lossy(head))
}

/// Reads a file; of several times, the first or that of the options.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let bytes = read_bytes(path)?;
    from_bytes(path, &bytes, options.time).map_err(|f| f.in_file(path, FORMAT))
}

fn from_bytes(path: &Path, bytes: &[u8], time: Option<f64>) -> Result<LoadedFile, Fault> {
    let mut file = if bytes.starts_with(binary::MAGIC) {
        binary::read(bytes)?
    } else {
        text::read(&String::from_utf8_lossy(bytes))?
    };
    if file.zones.is_empty() {
        let at = At::Field("the file".into());
        return Err(Fault::new(at, "it has no zones", FORMAT_CURE));
    }
    let axes = coordinates(&file.variables)?;
    make_unique(&mut file);
    let steps = steps(path, &file.zones);
    let time = match time {
        Some(t) => Some(step_at(&steps, t)?.time),
        None => steps.first().map(|s| s.time),
    };
    if steps.len() > 1 {
        let of = time.unwrap_or_default();
        file.warnings.push(format!("a file with {} times; this is t = {of}", steps.len()));
    }
    let shown = |z: &&Zone| steps.is_empty() || z.header.time.is_none() || z.header.time == time;
    let zones: Vec<&Zone> = file.zones.iter().filter(shown).collect();

    // Shared variables are copied, so a short file must not ask for many copies of a long one.
    let shared = zones.iter().map(|z| z.shared_values()).fold(0, u64::saturating_add);
    if shared > (bytes.len() as u64).saturating_mul(text::MOST_PER_BYTE) {
        let what = format!("zones share {shared} values, in a file of {} bytes", bytes.len());
        let cure = "split the file, or choose one time";
        return Err(Fault::unsupported(At::Field("VARSHARELIST".into()), what, cure));
    }
    let mut blocks = Vec::with_capacity(zones.len());
    for z in &zones {
        let data = z.dataset(&file.variables, axes)?;
        blocks.push(Block { name: z.header.title.clone(), data });
    }
    warn_passive(&zones, &file.variables, &mut file.warnings);
    let data = match blocks.len() {
        1 => blocks.remove(0).data,
        _ => Dataset::MultiBlock(blocks),
    };
    let (content, time_steps) = (Content::Data(data), steps);
    Ok(LoadedFile { format: FORMAT, content, warnings: file.warnings, time_steps })
}

/// The times, if there is more than one.
fn steps(path: &Path, zones: &[Zone]) -> Vec<TimeStep> {
    let mut times: Vec<f64> = zones.iter().filter_map(|z| z.header.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    if times.len() < 2 {
        return Vec::new();
    }
    times.into_iter().map(|time| time_axis::step(path, time)).collect()
}

fn warn_passive(zones: &[&Zone], names: &[String], warnings: &mut Vec<String>) {
    for (v, name) in names.iter().enumerate() {
        let without = zones.iter().filter(|z| z.values[v].is_none()).count();
        if without > 0 {
            warnings.push(format!(
                "variable `{name}` is passive in {without} of {} zones and left out there",
                zones.len()
            ));
        }
    }
}

/// The variables that are x, y and z.
fn coordinates(names: &[String]) -> Result<[Option<usize>; 3], Fault> {
    let mut axes = [None; 3];
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        let is = |name: &String| {
            let plain = name.split(['[', '(']).next().unwrap_or_default().trim().to_lowercase();
            let plain: String = plain.chars().filter(char::is_ascii_alphanumeric).collect();
            let digit = format!("points{axis}");
            plain == letter
                || plain == digit
                || plain == format!("coordinate{letter}")
                || plain == format!("{letter}coordinate")
                || plain == format!("coord{letter}")
        };
        axes[axis] = names.iter().position(is);
    }
    if axes.iter().flatten().count() >= 2 {
        return Ok(axes);
    }
    let what = format!("the coordinates are not among {}", names.join(", "));
    Err(Fault::new(At::Field("VARIABLES".into()), what, "name those of the points X, Y and Z"))
}

/// Renames variables whose names occur twice.
fn make_unique(file: &mut File) {
    let mut seen = std::collections::HashSet::new();
    for (v, name) in file.variables.iter_mut().enumerate() {
        if !seen.insert(name.clone()) {
            let new = format!("{name} ({})", v + 1);
            file.warnings.push(format!("variable {} is the second `{name}`: now `{new}`", v + 1));
            seen.insert(new.clone());
            *name = new;
        }
    }
}

fn solution_without_grid(at: At) -> Fault {
    let cure = "join it with its grid file in Tecplot, and save a full file";
    Fault::unsupported(at, "it is a solution file, whose grid is in another file", cure)
}
