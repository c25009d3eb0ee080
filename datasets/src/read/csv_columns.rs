//! Which columns of a table are coordinates, by the names that solvers and ParaView give them, and
//! which are values.

use super::ReadError;
use super::csv::{CsvTable, FORMAT};
use super::error::{At, Fault};
use crate::model::{DataArray, Values};
use std::path::PathBuf;

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

/// Names, as in [`NAMES`], of the radius, of the coordinate along the axis, and of the angle about
/// it in axisymmetric tables. `Radial Coordinate` is Fluent's and CFD-Post's, `r` with `z` is
/// COMSOL's.
const RADII: &[&str] = &[
    "r",
    "radius",
    "radial_coordinate",
    "r_coordinate",
    "r_coord",
    "coordinate_r",
    "coordinater",
    "radial_position",
];
const AXIAL: &[&str] = &["axial_coordinate", "axial_position"];
const ANGLES: &[&str] =
    &["theta", "azimuth", "angular_coordinate", "theta_coordinate", "coordinatetheta"];

/// Units of length that names of columns have.
const UNITS: &[(&str, f64)] =
    &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("in", 0.0254), ("ft", 0.3048)];

/// Cells that say that there is no value.
const MISSING: &[&str] = &["", "nan", "-nan", "na", "n/a", "null", "none", "-", "--"];

/// What a column is by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// x, y or z.
    Axis(usize),
    /// The coordinate along the axis of symmetry.
    Axial,
    /// The distance from it.
    Radius,
    /// The angle about it.
    Angle,
}

/// The columns of a table of points.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Columns {
    /// Columns of x, y and z. There is an x or, without it, an error. In axisymmetric tables x is
    /// along the axis, y is the radius, and there is no z.
    pub(crate) coordinates: [Option<usize>; 3],
    /// Columns with numbers.
    values: Vec<usize>,
    /// Whether y is a radius by its name.
    pub(crate) axisymmetric: bool,
    /// The unit of x by its name, with metres per unit, unless it is the metre.
    pub(crate) unit: Option<(&'static str, f64)>,
}

impl Columns {
    /// Finds the columns. A radius is a coordinate where the table has no other one across the
    /// axis: in a table of `x`, `y` and `radius` it is a value.
    ///
    /// # Errors
    /// If there is no x, or if an axisymmetric table has several angles.
    pub(crate) fn find(table: &CsvTable) -> Result<Columns, ReadError> {
        let fault = |what: String, cure: &str| {
            Fault::new(At::Field("the table".into()), what, cure).in_file(table.path(), FORMAT)
        };
        let places: Vec<_> = table.columns().iter().map(|name| place(name)).collect();
        let first = |wanted: Place| places.iter().position(|p| p.is_some_and(|p| p.0 == wanted));
        let mut coordinates = [0, 1, 2].map(|axis| first(Place::Axis(axis)));
        let along = match coordinates {
            [x, None, None] => x.or_else(|| first(Place::Axial)),
            // The axis is z where there is no x.
            [None, None, z] => z,
            _ => None,
        };
        let radial = along.zip(first(Place::Radius));
        if let Some((along, radius)) = radial {
            coordinates = [Some(along), Some(radius), None];
            if let Some(angle) = first(Place::Angle)
                && differs(table, angle)
            {
                let name = &table.columns()[angle];
                return Err(fault(
                    format!("cylindrical coordinates: a radius, and different angles `{name}`"),
                    "write x, y and z of the points, or rename the column if it is no place",
                ));
            }
        }
        if coordinates[0].is_none() {
            let names = table.columns().iter().map(|c| format!("`{c}`")).collect::<Vec<_>>();
            let what = format!("there is no column with coordinates among {}", names.join(", "));
            let cure = "name those x, y and z, or x and r if the flow is axisymmetric";
            return Err(fault(what, cure));
        }
        let units = coordinates.iter().flatten().filter_map(|c| places[*c]?.1);
        let unit = units.into_iter().next();
        let others = (0..table.columns().len()).filter(|i| !coordinates.contains(&Some(*i)));
        let values = with_numbers(table, others.collect());
        let unit = unit.filter(|(_, metres)| *metres != 1.0);
        Ok(Columns { coordinates, values, axisymmetric: radial.is_some(), unit })
    }

    /// The numbers of all rows.
    ///
    /// # Errors
    /// If a cell is neither a number nor missing.
    pub(crate) fn numbers(&self, table: &CsvTable) -> Result<Numbers, ReadError> {
        let places = self.coordinates.iter().flatten();
        let wanted: Vec<usize> = places.chain(&self.values).copied().collect();
        let mut columns = table.columns_of_numbers(&wanted, is_missing)?.into_iter();
        let mut place = |column: Option<usize>| match column {
            Some(_) => columns.next().unwrap_or_default(),
            None => vec![0.0; table.len()],
        };
        let coordinates = self.coordinates.map(&mut place);
        let names = self.values.iter().map(|c| table.columns()[*c].clone());
        Ok(Numbers { path: table.path().into(), coordinates, values: names.zip(columns).collect() })
    }
}

/// The numbers of a table of points, without its text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Numbers {
    /// The file, for messages.
    pub(crate) path: PathBuf,
    /// Coordinates of each row: 0 along axes for which the table has no column, NaN where a cell is
    /// missing.
    pub(crate) coordinates: [Vec<f64>; 3],
    /// Values of each row by the names of the columns. Missing ones are NaN.
    pub(crate) values: Vec<(String, Vec<f64>)>,
}

impl Numbers {
    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.coordinates[0].len()
    }
}

/// Those of these columns that have numbers: columns of text, as names of regions, are left out, as
/// are columns without any value.
fn with_numbers(table: &CsvTable, columns: Vec<usize>) -> Vec<usize> {
    let mut is_number: Vec<Option<bool>> = vec![Some(false); table.columns().len()];
    columns.iter().for_each(|c| is_number[*c] = None);
    for row in 0..table.len() {
        if !is_number.contains(&None) {
            break;
        }
        let mut column = 0;
        table.each_cell(row, |cell| {
            if is_number[column].is_none() && !is_missing(&cell) {
                is_number[column] = Some(cell.parse::<f64>().is_ok());
            }
            column += 1;
        });
    }
    columns.into_iter().filter(|c| is_number[*c] == Some(true)).collect()
}

/// An array of points.
pub(crate) fn array(name: &str, values: Vec<f64>) -> DataArray {
    DataArray::new(name, 1, Values::F64(values))
}

/// Whether a column has different numbers.
fn differs(table: &CsvTable, column: usize) -> bool {
    let mut numbers = (0..table.len()).filter_map(|r| table.cell(r, column).parse::<f64>().ok());
    let first = numbers.next();
    numbers.any(|n| Some(n) != first)
}

/// What a column is by its name, and its unit.
fn place(name: &str) -> Option<(Place, Option<(&'static str, f64)>)> {
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
    let of_axes = (0..3).find(|axis| NAMES.iter().any(|n| of_axis(n, *axis) == plain));
    let place = match of_axes {
        Some(axis) => Place::Axis(axis),
        None if RADII.contains(&plain) => Place::Radius,
        None if AXIAL.contains(&plain) => Place::Axial,
        None if ANGLES.contains(&plain) => Place::Angle,
        None => return None,
    };
    Some((place, unit))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_programs_are_known_with_their_units() {
        use Place::{Angle, Axial, Axis, Radius};
        for (name, expected) in [
            ("x", Some((Axis(0), None))),
            ("Y_m", Some((Axis(1), Some("m")))),
            ("Points:2", Some((Axis(2), None))),
            ("points_1", Some((Axis(1), None))),
            ("x-coordinate", Some((Axis(0), None))),
            ("    z-coordinate", Some((Axis(2), None))),
            ("X (mm)", Some((Axis(0), Some("mm")))),
            ("Y [ m ]", Some((Axis(1), Some("m")))),
            ("Centroid[Z] (m)", Some((Axis(2), Some("m")))),
            ("Position[X] (mm)", Some((Axis(0), Some("mm")))),
            ("CoordinateY", Some((Axis(1), None))),
            ("coordinate_z", Some((Axis(2), None))),
            ("z_mm", Some((Axis(2), Some("mm")))),
            ("r", Some((Radius, None))),
            ("Radial Coordinate [ m ]", Some((Radius, Some("m")))),
            ("    radial-coordinate", Some((Radius, None))),
            ("radius (mm)", Some((Radius, Some("mm")))),
            ("r_mm", Some((Radius, Some("mm")))),
            ("axial-coordinate", Some((Axial, None))),
            ("theta", Some((Angle, None))),
            ("rho", None),
            ("radial-velocity", None),
            ("x-velocity", None),
            ("Velocity[i] (m/s)", None),
            ("exhaust", None),
            ("T_K", None),
            ("", None),
            ("[x]", None),
            ("(", None),
        ] {
            let found = place(name).map(|(a, u)| (a, u.map(|u| u.0)));
            assert_eq!(found, expected, "{name}");
        }
    }
}
