//! Converts tables of points in no order to meshes: triangles in a plane, tetrahedra in space.

use super::ReadError;
use super::csv::{CsvTable, FORMAT};
use super::csv_columns::{Columns, Numbers, array};
use super::error::{At, Fault};
use crate::delaunay::gaps::{self, Gaps};
use crate::delaunay::snap::Snapped;
use crate::delaunay::{Degenerate, tetrahedra, triangles};
use crate::model::{Attributes, Cells, Dataset, Points, UnstructuredGrid};
use crate::plane_of_points::{FLATNESS, Lie, lie};
use glam::{DMat3, DVec3};

/// Default of the width of a gap ([`dataset`]).
pub const GAP_SPACINGS: f64 = gaps::SPACINGS;

/// Points that are off a plane by less than this part of their box were probably meant to be in
/// one.
const NEARLY_FLAT: f64 = 0.02;

/// VTK's types of a triangle and a tetrahedron.
const TRIANGLE: u8 = 5;
const TETRAHEDRON: u8 = 10;

/// How a table of points became a mesh.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct PointsReport {
    /// Points of the mesh.
    pub points: usize,
    /// 2 in a plane, 3 in space.
    pub dimensions: usize,
    /// The normal of their plane, of length 1, where it slants to the axes.
    pub slanting_normal: Option<[f64; 3]>,
    /// Distance of the point that is farthest from a plane that slants to the axes, by the longest
    /// side of the points' box. In a plane up to 1e-4; zero in a plane of two axes.
    pub off_plane: f64,
    /// Rows left out because a coordinate is missing.
    pub rows_without_place: usize,
    /// Rows at the place of another one; the point has their mean.
    pub joined_rows: usize,
    /// Those with values that differ from the other row's.
    pub joined_with_other_values: usize,
    /// Missing values, which are NaN in the mesh.
    pub missing_values: usize,
    /// Triangles or tetrahedra of the mesh.
    pub cells: usize,
    /// Cells of the convex hull that are none of the mesh: they bridge a place without points.
    pub gap_cells: usize,
    /// Points that are corners of such cells only.
    pub lonely_points: usize,
}

/// Converts a table to an unstructured grid by Delaunay triangulation. Cells that bridge a place
/// without points are left out where it is `gap` times as wide as the cells around it; infinity
/// keeps the whole convex hull. All columns of numbers become point arrays. Points are in the order
/// of a Hilbert curve, so the mesh does not depend on the order of the rows. Points of a plane that
/// slants to the axes become triangles in it.
///
/// # Errors
/// If there is no x, a cell is not a number, or all points lie on a line.
///
/// ```
/// use datasets::read::{csv, csv_points};
/// let text = b"x y T\n0 0 1\n2 0 2\n0 2 3\n1 1 4\n1 -1 5\n";
/// let table = csv::read_from_bytes("t.csv".as_ref(), text)?;
/// let (data, report) = csv_points::dataset(&table, csv_points::GAP_SPACINGS)?;
/// assert_eq!((report.points, report.dimensions, report.cells), (5, 2, 3));
/// assert_eq!(data.kind(), "UnstructuredGrid");
/// # Ok::<(), datasets::read::ReadError>(())
/// ```
pub fn dataset(table: &CsvTable, gap: f64) -> Result<(Dataset, PointsReport), ReadError> {
    of_numbers(Columns::find(table)?.numbers(table)?, gap)
}

/// As [`dataset`], of the numbers of a table. Each copy of the points ends where the next is made:
/// tables of millions of rows are common.
pub(crate) fn of_numbers(numbers: Numbers, gap: f64) -> Result<(Dataset, PointsReport), ReadError> {
    let Numbers { path, coordinates, mut values } = numbers;
    let mut report = PointsReport::default();

    // Rows with a place.
    let at = |row: usize| [0, 1, 2].map(|a: usize| coordinates[a][row]);
    let has_place = |row: &usize| at(*row).iter().all(|x| x.is_finite());
    let count = coordinates[0].len();
    let rows: Vec<usize> = (0..count).filter(has_place).collect();
    report.rows_without_place = count - rows.len();
    let mut points: Vec<[f64; 3]> = rows.iter().map(|r| at(*r)).collect();
    if rows.len() < count {
        values.iter_mut().for_each(|(_, v)| *v = rows.iter().map(|r| v[*r]).collect());
    }
    drop((coordinates, rows));

    let fault = |what: String, cure: &str| {
        Fault::new(At::Field("the table".into()), what, cure).in_file(&path, FORMAT)
    };
    if u32::try_from(points.len()).is_err() {
        return Err(fault(format!("{} points are too many", points.len()), "thin them out"));
    }
    let lie = lie(points.iter().copied().map(DVec3::from));
    let flat = match lie {
        Lie::Across(axis) => {
            let low = points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
            points.iter_mut().for_each(|p| p[axis] = low);
            Some((axis, DMat3::IDENTITY))
        }
        Lie::Slanting(plane) => {
            points.iter_mut().for_each(|p| *p = plane.project(DVec3::from(*p)).to_array());
            report.slanting_normal = Some(plane.normal.to_array());
            report.off_plane = plane.off;
            Some(plane.turn())
        }
        Lie::Space { off } => {
            report.off_plane = off;
            None
        }
        Lie::Line => None,
    };
    report.dimensions = if flat.is_some() { 2 } else { 3 };
    let turned: Vec<[f64; 3]> = match flat {
        // The axis across the plane comes last, and has one coordinate.
        Some((axis, turn)) => {
            let in_plane = |p: &[f64; 3]| {
                let p = turn * DVec3::from(*p);
                [p[(axis + 1) % 3], p[(axis + 2) % 3], 0.0]
            };
            points.iter().map(in_plane).collect()
        }
        None => points.clone(),
    };
    let snapped = Snapped::new(&turned);
    drop(turned);
    let joined = join(&snapped, points, values, &mut report);

    // The cells.
    let cells = match (lie, flat) {
        (Lie::Line, _) => Err(Degenerate::Line),
        (_, Some(_)) => triangles(&snapped).map(|c| kept(&joined.places, &c, gap, &mut report)),
        _ => tetrahedra(&snapped).map(|c| kept(&joined.places, &c, gap, &mut report)),
    };
    // Points that are in no plane are in none as integers either.
    let cells = cells.map_err(|(Degenerate::Line | Degenerate::Plane)| {
        fault(
            format!("{} different points, all on one line", snapped.len()),
            "give points of a plane or of space, three or more",
        )
    })?;
    let mut has_cell = vec![false; snapped.len()];
    cells.connectivity().iter().for_each(|p| has_cell[*p as usize] = true);
    report.points = snapped.len();
    report.lonely_points = has_cell.iter().filter(|c| !**c).count();

    let kind = if flat.is_some() { TRIANGLE } else { TETRAHEDRON };
    let attributes = Attributes { point: joined.arrays, ..Attributes::default() };
    let grid = UnstructuredGrid {
        points: Points::F64(joined.places.iter().map(|p| p.to_array()).collect()),
        types: vec![kind; cells.len()],
        cells,
        attributes,
        ..UnstructuredGrid::default()
    };
    Ok((Dataset::UnstructuredGrid(grid), report))
}

/// Places with one point each.
struct Joined {
    places: Vec<DVec3>,
    arrays: Vec<crate::model::DataArray>,
}

/// Joins the rows of each place: the first of their coordinates, and the mean of their values.
fn join(
    snapped: &Snapped,
    points: Vec<[f64; 3]>,
    values: Vec<(String, Vec<f64>)>,
    report: &mut PointsReport,
) -> Joined {
    let count = snapped.len();
    report.joined_rows = points.len() - count;
    let mut places = vec![DVec3::INFINITY; count];
    let less = |p: DVec3, q: DVec3| {
        p.to_array().partial_cmp(&q.to_array()).is_some_and(|order| order.is_lt())
    };
    for (place, p) in snapped.place_of.iter().zip(&points) {
        let p = DVec3::from(*p);
        // Within a rounding of the integers, rows may differ: their order shall not matter.
        if less(p, places[*place as usize]) {
            places[*place as usize] = p;
        }
    }
    let mut differs = vec![false; points.len()];
    let mut arrays = Vec::with_capacity(values.len());
    for (name, of_rows) in values {
        let mut sums = vec![(0.0, 0u32); count];
        let mut first = vec![f64::NAN; count];
        for (row, (place, value)) in snapped.place_of.iter().zip(&of_rows).enumerate() {
            let place = *place as usize;
            if value.is_nan() {
                report.missing_values += 1;
                continue;
            }
            differs[row] |= sums[place].1 > 0 && first[place] != *value;
            first[place] = *value;
            sums[place] = (sums[place].0 + value, sums[place].1 + 1);
        }
        // A single value stays as it is; without any, the mean is NaN.
        arrays.push(array(&name, sums.iter().map(|(sum, n)| sum / f64::from(*n)).collect()));
    }
    report.joined_with_other_values = differs.iter().filter(|d| **d).count();
    Joined { places, arrays }
}

/// The cells that are no gaps.
fn kept<const N: usize>(
    places: &[DVec3],
    cells: &[[u32; N]],
    gap: f64,
    report: &mut PointsReport,
) -> Cells {
    let Gaps { is_gap, cells: gap_cells } = gaps::find(places, cells, gap);
    report.gap_cells = gap_cells;
    report.cells = cells.len() - gap_cells;
    let kept = cells.iter().zip(is_gap).filter(|(_, gap)| !gap).flat_map(|(c, _)| *c);
    Cells::uniform(N, kept.collect())
}

impl PointsReport {
    /// What was found and done, one sentence each. `gap` is the option that made it.
    pub(crate) fn sentences(&self, gap: f64) -> Vec<String> {
        let (kind, place) = match (self.dimensions, self.slanting_normal) {
            (2, None) => ("triangles", "in a plane".into()),
            (2, Some([x, y, z])) => {
                ("triangles", format!("in the plane with the normal ({x:.6}, {y:.6}, {z:.6})"))
            }
            _ => ("tetrahedra", "in space".into()),
        };
        let mut found = vec![format!(
            "{} points in no order {place} became {} {kind} by Delaunay triangulation; {} more, \
             across places without points that are {gap} times as wide as the cells around, were \
             taken away (the option gap)",
            self.points, self.cells, self.gap_cells
        )];
        let mut add = |count: usize, what: &str| {
            if count > 0 {
                found.push(format!("{count} {what}"));
            }
        };
        add(self.rows_without_place, "rows without a coordinate are left out");
        add(self.joined_rows, "rows at the place of another one are joined with it");
        add(
            self.joined_with_other_values,
            "of the joined rows have other values; their mean is taken",
        );
        add(self.missing_values, "values are missing and stay without a number (NaN)");
        add(self.lonely_points, "points are in no cell: there are none near them");
        if self.dimensions == 3 && self.off_plane < NEARLY_FLAT {
            found.push(format!(
                "they are nearly in a plane, but in none: the farthest is {:.2e} of their longest \
                 side off, and {FLATNESS:e} would do; where they are a plane, write their \
                 coordinates with more digits, or leave out rows that are not of it",
                self.off_plane
            ));
        }
        found
    }
}
