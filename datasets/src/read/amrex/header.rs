//! The texts of a plotfile: `Header`, and the list of boxes of each level (`Cell_H`).

use crate::read::error::{At, BROKEN, Fault, TRUNCATED};
use crate::read::refinement::IndexBox;

pub(super) struct Level {
    pub(super) domain: IndexBox,
    pub(super) spacing: Vec<f64>,
    /// Cells of the next level along an axis of one cell.
    pub(super) ratio: i64,
    /// Path of its files within the folder, without their endings.
    pub(super) path: String,
}

pub(super) struct Header {
    pub(super) variables: Vec<String>,
    pub(super) axes: usize,
    pub(super) time: f64,
    pub(super) low: Vec<f64>,
    pub(super) levels: Vec<Level>,
    pub(super) warnings: Vec<String>,
}

/// A box and where its values are.
pub(super) struct StoredBox {
    pub(super) cells: IndexBox,
    pub(super) file: String,
    pub(super) offset: u64,
}

/// Lines with their numbers.
struct Lines<'a> {
    lines: std::str::Lines<'a>,
    number: u64,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str) -> Self {
        Lines { lines: text.lines(), number: 0 }
    }
    fn at(&self) -> At {
        At::Line(self.number)
    }
    fn next(&mut self, what: &str) -> Result<&'a str, Fault> {
        self.number += 1;
        let at = self.at();
        let ended = || Fault::new(at, format!("the file ends before {what}"), TRUNCATED);
        self.lines.next().map(str::trim).ok_or_else(ended)
    }
    fn fault(&self, what: &str, line: &str) -> Fault {
        let shown: String = line.chars().take(60).collect();
        Fault::new(self.at(), format!("{what}: `{shown}`"), BROKEN)
    }
    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, Fault> {
        let line = self.next(what)?;
        let first = line.split_whitespace().next().unwrap_or_default();
        first.parse().map_err(|_| self.fault(what, line))
    }
    /// At least `count` finite numbers in a line.
    fn numbers(&mut self, what: &str, count: usize) -> Result<Vec<f64>, Fault> {
        let line = self.next(what)?;
        let parse = |w: &str| w.parse::<f64>().ok().filter(|x| x.is_finite());
        let numbers: Option<Vec<f64>> = line.split_whitespace().map(parse).collect();
        numbers.filter(|n| n.len() >= count).ok_or_else(|| self.fault(what, line))
    }
}

/// All whole numbers in a text.
pub(super) fn integers(text: &str) -> Vec<i64> {
    let words = text.split(|c: char| !c.is_ascii_digit() && c != '-');
    words.filter_map(|w| w.parse().ok()).collect()
}

/// The box of three groups of `axes` numbers: low, high, and the kind, which is 0 for cells.
pub(super) fn index_box(numbers: &[i64], axes: usize) -> Option<IndexBox> {
    let groups = numbers.get(..3 * axes)?;
    let (mut low, mut high) = ([0; 3], [0; 3]);
    low[..axes].copy_from_slice(&groups[..axes]);
    high[..axes].copy_from_slice(&groups[axes..2 * axes]);
    let limit = i64::from(i32::MAX);
    let fits = |v: &[i64; 3]| v.iter().all(|i| i.abs() <= limit);
    let cells = groups[2 * axes..].iter().all(|k| *k == 0);
    let whole = (0..3).all(|a| low[a] <= high[a]);
    (fits(&low) && fits(&high) && cells && whole).then_some(IndexBox { low, high })
}

/// Reads `Header`.
pub(super) fn parse(text: &str) -> Result<Header, Fault> {
    let mut l = Lines::new(text);
    let version = l.next("the version")?;
    if !version.starts_with("HyperCLaw") && !version.starts_with("NavierStokes") {
        return Err(l.fault("the version is not HyperCLaw-V1.1", version));
    }
    let count: usize = l.number("the number of variables")?;
    let mut variables = Vec::new();
    for _ in 0..count {
        variables.push(l.next("names of variables")?.to_string());
    }
    let axes: usize = l.number("the number of axes")?;
    if !(1..=3).contains(&axes) {
        return Err(l.fault("the number of axes is not 1, 2 or 3", &axes.to_string()));
    }
    let time: f64 = l.number("the time")?;
    let finest: usize = l.number("the finest level")?;
    let low = l.numbers("the low corner", axes)?;
    l.numbers("the high corner", axes)?;
    let line = l.next("the ratios of refinement")?;
    let ratios = integers(line);
    if ratios.len() < finest || ratios.iter().any(|r| !(1..=1 << 20).contains(r)) {
        return Err(l.fault("the ratios of refinement", line));
    }
    let line = l.next("the domains")?;
    let domains = integers(line);
    let mut levels = Vec::new();
    for level in 0..=finest {
        let numbers = domains.get(3 * axes * level..).unwrap_or_default();
        let domain = index_box(numbers, axes).ok_or_else(|| l.fault("the domains", line))?;
        let ratio = ratios.get(level).copied().unwrap_or(1);
        levels.push(Level { domain, spacing: Vec::new(), ratio, path: String::new() });
    }
    l.next("the steps")?;
    for level in &mut levels {
        level.spacing = l.numbers("the sizes of cells", axes)?;
        if level.spacing.iter().any(|s| *s <= 0.0) {
            return Err(l.fault("the sizes of cells", "not above 0"));
        }
    }
    let system: i64 = l.number("the coordinate system")?;
    let mut warnings = Vec::new();
    match system {
        0 => {}
        1 => warnings.push("the coordinates are cylindrical: x is the radius".into()),
        _ => warnings.push("the coordinates are spherical: x is the radius".into()),
    }
    l.next("the width of the boundary")?;
    for level in &mut levels {
        let line = l.next("a level")?;
        let boxes = line.split_whitespace().nth(1).and_then(|n| n.parse::<u64>().ok());
        let boxes = boxes.ok_or_else(|| l.fault("a level", line))?;
        l.next("the step of a level")?;
        for _ in 0..boxes {
            for _ in 0..axes {
                l.next("corners of boxes")?;
            }
        }
        level.path = l.next("the path of a level")?.to_string();
    }
    Ok(Header { variables, axes, time, low, levels, warnings })
}

/// Reads the list of boxes of a level.
pub(super) fn boxes_of_level(text: &str, axes: usize) -> Result<Vec<StoredBox>, Fault> {
    let mut l = Lines::new(text);
    for what in ["the version", "the layout", "the number of variables", "the ghost cells"] {
        l.next(what)?;
    }
    let line = l.next("the number of boxes")?;
    let count = integers(line).first().copied().and_then(|n| u64::try_from(n).ok());
    let count = count.ok_or_else(|| l.fault("the number of boxes", line))?;
    let mut cells = Vec::new();
    for _ in 0..count {
        let line = l.next("boxes")?;
        let b = index_box(&integers(line), axes);
        cells.push(b.ok_or_else(|| l.fault("a box of cells", line))?);
    }
    l.next("the end of the boxes")?;
    l.next("the number of files")?;
    let mut boxes = Vec::new();
    for cells in cells {
        let line = l.next("files of boxes")?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let (Some(file), Some(offset)) = (words.get(1), words.get(2)) else {
            return Err(l.fault("the file of a box", line));
        };
        let offset = offset.parse().map_err(|_| l.fault("the file of a box", line))?;
        boxes.push(StoredBox { cells, file: (*file).to_string(), offset });
    }
    Ok(boxes)
}
