//! Tables of points in no order, as programs export them.

use super::Sample;
use std::fmt::Write as _;

/// Points in the unit square or cube whose coordinates are multiples of the golden ratio and the
/// like, each with a value that is missing now and then.
fn rows(count: u32, dimensions: usize, separator: char) -> String {
    let mut text = String::new();
    for i in 1..=count {
        for irrational in [0.618_034, 0.414_214, 0.732_051].iter().take(dimensions) {
            write!(text, "{:.4}{separator}", (f64::from(i) * irrational).fract()).unwrap();
        }
        match i % 7 {
            0 => writeln!(text, "nan").unwrap(),
            _ => writeln!(text, "{}", 1.0 + 0.1 * f64::from(i)).unwrap(),
        }
    }
    text
}

/// Tables with each separator: in a plane, in space, axisymmetric, with quotes, comments, a column
/// of text and sections.
pub(crate) fn all() -> Vec<Sample> {
    let post =
        format!("[Name]\nPlane 1\n\n[Data]\nX [ m ], Y [ m ], T [ K ]\n{}", rows(40, 2, ','));
    let faces = post + "\n[Faces]\n0, 1, 2\n";
    let regions: Vec<String> =
        rows(40, 3, ';').lines().map(|l| format!("\"a \"\"region\"\"\";{l}")).collect();
    let quoted = format!("region;\"x\";\"y\";\"z\";\"rho\"\n{}\n", regions.join("\n"));
    [
        ("a.csv", faces),
        ("b.csv", quoted),
        ("a.tsv", format!("Radial Coordinate\tX\tT\n{}", rows(40, 2, '\t'))),
        ("b.tsv", format!("x\ty\tT\n{}\t\t\n{}", "0.5\t0.5\t1\n0.5\t0.5\t2\n", rows(20, 2, '\t'))),
        ("a.txt", format!("# made by hand\n# x y z rho\n{}", rows(40, 3, ' '))),
    ]
    .map(|(name, text)| (name, text.into_bytes()))
    .into()
}
