//! Converts tables of points that form a lattice, as solvers and ParaView export them, to data
//! sets.

use super::ReadError;
use super::csv::{CsvTable, FORMAT};
use super::error::{At, Fault};
use crate::model::{Attributes, DataArray, Dataset, RectilinearGrid, Values};

/// Names of the coordinate columns, case-insensitive. `Points:0` is ParaView's.
const COORDINATES: [&[&str]; 3] = [
    &["x", "x_m", "Points:0", "Points_0"],
    &["y", "y_m", "Points:1", "Points_1"],
    &["z", "z_m", "Points:2", "Points_2"],
];

/// Converts the table to a rectilinear grid: every combination of its x, y and z must occur once,
/// in any order. All other columns of numbers become point arrays. A missing z (or y) is 0.
///
/// ```
/// use datasets::read::{csv, csv_lattice};
/// let table = csv::read_from_bytes("t.csv".as_ref(), b"y_m,x_m,T\n0,0,1\n0,2,2\n1,0,3\n1,2,4\n")?;
/// let data = csv_lattice::dataset(&table)?;
/// assert_eq!(data.counts().0, 4);
/// assert_eq!(data.attributes().unwrap().point_array("T").unwrap().get(1, 0), 2.0);
/// # Ok::<(), datasets::read::ReadError>(())
/// ```
pub fn dataset(table: &CsvTable) -> Result<Dataset, ReadError> {
    let fault = |what: String, cure: &str| {
        Fault::new(At::Field("the table".into()), what, cure).in_file(table.path(), FORMAT)
    };
    let mut is_coordinate = vec![false; table.columns().len()];
    let mut of_rows: Vec<Vec<f64>> = Vec::new();
    let mut coordinates: Vec<Vec<f64>> = Vec::new();
    for (axis, names) in COORDINATES.iter().enumerate() {
        let found =
            table.columns().iter().position(|c| names.iter().any(|n| n.eq_ignore_ascii_case(c)));
        let values = match found {
            Some(i) => {
                is_coordinate[i] = true;
                table.numbers(&table.columns()[i])?
            }
            None if axis > 0 => vec![0.0; table.len()],
            None => {
                return Err(fault(
                    "there is no column with coordinates".into(),
                    "name those x, y and z",
                ));
            }
        };
        let mut distinct = values.clone();
        distinct.sort_by(f64::total_cmp);
        // −0 and 0 are the same coordinate.
        distinct.dedup_by(|a, b| a == b);
        of_rows.push(values);
        coordinates.push(distinct);
    }
    let dims = [0, 1, 2].map(|a| coordinates[a].len());
    let cells = dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
    if cells != Some(table.len()) || table.is_empty() {
        let what = format!(
            "{} rows, but {} x {} x {} different coordinates: the points are not a lattice",
            table.len(),
            dims[0],
            dims[1],
            dims[2]
        );
        return Err(fault(what, "export the mesh itself (.vtu, .vts), or points on a lattice"));
    }

    // The row of each lattice point.
    let mut row_of = vec![usize::MAX; table.len()];
    for row in 0..table.len() {
        let at = [0, 1, 2].map(|a| coordinates[a].partition_point(|x| *x < of_rows[a][row]));
        let slot = &mut row_of[at[0] + dims[0] * (at[1] + dims[1] * at[2])];
        if *slot != usize::MAX {
            let what = format!(
                "lines {} and {} have the same coordinates",
                table.line(*slot),
                table.line(row)
            );
            return Err(fault(what, "remove one of them"));
        }
        *slot = row;
    }

    let mut attributes = Attributes::default();
    for (i, name) in table.columns().iter().enumerate().filter(|(i, _)| !is_coordinate[*i]) {
        // Text columns are ignored; a missing number in a column of numbers is an error.
        if table.cell(0, i).parse::<f64>().is_err() {
            continue;
        }
        let values = table.numbers(name)?;
        let ordered = row_of.iter().map(|&r| values[r]).collect();
        attributes.point.push(DataArray::new(name.clone(), 1, Values::F64(ordered)));
    }
    let extent = [0, dims[0] as i32 - 1, 0, dims[1] as i32 - 1, 0, dims[2] as i32 - 1];
    let coordinates =
        coordinates.try_into().unwrap_or_else(|_| unreachable!("three axes were pushed"));
    Ok(Dataset::RectilinearGrid(RectilinearGrid { extent, coordinates, attributes }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::csv;
    use std::path::Path;

    fn read(text: &str) -> Result<Dataset, String> {
        let table =
            csv::read_from_bytes(Path::new("t.csv"), text.as_bytes()).map_err(|e| e.to_string())?;
        dataset(&table).map_err(|e| e.to_string())
    }

    #[test]
    fn rows_in_any_order_and_text_columns() {
        let data = read(
            "T,name,Points:0,Points:1,Points:2\n4,d,1,0,5\n1,a,-0.0,0,3\n3,c,0,0,5\n2,b,1,0,3\n",
        )
        .unwrap();
        let Dataset::RectilinearGrid(g) = &data else { panic!("{}", data.kind()) };
        assert_eq!(g.coordinates, [vec![0.0, 1.0], vec![0.0], vec![3.0, 5.0]]);
        assert_eq!(g.attributes.point.len(), 1);
        assert_eq!(g.attributes.point[0].values, Values::F64(vec![1.0, 2.0, 3.0, 4.0]));
        data.check().unwrap();
    }

    #[test]
    fn what_is_no_lattice_is_refused() {
        for (text, word) in [
            ("a,b\n1,2\n", "name those x, y and z"),
            ("x,y,T\n0,0,1\n1,1,2\n", "not a lattice"),
            ("x,y,T\n0,0,1\n0,0,2\n", "not a lattice"),
            ("x,y,T\n0,0,1\n0,1,2\n1,0,3\n1,0,4\n", "lines 4 and 5 have the same coordinates"),
            ("x,T\n", "not a lattice"),
            ("x,T\n0,1\n1,\n", "fill it in"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(word), "{text:?}: {error}");
        }
    }
}
