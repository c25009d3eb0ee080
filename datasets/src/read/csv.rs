//! Tables as text: a line of column names, then one row per line. Cells are separated by commas, or
//! by semicolons or tabs if the header uses them instead, or by blanks if it has none of these.
//!
//! Cells may be quoted (`"a, b"`, a quote inside is doubled) but not contain line breaks. Empty
//! lines and lines that begin with `#` or `%` are skipped; without another header, the last of them
//! before the numbers is one (NumPy, COMSOL). In exports of CFD-Post, the table is the section
//! `[Data]`. Callers request columns by name, so their order does not matter.
//!
//! The lexer is our own because the crate csv does not reject broken quotes: see the book,
//! "Decisions and their reasons".

use super::ReadError;
use super::error::{At, Fault, read_bytes};
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "CSV";

/// A table with named columns. It holds the text of the file once; cells are found in it when they
/// are asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct CsvTable {
    path: PathBuf,
    separator: char,
    header: String,
    columns: Vec<String>,
    text: String,
    rows: Vec<Row>,
}

/// A row: the number of its line, and where that is in the text.
#[derive(Debug, Clone, PartialEq)]
struct Row {
    line: u64,
    text: Range<usize>,
}

/// Reads a table.
pub fn read(path: &Path) -> Result<CsvTable, ReadError> {
    parse(path, read_bytes(path)?).map_err(|f| f.in_file(path, FORMAT))
}

/// Reads a table from its bytes; `path` is used in messages only.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<CsvTable, ReadError> {
    parse(path, bytes.to_vec()).map_err(|f| f.in_file(path, FORMAT))
}

fn parse(path: &Path, bytes: Vec<u8>) -> Result<CsvTable, Fault> {
    let whole = String::from_utf8(bytes).map_err(|e| {
        let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = before.iter().filter(|&&b| b == b'\n').count() as u64 + 1;
        Fault::new(
            At::Line(line),
            "bytes that are not text (UTF-8)",
            "save the table as UTF-8 text",
        )
    })?;
    let text = whole.strip_prefix('\u{feff}').unwrap_or(&whole);
    let numbered = || text.lines().enumerate().map(|(i, l)| (i as u64 + 1, l));
    let is_section = |l: &str| l.trim().starts_with('[') && l.trim().ends_with(']');
    let data = numbered().find(|(_, l)| l.trim().eq_ignore_ascii_case("[data]"));
    let (start, has_sections) = data.map_or((0, false), |(line, _)| (line, true));
    let numbered = numbered()
        .skip(start as usize)
        .take_while(move |(_, l)| !(has_sections && is_section(l)))
        .filter(|(_, l)| !l.trim().is_empty());
    let is_comment = |l: &str| l.trim_start().starts_with(COMMENT);
    let mut lines = numbered.clone().filter(|(_, l)| !is_comment(l)).peekable();

    // The header.
    let Some(&(first_line, first)) = lines.peek() else {
        let cure = "the first line must name the columns, such as `x,y,value`";
        return Err(Fault::new(At::Line(1), "there are no lines with content", cure));
    };
    let comment = numbered.take_while(|(line, _)| *line < first_line).last();
    let (header_line, header, separator) = match comment.and_then(|c| header_in(c.1, first)) {
        Some((header, separator)) => (first_line - 1, header, separator),
        None => {
            lines.next();
            let second = lines.peek().map(|l| l.1);
            (first_line, first, separator_of(first, second))
        }
    };
    let columns = match header_line == first_line {
        true => cells(header, separator).map_err(|what| unclosed(header_line, what))?,
        false => cells(header, separator_of(header, None)).unwrap_or_default(),
    };
    for (i, name) in columns.iter().enumerate() {
        let at = At::Line(header_line);
        if name.is_empty() {
            return Err(Fault::new(
                at,
                format!("column {} has no name", i + 1),
                "name every column",
            ));
        }
        if columns[..i].contains(name) {
            return Err(Fault::new(
                at,
                format!("two columns are called `{name}`"),
                "rename one of them",
            ));
        }
    }
    if columns.iter().all(|c| c.parse::<f64>().is_ok()) {
        let cure = "put a line with the names of the columns above it";
        return Err(Fault::new(
            At::Line(header_line),
            "numbers where the names of the columns should be",
            cure,
        ));
    }

    // The rows.
    let mut rows = Vec::new();
    for (line, row) in lines {
        let mut count = 0;
        each_cell(row, separator, |_| count += 1).map_err(|what| unclosed(line, what))?;
        if count != columns.len() {
            let what = format!("{count} cells, but there are {} columns", columns.len());
            let cure = format!("give every row one cell per column, separated by {separator:?}");
            return Err(Fault::new(At::Line(line), what, cure));
        }
        // A line is a part of the text.
        let start = row.as_ptr() as usize - whole.as_ptr() as usize;
        rows.push(Row { line, text: start..start + row.len() });
    }
    let header = header.to_string();
    Ok(CsvTable { path: path.to_path_buf(), separator, header, columns, rows, text: whole })
}

/// Characters that begin a comment.
const COMMENT: [char; 2] = ['#', '%'];

/// The separator of a header; the next row tells whether blanks are one.
fn separator_of(header: &str, next: Option<&str>) -> char {
    let count = |line: &str, separator| cells(line, separator).map_or(0, |c| c.len());
    let fits = |separator| {
        next.is_none_or(|row| count(row, separator) == count(header, separator))
            && count(header, separator) > 1
    };
    match [',', ';', '\t'].into_iter().find(|&c| header.contains(c)) {
        // Columns may be aligned with tabs in the header and with blanks below.
        Some('\t') if !fits('\t') && fits(' ') => ' ',
        Some(mark) => mark,
        None if fits(' ') => ' ',
        None => ',',
    }
}

/// The names in a comment before a row of numbers, and the separator of the row, if the comment has
/// a name for each.
fn header_in<'a>(comment: &'a str, row: &str) -> Option<(&'a str, char)> {
    let separator = separator_of(row, None);
    let numbers = cells(row, separator).ok()?;
    let header = comment.trim_start().trim_start_matches(COMMENT).trim();
    let names = cells(header, separator_of(header, None)).ok()?;
    let all_numbers = numbers.iter().all(|n| n.parse::<f64>().is_ok());
    let fits = all_numbers && names.len() == numbers.len() && numbers.len() > 1;
    fits.then_some((header, separator))
}

fn unclosed(line: u64, cell: String) -> Fault {
    let shown: String = cell.chars().take(40).collect();
    let what = format!("the quoted cell `{shown}` has no closing quote, or text after it");
    Fault::new(At::Line(line), what, "close the quote on the same line; double the quotes inside")
}

/// The cells of a line without surrounding space and quotes; `Err` holds the cell whose quotes are
/// invalid.
fn cells(line: &str, separator: char) -> Result<Vec<String>, String> {
    let mut out = Vec::new();
    each_cell(line, separator, |cell| out.push(cell.into_owned()))?;
    Ok(out)
}

/// Calls `f` with each cell of a line; see [`cells`].
fn each_cell<'a>(
    line: &'a str,
    separator: char,
    mut f: impl FnMut(Cow<'a, str>),
) -> Result<(), String> {
    if separator == ' ' {
        return each_blank_cell(line, f);
    }
    let mut rest = line;
    loop {
        // White space that is not itself the separator (a tab may be).
        let start = rest.trim_start_matches(|c: char| c.is_whitespace() && c != separator);
        if let Some(quoted) = start.strip_prefix('"') {
            let (cell, after) = closed(quoted).ok_or_else(|| quoted.replace("\"\"", "\""))?;
            let after = after.trim_start_matches(|c: char| c.is_whitespace() && c != separator);
            match after.strip_prefix(separator) {
                Some(next) => rest = next,
                None if after.is_empty() => {
                    f(cell);
                    return Ok(());
                }
                None => return Err(cell.into_owned()),
            }
            f(cell);
        } else {
            match rest.split_once(separator) {
                Some((cell, next)) => {
                    f(cell.trim().into());
                    rest = next;
                }
                None => {
                    f(rest.trim().into());
                    return Ok(());
                }
            }
        }
    }
}

/// The cell up to the quote that closes it, and what is after that; `None` without one.
fn closed(quoted: &str) -> Option<(Cow<'_, str>, &str)> {
    let mut from = 0;
    loop {
        let end = from + quoted[from..].find('"')?;
        if !quoted[end + 1..].starts_with('"') {
            let cell = &quoted[..end];
            let cell = if from == 0 { cell.into() } else { cell.replace("\"\"", "\"").into() };
            return Some((cell, &quoted[end + 1..]));
        }
        from = end + 2;
    }
}

/// As [`each_cell`], where blanks separate.
fn each_blank_cell<'a>(line: &'a str, mut f: impl FnMut(Cow<'a, str>)) -> Result<(), String> {
    let mut rest = line.trim();
    while !rest.is_empty() {
        let (cell, next) = match rest.strip_prefix('"') {
            Some(quoted) => quoted.split_once('"').ok_or_else(|| quoted.to_string())?,
            None => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        if !next.is_empty() && !next.starts_with(char::is_whitespace) {
            return Err(cell.to_string());
        }
        f(cell.into());
        rest = next.trim_start();
    }
    Ok(())
}

impl CsvTable {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
    /// Names of the columns, in file order.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }
    /// The separator between cells; a blank stands for any number of blanks and tabs.
    pub fn separator(&self) -> char {
        self.separator
    }
    /// The header as written in the file.
    pub fn header_text(&self) -> &str {
        &self.header
    }
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }
    /// True if there is only a header.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
    /// Row `row` as written in the file; panics when out of range.
    pub fn row_text(&self, row: usize) -> &str {
        &self.text[self.rows[row].text.clone()]
    }
    /// Line number of row `row` in the file, from 1; panics when out of range.
    pub fn line(&self, row: usize) -> u64 {
        self.rows[row].line
    }
    /// A cell as text; panics when out of range. It is found by reading its row.
    pub fn cell(&self, row: usize, column: usize) -> Cow<'_, str> {
        let mut found = None;
        let mut at = 0;
        self.each_cell(row, |cell| {
            if at == column {
                found = Some(cell);
            }
            at += 1;
        });
        found.expect("the column exists")
    }

    /// Calls `f` with each cell of a row.
    pub(crate) fn each_cell<'a>(&'a self, row: usize, f: impl FnMut(Cow<'a, str>)) {
        // Rows whose quotes are not closed were refused when the table was read.
        let _ = each_cell(self.row_text(row), self.separator, f);
    }

    /// Index of the column with this name. Case matters only if it distinguishes columns.
    pub fn column_index(&self, name: &str) -> Result<usize, ReadError> {
        if let Some(i) = self.columns.iter().position(|c| c == name) {
            return Ok(i);
        }
        let mut same =
            self.columns.iter().enumerate().filter(|(_, c)| c.eq_ignore_ascii_case(name));
        if let (Some((i, _)), None) = (same.next(), same.next()) {
            return Ok(i);
        }
        let names = self.columns.iter().map(|c| format!("`{c}`")).collect::<Vec<_>>().join(", ");
        let what = format!("there is no column `{name}`; there are {names}");
        let cure = format!("rename a column to `{name}`, or add it");
        Err(Fault::new(At::Field("the header".into()), what, cure).in_file(&self.path, FORMAT))
    }

    /// The numbers of a column. A cell that is not a finite number gives an error with its line,
    /// column and content.
    ///
    /// ```
    /// use datasets::read::csv;
    /// let table = csv::read_from_bytes("t.csv".as_ref(), b"y, x\n1.5, 2\n-3e2, 4\n")?;
    /// assert_eq!(table.numbers("x")?, [2.0, 4.0]);
    /// assert_eq!(table.numbers("y")?, [1.5, -300.0]);
    /// let error = table.numbers("z").unwrap_err().to_string();
    /// assert!(error.contains("no column `z`; there are `y`, `x`"));
    /// # Ok::<(), datasets::read::ReadError>(())
    /// ```
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, ReadError> {
        let column = self.column_index(name)?;
        let number = |row| {
            let cell = self.cell(row, column);
            number(&cell).ok_or_else(|| self.not_a_number(row, column, &cell))
        };
        (0..self.len()).map(number).collect()
    }

    /// The numbers of several columns, by one reading of each row. Cells for which `is_missing` is
    /// true are NaN.
    pub(crate) fn columns_of_numbers(
        &self,
        wanted: &[usize],
        is_missing: impl Fn(&str) -> bool,
    ) -> Result<Vec<Vec<f64>>, ReadError> {
        let mut out = vec![Vec::with_capacity(self.len()); wanted.len()];
        let mut of_column = vec![None; self.columns.len()];
        wanted.iter().enumerate().for_each(|(i, &column)| of_column[column] = Some(i));
        for row in 0..self.len() {
            let (mut column, mut fault) = (0, None);
            self.each_cell(row, |cell| {
                if let Some(i) = of_column[column] {
                    let value = match number(&cell) {
                        _ if is_missing(&cell) => f64::NAN,
                        Some(value) => value,
                        None => {
                            fault.get_or_insert((column, cell));
                            f64::NAN
                        }
                    };
                    out[i].push(value);
                }
                column += 1;
            });
            if let Some((column, cell)) = fault {
                return Err(self.not_a_number(row, column, &cell));
            }
        }
        Ok(out)
    }

    fn not_a_number(&self, row: usize, column: usize, cell: &str) -> ReadError {
        let cure = if cell.is_empty() {
            "fill it in, or remove the row"
        } else if cell.contains(',') {
            "write the number with a decimal point"
        } else {
            "write a number, without its unit"
        };
        self.fault(self.line(row), &self.columns[column], cell, "is not a number", cure)
    }

    /// Makes an error about the value in a cell, for checks by callers.
    pub fn cell_error(&self, row: usize, column: &str, what: &str, cure: &str) -> ReadError {
        let index = self.columns.iter().position(|c| c.eq_ignore_ascii_case(column));
        let (line, cell) = match (self.rows.get(row), index) {
            (Some(r), Some(i)) => (r.line, self.cell(row, i)),
            (Some(r), None) => (r.line, "".into()),
            (None, _) => (0, "".into()),
        };
        self.fault(line, column, &cell, what, cure)
    }

    fn fault(&self, line: u64, column: &str, cell: &str, what: &str, cure: &str) -> ReadError {
        let shown: String = cell.chars().take(40).collect();
        let what = format!("column `{column}`: `{shown}` {what}");
        Fault::new(At::Line(line), what, cure).in_file(&self.path, FORMAT)
    }
}

/// The finite number that a cell is.
fn number(cell: &str) -> Option<f64> {
    cell.parse::<f64>().ok().filter(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table(text: &str) -> Result<CsvTable, String> {
        read_from_bytes(Path::new("t.csv"), text.as_bytes()).map_err(|e| e.to_string())
    }

    #[test]
    fn comments_quotes_separators_and_line_ends() {
        let t = table(
            "\u{feff}# made by hand\r\n\"a;1\";B ; c\r\n\r\n\"say \"\"hi\"\"\" ;2; 3 \r\n#x\r\n \
             ;4;\"5\"",
        )
        .unwrap();
        assert_eq!(
            (t.columns(), t.separator(), t.len()),
            (&["a;1".into(), "B".into(), "c".into()][..], ';', 2)
        );
        assert_eq!((&*t.cell(0, 0), &*t.cell(1, 0)), ("say \"hi\"", ""));
        assert_eq!((t.line(0), t.line(1)), (4, 6));
        assert_eq!(t.numbers("b").unwrap(), [2.0, 4.0]);
        assert_eq!(t.numbers("c").unwrap(), [3.0, 5.0]);
        assert_eq!(table("x\n1\n").unwrap().numbers("x").unwrap(), [1.0]);
        assert_eq!(table("x\ty\n1\t2\n").unwrap().numbers("y").unwrap(), [2.0]);
        assert_eq!(table("x\ty\n\t2\n").unwrap().cell(0, 1), "2");
    }

    #[test]
    fn blanks_comments_with_names_and_sections() {
        let t = table("nodenumber  x-coordinate\ty-coordinate\n 1   0.5 -2e-1\n2 1 3 \n").unwrap();
        assert_eq!((t.columns()[1].as_str(), t.separator(), t.len()), ("x-coordinate", ' ', 2));
        let t = table("nodenumber  x y\n 1   0.5 -2e-1\n2\t1 3 \n").unwrap();
        assert_eq!((t.columns().len(), t.separator(), t.len()), (3, ' ', 2));
        assert_eq!(t.numbers("y").unwrap(), [-0.2, 3.0]);
        let t = table("\"X (m)\" \"T (K)\"\n0 300\n").unwrap();
        assert_eq!(t.columns(), ["X (m)", "T (K)"]);
        // NumPy's and COMSOL's header is a comment.
        for text in ["# x y rho\n1 2 3\n", "% made\n%  x,y, rho\n1;2;3\n", "#x y rho\n1,2,3\n"] {
            let t = table(text).unwrap();
            assert_eq!((t.columns(), t.len()), (&["x", "y", "rho"].map(String::from)[..], 1));
        }
        let t = table("[Name]\nPlane 1\n\n[Data]\nX [ m ], T [ K ]\n0,1\n\n[Faces]\n0, 1, 2\n")
            .unwrap();
        assert_eq!((t.columns()[0].as_str(), t.len(), t.line(0)), ("X [ m ]", 1, 6));
        // One column whose name has a blank.
        assert_eq!(table("the value\n1\n").unwrap().columns(), ["the value"]);
    }

    #[test]
    fn errors_name_file_line_column_value_and_cure() {
        let t = table("a,b\n1,2\n3,warm\n").unwrap();
        let text = t.numbers("b").unwrap_err().to_string();
        assert!(
            text.contains("t.csv")
                && text.contains("in line 3: column `b`: `warm` is not a number; write a number"),
            "{text}"
        );
        for (bad, word) in [
            ("", "no lines"),
            ("# only this\n", "no lines"),
            ("1,2\n3,4\n", "names of the columns"),
            ("a,a\n", "two columns"),
            ("a,\n", "column 2 has no name"),
            ("a,b\n1\n", "in line 2: 1 cells, but there are 2 columns"),
            ("a,b\n1,\"2\n", "no closing quote"),
            ("a,b\n1,\"2\"x\n", "no closing quote"),
            ("a,b\n1,\"2\"5\n", "no closing quote"),
            ("a;b\n1;2,5\n", "decimal point"),
            ("a,b\n1,\n", "fill it in"),
            ("a,b\n1,inf\n", "not a number"),
        ] {
            let text = match table(bad) {
                Err(e) => e,
                Ok(t) => t.numbers("b").unwrap_err().to_string(),
            };
            assert!(text.contains(word), "{bad:?}: {text}");
        }
        assert!(
            read_from_bytes(Path::new("t.csv"), b"a\n\xff\n")
                .unwrap_err()
                .to_string()
                .contains("in line 2")
        );
        // Case does not matter unless it distinguishes columns.
        assert!(table("A,a\n1,2\n").unwrap().numbers("a").is_ok());
        assert!(table("Ab,aB\n1,2\n").unwrap().numbers("ab").is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_table_or_an_error(
            bytes in proptest::collection::vec(any::<u8>(), 0..200)
        ) {
            if let Ok(t) = read_from_bytes(Path::new("t.csv"), &bytes) {
                for name in t.columns() {
                    let _ = t.numbers(name);
                }
            }
        }

        #[test]
        fn any_text_of_csv_characters_is_a_table_or_an_error(text in "[a-b\",;\t\n\r# \
                                                                      0-9.e-]{0,120}") {
            if let Ok(t) = table(&text) {
                let columns = t.columns().len();
                let fits = |r| (0..columns).all(|c| t.cell(r, c).len() <= text.len());
                prop_assert!((0..t.len()).all(fits));
            }
        }

        #[test]
        fn what_is_written_is_read_in_any_order_of_columns(
            rows in proptest::collection::vec(proptest::collection::vec(-1e30f64..1e30, 3), 0..20),
            order in Just(vec![0usize, 1, 2]).prop_shuffle(),
            separator in prop_oneof![Just(','), Just(';'), Just('\t')],
            quoted: bool,
        ) {
            let names = ["alpha", "beta", "gamma"];
            let join = |cells: Vec<String>| {
                let cells = cells.iter().map(|c| if quoted { format!("\"{c}\"") } else { c.clone() });
                cells.collect::<Vec<_>>().join(&separator.to_string())
            };
            let mut text = join(order.iter().map(|&c| names[c].to_string()).collect()) + "\n";
            for r in &rows {
                text += &(join(order.iter().map(|&c| format!("{:e}", r[c])).collect()) + "\n");
            }
            let t = table(&text).unwrap();
            for (c, name) in names.iter().enumerate() {
                let expected: Vec<f64> = rows.iter().map(|r| r[c]).collect();
                prop_assert_eq!(t.numbers(name).unwrap(), expected);
            }
        }

        #[test]
        fn quoted_text_survives(cells in proptest::collection::vec("[ -~]{0,12}", 1..5)) {
            let names: Vec<String> = (0..cells.len()).map(|i| format!("c{i}")).collect();
            let row: Vec<String> = cells.iter().map(|c| format!("\"{}\"", c.replace('"', "\"\""))).collect();
            let t = table(&format!("{}\n{}\n", names.join(","), row.join(","))).unwrap();
            for (i, c) in cells.iter().enumerate() {
                prop_assert_eq!(&*t.cell(0, i), c.as_str());
            }
        }
    }
}
