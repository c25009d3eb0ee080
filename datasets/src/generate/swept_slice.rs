//! Sweeps a plane slice of a computed flow, by revolution or extrusion, to the three-dimensional
//! flow that it represents.
//!
//! Solvers compute axisymmetric and plane flows on one layer of cells. A beam of light crosses the
//! whole flow: the slice revolved about its axis, or repeated along the span.

use super::flow::{Flow, FlowError, names};
use crate::model::{Dataset, ModelError, StructuredGrid};
use glam::{DVec3, UVec3};

/// A slice on a lattice of cells: x along the stream, y the distance from the axis (or from the
/// plane of symmetry). Lines of constant first index must have constant x, as in meshes made of
/// blocks between vertical lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    /// x of the lines, ascending.
    x_m: Vec<f64>,
    /// y of the lattice points on line i, ascending; the first is on the body's surface or the
    /// axis.
    y_m: Vec<Vec<f64>>,
    /// Per field: name, unit, and cell values, first by line and then along the line.
    fields: Vec<(&'static str, &'static str, Vec<f64>)>,
}

/// How the slice extends to three dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sweep {
    /// Revolved about the x axis.
    Revolve,
    /// Repeated along z over this span, and mirrored at y = 0.
    Extrude {
        /// Extent along z.
        span_m: f64,
    },
}

/// Why a data set cannot be used as a slice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SliceError {
    /// The data set is not a structured grid of one layer.
    #[error(
        "the slice must be a structured grid of at least 2 x 2 points in one layer, not {found}"
    )]
    NotASlice {
        /// Kind of the data set.
        found: String,
    },
    /// Lines are not at constant x, or run backwards.
    #[error(
        "line {line} of the slice {what}; lines of constant first index must have constant and \
         growing x, and growing y"
    )]
    Line {
        /// First index of the line.
        line: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// An array is missing or unusable.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The requested lattice is not possible.
    #[error(transparent)]
    Flow(#[from] FlowError),
}

impl Slice {
    /// Takes the cell arrays `density` and, if there is one, `temperature`.
    pub fn from_dataset(data: &Dataset) -> Result<Slice, SliceError> {
        data.check()?;
        let not_a_slice = |found: String| SliceError::NotASlice { found };
        let Dataset::StructuredGrid(grid) = data else {
            return Err(not_a_slice(data.kind().into()));
        };
        let [nx, ny, nz] = crate::model::extent_dims(grid.extent);
        if nx < 2 || ny < 2 || nz != 1 {
            return Err(not_a_slice(format!("{nx} x {ny} x {nz} points")));
        }
        let (x_m, y_m) = lines(grid, nx, ny)?;
        let mut fields = Vec::new();
        for (name, unit) in [(names::DENSITY, "kg/m³"), (names::TEMPERATURE, "K")] {
            let Some(array) = grid.attributes.cell_array(name) else { continue };
            let by_line = (0..(nx - 1) * (ny - 1))
                .map(|c| array.get(c % (ny - 1) * (nx - 1) + c / (ny - 1), 0));
            fields.push((name, unit, by_line.collect()));
        }
        if fields.first().is_none_or(|f| f.0 != names::DENSITY) {
            let available = grid
                .attributes
                .cell
                .iter()
                .map(|a| format!("`{}`", a.name))
                .collect::<Vec<_>>()
                .join(", ");
            return Err(ModelError::NoArray {
                name: "density (per cell)".into(),
                kind: data.kind(),
                available,
            }
            .into());
        }
        Ok(Slice { x_m, y_m, fields })
    }

    /// The whole flow on a lattice of `dims` points. Values are means of 2 x 2 x 2 samples per box,
    /// bilinear between the slice's cells; NaN within the body.
    pub fn flow(&self, sweep: Sweep, dims: UVec3) -> Result<Flow, SliceError> {
        let (first, last) = (self.x_m[0], self.x_m[self.x_m.len() - 1]);
        // Reach only as far out as the shortest line.
        let side = self.y_m.iter().map(|l| l[l.len() - 1]).fold(f64::INFINITY, f64::min);
        let half_span = match sweep {
            Sweep::Revolve => side / 2f64.sqrt(), // the corners of the lattice lie within the slice
            Sweep::Extrude { span_m } => 0.5 * span_m,
        };
        let side = if sweep == Sweep::Revolve { half_span } else { side };
        let mut flow = Flow::over(
            dims,
            DVec3::new(first, -side, -half_span),
            DVec3::new(last, side, half_span),
        )?;
        let (origin, spacing) = (flow.origin_m, flow.spacing_m);
        let wanted: Vec<_> = self.fields.iter().map(|f| (f.0, f.1)).collect();
        flow.fill(
            &wanted,
            || (),
            |(), j, k, rows| {
                for i in 0..rows[0].len() {
                    let p = origin + spacing * DVec3::new(i as f64, j as f64, k as f64);
                    let (mut sums, mut count) = ([0.0; 2], 0);
                    for corner in 0..8 {
                        let sign = |bit: u32| if corner >> bit & 1 == 0 { -0.25 } else { 0.25 };
                        let q = p + spacing * DVec3::new(sign(0), sign(1), sign(2));
                        let r = if sweep == Sweep::Revolve { q.y.hypot(q.z) } else { q.y.abs() };
                        if let Some(cells) = self.locate(q.x.clamp(first, last), r) {
                            count += 1;
                            for (sum, field) in sums.iter_mut().zip(&self.fields) {
                                *sum +=
                                    cells.iter().map(|&(cell, w)| w * field.2[cell]).sum::<f64>();
                            }
                        }
                    }
                    for (row, sum) in rows.iter_mut().zip(sums) {
                        row[i] = (sum / count as f64) as f32; // 0/0 within the body: NaN
                    }
                }
            },
        );
        Ok(flow)
    }

    /// Cell values of a field along line `line` of cells, with the positions of the cells' centres.
    pub fn line(&self, name: &str, line: usize) -> Option<Vec<([f64; 2], f64)>> {
        let (_, _, values) = self.fields.iter().find(|f| f.0 == name)?;
        let [a, b] = [self.y_m.get(line)?, self.y_m.get(line + 1)?];
        let x = 0.5 * (self.x_m[line] + self.x_m[line + 1]);
        let n = a.len() - 1;
        let middle = |j: usize| [x, 0.25 * (a[j] + a[j + 1] + b[j] + b[j + 1])];
        Some((0..n).map(|j| (middle(j), values[line * n + j])).collect())
    }

    /// Number of lines of cells.
    pub fn lines(&self) -> usize {
        self.x_m.len() - 1
    }

    /// The body's surface, upstream to downstream.
    pub fn surface_m(&self) -> Vec<[f64; 2]> {
        self.x_m.iter().zip(&self.y_m).map(|(&x, y)| [x, y[0]]).collect()
    }

    /// The cells and weights that determine the value at a point; `None` within the body.
    ///
    /// Interpolates along each of the two nearest columns of cells at the point's own y, then
    /// between the columns. Where the surface has a corner, cells of equal number lie at different
    /// heights, and interpolation by number would shear the field.
    fn locate(&self, x: f64, y: f64) -> Option<[(usize, f64); 4]> {
        let line = self.x_m.partition_point(|&l| l <= x).clamp(1, self.x_m.len() - 1) - 1;
        let s = (x - self.x_m[line]) / (self.x_m[line + 1] - self.x_m[line]);
        if y < self.y_m[line][0] + (self.y_m[line + 1][0] - self.y_m[line][0]) * s {
            return None;
        }
        let columns = self.x_m.len() - 1;
        let across = (line as f64 + s - 0.5).clamp(0.0, (columns - 1) as f64);
        let left = (across as usize).min(columns.saturating_sub(2));
        let right = (left + 1).min(columns - 1);
        let t = (across - left as f64).min(1.0);
        let [[a, b], [c, d]] = [left, right].map(|column| self.along(column, y));
        let weighted = |(cell, w): (usize, f64), by: f64| (cell, w * by);
        Some([weighted(a, 1.0 - t), weighted(b, 1.0 - t), weighted(c, t), weighted(d, t)])
    }

    /// The two cells of a column next to y, with their weights.
    fn along(&self, column: usize, y: f64) -> [(usize, f64); 2] {
        let [a, b] = [&self.y_m[column], &self.y_m[column + 1]];
        let n = a.len() - 1;
        let middle = |j: usize| 0.25 * (a[j] + a[j + 1] + b[j] + b[j + 1]);
        let (mut low, mut high) = (0, n - 1);
        while high - low > 1 {
            let half = (low + high) / 2;
            if middle(half) <= y { low = half } else { high = half }
        }
        let gap = middle(high) - middle(low);
        let t = if gap > 0.0 { ((y - middle(low)) / gap).clamp(0.0, 1.0) } else { 0.0 };
        [(column * n + low, 1.0 - t), (column * n + high, t)]
    }
}

/// Positions of the lattice's lines.
fn lines(
    grid: &StructuredGrid,
    nx: usize,
    ny: usize,
) -> Result<(Vec<f64>, Vec<Vec<f64>>), SliceError> {
    let (mut x_m, mut y_m) = (Vec::new(), Vec::new());
    for line in 0..nx {
        let points: Vec<DVec3> = (0..ny).map(|j| grid.points.get(j * nx + line)).collect();
        let x = points[0].x;
        let length = (points[ny - 1] - points[0]).length();
        let straight = |p: &DVec3| (p.x - x).abs() <= 1e-5 * length; // false for NaN, too
        if !points.iter().all(straight) {
            return Err(SliceError::Line { line, what: "is not at one x" });
        }
        if x_m.last().is_some_and(|&last| x <= last) {
            return Err(SliceError::Line { line, what: "is not behind the line before it" });
        }
        if points.windows(2).any(|w| w[1].y <= w[0].y) {
            return Err(SliceError::Line { line, what: "does not run outwards" });
        }
        x_m.push(x);
        y_m.push(points.iter().map(|p| p.y).collect());
    }
    Ok((x_m, y_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Attributes, DataArray, Points, Values};

    /// Density x + 10 y on 8 x 6 cells above a ramp.
    fn ramp() -> Dataset {
        let surface = |x: f64| (0.5 * (x - 1.0)).max(0.0);
        let point = |i: usize, j: usize| {
            let (x, s) = (i as f64 * 0.5, surface(i as f64 * 0.5));
            [x, s + (6.0 - s) * j as f64 / 6.0, 0.0]
        };
        let points = (0..63).map(|n| point(n % 9, n / 9)).collect();
        let middle = |i: usize, j: usize| {
            let c = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)].map(|(i, j)| point(i, j));
            [0, 1].map(|a| c.iter().map(|p| p[a]).sum::<f64>() / 4.0)
        };
        let density = (0..48).map(|n| middle(n % 8, n / 8)).map(|[x, y]| x + 10.0 * y).collect();
        let array = DataArray::new("density", 1, Values::F64(density));
        Dataset::StructuredGrid(StructuredGrid {
            extent: [0, 8, 0, 6, 0, 0],
            points: Points::F64(points),
            attributes: Attributes { cell: vec![array], ..Default::default() },
        })
    }

    #[test]
    fn revolved_and_extruded_flows_have_the_slices_values_and_holes() {
        let slice = Slice::from_dataset(&ramp()).unwrap();
        assert_eq!(slice.lines(), 8);
        for sweep in [Sweep::Revolve, Sweep::Extrude { span_m: 2.0 }] {
            let flow = slice.flow(sweep, UVec3::new(41, 41, 41)).unwrap();
            let rho = flow.grid("density").unwrap();
            let mut checked = 0;
            for (n, &value) in rho.values().iter().enumerate() {
                let n = n as u32;
                let p = flow.position_m(n % 41, n / 41 % 41, n / 1681);
                let r = if sweep == Sweep::Revolve { p.y.hypot(p.z) } else { p.y.abs() };
                let surface = (0.5 * (p.x - 1.0)).max(0.0);
                if r < surface - 0.3 {
                    assert!(value.is_nan());
                } else if r > surface + 0.8 && r < 5.0 && (0.3..3.7).contains(&p.x) {
                    checked += 1;
                    assert!((value as f64 - (p.x + 10.0 * r)).abs() < 0.05, "{p}: {value}");
                }
            }
            assert!(checked > 5000, "{checked}");
        }
    }

    #[test]
    fn leaning_lines_missing_density_and_volumes_are_refused() {
        let Dataset::StructuredGrid(good) = ramp() else { unreachable!() };
        let mut leaning = good.clone();
        let Points::F64(p) = &mut leaning.points else { unreachable!() };
        p[20][0] += 0.1;
        let error = Slice::from_dataset(&Dataset::StructuredGrid(leaning)).unwrap_err();
        assert!(error.to_string().contains("line 2"), "{error}");
        let mut nameless = good.clone();
        nameless.attributes.cell[0].name = "rho".into();
        let error = Slice::from_dataset(&Dataset::StructuredGrid(nameless)).unwrap_err();
        assert!(error.to_string().contains("`rho`"), "{error}");
        let mut folded = good;
        let Points::F64(p) = &mut folded.points else { unreachable!() };
        p[10][1] = -3.0;
        assert!(matches!(
            Slice::from_dataset(&Dataset::StructuredGrid(folded)),
            Err(SliceError::Line { line: 1, .. })
        ));
    }
}
