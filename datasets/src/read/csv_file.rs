//! Opens a table of points: as the lattice that they are, or else as the mesh between them.

use super::csv::{self, FORMAT};
use super::csv_columns::Columns;
use super::error::{At, Fault};
use super::{Content, LoadedFile, OpenOptions, ReadError, csv_lattice, csv_points};
use std::path::Path;

/// Reads a table.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let gap = options.gap.unwrap_or(csv_points::GAP_SPACINGS);
    if gap.is_nan() || gap <= 0.0 {
        let what = format!("it is {gap}");
        let cure = "give a number above 0, such as 2.7, or inf for the whole convex hull";
        let fault = Fault::option(At::Field("the option `gap`".into()), what, cure);
        return Err(fault.in_file(path, FORMAT));
    }
    let table = csv::read(path)?;
    let columns = Columns::find(&table)?;
    let numbers = columns.numbers(&table)?;
    let names = table.columns().to_vec();
    // The text is needed no more, and may be larger than all that follows.
    drop(table);
    let mut warnings = Vec::new();
    let mut data = match csv_lattice::find(&numbers) {
        Some((data, missing)) => {
            if missing > 0 {
                warnings
                    .push(format!("{missing} values are missing and stay without a number (NaN)"));
            }
            data
        }
        None => {
            let (data, report) = csv_points::of_numbers(numbers, gap)?;
            warnings.extend(report.sentences(gap));
            data
        }
    };
    if columns.axisymmetric {
        let [along, radius] = [0, 1].map(|a| columns.coordinates[a]).map(|c| match c {
            Some(c) => names[c].as_str(),
            None => "",
        });
        warnings.push(format!(
            "the table is axisymmetric by the names of its columns: x is `{along}`, along the \
             axis, and y is `{radius}`, the distance from it"
        ));
        if let Some(attributes) = data.attributes_mut() {
            attributes.set_axisymmetric();
        }
    }
    if let Some((unit, metres)) = columns.unit {
        warnings.push(format!(
            "the coordinates are in {unit} by their names and stay so; a length unit of {metres} \
             makes them metres"
        ));
    }
    Ok(LoadedFile { format: FORMAT, content: Content::Data(data), warnings, time_steps: vec![] })
}
