//! Converts tables of points that form a lattice, as solvers and ParaView export them, to data
//! sets.

use super::ReadError;
use super::csv::{CsvTable, FORMAT};
use super::csv_columns::{Columns, Numbers, array};
use super::error::{At, Fault};
use crate::model::{Attributes, Dataset, RectilinearGrid};

/// Converts the table to a rectilinear grid: every combination of its x, y and z must occur once,
/// in any order. All other columns of numbers become point arrays. A missing z (or y) is 0, and a
/// missing value is NaN.
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
    let numbers = Columns::find(table)?.numbers(table)?;
    match lattice(&numbers) {
        Ok((data, _)) => Ok(data),
        Err(NotLattice { what, rows, cure }) => {
            let lines = rows.map(|r| {
                let [first, second] = r.map(|row| table.line(row));
                format!("lines {first} and {second} ")
            });
            let what = lines.unwrap_or_default() + &what;
            let at = At::Field("the table".into());
            Err(Fault::new(at, what, cure).in_file(table.path(), FORMAT))
        }
    }
}

/// The lattice of the rows, if they are one, and how many values are missing.
pub(crate) fn find(numbers: &Numbers) -> Option<(Dataset, usize)> {
    lattice(numbers).ok()
}

/// Why a table is not a lattice, two rows that are the reason, and the cure.
struct NotLattice {
    what: String,
    rows: Option<[usize; 2]>,
    cure: &'static str,
}

fn lattice(numbers: &Numbers) -> Result<(Dataset, usize), NotLattice> {
    let rows = numbers.len();
    let coordinates = numbers.coordinates.each_ref().map(|of_rows| {
        let mut distinct = of_rows.clone();
        distinct.sort_by(f64::total_cmp);
        // −0 and 0 are the same coordinate.
        distinct.dedup_by(|a, b| a == b);
        distinct.shrink_to_fit();
        distinct
    });
    let dims = [0, 1, 2].map(|a| coordinates[a].len());
    let cells = dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
    let has_gap = coordinates.iter().flatten().any(|x| x.is_nan());
    if cells != Some(rows) || rows == 0 || has_gap {
        let what = format!(
            "{rows} rows, but {} x {} x {} different coordinates: the points are not a lattice",
            dims[0], dims[1], dims[2]
        );
        let cure = "export the mesh itself (.vtu, .vts), or points on a lattice";
        return Err(NotLattice { what, rows: None, cure });
    }

    // The row of each lattice point.
    let mut row_of = vec![usize::MAX; rows];
    for row in 0..rows {
        let place = |a: usize| numbers.coordinates[a][row];
        let at = [0, 1, 2].map(|a| coordinates[a].partition_point(|x| *x < place(a)));
        let slot = &mut row_of[at[0] + dims[0] * (at[1] + dims[1] * at[2])];
        if *slot != usize::MAX {
            return Err(NotLattice {
                what: "have the same coordinates".into(),
                rows: Some([*slot, row]),
                cure: "remove one of them",
            });
        }
        *slot = row;
    }

    let mut attributes = Attributes::default();
    let mut missing = 0;
    for (name, values) in &numbers.values {
        missing += values.iter().filter(|v| v.is_nan()).count();
        attributes.point.push(array(name, row_of.iter().map(|&r| values[r]).collect()));
    }
    let extent = [0, dims[0] as i32 - 1, 0, dims[1] as i32 - 1, 0, dims[2] as i32 - 1];
    let grid = RectilinearGrid { extent, coordinates, attributes };
    Ok((Dataset::RectilinearGrid(grid), missing))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Values;
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
            ("x,T\n0,1\n,2\n", "not a lattice"),
            ("x,T\n0,1\n1,warm\n", "in line 3: column `T`: `warm` is not a number"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(word), "{text:?}: {error}");
        }
    }
}
