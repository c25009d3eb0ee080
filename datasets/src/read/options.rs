//! What a caller can say about a file that the file itself does not hold.

use super::error::{At, Fault};
use super::{Content, LoadedFile, TimeStep};
use crate::model::Dataset;
use glam::DVec3;

/// Options of [`super::open_with`]. Each is refused by formats to which it means nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OpenOptions {
    /// The time to read from a file or folder with several, in the unit of the program that wrote
    /// it. Without it, the last time of an OpenFOAM case is read, and the first of others.
    pub time: Option<f64>,
    /// Distance between points along x, y and z, for NumPy arrays, raw volumes, and NRRD,
    /// MetaImage and NetCDF files without coordinates.
    pub spacing: Option<[f64; 3]>,
    /// Position of the first point, for the same files.
    pub origin: Option<[f64; 3]>,
    /// For tables of points in no order (CSV): a place without points is none of the flow where it
    /// is this many times as wide as the cells around it ([`super::csv_points`]). Infinity keeps
    /// the whole convex hull.
    pub gap: Option<f64>,
}

impl OpenOptions {
    /// A fault if there is a spacing or an origin.
    pub(crate) fn refuse_lattice(&self) -> Result<(), Fault> {
        let (name, value) = match (self.spacing, self.origin) {
            (Some(s), _) => ("spacing", s),
            (_, Some(o)) => ("origin", o),
            _ => return Ok(()),
        };
        Err(refused(name, format!("{value:?}"), "the file has its own coordinates: leave it out"))
    }

    /// Places the lattice of a file that does not say where it is.
    pub(crate) fn place(&self, file: &mut LoadedFile) -> Result<(), Fault> {
        let finite = |v: Option<[f64; 3]>| v.is_none_or(|v| v.iter().all(|x| x.is_finite()));
        let positive = |v: Option<[f64; 3]>| v.is_none_or(|v| v.iter().all(|x| *x > 0.0));
        if !finite(self.spacing) || !positive(self.spacing) {
            let value = format!("{:?}", self.spacing.unwrap_or_default());
            return Err(refused("spacing", value, "give finite numbers above 0"));
        }
        if !finite(self.origin) {
            let value = format!("{:?}", self.origin.unwrap_or_default());
            return Err(refused("origin", value, "give finite numbers"));
        }
        if let Content::Data(Dataset::ImageData(image)) = &mut file.content {
            image.spacing = self.spacing.map_or(image.spacing, DVec3::from_array);
            image.origin = self.origin.map_or(image.origin, DVec3::from_array);
        }
        Ok(())
    }

    /// A fault if there is a gap.
    pub(crate) fn refuse_gap(&self) -> Result<(), Fault> {
        match self.gap {
            Some(g) => Err(refused("gap", g, "the file is no table of points: leave it out")),
            None => Ok(()),
        }
    }

    /// A fault if there is a time.
    pub(crate) fn refuse_time(&self) -> Result<(), Fault> {
        match self.time {
            Some(t) => Err(refused("time", t, "the file has no list of times: leave it out")),
            None => Ok(()),
        }
    }
}

fn refused(name: &str, value: impl std::fmt::Display, cure: &str) -> Fault {
    Fault::option(At::Field(format!("the option `{name}`")), format!("it is {value}"), cure)
}

/// Number of times at both ends that messages list.
const SHOWN: usize = 4;

/// The step whose time is `time`, apart from rounding: programs write times with six digits.
pub(crate) fn step_at(steps: &[TimeStep], time: f64) -> Result<&TimeStep, Fault> {
    let near = |a: f64| (a - time).abs() <= 1e-6 * a.abs().max(time.abs());
    let nearest =
        steps.iter().min_by(|a, b| (a.time - time).abs().total_cmp(&(b.time - time).abs()));
    if let Some(step) = nearest
        && near(step.time)
    {
        return Ok(step);
    }
    let mut times: Vec<String> = steps.iter().map(|s| s.time.to_string()).collect();
    times.dedup();
    if times.len() > 2 * SHOWN + 1 {
        let hidden = times.len() - 2 * SHOWN;
        times.splice(SHOWN..times.len() - SHOWN, [format!("... ({hidden} more)")]);
    }
    let cure = match times.len() {
        0 => "leave it out: there are no times".to_string(),
        _ => format!("choose one of {}", times.join(", ")),
    };
    Err(refused("time", time, &cure))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_found_within_six_digits_and_a_wrong_one_lists_the_others() {
        let step = |i: u32| TimeStep { time: f64::from(i) / 3.0, part: 0, path: "a".into() };
        let steps: Vec<TimeStep> = (0..20).map(step).collect();
        assert_eq!(step_at(&steps, 0.333_333_1).unwrap().time, 1.0 / 3.0);
        assert_eq!(step_at(&steps, 0.0).unwrap().time, 0.0);
        let fault = step_at(&steps, 0.5).unwrap_err();
        assert!(fault.what.contains("0.5") && fault.cure.contains("(12 more)"), "{fault:?}");
        assert!(step_at(&[], 1.0).unwrap_err().cure.contains("no times"));
    }
}
