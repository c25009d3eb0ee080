//! Which columns of a table are coordinates, by the names that solvers and ParaView give them, and
//! which are values.

use super::ReadError;
use super::csv::{CsvTable, FORMAT};
use super::error::{At, Fault};
use crate::model::{DataArray, Values};

/// Names of the x column apart from case, brackets with units, and `-`, ` ` for `_`. Those of y and
/// z have the other letters and numbers. `Points:0` is ParaView's, `x-coordinate` Fluent's,
/// `Centroid[X]` and `Position[X]` those of Star-CCM+.
const NAMES: &[&str] = &[
    "x",
    "x_coordinate",
    "xcoordinate",
    "x_coord",
    "coordinate_x",
    "coordinatex",
    "x_position",
    "points:0",
    "points_0",
    "coordinates:0",
    "coordinates_0",
    "centroid[x]",
    "position[x]",
];

/// Units of length that names of columns have.
const UNITS: &[(&str, f64)] =
    &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("in", 0.0254), ("ft", 0.3048)];

/// Cells that say that there is no value.
const MISSING: &[&str] = &["", "nan", "-nan", "na", "n/a", "null", "none", "-", "--"];

/// The columns of a table of points.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Columns {
    /// Columns of x, y and z. There is an x or, without it, an error.
    pub(crate) coordinates: [Option<usize>; 3],
    /// Columns with numbers.
    values: Vec<usize>,
    /// The unit of x by its name, with metres per unit, unless it is the metre.
    pub(crate) unit: Option<(&'static str, f64)>,
}

impl Columns {
    /// Finds the columns.
    ///
    /// # Errors
    /// If there is no x.
    pub(crate) fn find(table: &CsvTable) -> Result<Columns, ReadError> {
        let mut coordinates = [None; 3];
        let mut unit = None;
        for (i, name) in table.columns().iter().enumerate() {
            if let Some((axis, of_name)) = axis(name)
                && coordinates[axis].is_none()
            {
                coordinates[axis] = Some(i);
                unit = unit.or(of_name);
            }
        }
        if coordinates[0].is_none() {
            let names = table.columns().iter().map(|c| format!("`{c}`")).collect::<Vec<_>>();
            let what = format!("there is no column with coordinates among {}", names.join(", "));
            let at = At::Field("the table".into());
            return Err(Fault::new(at, what, "name those x, y and z").in_file(table.path(), FORMAT));
        }
        // Columns of text, as names of regions, are left out, as are columns without any value.
        let is_number = |c: &usize| {
            let mut cells = (0..table.len()).map(|r| table.cell(r, *c));
            let first = cells.find(|cell| !is_missing(cell));
            first.is_some_and(|cell| cell.parse::<f64>().is_ok())
        };
        let values = (0..table.columns().len()).filter(|i| !coordinates.contains(&Some(*i)));
        let values = values.filter(is_number).collect();
        let unit = unit.filter(|(_, metres)| *metres != 1.0);
        Ok(Columns { coordinates, values, unit })
    }

    /// The coordinates of each row along an axis: 0 where the table has no column for it, NaN where
    /// the cell is missing.
    pub(crate) fn along(&self, table: &CsvTable, axis: usize) -> Result<Vec<f64>, ReadError> {
        match self.coordinates[axis] {
            Some(column) => numbers(table, column),
            None => Ok(vec![0.0; table.len()]),
        }
    }

    /// The values of each row by the names of the columns. Missing ones are NaN.
    pub(crate) fn values(&self, table: &CsvTable) -> Result<Vec<(String, Vec<f64>)>, ReadError> {
        self.values.iter().map(|c| Ok((table.columns()[*c].clone(), numbers(table, *c)?))).collect()
    }
}

/// An array of points.
pub(crate) fn array(name: &str, values: Vec<f64>) -> DataArray {
    DataArray::new(name, 1, Values::F64(values))
}

/// The axis that a column is of, and its unit.
fn axis(name: &str) -> Option<(usize, Option<(&'static str, f64)>)> {
    let name = name.trim().to_lowercase().replace(['-', ' '], "_");
    // Brackets with a unit come last: `x (mm)`, `X [ m ]`, `Centroid[X] (m)`.
    let brackets = name.find(['(', '[']).filter(|at| {
        let inner = name[*at..].trim_matches(|c: char| "()[]_".contains(c));
        *at > 0 && !["x", "y", "z"].contains(&inner.split([']', ')']).next().unwrap_or(""))
    });
    let brackets = brackets.or_else(|| name.find("](").or_else(|| name.find("]_")).map(|i| i + 1));
    let (plain, unit) = match brackets {
        Some(at) => (&name[..at], name[at..].trim_matches(|c: char| "()[]_".contains(c))),
        // `x_mm`
        None => match name.split_once('_') {
            Some((letter, unit)) if UNITS.iter().any(|u| u.0 == unit) => (letter, unit),
            _ => (name.as_str(), ""),
        },
    };
    let plain = plain.trim_end_matches('_');
    let unit = UNITS.iter().find(|u| u.0 == unit).copied();
    let axis = (0..3).find(|axis| NAMES.iter().any(|n| of_axis(n, *axis) == plain))?;
    Some((axis, unit))
}

/// A name of [`NAMES`] for another axis.
fn of_axis(name: &str, axis: usize) -> String {
    let letter = ["x", "y", "z"][axis];
    match name.strip_suffix('0') {
        Some(points) => format!("{points}{axis}"),
        None if name == "x" || name.starts_with("xc") || name.starts_with("x_") => {
            format!("{letter}{}", &name[1..])
        }
        None => name
            .replace("[x]", &format!("[{letter}]"))
            .replace("_x", &format!("_{letter}"))
            .replace("ex", &format!("e{letter}")),
    }
}

fn is_missing(cell: &str) -> bool {
    MISSING.iter().any(|m| m.eq_ignore_ascii_case(cell))
}

/// The numbers of a column, NaN for missing ones.
fn numbers(table: &CsvTable, column: usize) -> Result<Vec<f64>, ReadError> {
    let number = |row| match table.cell(row, column) {
        cell if is_missing(cell) => Ok(f64::NAN),
        _ => table.number(row, column),
    };
    (0..table.len()).map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_programs_are_known_with_their_units() {
        for (name, expected) in [
            ("x", Some((0, None))),
            ("Y_m", Some((1, Some("m")))),
            ("Points:2", Some((2, None))),
            ("points_1", Some((1, None))),
            ("x-coordinate", Some((0, None))),
            ("    z-coordinate", Some((2, None))),
            ("X (mm)", Some((0, Some("mm")))),
            ("Y [ m ]", Some((1, Some("m")))),
            ("Centroid[Z] (m)", Some((2, Some("m")))),
            ("Position[X] (mm)", Some((0, Some("mm")))),
            ("CoordinateY", Some((1, None))),
            ("coordinate_z", Some((2, None))),
            ("z_mm", Some((2, Some("mm")))),
            ("x-velocity", None),
            ("Velocity[i] (m/s)", None),
            ("exhaust", None),
            ("T_K", None),
            ("", None),
            ("[x]", None),
            ("(", None),
        ] {
            let found = axis(name).map(|(a, u)| (a, u.map(|u| u.0)));
            assert_eq!(found, expected, "{name}");
        }
    }
}
