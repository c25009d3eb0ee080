//! Computes the index for tables of conditions, as `schlieren index --csv FILE` does.

use super::IndexError;
use super::ciddor::{Ciddor, MoistAir};
use datasets::read::ReadError;
use datasets::read::csv::{self, CsvTable};
use std::io::{self, Write};
use std::path::Path;

/// The columns that a table must have, in any order. Other columns are kept.
pub const COLUMNS: [&str; 5] = ["lambda_um", "T_C", "p_Pa", "RH_frac", "CO2_ppm"];
/// The column that is added to the table.
pub const RESULT: &str = "n_minus_1";

/// A table with its results.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexTable {
    table: CsvTable,
    n_minus_1: Vec<f64>,
    warnings: Vec<String>,
}

/// Computes n − 1 by Ciddor's equation for every row of the file.
pub fn compute(path: &Path) -> Result<IndexTable, ReadError> {
    compute_table(csv::read(path)?)
}

/// Computes n − 1 by Ciddor's equation for every row of the table.
///
/// ```
/// use schlieren::index::csv::{IndexTable, compute_table};
/// let text = b"T_C,p_Pa,lambda_um,RH_frac,CO2_ppm\n20,101325,0.633,0,450\n";
/// let table = datasets::read::csv::read_from_bytes("t.csv".as_ref(), text)?;
/// let results: IndexTable = compute_table(table)?;
/// let mut out = Vec::new();
/// results.write(&mut out).unwrap();
/// assert_eq!(out, b"T_C,p_Pa,lambda_um,RH_frac,CO2_ppm,n_minus_1\n20,101325,0.633,0,450,2.71799831635e-4\n");
/// # Ok::<(), datasets::read::ReadError>(())
/// ```
pub fn compute_table(table: CsvTable) -> Result<IndexTable, ReadError> {
    if table.columns().iter().any(|c| c == RESULT) {
        return Err(table.cell_error(
            0,
            RESULT,
            "is in a column that this program adds",
            "rename the column",
        ));
    }
    let [wavelength, temperature, pressure, humidity, co2] =
        COLUMNS.map(|name| table.numbers(name));
    let (wavelength, temperature, pressure) = (wavelength?, temperature?, pressure?);
    let (humidity, co2) = (humidity?, co2?);

    let mut n_minus_1 = Vec::with_capacity(table.len());
    // Per quantity: the number of rows out of range, and a warning for the first.
    let mut outside: Vec<(&'static str, usize, String)> = Vec::new();
    for row in 0..table.len() {
        let air = MoistAir {
            temperature_c: temperature[row],
            pressure_pa: pressure[row],
            relative_humidity: humidity[row],
            co2_ppm: co2[row],
        };
        let ciddor = Ciddor::new(wavelength[row]).map_err(|e| refused(&table, row, &e))?;
        n_minus_1.push(ciddor.n_minus_1(&air).map_err(|e| refused(&table, row, &e))?);
        for o in ciddor.out_of_range(&air) {
            match outside.iter_mut().find(|x| x.0 == o.quantity) {
                Some(seen) => seen.1 += 1,
                None => outside.push((o.quantity, 1, format!("line {}: {o}", table.line(row)))),
            }
        }
    }
    let warnings = outside
        .into_iter()
        .map(|(_, count, first)| match count {
            1 => first,
            more => format!("{first} ({more} rows)"),
        })
        .collect();
    Ok(IndexTable { table, n_minus_1, warnings })
}

/// Converts an error of the formula to an error of the cell that causes it.
fn refused(table: &CsvTable, row: usize, error: &IndexError) -> ReadError {
    let IndexError::Impossible { quantity, reason, cure, .. } = error else {
        return table.cell_error(row, COLUMNS[0], &error.to_string(), "check the row");
    };
    let column = match *quantity {
        "wavelength" => COLUMNS[0],
        "temperature" => COLUMNS[1],
        "pressure" => COLUMNS[2],
        "relative humidity" => COLUMNS[3],
        _ => COLUMNS[4],
    };
    table.cell_error(row, column, reason, cure)
}

impl IndexTable {
    /// The results, row by row.
    pub fn n_minus_1(&self) -> &[f64] {
        &self.n_minus_1
    }
    /// Warnings about rows outside the range of the formula, one line per quantity.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }
    /// Writes the table with the result as the last column, to 12 significant digits. Comments of
    /// the file are dropped.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let separator = self.table.separator();
        writeln!(out, "{}{separator}{RESULT}", self.table.header_text().trim_end())?;
        for (row, n) in self.n_minus_1.iter().enumerate() {
            writeln!(out, "{}{separator}{n:.11e}", self.table.row_text(row).trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table(text: &str) -> CsvTable {
        csv::read_from_bytes(Path::new("conditions.csv"), text.as_bytes()).unwrap()
    }

    #[test]
    fn errors_name_file_line_column_value_and_cure() {
        let header = "lambda_um,T_C,p_Pa,RH_frac,CO2_ppm\n0.5,20,101325,0,450\n";
        for (row, column, value, cure) in [
            ("633,20,101325,0,450x", "CO2_ppm", "450x", "without its unit"),
            ("0.05,20,101325,0,450", "lambda_um", "0.05", "in micrometres"),
            ("0.5,-300,101325,0,450", "T_C", "-300", "degrees Celsius"),
            ("0.5,20,-5,0,450", "p_Pa", "-5", "absolute pressure"),
            ("0.5,20,101325,50,450", "RH_frac", "50", "50 % is 0.5"),
            ("0.5,20,101325,0,-1", "CO2_ppm", "-1", "ppm"),
        ] {
            let text = compute_table(table(&format!("{header}{row}\n"))).unwrap_err().to_string();
            for word in ["conditions.csv", "line 3", column, value, cure] {
                assert!(text.contains(word), "{word} is not in: {text}");
            }
        }
        let text = compute_table(table("lambda_um,T_C,p_Pa,RH_frac\n")).unwrap_err().to_string();
        assert!(text.contains("no column `CO2_ppm`"), "{text}");
        let text =
            compute_table(table("lambda_um,T_C,p_Pa,RH_frac,CO2_ppm,n_minus_1\n1,1,1,0,1,1\n"))
                .unwrap_err();
        assert!(text.to_string().contains("rename the column"));
    }

    #[test]
    fn rows_out_of_range_are_counted_and_the_first_is_named() {
        let rows = "0.5,20,101325,0,450\n0.5,500,101325,0,450\n0.5,600,101325,0,450\n1.7,20,101325,0,450\n";
        let a =
            compute_table(table(&format!("lambda_um,T_C,p_Pa,RH_frac,CO2_ppm\n{rows}"))).unwrap();
        assert_eq!((a.n_minus_1().len(), a.warnings().len()), (4, 2));
        assert!(
            a.warnings()[0].starts_with("line 3: ") && a.warnings()[0].ends_with("(2 rows)"),
            "{:?}",
            a.warnings()
        );
        assert!(a.warnings()[1].starts_with("line 5: ") && a.warnings()[1].contains("1700 nm"));
    }

    proptest! {
        #[test]
        fn the_order_of_columns_and_extra_columns_change_nothing(
            rows in proptest::collection::vec(
                (0.3f64..1.69, -40f64..100.0, 2e5f64..3e5, 0f64..1.0, 0f64..2000.0),
                1..8,
            ),
            order in Just(vec![0usize, 1, 2, 3, 4, 5]).prop_shuffle(),
        ) {
            let names = ["lambda_um", "T_C", "p_Pa", "RH_frac", "CO2_ppm", "note"];
            let line = |cells: [String; 6]| order.iter().map(|&c| cells[c].clone()).collect::<Vec<_>>().join(",") + "\n";
            let mut text = line(names.map(String::from));
            for r in &rows {
                text += &line([r.0.to_string(), r.1.to_string(), r.2.to_string(), r.3.to_string(), r.4.to_string(), "x".into()]);
            }
            let a = compute_table(table(&text)).unwrap();
            let mut out = Vec::new();
            a.write(&mut out).unwrap();
            let printed = csv::read_from_bytes(Path::new("out.csv"), &out).unwrap().numbers(RESULT).unwrap();
            for (i, r) in rows.iter().enumerate() {
                let air = MoistAir {
                    temperature_c: r.1,
                    pressure_pa: r.2,
                    relative_humidity: r.3,
                    co2_ppm: r.4,
                };
                let expected = Ciddor::new(r.0).unwrap().n_minus_1(&air).unwrap();
                prop_assert_eq!(a.n_minus_1()[i], expected);
                // 12 significant digits.
                prop_assert!((printed[i] / expected - 1.0).abs() <= 5e-12);
            }
        }
    }
}
