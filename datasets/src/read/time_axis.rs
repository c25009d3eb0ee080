//! Times of a file that holds several. `FILE/TIME` is the path of one of them, as `case/0.002` is
//! that of a time of an OpenFOAM case.

use super::TimeStep;
use super::error::Fault;
use super::options::step_at;
use std::path::{Path, PathBuf};

/// Most times of a file; each has a path of its own.
pub(crate) const MOST: usize = 1 << 20;

/// The times as steps, and which of them was asked for: without one, the first. A warning says that
/// there are others.
pub(crate) fn choose(
    path: &Path,
    times: &[f64],
    time: Option<f64>,
    warnings: &mut Vec<String>,
) -> Result<(usize, Vec<TimeStep>), Fault> {
    if times.len() > MOST {
        return Err(Fault::field(
            "the times",
            format!("{} of them, more than {MOST}", times.len()),
        ));
    }
    let steps: Vec<TimeStep> = times.iter().map(|&time| step(path, time)).collect();
    let chosen = match time {
        Some(t) => {
            let found = step_at(&steps, t)?;
            steps.iter().position(|s| s.time.total_cmp(&found.time).is_eq()).unwrap_or(0)
        }
        None => 0,
    };
    if let [first, _, ..] = times
        && time.is_none()
    {
        let n = times.len();
        warnings.push(format!("a series of {n} times; this is the first, t = {first}"));
    }
    Ok((chosen, steps))
}

/// A time of a file, with a path of its own.
pub(crate) fn step(path: &Path, time: f64) -> TimeStep {
    TimeStep { time, part: 0, path: path.join(time.to_string()) }
}

/// The file and the time of a path `FILE/TIME`.
pub(crate) fn time_of_file(path: &Path) -> Option<(PathBuf, f64)> {
    let time: f64 = path.file_name()?.to_str()?.parse().ok()?;
    let file = path.parent()?;
    (!path.exists() && file.is_file()).then(|| (file.to_path_buf(), time))
}
